"""What the simulated devices of the Inspire family share."""

READING: dict[str, dict[object, str]] = {
    "reads-across-gaps": {"answered": "", "silent": "fault=block-silent"},
    "gap-bytes": {"zeros": "", "silent": "fault=block-silent"},
    "reply-time": {"*": "turnaround={seconds}"},
}
"""What facts about reads make of each of them, see `engine.facts_file`."""

EB90: dict[str, dict[object, str]] = {
    **READING,
    "longest-read": {252: "", 12: "fault=block-silent"},
    "id-acknowledged-by": {"new": "", "old": "ack-id=old"},
    "save-frames": {
        "acknowledged, result 00 with flag 11": "",
        "acknowledged, result 00 with flag 12": "result-flag=18",
        "acknowledged": "fault=no-late-frames",
    },
    "calibration-frames": {"reported": "", "not reported": "fault=no-late-frames"},
}
"""The same of the hands, with their frames."""
