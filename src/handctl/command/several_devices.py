"""One command on several named devices at once: `-d left,right`, `-d '*'`. Each runs in its own thread, on its own link.

For what reads, and for stop. One table with a column for the device, one envelope with that of each device in `results`, and the highest of
their exit codes.
"""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import click

from handctl.command import snapshots
from handctl.command.command_lines import ScriptLine, parse_line
from handctl.command.library_call import Call
from handctl.command.options import OutFile
from handctl.command.run import PlannedAction, Run
from handctl.errors import STOPPED, HandctlError, Hint, Interrupted, LinkError, UsageError, joined, typed
from handctl.families import FAMILIES
from handctl.model.result import Column, Grid, Row, Sample, Table
from handctl.model.stop_on_interrupt import NOT_STOPPED
from handctl.screen.render import default_view
from handctl.stop.device_access import DeviceAccess, report
from handctl.stop.stop_listener import STOP_SECONDS
from handctl.system import clock
from handctl.wording import plural

TAKES = ("status", "dump", "get", "watch", "snapshot", "diff", "report", "stop")
"""The commands that take several devices."""
BY_THEMSELVES = ("top",)
"""Those that take names and see to all of them."""
NAME = "{name}"
"""Stands in a file name for the name of the device."""
DEVICE = Column("device", "Device")
LEAVE_SECONDS = 3.0
"""How long a device that was interrupted is waited for."""
OPENING_SECONDS = 0.01
OPEN_SECONDS = 1.0
"""How long a stop waits for a link that is just being opened or closed."""
POLL_SECONDS = 0.1
"""How often it is looked whether a Ctrl-C has come while the devices are waited for."""


def devices_in(words: Sequence[str]) -> tuple[int, str, tuple[str, ...]] | None:
    """The several devices of -d as (position of the word, text before the names, the names); None if there is only one."""
    for place, start, text in _each_d(words):
        if "," in text or text == "*":
            return place, start, _named(text, urgent="stop" in words)
    return None


def _each_d(words: Sequence[str]) -> Iterator[tuple[int, str, str]]:
    """Each -d of a line: position of the word with the names, text before them, the names."""
    for place, word in enumerate(words):
        if word == "--":
            break
        before = words[place - 1] if place else ""
        if before in ("-d", "--device"):
            yield place, "", word
        elif word.startswith("--device="):
            yield place, "--device=", word.removeprefix("--device=")
        elif word.startswith("-d") and len(word) > 2:
            yield place, "-d", word[2:]


def joined_for_a_stop(words: Sequence[str]) -> list[str]:
    """The words of a stop with `-d A -d B` as `-d A,B`: it stops all that were named. At different levels the one nearest the verb wins."""
    line, gone = list(words), set[int]()
    first, begins, names = 0, "", list[str]()
    for place, start, text in _each_d(words):
        if not names or any(word == "stop" or word in FAMILIES for word in words[first + 1 : place]):
            first, begins, names = place, start, [text]
            continue
        names += [] if text in names else [text]
        line[first] = begins + ",".join(names)
        gone |= {place} if start else {place - 1, place}
    return [word for at, word in enumerate(line) if at not in gone]


def _named(text: str, *, urgent: bool) -> tuple[str, ...]:
    """The names, each once. Raises UsageError; with `urgent` what is wrong with one of them holds up none of the others."""
    from handctl.command.config_file import read_config

    config = read_config(passed=[] if urgent else None)
    names = [name.strip() for name in text.split(",") if name.strip()]
    if "*" in names:
        names = [*config.devices, *config.unusable]  # those are reported as not stopped
    if not names:
        raise UsageError(f"-d {text}: no devices are named", hint="`handctl devices add NAME FAMILY -p LINK` adds one")
    for name in names if not urgent else ():
        config.find(name)
    return tuple(dict.fromkeys(names))


