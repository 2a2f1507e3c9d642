"""What a fact about a real EH55BF1 makes of the simulated one. See `engine.facts`."""

FACTS: dict[str, dict[object, str]] = {
    "reads-across-gaps": {"answered": "", "silent": "fault=block-silent"},
    "gap-bytes": {"zeros": "", "silent": "fault=block-silent"},
    "longest-read": {252: "", 12: "fault=block-silent"},
    "reply-time": {"*": "turnaround={seconds}"},
    "speed-register": {1001: "", 1002: "fault=baud-at-1002"},
    "set-points-at-power-on": {-1: "fault=fresh"},
    "id-acknowledged-by": {"new": "", "old": "ack-id=old"},
}
