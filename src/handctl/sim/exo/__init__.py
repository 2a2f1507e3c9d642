"""The simulated EH55BF1 exoskeleton hand."""

SUMMARY = "exoskeleton hand EH55BF1 (serial)."
WIRES = ("serial",)
