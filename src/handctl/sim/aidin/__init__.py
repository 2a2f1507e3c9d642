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
}
"""What a fact about a real one makes of the simulated one, see `engine.facts`."""