class EachDevice:
    """The command on one device."""

    def __init__(self, name: str, one: ScriptLine) -> None:
        self.name = name
        self.line = one
        self.run = Call(one.context, one.settings, one.leaf.family)
        self.busy = False
        """Whether its link is open, or being opened or closed."""
        self.known = threading.Event()
        """Its columns are known, or it has ended."""

    @property
    def table(self) -> Table:
        """Without columns until its body has returned one."""
        return self.run.outcome.table or Table()

    @property
    def body(self) -> Callable[[], Table | PlannedAction | None]:
        """What it carries out: the command, or what a comparison of two devices needs of each."""
        one, run = self.line, self.run
        if _compares(one):
            return lambda: snapshots.held(run, setpoints=one.context.params.get("setpoints", False))
        return one.leaf.body(run)

    def work(self, take: Callable[[str, list[Row]], object]) -> None:
        """Carry it out, in a thread; samples of a stream are taken as they come. Never raises."""
        run = self.run
        self.busy = True
        try:
            outcome = run.carry_out(self.body)
            self.known.set()
            if outcome.streams and outcome.failure is None:
                for rows in run.samples():
                    take(self.name, rows)
            else:
                run.end_device()
        except (HandctlError, KeyboardInterrupt) as exc:
            run.outcome.failure = exc if isinstance(exc, HandctlError) else Interrupted()
        except Exception as exc:  # noqa: BLE001 - a bug of ours must not hide the other devices
            run.outcome.failure = HandctlError(f"internal error: {type(exc).__name__}: {exc}", code="internal")
            run.close(None)
        finally:
            self.busy = False
            self.known.set()

    def stop(self, who: str) -> HandctlError:
        """Stop its device at once: over the open link, or where there is none over one of its own. How that went. Never raises."""
        end = clock.now() + OPEN_SECONDS
        while self.busy:
            access = self.run.connection.device_access
            if access is not None and (stopped := access.stop_from_outside(who)) is not None:
                self.run.remember(stopped)  # its thread may sleep until the next sample
                return stopped
            if clock.now() > end:
                hint = Hint("run {}", f"-d {self.name} stop")
                return LinkError("it is not connected: nothing was sent", hint=hint, code=NOT_STOPPED)
            clock.sleep(OPENING_SECONDS)
        assert self.line.leaf.family is not None
        other = EachDevice(self.name, parse_line([self.line.leaf.family.kind, "stop", "-d", self.name], {}))
        other.work(lambda _name, _rows: None)
        said = [message.text for message in other.run.journal.messages if message.code == STOPPED]
        return other.run.outcome.failure or Interrupted(f"{who}: {' '.join(said)}", code=STOPPED)

    def silence(self) -> None:
        """Its link sends nothing more: what reads ends soon. A stop goes on."""
        if self.run.link is not None and not self.run.stops:
            self.run.link.block_sending()

    @property
    def rows(self) -> list[Row]:
        """Its rows, with its name."""
        return [{"device": self.name, **row} for row in self.table.rows]

    def result(self, *, with_rows: bool) -> dict[str, Any]:
        """Its envelope."""
        envelope = {"name": self.name, **self.run.envelope(self.run.outcome.failure, self.run.outcome.extra)}
        return {**envelope, "rows": self.table.rows} if with_rows else envelope


class EveryAccess(DeviceAccess):
    """The access to several devices, each in a thread of its own: the stop key of their view stops all of them.

    A person who needs it has no time to choose, and the device that moves need not be the one that is shown.
    """

    def __init__(self, run: Run, every: Callable[[], Sequence[EachDevice]]) -> None:
        super().__init__(run, None)
        self.pressed_once = threading.Event()
        """From now on no device is connected again."""
        self._every = every

    def stop(self, who: str, meant: Collection[str] = ()) -> dict[str, Any]:
        """Stop them all at once; their own runs have what was sent. Never raises."""
        found: dict[str, HandctlError] = {}
        self.pressed_once.set()

        def stop(each: EachDevice) -> None:
            found[each.name] = each.stop(who)

        every = self._every()
        threads = [threading.Thread(target=stop, args=(each,), daemon=True) for each in every]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(STOP_SECONDS)
        missing = LinkError("the stop has not finished, so what was sent is unknown", code=NOT_STOPPED)
        every_one = [(each.name, found.get(each.name, missing)) for each in every]
        bad = [error for _, error in every_one if error.code != STOPPED]
        worst = max(bad, key=lambda error: error.exit_code) if bad else every_one[0][1]
        typed.update(name for name, _ in every_one)
        text = joined(*(f"{name}: {error.text}" for name, error in every_one))
        self.stopped = type(worst)(text, hint=worst.hint, code=NOT_STOPPED if bad else STOPPED)
        return report(None, ())


class Several(Run):
    """The run that shows what the runs of all devices found."""

    every: tuple[EachDevice, ...] = ()
    unfit: tuple[tuple[str, HandctlError], ...] = ()
    """The names that a stop could make nothing of: it stops the other devices."""

    @property
    def simulated(self) -> bool:
        return bool(self.every) and all(each.run.simulated for each in self.every)


