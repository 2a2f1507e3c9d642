"""The simulated EH55BF1 exoskeleton hand."""

SUMMARY = "exoskeleton hand EH55BF1 (serial)."
WIRES = ("serial",)

FACTS: dict[str, dict[object, str]] = {
    "reads-across-gaps": {"answered": "", "silent": "fault=block-silent"},
    "gap-bytes": {"zeros": "", "silent": "fault=block-silent"},
    "longest-read": {252: "", 12: "fault=block-silent"},
    "reply-time": {"*": "turnaround={seconds}"},
    "speed-register": {1001: "", 1002: "fault=baud-at-1002"},
    "set-points-at-power-on": {-1: "fault=fresh"},
    "id-acknowledged-by": {"new": "", "old": "ack-id=old"},
    "save-frames": {
        "acknowledged, result 00 with flag 11": "",
        "acknowledged, result 00 with flag 12": "result-flag=18",
        "acknowledged": "fault=no-late-frames",
    },
    "calibration-frames": {"reported": "", "not reported": "fault=no-late-frames"},
}
"""What a fact about a real one makes of the simulated one, see `engine.facts_file`."""
