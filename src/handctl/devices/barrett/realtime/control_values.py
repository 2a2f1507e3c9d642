"""Where control values of the RealTime loop come from: constant, a schedule with times, or live lines from stdin or a pipe.

    t,velocity.F1,velocity.F2        CSV, or one JSON object a line with the same keys
    0.0,20,20
    1.5,0,-20

A value holds until the next one; a name without a motor is for every motor that carries it. With a `t` column (seconds
since the start) everything is read and checked before the hand is touched, and the loop ends with the last row.
Without one each line counts when it comes, and the end of the input ends the loop. Knows no wire; of the loop no clock.
"""

from __future__ import annotations

import io
import math
import os
import re
import sys
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain, islice
from typing import Any

from handctl.devices.barrett.gcl.codec import MOTORS, motor_prefix
from handctl.devices.barrett.realtime.blocks import CONTROL, FEEDBACK, LIMITS, Values, check_control, selections, still
from handctl.errors import NoAnswer, UsageError
from handctl.files import is_pipe, read_text, unmarked
from handctl.number_parsing import real_in
from handctl.system import clock, disk
from handctl.system.waits import gives

Change = dict[tuple[int, str], Any]
Timed = tuple[float | None, Change]
COLUMNS = -1
"""In place of a motor: the columns that only laws use."""
MOST_ROWS = 100_000
"""With times: they are all kept, and a pipe may have more without end. At 50 a second it is half an hour."""
ONE_OBJECT = 'write one object a line, such as {"t": 0, "velocity.F1": 20}'
ALIASES = {"F1": 0, "F2": 1, "F3": 2, "SPREAD": 3, "1": 0, "2": 1, "3": 2, "4": 3, "S": 3}


class Controls:
    """Control values over time; this one never changes and never ends."""

    live = False
    follows = False
    """Each value is made of the feedback before it."""
    silent = False
    """Nothing has come for so long that velocities are 0."""

    def __init__(self, carries: Mapping[int, Sequence[str]], start: Change) -> None:
        self.carries = {index: tuple(names) for index, names in carries.items()}
        self._state: Values = {
            index: {name: start.get((index, name), 0) for name in names} for index, names in self.carries.items()
        }
        for index, names in self.carries.items():
            if "gain" in names and (index, "gain") not in start:
                hint = "give --gain G, or leave gain out of --send"
                raise UsageError(f"{MOTORS[index]} has no gain to start with", hint=hint)

    @property
    def first(self) -> Values:
        """What is sent first, as far as it is known now; asking takes nothing from the input."""
        return self._state

    def at(self, seconds: float) -> Values | None:
        """The values to send `seconds` after the start; None when it is over. Raises UsageError for a bad live line."""
        return self._state

    def extremes(self, index: int) -> tuple[int, int]:
        """Lowest and highest velocity that a motor can be sent."""
        if self.live:
            return LIMITS["velocity"]
        velocity = self._state[index]["velocity"]
        return velocity, velocity

    def steer(self, values: Mapping[str, Any]) -> None:
        """Values of a program that has the loop: of each name a number, one for each motor, or motor -> number. Raises UsageError."""
        change: Change = {}
        for name, given in values.items():
            carrying = [index for index, names in self.carries.items() if name in names]
            if not carrying:
                hint = f"add {name} to --send" if name in CONTROL else f"use {' or '.join(CONTROL)}"
                raise UsageError(f"{name} is not sent", hint=hint)
            several = [f"{key}={value}" for key, value in given.items()] if isinstance(given, Mapping) else given
            one = isinstance(several, str) or not isinstance(several, Iterable)  # numbers of numpy are no int
            change |= constant(str(several) if one else ",".join(map(str, several)), name, carrying)
        self._apply(change)
        self.live = True

    def _apply(self, change: Change) -> None:
        for (index, name), value in change.items():
            self._state[index][name] = value


class Schedule(Controls):
    """Rows with times, all checked beforehand."""

    def __init__(
        self, carries: Mapping[int, Sequence[str]], rows: Sequence[tuple[float, Change]], start: Change
    ) -> None:
        super().__init__(carries, {**start, **rows[0][1]})
        self._rows = deque(rows)

    def extremes(self, index: int) -> tuple[int, int]:
        sent = [change[index, "velocity"] for _, change in self._rows if (index, "velocity") in change]
        sent.append(super().extremes(index)[0])
        return min(sent), max(sent)

    def at(self, seconds: float) -> Values | None:
        if not self._rows:
            return None
        while self._rows and self._rows[0][0] <= seconds:
            self._apply(self._rows.popleft()[1])
        return self._state


