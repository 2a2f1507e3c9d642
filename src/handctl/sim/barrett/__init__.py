"""The simulated BarrettHand."""

SUMMARY = "BarrettHand BH8 with RealTime mode and boot monitor."
WIRES = ("serial",)

_TEXTS: dict[object, str] = {"name text": "texts=values", "name - text": "texts=names", "name: text": "texts=prose"}
_LATER = "BD, BP, BS, BDAT"
FACTS: dict[str, dict[object, str]] = {
    "prompt": {"space": "", "bare": "prompt=bare"},
    "line-end": {"lfcr": "", "crlf": "line-end=crlf"},
    "version-text": {"N": "texts=values", "Version N": "texts=names", "BarrettHand Firmware N": "texts=prose"},
    "parameter-list": _TEXTS,
    "value-list": {"values only": "texts=values", "name text": "texts=names", "name: text": "texts=prose"},
    "help-text": _TEXTS,
    "unknown-command": {"ERR 32": ""},
    "lower-case": {"accepted": ""},
    "longest-line": {128: "", "*": "line-limit={}"},
    "most-arguments": {24: "", "*": "max-arguments={}"},
    "absent-parameters": {"none": ""},
    "later-parameters": {"none": "", _LATER: "firmware=4.34", f"{_LATER}, LCT, LFBP, LFAIN": "firmware=4.4"},
    "position-sign": {"*": "position-sign={}"},
    "position-at-stop": {"*": "position-sign={}"},
    "idle-abort": {"prompt": ""},
    "strain-gauges": {3: "", 0: "fault=no-gauges"},
    "strain-alias": {"equal": ""},
    "motors-after-loop": {"run on": "", "stop": "loop-exit=stop"},
    "highest-speed": {38400: "", "*": "max-baud={}"},
}
"""What a fact about a real one makes of the simulated one, see `engine.facts_file`."""
