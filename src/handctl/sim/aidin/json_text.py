"""The JSON text of the simulated AIDIN-hand: objects out of the byte stream, feedback into it.

Knows keys, lengths and spelling, nothing of the hand and nothing of time. The manual (TCP/IP communication information)
says JSON, a buffer of 2048 bytes, and no more: no delimiter, no acknowledge. What else a server may do is an option.
"""

from __future__ import annotations

from functools import lru_cache

from handctl.sim.aidin.mechanics import Hand, by_finger, pose

TYPE_CHECKING = False  # a simulator loads without the typing module
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

BLANKS = b" \t\r\n\0"
RADIANS = 0.017453292519943295  # of one degree
BETWEEN = {"newline": "\n", "none": "", "nul": "\0", "blank": " ", "crlf": "\r\n"}
LAYOUTS = {"compact": (",", ":", ""), "blanks": (", ", ": ", ""), "indented": (",", ": ", "\n  ")}
WHOLE = rb'\{[^{}"]*(?:"[^"\\]*"[^{}"]*)*\}'
"""A flat object without escapes, as what follows the braces byte by byte would find it."""
LONG_GARBAGE = 71680  # bytes without a closing brace

TEXT_OPTIONS = {
    "reader": (("tolerant", "lines", "nul", "naive"), "how the hand splits the stream into objects: tolerant (default), lines or nul (each must be followed by that), naive (one read is one object, the rest is lost)"),
    "buffer": ((2048, 64, 65536), "longest object that the hand accepts, 64..65536 bytes (default 2048)"),
    "between": (tuple(BETWEEN), "what follows each feedback object: newline (default), none, nul, blank, crlf"),
    "layout": (tuple(LAYOUTS), "spelling of the feedback: compact (default), blanks, indented"),
    "digits": (("6", ("4", "6", "17")), "decimals of the feedback: 6 (default, for mm 3), 4, or 17 for full precision"),
    "integers": (False, "1: encoders and currents are written as 12.0"),
    "objects": (("one", "separate"), "feedback in one object (default) or a separate object for each of the 5 keys"),
}  # fmt: skip
TEXT_FAULTS = {
    "missing-key": "feedback has no current_state",
    "extra-key": "feedback has keys that the manual does not know, strings and objects among them",
    "wrong-length": "motor_pos has 14 values, task_space_pos 16",
    "nan": "NaN in joint_pos of the index finger, Infinity in sensor_state",
    "wrong-type": "current_state is null, motor_pos has a string, sensor_state is a number",
    "not-json": "text instead of feedback",
    "braces": "arrays in braces, as the manual prints them",
    "unclosed": "70 KiB without a closing brace before each feedback object",
    "degrees": "joint_pos is in degrees",
    "swapped": "index and middle finger are swapped in all feedback",
    "stuck": "the encoder of the index finger's motor 2 does not change",
    "frozen": "feedback does not change at all",
}


class Reader:
    """Takes JSON objects out of a byte stream. Never raises; what is no object is dropped and counted."""

    def __init__(self, given: dict[str, Any]) -> None:
        import json  # here, so that a command that needs no simulator does not pay for them
        import re

        self._loads: Callable[[str], Any] = json.loads
        self._whole = re.compile(WHOLE).match
        self._style, self._longest = given["reader"], given["buffer"]
        self.dropped = 0
        self.forget()

    def forget(self) -> None:
        """Unfinished input is gone."""
        self._text = bytearray()
        self._depth = 0
        self._quoted = self._escaped = False

    @property
    def waiting(self) -> bool:
        return bool(self._text)

    def feed(self, data: bytes) -> list[dict[str, Any]]:
        if self._style == "naive":
            reads = [data[at : at + self._longest] for at in range(0, len(data), self._longest)]
            found = [self._parse(read.partition(b"\0")[0]) for read in reads]
        elif self._style == "tolerant":
            found = self._steps(data)
        else:
            found = [self._split(byte, 10 if self._style == "lines" else 0) for byte in data]
        return [one for one in found if one is not None]

    def _steps(self, data: bytes) -> list[dict[str, Any] | None]:
        """What comes in one piece, as nearly all does, is taken in one step."""
        found, at = [], 0
        while at < len(data):
            whole = None if self._depth else self._whole(data, at, at + self._longest)
            found.append(self._parse(whole.group()) if whole else self._step(data[at]))
            at = whole.end() if whole else at + 1
        return found

    def _step(self, byte: int) -> dict[str, Any] | None:
        """One byte more: braces are counted outside strings, so an object may be cut anywhere."""
        if not self._depth and byte != 123:
            self.dropped += byte not in BLANKS
            return None
        self._text.append(byte)
        if not self._depth:
            self._depth = 1
        elif self._escaped:
            self._escaped = False
        elif self._quoted:
            self._escaped = byte == 92
            self._quoted = byte != 34
        elif byte == 34:
            self._quoted = True
        elif byte in b"{}":
            self._depth += 1 if byte == 123 else -1
            if not self._depth:
                return self._finish()
        if len(self._text) > self._longest:
            self.dropped += 1
            self.forget()
        return None

    def _split(self, byte: int, end: int) -> dict[str, Any] | None:
        if byte != end:
            if len(self._text) <= self._longest:  # one more than fits marks the line as too long
                self._text.append(byte)
            return None
        if self._text.strip(BLANKS):
            return self._finish()
        self.forget()
        return None

    def _finish(self) -> dict[str, Any] | None:
        text = bytes(self._text)
        self.forget()
        if len(text) <= self._longest:
            return self._parse(text.strip(BLANKS))
        self.dropped += 1
        return None

    def _parse(self, text: bytes) -> dict[str, Any] | None:
        try:
            value = self._loads(text.decode("utf-8"))
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            self.dropped += 1
            return None
        return value


