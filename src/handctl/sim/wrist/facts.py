"""What a fact about a real wrist module makes of the simulated one. See `engine.facts`."""

FACTS: dict[str, dict[object, str]] = {
    "reads-across-gaps": {"answered": "", "silent": "fault=block-silent"},
    "gap-bytes": {"zeros": "", "silent": "fault=block-silent"},
    "reply-time": {"*": "turnaround={seconds}"},
    "current-sign": {"signed": ""},
    "carrier": {"answered": ""},
}
