"""The EksoNR: reading and writing through its DataPort, and its tables. See `model.device`.

Knows words and names, no bytes: those are the port's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

from handctl.devices.ekso import write_checks
from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.frames import OVERHEAD, READS, START_MOVEMENT, Command, cancel_body, status_text, unpack
from handctl.devices.ekso.parameter_map import (
    CLOCKS,
    DATA,
    EKSO,
    MESSAGES,
    NAMED,
    NOTHING_SENT,
    SIGNS,
    Clock,
    Word,
    boot_ms,
    boot_text,
    days_of,
)
from handctl.devices.ekso.setting_change import Change
from handctl.errors import (
    Aftermath,
    DeviceRefused,
    HandctlError,
    Hint,
    Interrupted,
    LinkError,
    NoAnswer,
    NotPresent,
    ProtocolError,
    UsageError,
)
from handctl.model.device import Device
from handctl.model.explainer import HOST
from handctl.model.param import Element, Number, Reading, Step
from handctl.model.result import Cell, Column, Grid, Row, Table, hex_bytes
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.devices.ekso.setting_writer import Writer


# -- how people see the words: units, codes in words, bits in hex, boot time; old and new of a written setting ---------


def words_view(rows: list[Row]) -> list[Grid]:
    """One line a word, with as many decimals as the wire has, bits in hex; units and codes in words."""
    ids = any(row.get("id") is not None for row in rows)
    headings = ("Name", *(["ID"] if ids else []), "Value", "Unit", "Meaning")
    lines = []
    for row in rows:
        identity = [str(row["id"]) if row.get("id") is not None else ""] if ids else []
        lines.append((row["name"], *identity, _value_cell(row), row["unit"] or "", _meaning(row)))
    notes = dict.fromkeys(f"{row['name']}: {row['error']}" for row in rows if "error" in row)
    boot = {row["name"]: row.get("raw") for row in rows}
    high, low = boot.get("boot_time_high"), boot.get("boot_time_low")
    uptime = [f"boot {boot_text(boot_ms([high, low]))}"] if isinstance(high, int) and isinstance(low, int) else []
    right = frozenset({1, 2} if ids else {1})
    return [Grid(headings, tuple(lines), right=right, notes=(*uptime, *notes))]


def written_view(rows: list[Row]) -> list[Grid]:
    """Old and new side by side."""
    lines = [
        (row["name"], str(row["id"]), EKSO[row["name"]].shown(row["before"]), EKSO[row["name"]].shown(row["value"]))
        for row in rows
    ]
    return [Grid(("Name", "ID", "Before", "Now"), tuple(lines), right=frozenset({1, 2, 3}))]


def _value_cell(row: Row) -> str | Cell:
    if "error" in row:
        return Cell("?", "bad")
    param = NAMED.get(row["name"])
    return param.text(row["value"]) if param is not None else str(row["value"])


def _meaning(row: Row) -> str | Cell:
    label = row.get("label") or ""
    return Cell(label, "warn") if label.startswith("unknown") else label


def dump_view(rows: list[Row]) -> list[Grid]:
    """A grid per message."""
    grids = []
    clocks = [row for row in rows if row["message"] in ("date", "time")]
    if clocks:
        line = "  ".join(str(row.get("value", "?")) for row in clocks)
        grids.append(Grid(("Date and time",), ((line,),), title="EksoNR"))
    for message in dict.fromkeys(row["message"] for row in rows if row["message"] in MESSAGES):
        (grid,) = words_view([row for row in rows if row["message"] == message])
        grids.append(grid._replace(title=message.capitalize()))
    return grids


OPEN = ("no-answer", "echo", "acknowledged", "bad-length")
"""Codes of a message that this firmware may not have, where it has others."""
STATUS_SIZE = OVERHEAD + 2
"""Bytes of a reply that holds a status word: it refuses. One of another size is there, and of another version."""


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
    additional = ("left_hip_x", "left_hip_y", "right_hip_x", "right_hip_y")
    slowly = ("steps_taken",)
    vital = ("state", "upper_leg_length", "lower_leg_length")
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
        self.writer: Writer | None = None
        self.known: tuple[int, ...] | None = None
        self._lacking: dict[str, NotPresent] = {}
        """Messages that this firmware does not have."""

    @property
    def port(self) -> DataPort:
        """The line; with `--length-mode auto` its convention is looked for at first use."""
        if self._find_length:
            self._find_length = False
            mode = self._port.detect_length_mode()
            self.journal.info("length-mode", f"{self.link.name}: the device accepts requests with --length-mode {mode}")
        return self._port

    def identity(self) -> dict[str, object]:
        """The identity of a unit: the protocol has no serial number, and the pilot's number is personal and left out."""
        return {"kind": self.kind, "serial_number": None}

    # -- typed bytes ---------------------------------------------------------------------------------------------

    def plan_typed(self, data: bytes, can_id: int | None) -> tuple[Step, str] | None:
        """What writes is sent by its own command only, which writes the audit log; what starts a movement by none.

        There is no start byte, and the device may wait for the rest of a frame for as long as it likes: a byte that is one of these
        commands may begin it wherever no whole request to read stands, and that of the movement anywhere.
        """
        from handctl.devices.ekso.explain_bytes import explainer

        if START_MOVEMENT in data:
            raise UsageError(
                f"the byte {START_MOVEMENT:02X} may begin command {START_MOVEMENT}, which starts a movement and is never sent",
                hint="start a movement at the EksoNR itself. In a request to read, use another msgID. Nothing was sent.",
                code="never-sent",
            )
        writing = {int(Command.SET_VALUE): "set", int(Command.CANCEL_ACTION): "cancel"}
        found = [
            verb
            for piece in explainer().decode(data, HOST)
            if not piece.frame or piece.fields["command"] not in READS.values()
            for byte in piece.raw
            if (verb := writing.get(byte))
        ]
        if found:
            raise UsageError(
                "a frame that writes is not sent as typed, because it would be missing from the audit log",
                hint=Hint("use {}. Nothing was sent.", f"ekso {found[0]}"),
            )
        return None

    def admit(self, data: bytes, can_id: int | None) -> None:
        self.port.identify()

    # -- reading -------------------------------------------------------------------------------------------------

    def words(self, message: str) -> tuple[int, ...]:
        """The words of a message as raw integers in their fields' own sign."""
        raws = unpack(self.port.read(READS[message]).body, SIGNS[message])
        if message == "settings":
            self.known = raws
        return raws

    def rows_of(self, message: str, words: Sequence[int]) -> list[Row]:
        """A message that came, as rows of `get`."""
        return [self.row(_reading(word, word.raw_of(raw))) for word, raw in zip(MESSAGES[message], words, strict=True)]

    def readings(self, message: str) -> list[Reading]:
        """A whole message, each word as a Reading."""
        if message not in MESSAGES:
            return [self.told(next(clock for clock in CLOCKS if clock.name == message))]
        return [_reading(param, raw) for param, raw in zip(MESSAGES[message], self.words(message), strict=True)]

    def read(self, elements: Sequence[Element]) -> list[Reading]:
        """Read elements with one request per message. Raises what went wrong when nothing could be read."""
        found: dict[str, Found] = {}
        with self.keep_partial(lambda: _picked(elements, found)):
            messages = dict.fromkeys([element.param.message for element in elements])  # type: ignore[attr-defined]
            known = self._lacking if messages.keys() - self._lacking.keys() else {}
            for message in messages:
                try:
                    found[message] = known.get(message) or (
                        self.words(message) if message in MESSAGES else self.readings(message)
                    )
                except (NoAnswer, ProtocolError) as exc:
                    found[message] = exc
        errors = [entry for entry in found.values() if isinstance(entry, HandctlError)]
        if errors and len(errors) == len(found):
            raise errors[0]
        return _picked(elements, {message: self._judged(message, one) for message, one in found.items()})

    def _judged(self, message: str, found: Found) -> Found:
        """NotPresent, from now on, for a message that alone is silent, only acknowledged, or answered by a status word."""
        other_size = isinstance(found, ProtocolError) and found.code == "bad-length" and len(found.came) != STATUS_SIZE
        if (
            isinstance(found, NoAnswer | ProtocolError)
            and found.code in OPEN
            and not other_size
            and self.port.lacks(READS[message])
        ):
            found = self._lacking[message] = NotPresent.shown_by(found)
        return found

    def asked(self, message: str) -> list[Reading]:
        """`readings`; of a message that alone is silent, or only acknowledged, words that are not present, and of one of another size
        words that could not be read. Raises what `readings` raises."""
        try:
            return self.readings(message)
        except (NoAnswer, ProtocolError) as exc:
            error = self._judged(message, exc)
            if not isinstance(error, NotPresent) and exc.code != "bad-length":
                raise
            assert isinstance(error, HandctlError)
            words = MESSAGES.get(message) or [clock for clock in CLOCKS if clock.name == message]
            return _unread(words, error)

    def ask_ahead(self, elements: Sequence[Element]) -> Callable[[], None] | None:
        """What sends the request of the next `read` of these elements already; None where that is not a single one."""
        messages = {_word(element).message for element in elements}
        return partial(self.port.send_ahead, READS[messages.pop()]) if len(messages) == 1 else None

    def element_keys(self, element: Element) -> Row:
        param: Word = element.param  # type: ignore[assignment]
        return {"name": param.name, "word": None if isinstance(param, Clock) else param.word, "id": param.id}

    def value_keys(self, reading: Reading) -> Row:
        param: Word = reading.element.param  # type: ignore[assignment]
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

    def shown(self, message: str) -> Table:
        """All words of GetSettings ("settings"), GetData ("data") or GetFeedback ("feedback"); `time` and `date` alone."""
        if message in MESSAGES:
            return self.table(self.readings(message))
        columns = (Column("value", message.capitalize()),)
        return Table(rows=[self.row(*self.readings(message))], columns=columns, plain=("value",))

    def told(self, clock: Clock) -> Reading:
        """GetTime or GetDate."""
        body = self.port.read(READS[clock.name]).body
        parts = zip(clock.parts, body, strict=False)
        wrong = [f"{name} {number}" for (name, low, high), number in parts if not low <= number <= high]
        if clock.name == "date" and not wrong and body[2] > days_of(body[0], body[1]):
            wrong = [f"day {body[2]} of month {body[1]}"]
        if wrong:
            text = f"{self.link.name}: the device's {clock.name} is impossible: {', '.join(wrong)}"
            self.journal.warn("clock", text)
        return Reading(clock.each[0], int.from_bytes(body[:3], "big"), body)

    def _clocks(self) -> list[Reading]:
        """Date and time that belong together: the date is read before and after the time (two messages)."""
        date = self.asked("date")
        for _ in range(3):
            time = self.asked("time")
            again = self.asked("date") if date[0].value is not None else date
            if again[0].raw == date[0].raw:
                break
            date = again
        return [*date, *time]

    def now(self) -> tuple[Row, Row]:
        """The same as rows. Raises what kept one from being read."""
        readings = self._clocks()
        for reading in readings:
            if reading.error is not None:
                raise reading.error
        date, time = map(self.row, readings)
        return date, time

    def dump(self) -> Table:
        """Everything that can be read: date, time, 22 settings, 27 words of data, 17 of feedback."""
        found: list[Reading] = []
        columns = (Column("message", "Message"), *self.columns)

        def rows(readings: Sequence[Reading]) -> list[Row]:
            return [{**self.row(reading), "message": _word(reading.element).message} for reading in readings]

        for message, words in MESSAGES.items():
            try:
                found += self.asked(message)
            except (NoAnswer, ProtocolError) as exc:
                if not found:
                    raise
                found += _unread(words, exc)
            except (HandctlError, KeyboardInterrupt):
                self.journal.keep(Table(rows=rows(found), columns=columns, view=dump_view))
                raise
        try:
            found = [*self._clocks(), *found]
        except (NoAnswer, ProtocolError) as exc:
            found = [*_unread(CLOCKS, exc), *found]
        found = self.present(found)
        failure = next((reading.error for reading in found if reading.error is not None), None)
        return Table(rows=rows(found), columns=columns, view=dump_view, failure=failure)

    def status(self, check: bool) -> Table:
        """The health summary; with `check`, findings give exit code 7."""
        from handctl.devices.ekso.status import status

        return status(self, check)

    # -- writing -------------------------------------------------------------------------------------------------

    def plan(self, changes: Sequence[tuple[Element, Number]]) -> list[Step]:
        """The SetValue of each change. Where the present settings are known, its meaning is old -> new and the policy is
        applied.

        Raises UsageError for what the policy refuses. The msgID is that of the next message: a later one differs in
        msgID and CRC.
        """
        steps: list[Step] = []
        self._note_open_length()
        for element, value in changes:
            param = _word(element)
            raw = param.to_raw(value)
            if self.known is not None:
                steps += self._permitted(Change(param, self.known[param.word], raw))
            elif param.choices and raw not in param.choices:
                text = f"{param.name} = {param.shown(value)}: this code is not documented, so handctl never writes it"
                self.journal.warn("unlisted", text)
            else:
                steps.append(self._step(f"{param.name} = {param.shown(value)}", Change(param, raw, raw)))
        return steps

    def _permitted(self, change: Change) -> list[Step]:
        """The SetValue of each step on the way, where the writer leads there; else of the change, checked."""
        override = self.writer is not None and self.writer.override
        change.check_code()
        if self.writer is not None and self.writer.stepwise:
            return [self._step(one.text, one) for one in change.way(override)]
        change.check_step(override)
        return [self._step(change.text, change)]

    def _step(self, meaning: str, change: Change) -> Step:
        return Step(meaning, self._port.request(Command.SET_VALUE, change.body))

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
        record("cancel", {"frame": hex_bytes(self.port.request(Command.CANCEL_ACTION, body))})
        before = self.journal.counters.sent
        try:
            try:
                frame = self.port.exchange(Command.CANCEL_ACTION, body)
                self.port.resynchronise()  # a second answer may contradict it
            except (NoAnswer, ProtocolError, LinkError) as exc:
                record("cancel-result", {"answer": None, "verdict": exc.text})
                if self.journal.counters.sent > before:
                    exc.add_aftermath(
                        Aftermath(hint=f"It was sent and may have taken effect. {self._state_now()}", joint=" ")
                    )
                elif exc.code != "deadline":  # that one says by itself that nothing was sent
                    exc.add_aftermath(Aftermath(hint="It was not sent, or only in part.", joint=" "))
                raise
        except KeyboardInterrupt:
            if self.journal.counters.sent == before:
                raise
            record("cancel-result", {"answer": None, "verdict": "interrupted before its reply"})
            raise Interrupted(
                "interrupted. CancelAction was sent and may have taken effect",
                hint=Hint("check with {}, and send it again with {} if needed", "ekso status", "ekso cancel"),
            ) from None
        text = status_text(frame.status)
        twice = self.port.contradiction is not None
        verdict = self.port.statuses if twice else text
        record("cancel-result", {"answer": hex_bytes(frame.data), "status": frame.status, "verdict": verdict})
        if frame.status & 0xFF or twice:
            raise DeviceRefused(
                f"{self.port.where}: CancelAction 0x{word:04X}: {self.port.statuses}",
                hint=Hint("check with {}: the action may still be running", "ekso status"),
            )
        row: Row = {"name": "cancel_action", "word": 0, "id": None, "value": 0, "raw": frame.status, "unit": None}
        return Table(rows=[{**row, "label": text}], columns=self.columns)

    def _state_now(self) -> str:
        try:
            return f"The state is {DATA[18].label(self.words('data')[18])}."
        except HandctlError:
            return "The state cannot be read."


