"""The simulated EksoNR."""

SUMMARY = "EksoNR exoskeleton with its DataPort (serial)."
WIRES = ("serial",)

FACTS: dict[str, dict[object, str]] = {
    "length-convention": {"*": "length={}"},
    "answer-length": {"*": "answer-length={}"},
    "time-body": {3: "time-body=3", 4: ""},
    "echo-fields": {"command, msgID": ""},
    "service-grid": {0: "", 10: "quantum=10", 20: "quantum=20"},
    "bad-crc": {"silence": "", "acknowledged": "bad-crc=acknowledge"},
    "boot-time-words": {"high first": "", "stands still": "fault=frozen-clock"},
    "unlisted-codes": {"none": ""},
    "knee-sign": {"flexion positive": ""},
}
"""What a fact about a real one makes of the simulated one, see `engine.facts_file`."""
