"""The simulated BarrettHand."""

SUMMARY = "BarrettHand BH8-series: supervisory and RealTime mode, boot monitor."
WIRES = ("serial",)
