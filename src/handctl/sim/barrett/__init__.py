"""The simulated BarrettHand."""

SUMMARY = "BarrettHand BH8 with RealTime mode and boot monitor."
WIRES = ("serial",)
