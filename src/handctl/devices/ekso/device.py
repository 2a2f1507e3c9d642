"""What an EksoNR can tell and be told through its DataPort; returns Tables. See `model.device`.

Knows words and names, no bytes: those are the port's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

from handctl.devices.ekso import gates
from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.frames import Command, Frame, cancel_body, set_value_body, status_text
from handctl.devices.ekso.lengthmode import find_mode
from handctl.devices.ekso.map import CLOCKS, DATA, EKSO, MESSAGES, NOTHING_SENT, Clock, Word
from handctl.devices.ekso.views import dump_view, words_view, written_view
from handctl.errors import (
    DeviceRefused,
    HandctlError,
    Interrupted,
    Left,
    LinkError,
    NoAnswer,
    ProtocolError,
)
from handctl.model.device import Device
from handctl.model.param import Element, Number, Reading, Step, elements_of
from handctl.model.result import Column, Row, Table

if TYPE_CHECKING:
    from handctl.devices.ekso.change import Change

    class Writing(Protocol):
        """Who writes settings, with all gates (`settings.Writer`)."""

        override: bool
        stepwise: bool

        def write(self, wanted: Sequence[tuple[Word, int]], shown: tuple[int, ...]) -> tuple[int, ...]: ...


COMMANDS = {
    "settings": Command.GET_SETTINGS, "data": Command.GET_DATA, "feedback": Command.GET_FEEDBACK,
    "date": Command.GET_DATE, "time": Command.GET_TIME,
}  # fmt: skip


class Ekso(Device):
    """One EksoNR. `port` is the line to it; `writer` is given by the commands that write."""

    kind = "ekso"
    product = "EksoNR"
    map = EKSO
    worn = True
    live = (
        *("state", "torso_pitch", "torso_roll", "left_hip_angle", "left_knee_angle", "right_hip_angle"),
        *("right_knee_angle", "left_toe_pressure", "left_heel_pressure", "right_toe_pressure", "right_heel_pressure"),
        *("left_hip_current", "left_knee_current", "right_hip_current", "right_knee_current"),
    )
    beside = ("left_hip_x", "left_hip_y", "right_hip_x", "right_hip_y")
    slowly = ("steps_taken",)
    scales = MappingProxyType({
        **dict.fromkeys(("torso_pitch", "torso_roll"), (-30.0, 30.0)),
        **{f"{side}_{joint}_angle": (-30.0, 120.0) for side in ("left", "right") for joint in ("hip", "knee")},
        **{f"{side}_{joint}_current": (-10.0, 10.0) for side in ("left", "right") for joint in ("hip", "knee")},
        **{f"{side}_{part}_pressure": (0.0, 0.0) for side in ("left", "right") for part in ("toe", "heel")},
        **{f"{side}_hip_x": (-20.0, 20.0) for side in ("left", "right")},
        **{f"{side}_hip_y": (0.0, 40.0) for side in ("left", "right")},
    })  # fmt: skip
    """The manual has no ranges. A recorded rise from a chair fits into these; a pressure is drawn against its own maximum so far."""
    columns = (
        Column("name", "Name"),
        Column("word", "Word", right=True),
        Column("id", "ID", right=True),
        Column("value", "Value", right=True),
        Column("raw", "Raw", right=True),
        Column("unit", "Unit"),
        Column("label", "Meaning"),
    )
    view = staticmethod(words_view)
    not_covered = ("swing_complete and pilot_id: they have no ParameterID",)

    def __init__(self, port: DataPort, *, find_length: bool = False) -> None:
        super().__init__(port)
        self._port = port
        self._find_length = find_length
        self.writer: Writing | None = None
        self.known: tuple[int, ...] | None = None

    @property
    def port(self) -> DataPort:
        """The line; with `--length-mode auto` its convention is looked for at first use."""
        if self._find_length:
            self._find_length = False
            mode = find_mode(self._port)
            self.journal.info("length-mode", f"{self.link.name}: the device accepts requests with --length-mode {mode}")
        return self._port

    def identity(self) -> dict[str, object]:
        """What tells one unit from another: the protocol has no serial number; the pilot's is personal and stays out."""
        return {"kind": self.kind, "serial_number": None}

    # -- reading -------------------------------------------------------------------------------------------------

    def words(self, message: str) -> tuple[int, ...]:
        """The words of a message as raw integers in their fields' own sign."""
        words = self.port.read(COMMANDS[message]).words
        raws = tuple(param.raw_of(word) for param, word in zip(MESSAGES[message], words, strict=True))
        if message == "settings":
            self.known = raws
        return raws

    def readings(self, message: str) -> list[Reading]:
        """A whole message, each word as a Reading."""
        return [_reading(param, raw) for param, raw in zip(MESSAGES[message], self.words(message), strict=True)]

    def read(self, elements: Sequence[Element]) -> list[Reading]:
        """Read elements with one request per message. Raises what went wrong when nothing could be read."""
        found: dict[str, tuple[int, ...] | Reading | HandctlError] = {}
        clocks = {clock.name: clock for clock in CLOCKS}
        with self.keeping(lambda: self._found(elements, found)):
            for message in dict.fromkeys(_word(element).message for element in elements):
                try:
                    found[message] = self.told(clocks[message]) if message in clocks else self.words(message)
                except (NoAnswer, ProtocolError) as exc:
                    found[message] = exc
        errors = [entry for entry in found.values() if isinstance(entry, HandctlError)]
        if errors and len(errors) == len(found):
            raise errors[0]
        return self._found(elements, found)

    @staticmethod
    def _found(
        elements: Sequence[Element], found: dict[str, tuple[int, ...] | Reading | HandctlError]
    ) -> list[Reading]:
        readings = []
        for element in elements:
            param = _word(element)
            words = found.get(param.message) or HandctlError("not read")
            if isinstance(words, HandctlError):
                readings.append(Reading(element, None, b"", words))
            elif isinstance(words, Reading):
                readings.append(words)
            else:
                raw = words[param.word]
                readings.append(Reading(element, param.from_raw(raw), (raw & 0xFFFF).to_bytes(2, "big")))
        return readings

    def ask_ahead(self, elements: Sequence[Element]) -> None:
        """Send the request of the next `read` of these elements already, when it is a single one."""
        messages = {_word(element).message for element in elements}
        if len(messages) == 1:
            self.port.send_ahead(COMMANDS[messages.pop()])

    def named(self, element: Element) -> Row:
        param = _word(element)
        return {"name": param.name, "word": None if isinstance(param, Clock) else param.word, "id": param.id}

    def valued(self, reading: Reading) -> Row:
        param = _word(reading.element)
        assert reading.value is not None
        if isinstance(param, Clock):
            numbers = dict(zip((name for name, _, _ in param.parts), reading.raw, strict=False))
            row: Row = {"value": param.form.format(*reading.raw), "raw": reading.value, "unit": None, "label": None}
            return {**row, **numbers, "bytes": len(reading.raw)}
        return {
            "value": reading.value,
            "raw": int.from_bytes(reading.raw, "big", signed=param.signed),
            "unit": param.unit,
            "label": param.label(reading.value),
        }

    def message(self, name: str) -> Table:
        """All words of GetSettings ("settings"), GetData ("data") or GetFeedback ("feedback")."""
        return self.table(self.readings(name))

    def told(self, clock: Clock) -> Reading:
        """GetTime or GetDate."""
        body = self.port.read(COMMANDS[clock.name]).body
        parts = zip(clock.parts, body, strict=False)
        wrong = [f"{name} {number}" for (name, low, high), number in parts if not low <= number <= high]
        if wrong:
            text = f"{self.link.name}: the device's {clock.name} is impossible: {', '.join(wrong)}"
            self.journal.warn("clock", text)
        return Reading(elements_of(clock)[0], int.from_bytes(body[:3], "big"), body)

    def clock_row(self, what: str) -> Row:
        """GetTime or GetDate as one row, ``14:05:37`` or ``2026-11-20``; the raw integer has its bytes."""
        (clock,) = (clock for clock in CLOCKS if clock.name == what)
        return self.row(self.told(clock))

    def clock(self, what: str) -> Table:
        """`time` or `date` as a Table."""
        return Table(rows=[self.clock_row(what)], columns=(Column("value", what.capitalize()),), plain=("value",))

    def now(self) -> tuple[Row, Row]:
        """Date and time that belong together: the date is read before and after the time (two messages)."""
        date = self.clock_row("date")
        for _ in range(3):
            time = self.clock_row("time")
            again = self.clock_row("date")
            if again["value"] == date["value"]:
                break
            date = again
        return date, time

    def dump(self) -> Table:
        """Everything that can be read: date, time, 22 settings, 27 words of data, 17 of feedback."""
        rows: list[Row] = []
        failure: HandctlError | None = None
        answered = False
        columns = (Column("message", "Message"), *self.columns)
        for message, words in MESSAGES.items():
            try:
                rows += [{**self.row(reading), "message": message} for reading in self.readings(message)]
                answered = True
            except (NoAnswer, ProtocolError) as exc:
                if not answered:
                    raise
                failure = exc
                rows += [
                    {**self.row(Reading(elements_of(param)[0], None, b"", exc)), "message": message} for param in words
                ]
            except (HandctlError, KeyboardInterrupt):
                self.journal.keep(Table(rows=rows, columns=columns, view=dump_view))
                raise
        try:
            rows = [{**row, "message": row["name"]} for row in self.now()] + rows
        except (NoAnswer, ProtocolError) as exc:
            failure = failure or exc
            unread = [Reading(elements_of(clock)[0], None, b"", exc) for clock in CLOCKS]
            rows = [{**self.row(reading), "message": reading.element.param.name} for reading in unread] + rows
        return Table(rows=rows, columns=columns, view=dump_view, failure=failure)

    def status(self, check: bool) -> Table:
        """What to look at first; with `check`, findings are exit 7."""
        from handctl.devices.ekso.status import status

        return status(self, check)

    # -- writing -------------------------------------------------------------------------------------------------

    def plan(self, changes: Sequence[tuple[Element, Number]]) -> list[Step]:
        """The SetValue of each change. Where the present settings are known, its meaning is old -> new and the policy is
        applied.

        Raises UsageError for what the policy refuses. The msgID is that of the next message: a later one differs in
        msgID and CRC.
        """
        from handctl.devices.ekso.change import Change

        steps: list[Step] = []
        self._note_open_length()
        for element, value in changes:
            param = _word(element)
            assert param.id is not None
            raw = param.to_raw(value)
            meaning = f"{param.name} = {param.shown(value)}"
            if self.known is not None:
                change: Change = Change(param, self.known[param.word], raw)
                steps += self._permitted(change)
                continue
            if param.choices and raw not in param.choices:
                self.journal.warn("unlisted", f"{meaning}: this code is not documented, so handctl never writes it")
                continue
            body = set_value_body(param.id, raw)
            steps.append(Step(meaning, self._port.request(Command.SET_VALUE, body)))
        return steps

    def _permitted(self, change: Change) -> list[Step]:
        """The SetValue of each step on the way, where the writer leads there; else of the change, checked."""
        from handctl.devices.ekso.change import Change, check_change, check_code, way

        override = self.writer is not None and self.writer.override
        if self.writer is None or not self.writer.stepwise:
            check_change(change, override)
            stages = [change.new]
        else:
            check_code(change)
            stages = way(change, override)
        assert change.param.id is not None
        return [
            Step(
                Change(change.param, old, new).text,
                self._port.request(Command.SET_VALUE, set_value_body(change.param.id, new)),
            )
            for old, new in zip([change.old, *stages], stages, strict=False)
        ]

    def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        """Write settings one at a time through all gates; the settings as they are read back afterwards."""
        assert self.writer is not None
        shown = self.known if self.known is not None else self.words("settings")
        wanted = [(_word(element), _word(element).to_raw(value)) for element, value in changes]
        self.known = after = self.writer.write(wanted, shown)
        return [_reading(param, after[param.word]) for param, _ in wanted]

    def plan_cancel(self, word: int) -> list[Step]:
        """The CancelAction that `cancel` would send. Raises UsageError for word 0."""
        self._note_open_length()
        return [Step(f"CancelAction 0x{word:04X}", self._port.request(Command.CANCEL_ACTION, cancel_body(word)))]

    def _note_open_length(self) -> None:
        if self._find_length:
            self.journal.info(
                "length-mode",
                f"shown with --length-mode {self._port.mode}, because only a connected device shows which one it needs",
            )

    def cancel(self, word: int, record: Callable[[str, dict[str, object]], None]) -> Table:
        """CancelAction once; `record` notes request and answer.

        Raises DeviceRefused, UsageError for word 0, Interrupted when nobody waited for the answer.
        """
        body = cancel_body(word)
        self.port.identify()
        request = self.port.request(Command.CANCEL_ACTION, body).hex(" ").upper()
        record("cancel", {"frame": request})
        sent = self.journal.counters.sent
        try:
            frame = self._cancelled(body, record, sent)
        except KeyboardInterrupt:
            if self.journal.counters.sent == sent:
                raise
            record("cancel-result", {"answer": None, "verdict": "interrupted before its reply"})
            raise Interrupted(
                "interrupted. CancelAction was sent and may have taken effect",
                hint="check with `handctl ekso status`, and send it again with `handctl ekso cancel` if needed",
            ) from None
        status = frame.words[0] & 0xFFFF
        text = status_text(status)
        record("cancel-result", {"answer": frame.data.hex(" ").upper(), "status": status, "verdict": text})
        if status & 0xFF:
            raise DeviceRefused(
                f"{self.port.where}: CancelAction 0x{word:04X}: {text} (status 0x{status:04X})",
                hint="check with `handctl ekso status`: the action may still be running",
            )
        row: Row = {"name": "cancel_action", "word": 0, "id": None, "value": 0, "raw": status, "unit": None}
        return Table(rows=[{**row, "label": text}], columns=self.columns)

    def _cancelled(self, body: bytes, record: Callable[[str, dict[str, object]], None], sent: int) -> Frame:
        """The answer to CancelAction; an error says what may have become of the request. `sent` requests went before."""
        try:
            return self.port.exchange(Command.CANCEL_ACTION, body)
        except (NoAnswer, ProtocolError, LinkError) as exc:
            record("cancel-result", {"answer": None, "verdict": exc.text})
            if self.journal.counters.sent > sent:
                exc.leaves(Left(hint=self._state_now(), joint=" "))
            elif exc.code != "deadline":  # that one says by itself that nothing was sent
                exc.leaves(Left(hint="It was not sent, or only in part.", joint=" "))
            raise

    def _state_now(self) -> str:
        try:
            return f"It was sent and may have taken effect. The state is {DATA[18].label(self.words('data')[18])}."
        except HandctlError:
            return "It was sent and may have taken effect. The state cannot be read."


def _word(element: Element) -> Word:
    assert isinstance(element.param, Word)
    return element.param


def _reading(param: Word, raw: int) -> Reading:
    return Reading(Element(param, 0), param.from_raw(raw), (raw & 0xFFFF).to_bytes(2, "big"))


def one_setting(texts: Sequence[str]) -> tuple[Element, Number]:
    """The one NAME=VALUE of a `set`, checked. Raises UsageError for more: settings of a worn device are set one by one."""
    changes = EKSO.assignments(texts)
    if len(changes) != 1:
        raise gates.refusal(
            gates.ONE, f"{len(changes)} settings at once", f"one `set` writes one setting. {NOTHING_SENT}"
        )
    return changes[0]


def written_table(ekso: Ekso, before: Sequence[int], readings: Sequence[Reading]) -> Table:
    """What `set` wrote, with the raw values `before`: rows as of `get`, with `before` and `before_label`."""
    table = ekso.table(readings)
    for row in table.rows:
        param = EKSO[row["name"]]
        old = param.from_raw(before[param.word])
        row |= {"before": old, "before_label": param.label(old)}
    table.columns = (*ekso.columns[:3], Column("before", "Before", right=True), *ekso.columns[3:])
    table.view = written_view
    return table
