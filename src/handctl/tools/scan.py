"""`handctl scan`: which device answers on a port. Read-only probes of each family, in an order that disturbs none.

On a serial port, after listening:
 1. ekso   GetTime is 6 bytes without a start byte. It goes first: an EksoNR that has got part of anything else may wait
           for the rest and swallow it. For the others it is noise of less than a character at their slower speeds.
 2. wrist  then exo, at each speed of the frame they share: header, length and sum protect everybody else. A hand with a
           wrist answers both questions, so the wrist is asked first.
 3. barrett  a mark and CR, last: for the others they are two bytes of no frame. They end no movement and start none.
A BarrettHand hears 1 and 2 at its own speed as a few odd characters: never as a CR, so no line is carried out. Its boot
monitor at 9600 hears nothing at 115200 and 57600 as FF, its trigger (a test samples the bits); at other speeds it might.
So it is asked at 9600 behind those, and other speeds wait until the port was open for 3 s.
On TCP the AIDIN-hand is looked for first: binary requests might upset a server that parses text, while its empty object
is harmless to all; a pause behind it lets an EksoNR forget it. CAN has the wrist only.
What talks by itself before anything was asked is left alone: none of the serial devices does.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any, NamedTuple

import click

from handctl import __version__
from handctl.errors import Interrupted, LinkError, NoAnswer, ProtocolError, UsageError
from handctl.families import FAMILIES, SCANNED
from handctl.frame.clikit import Command
from handctl.frame.options import SharedOption
from handctl.frame.run import Run
from handctl.link import ByteLink, Link, open_link
from handctl.link.lock import Lock, hold
from handctl.link.tap import Tap
from handctl.link.tracefile import TraceFile
from handctl.model.param import ids_in
from handctl.model.result import Journal, Table
from handctl.tools.machine import Machine
from handctl.tools.probes import FamilyProbe, family_of, has_speed, probe_of, wire_of
from handctl.tools.scan_report import TALKATIVE, Search, Step, report
from handctl.tools.trace_read import FAMILY_EVENT

LISTEN = 0.3
PAUSE = 0.5
PORT_SECONDS = 15.0
"""Bound for one port when only the usual id is asked for; all ids take longer."""
ALL_IDS_SECONDS = 60.0
WIRE_NAMES = {"serial": "a serial line", "tcp": "TCP", "can": "CAN"}


class _ScanCommand(Command):
    """Takes -p several times."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        params = super().get_params(ctx)
        own = {name for param in self.params for name in param.opts}
        return [param for param in params if not (isinstance(param, SharedOption) and own & set(param.opts))]


@click.command("scan", cls=_ScanCommand)
@click.option(
    "-p",
    "--port",
    "links",
    multiple=True,
    metavar="LINK",
    help="Where to look (default: all serial ports that are free and permitted). Can be repeated.",
)
@click.option(
    "--family",
    "families",
    multiple=True,
    type=click.Choice(list(FAMILIES)),
    help="Look for this family only. Can be repeated.",
)
@click.option(
    "--ids", metavar="FROM-TO", help="Ids to ask for where devices have one, such as 1-254 (default: --id, or 1)."
)
@click.option("--all", "find_all", is_flag=True, help="Go on after the first device on a port.")
def cli(links: tuple[str, ...], families: tuple[str, ...], ids: str | None, find_all: bool) -> Table:
    """Find out which device answers on a port: family, speed, id.

    Read-only. A port that is in use is left alone. Nothing that is sent starts or ends a movement, or triggers a boot monitor.
    """
    run: Run = click.get_current_context().obj
    settings = run.settings
    wanted = tuple(family for family in SCANNED if not families or family in families)
    names = list(links) or ([settings.port] if settings.port else [])
    if settings.fake and not links:
        names = [f"fake://{family}" for family in wanted]
    elif not names:
        names = free_ports(Machine(), run.journal)
    chosen = parse_ids(ids or str(settings.id or 1))
    seconds = settings.deadline or (PORT_SECONDS if len(chosen) == 1 else ALL_IDS_SECONDS)
    trace = TraceFile(settings.trace, f"handctl {__version__} {run.command}", settings.verbose)
    tap = Tap(trace.write) if settings.trace or settings.verbose else None
    scan = Scan(run, wanted, chosen, seconds, find_all, tap)
    searches: list[Search] = []
    try:
        for name in names:
            searches.append(scan.look(name))
            if isinstance(searches[-1].error, Interrupted):
                break
    finally:
        trace.close()
    table = report(searches, wanted, run.journal)
    table.failure = table.failure or trace.failure
    return table


