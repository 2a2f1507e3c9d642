"""Explain recorded bytes of the AIDIN-hand: JSON objects in words, from the map of its keys and modes.

Bytes in, pieces out; knows no link. The hand streams by itself; only the neutral object ``{}`` asks for something.

For the ledger of writes an object with a mode is a command, one without (a poll) is none. Objects of one mode in a row are one
step: a mode is sent every 20 ms for as long as it is to hold. Nothing is acknowledged: only feedback is evidence.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from math import isfinite

from handctl.devices.aidin.json_codec import BETWEEN, Decoder, MalformedObject, numbers
from handctl.devices.aidin.parameter_map import AIDIN, FEEDBACK, FINGERS, MODES, AidinParam, Mode
from handctl.errors import ProtocolError
from handctl.fast_classes import replace
from handctl.model.explainer import DEVICE, HOST, ExplainedBytes, Explainer, Part, Value, stray
from handctl.model.write_ledger import Frame, WriteRules
from handctl.wording import plural

KEYS = {param.key: param for param in AIDIN}
FEEDBACK_KEYS = {param.key for param in FEEDBACK}


class AidinExplainer(Explainer):
    """One connection."""

    def __init__(self) -> None:
        self._decoders = {HOST: Decoder(), DEVICE: Decoder()}
        self._asked = False

    def feed(self, direction: str, data: bytes, can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer. There is no CAN."""
        decoder = self._decoders[direction]
        decoder.feed(data)
        pieces: list[ExplainedBytes] = []
        while True:
            try:
                content = decoder.next()
            except MalformedObject as exc:
                kind = ("stray", "") if exc.stray else ("bad-json", exc.text.partition(":")[0])
                pieces.append(stray(direction, decoder.used, kind[1], kind[0]))
                continue
            raw = decoder.used
            if content is not None:
                pieces.append(self._piece(direction, raw, content))
            elif raw and pieces and pieces[-1].frame:
                pieces[-1] = replace(pieces[-1], raw=pieces[-1].raw + raw)  # the line end behind an object
            elif raw:
                pieces.append(
                    ExplainedBytes(direction=direction, raw=raw, meaning="blanks between objects", title="blanks")
                )
            if content is None:
                return pieces

    def flush(self) -> list[ExplainedBytes]:
        """See Explainer."""
        pieces = []
        for direction, decoder in self._decoders.items():
            if raw := decoder.pending:
                pieces.append(stray(direction, raw, f"an object cut off after {plural(len(raw), 'byte')}", "cut-short"))
        self._decoders = {HOST: Decoder(), DEVICE: Decoder()}
        return pieces

    def decode(self, data: bytes, side: str = "", can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer. Feedback keys come from the hand, everything else from the host."""
        device = any(f'"{key}"'.encode() in data for key in FEEDBACK_KEYS)
        direction = side or (DEVICE if device else HOST)
        return [*self.feed(direction, data), *self.flush()]

    def simulated(self, values: Mapping[str, float | str], moments: Mapping[str, float]) -> Iterator[str]:
        """See Explainer: where the motors are, and what the fingertips feel; joints and currents follow from that."""
        for command, key in (("bend", "motor_pos"), ("sensors", "sensor_state")):
            param = KEYS[key]
            for finger in FINGERS:
                names = [
                    f"{param.name}.{part}"
                    for place, part in enumerate(param.elements)
                    if param.finger_of(place) == finger
                ]
                if all(name in values for name in names):
                    yield f"{command} {finger} {' '.join(f'{values[name]}' for name in names)}"

    def recognises(self, data: bytes, can_id: int | None = None) -> bool:
        """See Explainer."""
        return can_id is None and data.lstrip(BETWEEN)[:1] == b"{"

    def _piece(self, direction: str, raw: bytes, content: dict[str, object]) -> ExplainedBytes:
        texts, parts, problem = [], [], ""
        values: list[Value] = []
        for key, value in content.items():
            text, found, wrong = _explained(key, value)
            texts.append(text)
            values += found
            problem = problem or wrong
            parts.append(Part(b"", key, text.removeprefix(f"{key} ")))
        meaning = "; ".join(texts) if texts else "the neutral object: no key, nothing commanded"
        asks = "object" if direction == HOST and not content else ""
        answers = "object" if direction == DEVICE and self._asked else ""
        self._asked = bool(asks) or (self._asked and direction == HOST)
        keys = ", ".join(content)
        mode = content.get("hand_mode")
        return ExplainedBytes(
            direction=direction, raw=raw, meaning=meaning, problem=problem, values=tuple(values), asks=asks,
            answers=answers, title=f"{direction} {keys}", fields={"keys": keys, "mode": mode if isinstance(mode, int) else None},
            parts=tuple(parts),
        )  # fmt: skip


def _explained(key: str, value: object) -> tuple[str, list[Value], str]:
    """One key in words, its values in the units of the book, and what is wrong with it."""
    if key == "hand_mode" and isinstance(value, int):
        name = MODES.get(value)
        return f"hand_mode {value}: {name or 'not documented'}", [Value(key, value)], "" if name else "unknown-mode"
    param = KEYS.get(key)
    if param is None or not param.elements:
        tenths = param is not None and param.unit == "0.1 %" and isinstance(value, int)
        shown = f"{value / 10:g} %" if tenths and isinstance(value, int) else _shown(value)
        known = param is not None or key in ("hand_mode", "maxtorque")
        finite = not isinstance(value, float) or isfinite(value)  # JSON has 1e400, and no number has
        good = known and finite and not isinstance(value, bool)
        kept: list[Value] = [Value(key, value)] if good and isinstance(value, int | float) else []
        unit = f" {param.unit}" if param is not None and param.unit and not tenths else ""
        return (
            f"{key} {shown}{unit}" + ("" if known else " (not documented)"),
            kept,
            "unknown-key" if not known else "" if finite else "bad-value",
        )
    try:
        checked = numbers(value, param.count, int_range=param.int_range, most=param.most_on_wire)
    except ProtocolError as exc:
        return f"{key}: {exc.text}", [], "bad-value"
    amounts = [param.from_wire(number) for number in checked]
    found = [
        Value(f"{param.name}.{part}", amount, param.unit) for part, amount in zip(param.elements, amounts, strict=True)
    ]
    return f"{key} {_by_finger(param, [param_text(param, amount) for amount in amounts])}", found, ""


def param_text(param: AidinParam, amount: float) -> str:
    """A value with the decimals that people see."""
    return f"{amount:.{param.places}f}" if param.places else f"{amount:g}" if isinstance(amount, float) else str(amount)


def _by_finger(param: AidinParam, texts: list[str]) -> str:
    """``[deg] thumb 0.6 1.0 136.1 136.1, index …``: the elements of each finger in wire order."""
    size = len(param.labels)
    groups = [f"{finger} {' '.join(texts[i * size : i * size + size])}" for i, finger in enumerate(FINGERS)]
    unit = f" [{param.unit}]" if param.unit else ""
    return f"({' '.join(param.labels)}){unit}: {', '.join(groups)}"


def _shown(value: object) -> str:
    from json import dumps

    if isinstance(value, int) and abs(value) > 1 << 64:
        return "a very long integer"
    try:
        text = dumps(value)
    except (ValueError, RecursionError):
        return "a value that cannot be shown"
    return text if len(text) <= 60 else f"{text[:57]}..."


explainer = AidinExplainer


# -- which of these bytes write, and what acknowledges them -----------------------------------------------------------


MODE = re.compile(rb'"hand_mode"[ :]*(\d{0,2})')
BLANKS = b" \t\r\n\0"
NEXT: dict[int, str] = {
    Mode.MAXTORQUE: "send it again, because the maximum torque cannot be read back",
    Mode.STOP: "`handctl aidin get current_state`, or switch the power off",
    Mode.BIAS: "`handctl aidin get sensor_state`",
}


class AidinWriteRules(WriteRules):
    """One connection."""

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteRules."""
        found = MODE.search(data)
        return (Frame(data, None, data.rstrip(BLANKS), group=f"mode {found[1].decode()}"),) if found else ()

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteRules: the terminator is no part of the command."""
        return data.rstrip(BLANKS) if MODE.search(data) else None

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteRules."""
        found = MODE.search(data)
        return NEXT.get(int(found[1] or -1) if found else -1, "`handctl aidin status`")


words = AidinWriteRules
