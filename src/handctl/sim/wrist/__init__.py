"""The simulated wrist module."""

SUMMARY = "Inspire wrist module with the hand behind it."
WIRES = ("serial", "can")
