"""The simulated AIDIN-hand."""

SUMMARY = "AIDIN-hand (TCP, JSON)."
WIRES = ("tcp",)