def free_ports(machine: Machine, journal: Journal) -> list[str]:
    """Serial ports that nobody holds and that we may open; of the others, why they are left out."""
    names = []
    for port in machine.ports():
        if port.free:
            names.append(port.path)
            continue
        why = f"in use by {', '.join(map(str, port.held))}" if port.held else "not permitted"
        journal.warn("left-out", f"{port.path} is {why}, so it was left out", hint="`handctl ports` shows the remedy")
    if not names:
        raise LinkError(
            "no serial port is free",
            hint="`handctl ports` lists the ports. Give another link with -p, such as `-p tcp://HOST`",
            code="no-port",
        )
    return names


def parse_ids(text: str) -> list[int]:
    """``1-254`` or ``1,7`` -> ids 1 to 254 in that order. Raises UsageError."""

    def check(number: int) -> None:
        if not 1 <= number <= 254:
            raise UsageError(f"--ids {text}: {number} is not 1 to 254", hint="write for example `--ids 1-254`")

    return ids_in(text, check)


def plan(wire: str, families: Sequence[str], speeds: bool) -> list[Step]:
    """Which probes, in which order, on a kind of link; without `speeds` each family once, at the link's own."""
    found = [family for family in SCANNED if family in families and wire in probe_of(family).WIRES]
    if wire == "tcp":  # who is at home there comes before who is behind a serial server
        found.sort(key=lambda family: "serial" in probe_of(family).WIRES)
    if not speeds:
        return [Step(family, None) for family in found]
    # Neighbours of the same speeds are all asked at one speed before the next one is set.
    groups = [(at, list(alike)) for at, alike in groupby(found, key=lambda family: probe_of(family).SPEEDS)]
    steps = [Step(family, speed) for at, members in groups for speed in at for family in members]
    for family in found:  # a boot monitor is excluded before anything that it could take for its trigger is sent
        guard = guard_of(family)
        if guard is not None:
            steps.sort(key=lambda step: 0 if step.speed in guard.harmless else 1 if step == guard.step else 2)
    return steps


class Guard(NamedTuple):
    """A step that comes before those at speeds that are not `harmless`, and how long the port is open before them."""

    step: Step
    seconds: float
    harmless: tuple[int, ...]


def guard_of(family: str) -> Guard | None:
    """What a family's probe says of it, None for most."""
    found = getattr(probe_of(family), "GUARD", None)
    return None if found is None else Guard(Step(family, found[0]), found[1], found[2])