def run_on_each(words: Sequence[str], found: tuple[int, str, tuple[str, ...]]) -> None:
    """Run the command line `words` on each of the devices that it names. Raises HandctlError."""
    place, start, names = found
    if any(word in BY_THEMSELVES for word in words):
        begin = place if start else place - 1
        one = parse_line([*words[:begin], *words[place + 1 :], *names], {})
        one.leaf.invoke(one.context)
        return
    every, unfit = [], []
    for name in names:
        own = [word.replace(NAME, name) for word in words]
        own[place] = f"{start}{name}"
        try:
            every.append(EachDevice(name, parse_line(own, {})))
        except UsageError as exc:
            unfit.append((name, exc))
    if unfit and not (every and every[0].line.leaf.stops):
        raise unfit[0][1]
    first = every[0].line
    _check(words, every)
    alike = len({each.line.command for each in every}) == 1
    command = first.command if alike else first.command.partition(" ")[2]
    context = click.Context(first.leaf, info_name=f"handctl {command}")
    settings = first.settings._replace(port=None, fake=False, trace=None, device=None, kind=None, wide=False)
    whole = Several(context, settings, None)
    whole.every, whole.unfit = tuple(every), tuple(unfit)
    with whole.shown():
        whole.carry_out(lambda: _together(whole, every))


def _check(words: Sequence[str], every: Sequence[EachDevice]) -> None:
    """Raise UsageError for what does not take several devices."""
    leaf = every[0].line.leaf
    if leaf.name not in TAKES or (leaf.writes and not leaf.stops):
        raise UsageError(
            f"`handctl {every[0].line.command}` takes one device at a time",
            hint=f"give one name with -d. {', '.join(TAKES)} take several",
        )
    settings = every[0].line.settings
    if leaf.stops:  # no file and no format holds it up
        for each in every:
            each.run.settings = each.run.settings._replace(trace=None, wide=None)
        return
    if settings.format == "openmetrics" or settings.wide:
        what = "--wide" if settings.wide else "--format openmetrics"
        raise UsageError(f"{what} cannot keep several devices apart", hint="run it for one device at a time")
    if _compares(every[0].line) and (len(every) != 2 or len({each.line.command for each in every}) > 1):
        raise UsageError(
            "without a file, diff compares two devices of one family",
            hint="name two of one family, such as -d left,right, or give a snapshot",
        )
    files = [
        str(each.line.context.params.get(param.name))
        for each in every
        for param in leaf.params
        if isinstance(param.type, OutFile)
    ]
    traces = [each.line.settings.trace for each in every if each.line.settings.trace]
    for paths in (files, traces):
        if len(set(paths)) < len(paths):
            folder, name = os.path.split(paths[0])
            raise UsageError(
                f"{paths[0]}: one file cannot take several devices",
                hint=f"put {NAME} into its name, such as {os.path.join(folder, f'{NAME}-{name}')}",
            )


def _together(whole: Several, every: Sequence[EachDevice]) -> Table:
    came: queue.SimpleQueue[tuple[str, list[Row]] | None] = queue.SimpleQueue()

    def work(line: Sequence[EachDevice]) -> None:
        for each in line:
            each.work(lambda name, rows: came.put((name, rows)))
            came.put(None)

    threads = [threading.Thread(target=work, args=(line,), daemon=True) for line in _lines(every)]
    for thread in threads:
        thread.start()
    if whole.streams:
        whole.connection.device_access = EveryAccess(whole, lambda: every)
        while not all(each.known.wait(POLL_SECONDS) for each in every):
            pass
        columns = (DEVICE, *_columns(every))
        table = Table(columns=columns, cards={each.name: partial(getattr, each, "table") for each in every})
        table.samples = _samples(whole, table, every, _arrivals(every, threads, came))
        table.summary = lambda: {"results": [each.result(with_rows=False) for each in every]}
        return table
    for _ in _arrivals(every, threads, came):
        pass
    _tell(whole, every)
    return _compared(whole, every) if _compares(every[0].line) else _merged(whole, every)


def _lines(every: Sequence[EachDevice]) -> list[list[EachDevice]]:
    """The devices that are served one after the other: in a stop those at one place, which would fight for it; else each alone."""
    lines: dict[str, list[EachDevice]] = {}
    for each in every:
        place = ""
        if each.run.stops:
            with contextlib.suppress(HandctlError):
                place = each.run.place
        lines.setdefault(place or f"{each.name} alone", []).append(each)
    return list(lines.values())