class Writer:
    """Spells the feedback of a hand."""

    def __init__(self, given: dict[str, Any]) -> None:
        self._comma, self._colon, self._indent = LAYOUTS[given["layout"]]
        self._end = BETWEEN[given["between"]]
        self._digits = int(given["digits"])
        self._whole = "{}.0".format if given["integers"] else str
        self._separate = given["objects"] == "separate"
        self.restart()

    def restart(self) -> None:
        """What the faults "stuck" and "frozen" remember is taken anew."""
        self._stuck: str | None = None
        self._frozen = b""
        self._shown: object = None  # what was spelled last without a fault

    def feedback(self, hand: Hand, hits: frozenset[str]) -> bytes:
        """All five keys at this moment, spoiled as `hits` wants."""
        if "frozen" in hits and self._frozen:
            return self._frozen
        if "not-json" in hits:
            return b"AIDIN-hand: sensor bus timeout, retrying" + self._end.encode()
        values = hand.encoders(), hand.currents(), hand.sensors()
        if not hits and values == self._shown:
            return self._frozen
        self._shown = None if hits else values
        rows = self._rows(hand, *values, 1.0 if "degrees" in hits else RADIANS)
        self._stuck = self._stuck or rows["motor_pos"][4]
        if hits & TEXT_FAULTS.keys():
            self._misread(rows, hits)
        opening, closing = ("{", "}") if "braces" in hits else ("[", "]")
        texts = {key: opening + self._comma.join(row) + closing for key, row in rows.items()}
        if hits & TEXT_FAULTS.keys():
            _mistype(texts, hits)
        pairs = [f'"{key}"{self._colon}{text}' for key, text in texts.items()]
        groups = [[pair] for pair in pairs] if self._separate else [pairs]
        text = "".join(self._object(group) for group in groups)
        if "unclosed" in hits:
            text = '{"motor_pos":[' + "0," * (LONG_GARBAGE // 2) + text
        self._frozen = text.encode()
        return self._frozen

    def _object(self, pairs: list[str]) -> str:
        joint = "," + (self._indent or self._comma[1:])
        return "{" + self._indent + joint.join(pairs) + ("\n" if self._indent else "") + "}" + self._end

    def _rows(
        self, hand: Hand, counts: list[int], currents: list[int], forces: list[float], scale: float
    ) -> dict[str, list[str]]:
        poses = [_pose(*finger, hand.coupling, scale, self._digits) for finger in by_finger(counts)]
        return {
            "motor_pos": [*map(self._whole, counts)],
            "joint_pos": [angle for joints, _ in poses for angle in joints],
            "task_space_pos": [place for _, tip in poses for place in tip],
            "current_state": [*map(self._whole, currents)],
            "sensor_state": [_number(force, self._digits) for force in forces],
        }

    def _misread(self, rows: dict[str, list[str]], hits: frozenset[str]) -> None:
        """Values in the wrong place or no values at all."""
        if "stuck" in hits and self._stuck is not None:
            rows["motor_pos"][4] = self._stuck
        if "swapped" in hits:
            for row in rows.values():
                size = len(row) // 5
                row[size : 2 * size], row[2 * size : 3 * size] = row[2 * size : 3 * size], row[size : 2 * size]
        if "nan" in hits:
            rows["joint_pos"][5] = "NaN"
            rows["sensor_state"][8] = "Infinity"
        if "wrong-type" in hits:
            rows["motor_pos"][7] = '"open"'
        if "wrong-length" in hits:
            rows["motor_pos"].pop()
            rows["task_space_pos"].append("0.0")


def _mistype(texts: dict[str, str], hits: frozenset[str]) -> None:
    """Keys that are missing, strange or of another type."""
    if "missing-key" in hits:
        del texts["current_state"]
    elif "wrong-type" in hits:
        texts["current_state"] = "null"
    if "wrong-type" in hits:
        texts["sensor_state"] = "0.5"
    if "extra-key" in hits:
        texts["battery"] = "87"
        texts["status"] = '{"text":"a } and a \\" in a string","list":[1,{}]}'


@lru_cache(1024)  # while one finger moves the others stand
def _pose(
    finger: int, counts: tuple[int, ...], coupling: str, scale: float, digits: int
) -> tuple[list[str], list[str]]:
    """The joint angles of a finger with these encoders, times `scale`, and the place of its tip."""
    joints, tip = pose(finger, counts, coupling)
    long = min(digits, 3) if digits < 17 else 17
    return [_number(angle * scale, digits) for angle in joints], [_number(place, long) for place in tip]


@lru_cache(4096)  # most come again and again
def _number(value: float, digits: int) -> str:
    """With a decimal point or an exponent, and no minus before zero."""
    if digits == 17:
        text = f"{value + 0.0:.17g}"
        return text if set(text) & set(".e") else text + ".0"
    return repr(round(value, digits) + 0.0)
