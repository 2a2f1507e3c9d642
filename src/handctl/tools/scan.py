"""`handctl scan`: which device answers on a port. Read-only probes of each family, in an order that disturbs none.

On a serial port, after listening:
 1. ekso   GetTime is 6 bytes without a start byte. It goes first: an EksoNR that has got part of anything else may wait
           for the rest and swallow it. For the others it is noise of less than a character at their slower speeds.
 2. wrist  then exo, at each speed of the frame they share: header, length and sum protect everybody else. A hand with a
           wrist answers both questions, so the wrist is asked first.
 3. hand  at 115200, in EB90 and in Modbus RTU: at the slower speeds the exoskeleton hand's question finds it. At 921600
          only `handctl hand scan` asks: that reads as a trigger to a boot monitor.
 4. barrett  a mark and CR, last: for the others they are two bytes of no frame. They end no movement and start none.
A BarrettHand hears 1 to 3 at its own speed as a few odd characters: never as a CR, so no line is carried out. Its boot
monitor at 9600 hears nothing at 115200 and 57600 as FF, its trigger (a test samples the bits); at other speeds it might.
So it is asked at 9600 behind those, and other speeds wait until the port was open for 3 s.
On TCP the AIDIN-hand is looked for first: binary requests might upset a server that parses text, while its empty object
is harmless to all; a pause behind it lets an EksoNR forget it. Whose own port the LINK names is asked first of all.
CAN has the wrist, then the hand.
What talks by itself before anything was asked is left alone: none of the serial devices does.

Each probe waits as long as a cable needs. An answer over a slower line comes behind it, and finds nobody: where bytes came
and no device was found, this speed is asked a second time with more patience.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import click

from handctl import __version__
from handctl.errors import Interrupted, LinkError, NoAnswer, ProtocolError, UsageError
from handctl.families import FAMILIES, SCANNED
from handctl.frame.clikit import Command
from handctl.frame.options import SharedOption
from handctl.frame.run import Run
from handctl.link import ByteLink, Deadline, Link, open_link
from handctl.link.lock import Lock, hold
from handctl.link.tap import Tap
from handctl.link.tracefile import TraceFile
from handctl.model.foreign import signed
from handctl.model.param import ids_in
from handctl.model.result import Journal, Table
from handctl.system import clock
from handctl.tools.machine import Machine
from handctl.tools.probes import FamilyProbe, family_of, has_speed, listened, probe_of, wire_of
from handctl.tools.scan_plan import Guard, guard_of, plan, port_of, safe_speeds
from handctl.tools.scan_report import TALKATIVE, Search, Step, report
from handctl.tools.trace_read import FAMILY_EVENT

LISTEN = 0.3
PAUSE = 0.5
LATE = 0.43
"""Seconds behind the last probe at a speed: an answer that comes then is late ..."""
PATIENCE = 0.9
"""... and so long is waited for each when this speed is asked again."""
ECHOES = {"echo", "echo-differs"}
PORT_SECONDS = 45.0
"""Bound for one port when only the usual id is asked for: 10 s in silence, 30 s when each speed is asked again ..."""
ID_SECONDS = 2.0
"""... and for each id: one after the other at each speed, up to four times where others speak."""
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
    trace = TraceFile(settings.trace, f"handctl {__version__} {run.command}", settings.verbose)
    tap = Tap(trace.write) if settings.trace or settings.verbose else None
    scan = Scan(run, wanted, chosen, find_all, tap)
    searches: list[Search] = []
    try:
        for name in names:
            searches.append(scan.look(name))
            if isinstance(searches[-1].error, Interrupted):
                break
    finally:
        trace.close()
    told = [search for search in searches if search.rows] or searches
    if len(told) == 1:
        run.journal.line = told[0].line
    for search in told:
        if words := search.line.words():
            run.journal.info("line", f"{search.link}: {words}")
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


class Scan:
    """Looks at one link after the other."""

    def __init__(self, run: Run, families: Sequence[str], ids: Sequence[int], find_all: bool, tap: Tap | None) -> None:
        self._run = run
        self._families = families
        self._ids = ids
        self._all = find_all
        self._tap = tap
        self._left = run.settings.deadline
        """Seconds that --deadline leaves for the links to come, by the clocks of those before."""

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
        if self._left is not None and self._left <= 0:
            search.expired = True
            return search
        lock: Lock | None = None
        link: Link | None = None
        started, opened = clock.now(), 0.0
        try:
            lock = hold(name, f"handctl {self._run.command}", port)
            link = open_link(name, baud=self._run.settings.baud or 115200, tap=self._tap, tcp_port=port)
            self._spend(clock.now() - started)
            opened = link.now()
            seconds = PORT_SECONDS + ID_SECONDS * len(self._ids) if self._left is None else self._left
            looking = Looking(self._run, link, search, self._ids, self._all, link.deadline(seconds))
            looking.at(wire, self._families)
        except LinkError as exc:
            search.error = exc
        except KeyboardInterrupt:
            search.error = Interrupted("interrupted")
        finally:
            self._run.guide.done()
            if link is not None:
                self._spend(link.now() - opened)
                link.close()
            else:
                self._spend(clock.now() - started)
            if lock is not None:
                lock.release()
        return search

    def _spend(self, seconds: float) -> None:
        if self._left is not None:
            self._left -= seconds


class Looking:
    """All probes on one open link, into its Search, until a device answers or `bound` is over."""

    def __init__(
        self, run: Run, link: Link, search: Search, ids: Sequence[int], find_all: bool, bound: Deadline
    ) -> None:
        self._run = run
        self._link = link
        self._search = search
        self._ids = ids
        self._all = find_all
        self._bound = bound
        self._opened = link.now()
        self._progress = ""
        self._before: Step | None = None
        self._families: Sequence[str] = ()
        self._safe: frozenset[int] | None = None

    def at(self, wire: str, families: Sequence[str]) -> None:
        """Listen, then ask every family: at each speed once, and once more with patience where something came too late."""
        link, search = self._link, self._search
        steps = plan(
            wire, families, has_speed(link) and wire == "serial", port_of(link.name) if wire == "tcp" else None
        )
        self._families = families
        if self._run.settings.baud is not None:
            steps = [Step(family, None) for family in dict.fromkeys(step.family for step in steps)]
        if wire == "serial" and isinstance(link, ByteLink):
            self._run.guide.progress(f"{search.link}: listening")
            search.unasked = listened(link, link.deadline(LISTEN).earlier(self._bound))
            if len(search.unasked) >= TALKATIVE:
                for family in dict.fromkeys(step.family for step in steps):
                    hear = getattr(probe_of(family), "overheard", None)
                    if hear is not None and (ids := hear(search.unasked)):
                        search.overheard[family] = ids
                return
        places = [(step, f"{number} of {len(steps)}") for number, step in enumerate(steps, 1)]
        self._safe = safe_speeds(steps)
        for _, group in groupby(places, key=lambda place: place[0].speed):
            alike, counted = list(group), self._counted()
            if any(self._over(*place) for place in alike):
                return
            if self._late(counted, [step for step, _ in alike]) and any(
                self._over(*place, PATIENCE) for place in alike
            ):
                return
        again = [place for place in places if self._may_repeat(place[0])]
        if not search.rows and self._unclear and any(self._over(*place, PATIENCE) for place in again):
            return
        search.expired = self._bound.expired  # the last probe may have been cut short

    def _over(self, step: Step, place: str, patience: float | None = None) -> bool:
        """One step, unless one of those before ends the search. Whether nothing more is to be asked."""
        link, search, before = self._link, self._search, self._before
        if self._bound.expired:
            search.expired = True
            return True
        if before is not None and (again := self._settled(before)) is not None and self._found(again, PATIENCE):
            return True
        if any(error.code == "boot-monitor" for error in search.met.values()):
            return True  # what comes next could be a trigger
        if before is not None and "serial" not in probe_of(before.family).WIRES:
            link.sleep(min(PAUSE, self._bound.remaining))
        if before is None or before.family != step.family:
            link.event(f"{FAMILY_EVENT}{step.family} on {search.link}")
        self._before = step
        at = f" at {step.speed}" if step.speed else ""
        more = ", again with more patience" if patience else ""
        self._progress = f"{search.link}: {step.family}{at} ({place}{more})"
        self._run.guide.progress(self._progress)
        if step.speed is not None and isinstance(link, ByteLink) and link.baud != step.speed:
            link.set_baud(step.speed)
        return self._found(step, patience)

    def _counted(self) -> int:
        """Frames and bytes that have come, of whatever kind."""
        counters = self._run.journal.counters
        return counters.received + counters.bad_frames + counters.stray_bytes

    @property
    def _met(self) -> set[str]:
        """The codes of all that was met but silence."""
        return {error.code for error in self._search.met.values()} - {NoAnswer.default_code}

    @property
    def _unclear(self) -> bool:
        """Whether bytes came that could be those of a late answer, and no boot monitor is there to take harm."""
        return not self._met <= ECHOES and "boot-monitor" not in self._met and self._run.settings.timeout is None

    def _late(self, counted: int, alike: Sequence[Step]) -> bool:
        """After one speed: whether something comes now, or has come, when nobody waited for it.

        At a speed that may not be asked again it must be a frame of a family: one that came late was heard by the next probe.
        """
        link, search = self._link, self._search
        once = self._before is not None and not self._may_repeat(self._before)
        met = b"".join(search.met[step].came for step in alike if step in search.met) if once else b""
        if search.rows or self._run.settings.timeout is not None or self._guard(self._before):
            return False
        if self._met and not signed(met, self._families):
            return False
        if not isinstance(link, ByteLink):
            return True
        self._run.guide.progress(f"{self._progress}: listening for late answers")
        late = listened(link, link.deadline(LATE).earlier(self._bound))
        self._run.journal.counters.stray_bytes += len(late)
        if once:
            return signed(met + late, self._families)
        return self._counted() > counted

    def _may_repeat(self, step: Step) -> bool:
        """Whether a step may be asked again although nobody was understood: a hand that was just switched on may have
        become a boot monitor meanwhile, which takes the bytes of other speeds for a firmware download (barrett §8)."""
        return self._safe is None or step.speed is None or step.speed in self._safe or self._guard(step) is not None

    def _guard(self, done: Step | None) -> Guard | None:
        """The guard that this step is, None for most."""
        guard = guard_of(done.family) if done is not None else None
        return guard if guard is not None and guard.step == done else None

    def _settled(self, done: Step) -> Step | None:
        """Behind a guard that met silence: listen until the port was open for long enough; the step once more if
        something came."""
        guard, link, search = self._guard(done), self._link, self._search
        if guard is None or not isinstance(link, ByteLink) or search.rows:
            return None
        if search.met[done].code != NoAnswer.default_code:
            return None
        self._run.guide.progress(f"{search.link}: listening for a device that starts")
        wait = link.deadline(max(0.0, self._opened + guard.seconds - link.now())).earlier(self._bound)
        came = False
        while not wait.expired:
            came = bool(link.read(wait)) or came
        return done if came else None

    def _found(self, step: Step, patience: float | None) -> bool:
        """One probe, whether it ends the search. What has answered another family's probe with its id is not counted again."""
        link, search = self._link, self._search
        probe: FamilyProbe = probe_of(step.family)
        quiet = Journal(progress=lambda text: self._run.guide.progress(f"{self._progress}: {text}"))
        quiet.counters = self._run.journal.counters
        quiet.line = search.lines.setdefault(step.family, quiet.line)
        where = {"family": step.family, "link": link.name, "baud": getattr(link, "baud", None), "id": None}
        ids = self._ids[:1] if patience else self._ids
        try:
            rows = probe.probe(link, quiet, self._bound, ids, self._run.settings.timeout or patience)
        except (NoAnswer, ProtocolError) as exc:
            search.meet(step, exc)
            return False
        if not search.rows:
            search.line = quiet.line
        rows = [{**where, **row} for row in rows]
        known = {(row["baud"], row["id"]) for row in search.rows if row["id"] is not None}
        search.rows += [row for row in rows if (row["baud"], row["id"]) not in known]
        return bool(search.rows) and not self._all
