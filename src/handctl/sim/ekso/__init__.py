"""The simulated EksoNR."""

SUMMARY = "EksoNR exoskeleton with its DataPort (serial)."
WIRES = ("serial",)
