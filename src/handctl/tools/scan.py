"""`handctl scan`: detect the device on a port. Read-only probes of each family, in an order that disturbs no other device.

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
A line with traffic before the first request is left alone: none of the serial devices sends without one.

Each probe waits as long as a cable needs. A reply over a slower line arrives too late: if bytes arrived but no device was
found, this baud rate is tried again with a longer timeout.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import click

from handctl import __version__
from handctl.command.command_tree import Command
from handctl.command.options import scan_options
from handctl.command.run import Run
from handctl.errors import Hint, Interrupted, LinkError, UsageError
from handctl.families import FAMILIES, SCAN_ORDER
from handctl.link import ByteLink, Link, is_can, open_link
from handctl.link.device_lock import Lock, hold
from handctl.link.transcript import TraceFile, TraceWriter, observed
from handctl.model.result import Journal, Table
from handctl.system import clock
from handctl.tools.family_probe import probe_of, set_speed, usual_ports, wire_of
from handctl.tools.port_inventory import Machine
from handctl.tools.scan_link import LinkScan, asking_order
from handctl.tools.scan_report import Search, report

LONG = 1800.0
"""Bound for one port: all ids of a slow line with others on it take minutes."""
WIRE_NAMES = {"serial": "a serial line", "tcp": "TCP", "can": "CAN"}


@click.command("scan", cls=Command)
@click.option(
    "-p",
    "--port",
    "links",
    multiple=True,
    metavar="LINK",
    help="The link to search (default: all serial ports that are free and accessible). Can be repeated.",
)
@click.option(
    "--family",
    "families",
    multiple=True,
    type=click.Choice(list(FAMILIES)),
    help="Search for this family only. Can be repeated.",
)
@scan_options
def cli(run: Run, links: tuple[str, ...], families: tuple[str, ...], ids: str | None, find_all: bool) -> Table:
    """Detect the device on a port: its family, baud rate and id.

    Read-only. Skips ports that are in use. Nothing it sends starts or ends a movement, or triggers a boot monitor.
    It tries the usual ids first, then the others. On a silent line it ends after about 6 s per family and lists what it
    skipped. With --all it tries everything, however long that takes.
    """
    settings = run.settings
    wanted = tuple(family for family in SCAN_ORDER if not families or family in families)
    names = list(links) or ([settings.port] if settings.port else [])
    if settings.fake and not links:
        names = [f"fake://{family}" for family in wanted]
    return _scanned(run, wanted, names, ids, find_all)


def scan_family(run: Run, ids: str | None, find_all: bool) -> Table:
    """The same for the family of `run`; of a link that was named it is that of the run, which a session may have open."""
    settings, family = run.settings, run.family
    if not (settings.port or settings.fake):
        return _scanned(run, (family.kind,), [], ids, find_all)
    name = run.link_name()
    if ids and not family.ids:
        raise UsageError(f"--ids: {family.kind} has no device ids", hint="leave --ids out")
    chosen = chosen_ids(run, (family.kind,), "can" if is_can(name) else wire_of(name), ids)
    link = run.open_link()
    was = getattr(link, "baud", None)
    search = Search(link.name)
    bound = run.bound(link, LONG)
    try:
        LinkScan(run, link, search, chosen, find_all, bound).at(_wire(link, name), (family.kind,))
    finally:
        run.prompts.done()
        set_speed(link, was)
    run.journal.line = search.line
    return report([search], (family.kind,), run.journal)


def _wire(link: Link, name: str) -> str:
    return "serial" if isinstance(link, ByteLink) and wire_of(name) == "can" else wire_of(name)


def _scanned(run: Run, wanted: Sequence[str], names: list[str], ids: str | None, find_all: bool) -> Table:
    """The search on these links, or on all free serial ports."""
    settings = run.settings
    for name in names or [""]:
        chosen_ids(run, wanted, wire_of(name), ids)  # what is wrong is told before anything is opened
    names = names or free_ports(Machine(), run.journal)
    trace = TraceFile(settings.trace, f"handctl {__version__} {run.command}", settings.verbose)
    scan = Scan(run, wanted, ids, find_all, trace if settings.trace or settings.verbose else None, settings.deadline)
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
    table = report(searches, wanted, run.journal)
    table.failure = table.failure or trace.failure
    return table


def chosen_ids(run: Run, families: Sequence[str], wire: str, text: str | None) -> list[int]:
    """The ids that were asked for, [] for all. Raises UsageError."""
    if text is None:
        return [run.settings.id] if run.settings.id is not None else []
    readers = [parse for family in families if (parse := getattr(probe_of(family), "parse_ids", None)) is not None]
    return [number for parse in readers[:1] for number in parse(text, wire)]


def free_ports(machine: Machine, journal: Journal) -> list[str]:
    """Serial ports that are free and that we may open, and for the others why they are skipped."""
    names = []
    for port in machine.ports():
        if port.free:
            names.append(port.path)
            continue
        why = f"in use by {', '.join(map(str, port.held))}" if port.held else "not permitted"
        journal.warn("left-out", f"{port.path} is {why}, so it was skipped", hint=Hint("{} shows the remedy", "ports"))
    if not names:
        raise LinkError(
            "no serial port is free",
            hint=Hint("{} lists the ports. Give another link with -p, such as `-p tcp://HOST`", "ports"),
            code="no-port",
        )
    return names


@dataclass(slots=True)
class Scan:
    """Scan one link after the other; `left`: the seconds that --deadline leaves, by the clocks of the links before."""

    _run: Run
    _families: Sequence[str]
    _ids: str | None
    _all: bool
    _tap: TraceWriter | None
    _left: float | None

    def look(self, name: str) -> Search:
        """All probes on one link until a device answers. What ends it early is in the Search."""
        search = Search(name)
        wire = wire_of(name)
        if not asking_order(wire, self._families, speeds=False):
            text = f"{name}: {' and '.join(self._families)} cannot be on {WIRE_NAMES[wire]}"
            search.error = UsageError(text, hint="use another LINK, or leave out --family")
            return search
        port = next(iter(usual_ports(self._families)), None) if wire == "tcp" else None
        if self._left is not None and self._left <= 0:
            search.expired = True
            return search
        lock: Lock | None = None
        link: Link | None = None
        started, spent, opened = clock.now(), 0.0, 0.0
        try:
            lock = hold(name, f"handctl {self._run.command}", port)
            link = open_link(name, baud=self._run.settings.baud or 115200, tcp_port=port)
            if self._tap is not None:
                observed(link, self._tap)
            spent, opened = clock.now() - started, link.now()
            chosen = chosen_ids(self._run, self._families, wire, self._ids)
            bound = link.deadline(LONG if self._left is None else self._left - spent)
            looking = LinkScan(self._run, link, search, chosen, self._all, bound)
            looking.at(wire, self._families)
        except LinkError as exc:
            search.error = exc
        except KeyboardInterrupt:
            search.error = Interrupted()
        finally:
            self._run.prompts.done()
            spent += link.now() - opened if link is not None else clock.now() - started
            self._left = self._left - spent if self._left is not None else None
            if link is not None:
                link.close()
            if lock is not None:
                lock.release()
        return search