class Live(Controls):
    """Lines that apply when they arrive. `listen` runs in another thread: the loop never waits for a line.

    When none has come for `stale` seconds, velocities are 0 until one does: nothing else stops a hand whose controlling
    program hangs (dossier 6.6).
    """

    live = True
    stale = 1.0

    def __init__(self, carries: Mapping[int, Sequence[str]], rows: Iterator[Timed], start: Change) -> None:
        super().__init__(carries, {**start, **next(rows)[1]})
        self._rows = rows
        self._arrived: deque[Change | UsageError | None] = deque()
        self._heard = 0.0

    def listen(self) -> None:
        """Take every line as it arrives, until the input ends or a line is invalid; the loop reads them with `at`."""
        try:
            for _, change in self._rows:
                self._arrived.append(change)
            self._arrived.append(None)
        except UsageError as exc:
            self._arrived.append(exc)
        except (OSError, ValueError) as exc:
            self._arrived.append(
                UsageError(
                    f"the control input cannot be read: {exc}", hint="check the program that writes the control values"
                )
            )

    def at(self, seconds: float) -> Values | None:
        while self._arrived:
            change = self._arrived[0]  # its end, good or bad, stays: whoever asks next is told as well
            if isinstance(change, UsageError):
                raise change
            if change is None:
                return None
            self._apply(change)
            self._arrived.popleft()
            self._heard = seconds
        self.silent = seconds - self._heard > self.stale
        return still(self._state) if self.silent else self._state


def constant(text: str, name: str, motors: Sequence[int]) -> Change:
    """``20`` for all of `motors`, ``20,127`` in their order, ``F1=20,F3=5`` -> values. Raises UsageError."""
    parts = [part.strip() for part in text.split(",")]
    named = [part.partition("=") for part in parts]
    if all(equals for _, equals, _ in named):
        return {(_motor(who, motors, f"--{name}"), name): _whole(value, name, f"--{name}") for who, _, value in named}
    values = [_whole(part, name, f"--{name}") for part in parts]
    if len(values) == 1:
        values *= len(motors)
    if len(values) != len(motors):
        raise UsageError(
            f"--{name} {text}: {len(values)} value{'s' * (len(values) != 1)} for {len(motors)} motor{'s' * (len(motors) != 1)}",
            hint=f"give one for all, one each in the order {', '.join(MOTORS[index] for index in motors)}, or F1=20,F3=5",
        )
    return {(index, name): value for index, value in zip(motors, values, strict=True)}


def parse(
    lines: Iterable[str], where: str, motors: Sequence[int], start: Change, columns: Collection[str] = ()
) -> Controls:
    """A schedule or live controls from CSV or JSON lines, with further `columns`. Raises UsageError with the line number."""
    numbered = (
        (number, line) for number, line in enumerate(unmarked(lines), 1) if line.strip() and not line.startswith("#")
    )
    first = next(numbered, None)
    if first is None:
        raise UsageError(f"{where}: no rows", hint="begin with a header such as t,velocity.F1, then rows of numbers")
    row = partial(_row, motors, columns)
    if first[1].lstrip().startswith("{"):
        rows = _json_rows(chain([first], numbered), where, row)
    else:
        rows = _csv_rows(first, numbered, where, row)
    if (head := next(rows, None)) is None:
        raise UsageError(f"{where}: a header, but no rows", hint="add rows of numbers below the header")
    time, change = head
    rows = chain([head], rows)
    carried = {index: tuple(n for n in CONTROL if (index, n) in {**start, **change}) for index in motors}
    for name in columns:
        if (COLUMNS, name) not in change:
            hint = "add the column, or correct its name in --law or --until"
            raise UsageError(f"{where}: no column {name!r} in the first row, but a law uses it", hint=hint)
    carried |= {COLUMNS: tuple(columns)} if columns else {}
    rows = _steady(rows, carried, timed=time is not None, where=where)
    if time is None:
        return Live(carried, rows, start)
    timed = [(t or 0.0, change) for t, change in islice(rows, MOST_ROWS + 1)]
    if len(timed) > MOST_ROWS:
        raise UsageError(
            f"{where}: more than {MOST_ROWS} rows", hint="leave t out and send each line when it is due: --control -"
        )
    return Schedule(carried, timed, start)


def _steady(rows: Iterator[Timed], carried: Mapping[int, Sequence[str]], *, timed: bool, where: str) -> Iterator[Timed]:
    """The same rows, checked against the first: times rise, and nothing new appears."""
    last = 0.0
    for number, (time, change) in enumerate(rows, 1):
        if (time is not None) != timed:
            raise UsageError(
                f"{where}: row {number} has {'no ' if timed else 'a '}time, the first has {'one' if timed else 'none'}",
                hint="give every row a time, or none",
            )
        if time is not None:
            if time < last:
                raise UsageError(
                    f"{where}: row {number}: time {time:g} s is before {last:g} s",
                    hint="sort the rows, because times must increase",
                )
            last = time
        for index, name in change:
            if name not in carried[index]:
                raise UsageError(
                    f"{where}: row {number}: {name}.{MOTORS[index]} was not in the first row",
                    hint="name every value in the first row, because the structure of the blocks is fixed when the loop starts",
                )
        yield time, change


