"""What a fact about a real RH56 hand makes of the simulated one. See `engine.facts`."""

FACTS: dict[str, dict[object, str]] = {
    "generation": {"*": "model={}"},
    "protocol": {"*": "speaks={}"},
    "byte-groups": {
        "low half first": "",
        "high half first": "fault=high-half",
        "one a register": "fault=rtu-unpacked",
    },
    "reads-across-gaps": {"answered": "", "silent": "fault=block-silent"},
    "gap-bytes": {"zeros": "", "silent": "fault=block-silent"},
    "longest-read": {252: "", 12: "fault=block-silent"},
    "reply-time": {"*": "turnaround={seconds}"},
    "current-sign": {"signed": ""},
    "speed-register": {1002: "", 1001: "baud-register=1001"},
    "set-points-at-power-on": {-1: ""},
    "write-acknowledgement": {"*": "ack={}"},
    "id-acknowledged-by": {"new": "", "old": "ack-id=old"},
}
