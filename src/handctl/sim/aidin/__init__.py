"""The simulated AIDIN-hand."""

SUMMARY = "AIDIN-hand (TCP, JSON)."
WIRES = ("tcp",)

_KEYS = "joint_pos, motor_pos, sensor_state, task_space_pos"
FACTS: dict[str, dict[object, str]] = {
    "exchange": {"*": "exchange={}"},
    "rate": {"*": "rate={}"},
    "between-objects": {name: f"between={name}" for name in ("newline", "none", "nul", "blank", "crlf")},
    "request-terminator": {"newline": "", "nul": "reader=nul"},
    "keys": {f"current_state, {_KEYS}": "", _KEYS: "fault=missing-key"},
    "objects": {"one": "", "separate": "objects=separate"},
    "layout": {"*": "layout={}"},
    "whole-numbers": {"integers": "", "decimals": "integers=1"},
    "decimals": {4: "digits=4", 6: "", "full": "digits=17"},
    "q4": {"*": "q4={}"},
    "homing-lasts": {"kept": ""},
    "q4-range": {"115 to 175": "q4=same", "147.5 to 177.5": "q4=half", "0 to 0": "q4=zero"},
}
"""What a fact about a real one makes of the simulated one, see `engine.facts_file`."""