def _unread(params: Sequence[Word], error: HandctlError) -> list[Reading]:
    return [Reading(Element(param, 0), None, b"", error) for param in params]


Found = tuple[int, ...] | list[Reading] | HandctlError
"""A whole message: its words as raw integers, of a clock its reading, or why it was not read."""


def _picked(elements: Sequence[Element], found: Mapping[str, Found]) -> list[Reading]:
    """The readings of these elements: only theirs are made, for the line waits for the next request meanwhile."""
    readings = []
    for element in elements:
        param: Word = element.param  # type: ignore[assignment]
        message = found.get(param.message)
        if isinstance(message, tuple):
            readings.append(_reading(param, message[param.word]))
        elif isinstance(message, list):
            readings.append(message[param.word])
        else:
            readings.append(Reading(element, None, b"", message or HandctlError("not read")))
    return readings


def _word(element: Element) -> Word:
    assert isinstance(element.param, Word)
    return element.param


def _reading(param: Word, raw: int) -> Reading:
    return Reading(param.each[0], param.from_raw(raw), (raw & 0xFFFF).to_bytes(2, "big"))


def one_setting(texts: Sequence[str]) -> tuple[Element, Number]:
    """The one NAME=VALUE of a `set`, checked. Raises UsageError for more: settings of a worn device are set one by one."""
    changes = EKSO.assignments(texts)
    if len(changes) != 1:
        raise write_checks.refusal(
            write_checks.ONE,
            f"{plural(len(changes), 'setting')} at once",
            f"one `set` writes one setting. {NOTHING_SENT}",
        )
    return changes[0]


def written_table(ekso: Ekso, before: Sequence[int], readings: Sequence[Reading]) -> Table:
    """What `set` wrote, with the raw values `before`: rows as of `get`, with `before` and `before_label`."""
    table = ekso.table(readings)
    for row in table.rows:
        param = EKSO[row["name"]]
        old = param.from_raw(before[param.word])
        row |= {"before": old, "before_label": param.label(old), "changed": old != row.get("value")}
    table.columns = (
        *ekso.columns[:3],
        Column("before", "Before", right=True),
        *ekso.columns[3:],
        Column("changed", "Changed"),
    )
    table.view = written_view
    return table