def _compares(one: ScriptLine) -> bool:
    """Whether the devices are compared with each other, and not each with a file."""
    return one.leaf.name == "diff" and one.context.params["a"] is None


def _compared(whole: Several, every: Sequence[EachDevice]) -> Table:
    """What differs between the two devices."""
    failure, results = _failure(whole), [each.result(with_rows=False) for each in every]
    if failure is not None:
        return Table(failure=failure, extra={"results": results})
    sides = [(each.name, {row["name"]: row["value"] for row in each.table.rows}) for each in every]
    setpoints = every[0].line.context.params.get("setpoints", False)
    table = snapshots.compared(whole, every[0].run.opened.map, sides, setpoints=setpoints)
    table.extra = {"results": results}
    return table


def _tell(whole: Several, every: Sequence[EachDevice]) -> None:
    """What each device had to say; JSON has it where it belongs."""
    for each in every if whole.settings.format not in ("json", "ndjson") else ():
        for message in each.run.journal.messages:
            whole.journal.note(message.level, message.code, f"{each.name}: {message.text}", message.hint)


def _arrivals(
    every: Sequence[EachDevice], threads: Sequence[threading.Thread], came: queue.SimpleQueue[Any]
) -> Generator[tuple[str, list[Row]], None, None]:
    """What the devices send, until all have ended. Left early, they end soon."""
    left = len(every)
    try:
        while left:
            try:
                found = came.get(timeout=POLL_SECONDS)
            except queue.Empty:
                continue
            if found is None:
                left -= 1
            else:
                yield found
    finally:
        if left:
            for each in every:
                each.silence()
            for thread in threads:
                thread.join(LEAVE_SECONDS)


def _samples(
    whole: Several, table: Table, every: Sequence[EachDevice], arrivals: Iterable[tuple[str, list[Row]]]
) -> Iterator[Sample]:
    for name, rows in arrivals:
        yield Sample(rows[0].get("t", 0.0) if rows else 0.0, tuple({"device": name, **row} for row in rows))
    _tell(whole, every)
    table.failure = _failure(whole)


def _columns(every: Sequence[EachDevice]) -> tuple[Column, ...]:
    """The columns of all tables, those of one family as they are."""
    found: dict[str, Column] = {}
    for each in every:
        for column in each.table.columns:
            found.setdefault(column.key, column)
    return tuple(found.values())


def _merged(whole: Several, every: Sequence[EachDevice]) -> Table:
    in_json = whole.settings.format in ("json", "ndjson")
    rows = whole.settings.format == "json"
    plain = next((each.table.plain for each in every if each.table.columns), ())
    return Table(
        rows=[] if rows else [row for each in every for row in each.rows],
        columns=(DEVICE, *_columns(every)),
        plain=("device", *plain) if plain else (),
        view=lambda _rows: _grids(every),
        failure=_failure(whole),
        extra={"results": [each.result(with_rows=rows) for each in every]} if in_json else {},
    )


def _grids(every: Sequence[EachDevice]) -> list[Grid]:
    """The tables of all devices; those with the same headings are one, with the device in front."""
    merged: dict[tuple[str, ...], Grid] = {}
    for each in every:
        table = each.table
        if not table.rows:
            continue
        for grid in table.view(table.rows) if table.view is not None else default_view(table):
            lines = tuple((each.name, *cells) for cells in grid.lines)
            notes = tuple(f"{each.name}: {note}" for note in (grid.title, *grid.notes) if note)
            known = merged.get(grid.headings)
            right = frozenset(place + 1 for place in grid.right)
            if known is None:
                merged[grid.headings] = Grid(("Device", *grid.headings), lines, "", right, notes)
            else:
                merged[grid.headings] = known._replace(lines=known.lines + lines, notes=known.notes + notes)
    return list(merged.values())


def _failure(whole: Several) -> HandctlError | None:
    """What went wrong, device by device; its exit code is the highest."""
    failed = [(each.name, error) for each in whole.every if (error := each.run.outcome.failure) is not None]
    failed += whole.unfit
    if not failed:
        return None
    typed.update(name for name, _ in failed)
    told = joined(*(f"{name}: {error.text}" for name, error in failed))
    worst = max((error for _, error in failed), key=lambda error: error.exit_code)
    count = plural(len(whole.every) + len(whole.unfit), "device")
    failure = HandctlError(f"{len(failed)} of {count}: {told}", hint=worst.hint, code=worst.code)
    failure.exit_code = worst.exit_code
    return failure