class Scan:
    """Looks at one link after the other."""

    def __init__(
        self, run: Run, families: Sequence[str], ids: Sequence[int], seconds: float, find_all: bool, tap: Tap | None
    ) -> None:
        self._run = run
        self._families = families
        self._ids = ids
        self._seconds = seconds
        self._all = find_all
        self._tap = tap

    def look(self, name: str) -> Search:
        """All probes on one link until a device answers. What ends it early is in the Search."""
        search = Search(name)
        wire = wire_of(name)
        if not plan(wire, self._families, speeds=False):
            text = f"{name}: {' and '.join(self._families)} cannot be on {WIRE_NAMES[wire]}"
            search.error = UsageError(text, hint="another LINK, or without --family")
            return search
        ports = [family_of(family).tcp_port for family in self._families] if wire == "tcp" else []
        port = next(filter(None, ports), None)
        lock: Lock | None = None
        link: Link | None = None
        try:
            lock = hold(name, f"handctl {self._run.command}", port)
            link = open_link(name, baud=self._run.settings.baud or 115200, tap=self._tap, tcp_port=port)
            self._probes(link, wire, search)
        except LinkError as exc:
            search.error = exc
        except KeyboardInterrupt:
            search.error = Interrupted("interrupted")
        finally:
            self._run.guide.done()
            if link is not None:
                link.close()
            if lock is not None:
                lock.release()
        return search

    def _probes(self, link: Link, wire: str, search: Search) -> None:
        bound = link.deadline(self._seconds)
        steps = plan(wire, self._families, has_speed(link) and wire == "serial")
        if self._run.settings.baud is not None:
            steps = [Step(family, None) for family in dict.fromkeys(step.family for step in steps)]
        if wire == "serial" and isinstance(link, ByteLink):
            self._run.guide.progress(f"{search.link}: listening")
            search.unasked = _listen(link)
            if len(search.unasked) >= TALKATIVE:
                return
        opened = link.now() - LISTEN
        before: Step | None = None
        for number, step in enumerate(steps, 1):
            if bound.expired:
                search.expired = True
                return
            if before is not None and (again := self._settled(link, before, opened, search)) is not None:
                self._one(link, again, search, bound)
                if search.rows and not self._all:
                    return
            if search.met and search.met[-1][1].code == "boot-monitor":
                return  # what comes next could be a trigger
            if before is not None and "serial" not in probe_of(before.family).WIRES:
                link.sleep(PAUSE)
            if before is None or before.family != step.family:
                link.event(f"{FAMILY_EVENT}{step.family} on {search.link}")
            before = step
            at = f" at {step.speed}" if step.speed else ""
            self._run.guide.progress(f"{search.link}: {step.family}{at} ({number} of {len(steps)})")
            if step.speed is not None and isinstance(link, ByteLink) and link.baud != step.speed:
                link.set_baud(step.speed)
            self._one(link, step, search, bound)
            if search.rows and not self._all:
                return
        search.expired = bound.expired  # the last probe may have been cut short

    def _settled(self, link: Link, done: Step, opened: float, search: Search) -> Step | None:
        """Behind a guard that met silence: listen until the port was open for long enough; the step once more if
        something came."""
        guard = guard_of(done.family)
        if guard is None or done != guard.step or not isinstance(link, ByteLink) or search.rows:
            return None
        if search.met[-1][1].code != NoAnswer.default_code:
            return None
        self._run.guide.progress(f"{search.link}: listening for a device that starts")
        wait = link.deadline(max(0.0, opened + guard.seconds - link.now()))
        came = False
        while not wait.expired:
            came = bool(link.read(wait)) or came
        return done if came else None

    def _one(self, link: Link, step: Step, search: Search, bound: Any) -> None:
        """One probe; what has answered another family's probe with its id is not counted again."""
        probe: FamilyProbe = probe_of(step.family)
        quiet = Journal()
        quiet.counters = self._run.journal.counters
        where = {"family": step.family, "link": link.name, "baud": getattr(link, "baud", None), "id": None}
        try:
            rows = probe.probe(link, quiet, bound, self._ids, self._run.settings.timeout)
        except (NoAnswer, ProtocolError) as exc:
            search.met.append((step, exc))
            return
        rows = [{**where, **row} for row in rows]
        known = {(row["baud"], row["id"]) for row in search.rows if row["id"] is not None}
        search.rows += [row for row in rows if (row["baud"], row["id"]) not in known]


def _listen(link: ByteLink) -> bytes:
    """What comes before anything was asked."""
    deadline = link.deadline(LISTEN)
    came = b""
    while len(came) < 256 and not deadline.expired:
        came += link.read(deadline)
    return came
