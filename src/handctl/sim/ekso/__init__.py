"""The simulated EksoNR."""

SUMMARY = "EksoNR exoskeleton, DataPort."
WIRES = ("serial",)