def _csv_rows(
    header: tuple[int, str],
    lines: Iterable[tuple[int, str]],
    where: str,
    row: Callable[[Mapping[str, Any], str], Timed],
) -> Iterator[Timed]:
    names = [name.strip() for name in _fields(header[1], f"{where}: line {header[0]}")]
    row(dict.fromkeys(names, 0), f"{where}: line {header[0]}")  # each name is known, whatever its values
    for number, line in lines:
        fields = _fields(line, f"{where}: line {number}")
        if len(fields) != len(names):
            raise UsageError(
                f"{where}: line {number}: {len(fields)} field{'s' * (len(fields) != 1)}, the header has {len(names)}",
                hint="give each line as many fields as the header has",
            )
        given = {name: field.strip() for name, field in zip(names, fields, strict=True) if field.strip()}
        yield row(given, f"{where}: line {number}")


def _fields(line: str, where: str) -> list[str]:
    import csv

    try:
        return next(csv.reader([line]))
    except csv.Error as exc:
        raise UsageError(f"{where} is not CSV: {exc}", hint="separate the fields with commas") from exc


def _json_rows(
    lines: Iterable[tuple[int, str]], where: str, row: Callable[[Mapping[str, Any], str], Timed]
) -> Iterator[Timed]:
    import json

    for number, line in lines:
        try:
            found = json.loads(line)
        except (ValueError, RecursionError) as exc:
            raise UsageError(f"{where}: line {number} is not JSON: {exc}", hint=ONE_OBJECT) from exc
        if not isinstance(found, dict):
            raise UsageError(f"{where}: line {number} is not a JSON object", hint=ONE_OBJECT)
        yield row({str(name): value for name, value in found.items()}, f"{where}: line {number}")


def _row(motors: Sequence[int], columns: Collection[str], fields: Mapping[str, Any], where: str) -> Timed:
    time: float | None = None
    change: Change = {}
    for key, value in fields.items():
        if key == "t":
            time = _seconds(value, where)
        elif key in columns:
            change[(COLUMNS, key)] = _number(value, key, where)
        else:
            name, which = targets(key, motors, where)
            change.update({(index, name): _whole(value, name, where) for index in which})
    return time, change


def targets(key: str, motors: Sequence[int], where: str) -> tuple[str, list[int]]:
    """``velocity.F1`` -> ("velocity", [0]); ``velocity`` -> all of `motors`; ``t`` -> ("t", []). Raises UsageError."""
    name, dot, who = key.partition(".")
    if key == "t":
        return key, []
    if name not in CONTROL:
        raise UsageError(
            f"{where}: {key!r} is not a control value",
            hint=f"use t, {', '.join(f'{name}.MOTOR' for name in CONTROL)} (motors {', '.join(MOTORS[i] for i in motors)})",
        )
    return name, [_motor(who, motors, where)] if dot else list(motors)


def _motor(text: str, motors: Sequence[int], where: str) -> int:
    index = ALIASES.get(text.strip().upper())
    if index is None or index not in motors:
        raise UsageError(
            f"{where}: {text!r} is not one of the loop's motors",
            hint=f"use one of {', '.join(MOTORS[i] for i in motors)}",
        )
    return index


def _whole(value: Any, name: str, where: str) -> int:
    if isinstance(value, str) and re.fullmatch("[+-]?[0-9]+", text := value.strip()):
        value = int(text) if len(text.lstrip("+-")) < 10 else 10**9
    if isinstance(value, bool) or not isinstance(value, int):
        raise UsageError(f"{where}: {name} {value!r} is not a whole number", hint="use a whole number, such as 20")
    try:
        return check_control(name, value)
    except UsageError as exc:
        raise UsageError(f"{where}: {exc.text}", hint=exc.hint, code=exc.code) from None


def _number(value: Any, name: str, where: str) -> float:
    number = math.nan if isinstance(value, bool) else real_in(value) if isinstance(value, str) else value
    if not isinstance(number, int | float) or not abs(number) < 1e12:
        raise UsageError(f"{where}: {name} {value!r} is not a number", hint="use a number, such as 9000 or 0.5")
    return float(number)


def _seconds(value: Any, where: str) -> float:
    try:
        seconds = float(value)
    except (TypeError, ValueError):
        seconds = -1.0
    if isinstance(value, bool) or not 0 <= seconds < 1e6:
        raise UsageError(f"{where}: t {value!r} is not a time in seconds", hint="use seconds, 0 or more, such as 0.5")
    return seconds


