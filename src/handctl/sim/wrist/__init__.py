"""The simulated wrist module."""

SUMMARY = "wrist module with the hand behind it (serial, CAN)."
WIRES = ("serial", "can")
