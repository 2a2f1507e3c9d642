"""The simulated wrist module."""

SUMMARY = "wrist module with the hand behind it (serial, CAN)."
WIRES = ("serial", "can")

FACTS: dict[str, dict[object, str]] = {
    "reads-across-gaps": {"answered": "", "silent": "fault=block-silent"},
    "gap-bytes": {"zeros": "", "silent": "fault=block-silent"},
    "reply-time": {"*": "turnaround={seconds}"},
    "current-sign": {"signed": ""},
    "carrier": {"answered": ""},
}
"""What a fact about a real one makes of the simulated one, see `engine.facts_file`."""
