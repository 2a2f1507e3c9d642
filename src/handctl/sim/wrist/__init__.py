"""The simulated wrist module."""

from handctl.sim.inspire import READING

SUMMARY = "wrist module with the hand behind it (serial, CAN)."
WIRES = ("serial", "can")

FACTS: dict[str, dict[object, str]] = {
    **READING,
    "current-sign": {"signed": ""},
    "carrier": {"answered": ""},
}
"""What a fact about a real one makes of the simulated one, see `engine.facts_file`."""