def loop_motors(text: str | None) -> list[int]:
    """``124`` -> [0, 1, 3]; None = all four. Raises UsageError."""
    return [int(digit) - 1 for digit in (motor_prefix(text) if text is not None else "1234")]


# -- what was asked for ----------------------------------------------------------------------------------------------


def received(text: str | None, motors: list[int]) -> tuple[dict[int, tuple[str, ...]] | None, bool | None]:
    """What --receive asks for: per motor, and whether with the temperature."""
    if text is None:
        return None, None
    names = [part.strip() for part in text.split(",") if part.strip()]
    temperature = any(name.lower() == "temperature" for name in names)
    rest = [name for name in names if name.lower() != "temperature"]
    return selections(rest, FEEDBACK, motors, "--receive"), temperature


def controls_of(
    send: str | None,
    velocity: str | None,
    gain: str | None,
    path: str | None,
    motors: list[int],
    seconds: float | None,
    columns: Collection[str] = (),
) -> Controls | None:
    """Where control values come from, None when nothing is to be sent. `columns` are those that laws use. Raises UsageError."""
    carried = selections(send.split(","), CONTROL, motors, "--send") if send is not None else None
    start: Change = {}
    for name, text in (("velocity", velocity), ("gain", gain)):
        if text is not None:
            given = motors if carried is None else [index for index in motors if name in carried[index]]
            if not given:
                raise UsageError(f"--{name} without {name} in --send {send}", hint="leave --send out, or add it there")
            start.update(constant(text, name, given))
    if path is not None:
        controls = _from_file(path, motors, start, seconds, columns)
        if carried is not None and carried != {index: controls.carries[index] for index in motors}:
            raise UsageError(
                f"--send {send} does not fit the columns of {path}",
                hint="leave --send out: the columns name the values",
            )
        return controls
    if carried is None:
        carried = {index: tuple(name for name in CONTROL if (index, name) in start) for index in motors}
    return Controls(carried, start) if any(carried.values()) else None


def _from_file(
    path: str, motors: list[int], start: Change, seconds: float | None, columns: Collection[str]
) -> Controls:
    """Control values of a file, or of a pipe or stdin that is waited for `seconds`."""
    if path == "-" or is_pipe(path):
        lines = Lines(path, seconds)
        controls = parse(lines, "stdin" if path == "-" else path, motors, start, columns)
        lines.begun = True
        return controls
    text = io.StringIO(read_text(path, "a control file", 16_000_000), newline=None)
    controls = parse(text, path, motors, start, columns)
    if controls.live:
        raise UsageError(f"{path}: no column t", hint="add times, or send the lines on stdin with --control -")
    return controls


# -- lines as a program sends them --------------------------------------------------------------------------------------


LONGEST_LINE = 65_536
"""Bytes of one line."""
SILENCE = 30.0
"""Seconds within which the values must have arrived, before the hand is touched, where no --deadline says otherwise."""


class Lines:
    """Lines of stdin ("-") or of a named pipe, without the buffering that would hold them back.

    Until `begun`, nothing is waited for longer than `seconds` in all, or SILENCE where that is None: who sends a timed row now
    and then, and never closes the pipe, would be waited for without end.
    """

    def __init__(self, path: str, seconds: float | None) -> None:
        self.begun = False
        self._path, self._seconds = path, SILENCE if seconds is None else seconds
        self._end = clock.now() + self._seconds

    def __iter__(self) -> Iterator[str]:
        """The lines. Raises UsageError for a line without end, NoAnswer where none comes in time."""
        try:
            descriptor = sys.stdin.fileno() if self._path == "-" else os.open(self._path, os.O_RDONLY | disk.AT_ONCE)
        except (OSError, ValueError, AttributeError):
            yield from sys.stdin
            return
        rest = b""
        try:
            while chunk := self._chunk(descriptor):
                *whole, rest = (rest + chunk).split(b"\n")
                for line in whole:
                    yield line.decode("utf-8", "replace")
                if len(rest) > LONGEST_LINE:
                    raise UsageError(
                        f"{self._path}: not control values: more than {LONGEST_LINE} bytes without a line end",
                        hint="send CSV or JSON lines, such as t,velocity.F1",
                    )
        finally:
            if self._path != "-":
                os.close(descriptor)
        if rest:
            yield rest.decode("utf-8", "replace")

    def _chunk(self, descriptor: int) -> bytes:
        """The data received; b"" at the end. A pipe that has no writer yet has not ended."""
        left = None if self.begun else max(0.0, self._end - clock.now())
        if not gives(descriptor, left):
            where = "stdin" if self._path == "-" else self._path
            raise NoAnswer(
                f"{where}: the control values were not complete within {self._seconds:g} s",
                hint="start the program that writes them. With a column t, it must close the pipe or stdin behind the last row. Or give a longer --deadline. Nothing was sent.",
                code="deadline",
            )
        return os.read(descriptor, 65536)
