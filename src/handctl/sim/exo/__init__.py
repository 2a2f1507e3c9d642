"""The simulated EH55BF1 exoskeleton hand."""

SUMMARY = "Inspire EH55BF1 exoskeleton hand."
WIRES = ("serial",)
