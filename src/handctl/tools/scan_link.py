"""Run all probes of a scan on one open link, then the searches over ids and baud rates. `scan` explains the order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import groupby, product
from typing import NamedTuple

from handctl.command.run import Run
from handctl.errors import NoAnswer, ProtocolError
from handctl.families import SCAN_ORDER
from handctl.link import ByteLink, Deadline, Link
from handctl.model.other_family_bytes import has_frame_of
from handctl.model.result import Journal, LineQuality, Row
from handctl.model.scan_task import ScanTask, ended_at_first
from handctl.number_parsing import number_in
from handctl.tools.family_probe import FamilyProbe, family_of, has_speed, listened, probe_of, set_speed
from handctl.tools.scan_report import TALKATIVE, Search, Step
from handctl.tools.trace_reader import FAMILY_EVENT

LISTEN = 0.3
PAUSE = 0.5
LATE = 0.43
"""Seconds behind the last probe at a speed: an answer that comes then is late ..."""
PATIENCE = 0.9
"""... and so long is waited for each when this speed is asked again."""
ECHOES = {"echo", "echo-differs"}
SILENT_SECONDS = 6.0
"""So long a silent line is asked for each family, unless all is asked for ..."""
ENDING = 0.7
"""... with the last answers awaited in it."""


class LinkScan:
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
        self._passed: list[tuple[Step, str]] = []
        """Steps that are not asked again unless a frame of a family has come since."""

    def at(self, wire: str, families: Sequence[str]) -> None:
        """Listen, then ask every family: at each speed once, and once more with patience where something came too late."""
        link, search = self._link, self._search
        steps = asking_order(
            wire, families, has_speed(link) and wire == "serial", port_of(link.name) if wire == "tcp" else None
        )
        self._families = families
        if self._run.settings.baud is not None:
            steps = [Step(family, None) for family in dict.fromkeys(step.family for step in steps)]
        makers = makers_of(step.family for step in steps)
        if len(makers) == 1 and (looks := makers[0][0]) is not None:
            self._sweep(looks, makers[0][1], first=True)
            return
        if wire == "serial" and isinstance(link, ByteLink):
            self._run.prompts.progress(f"{search.link}: listening")
            search.unasked = listened(link, link.deadline(LISTEN).earlier(self._bound))
            if len(search.unasked) >= TALKATIVE:
                for family in dict.fromkeys(step.family for step in steps):
                    hear = getattr(probe_of(family), "overheard", None)
                    if hear is not None and (ids := hear(search.unasked)):
                        search.overheard[family] = ids
                return
        aside = {family for family in families if wire == "serial" and getattr(probe_of(family), "ASIDE", False)}
        self._each([step for step in steps if step.family not in aside])
        sweeps = [members for looks, members in makers if looks is not None and len(self._ids) != 1]
        if search.rows and not self._all:
            self._ended(steps, [family for members in sweeps for family in members])
            return
        if self._bound.expired or "boot-monitor" in self._met:
            return
        for looks, members in makers:
            if looks is not None and (len(self._ids) != 1 or aside & {*members}):
                self._sweep(looks, members, first=False)
        search.expired = self._bound.expired

    def _ended(self, steps: Sequence[Step], with_ids: Sequence[str]) -> None:
        """Report what has not been tried since the first device: families, and the further ids of those that have ids."""
        search, last = self._search, self._before
        asked = {step.family for step in search.met} | ({last.family} if last is not None else set())
        rest = list(dict.fromkeys(step.family for step in steps if step.family not in asked))
        if with_ids:
            rest.append(f"ids other than {(self._ids or [1])[0]} ({', '.join(dict.fromkeys(with_ids))})")
        if rest:
            ended_at_first(self._run.journal, search.left, search.link, ", ".join(rest))

    def _each(self, steps: Sequence[Step]) -> None:
        """Every family with its usual id, at each of its speeds."""
        search = self._search
        places = [(step, f"{number} of {len(steps)}") for number, step in enumerate(steps, 1)]
        self._safe = safe_speeds(steps)
        for _, group in groupby(places, key=lambda place: place[0].speed):
            alike, counted = list(group), self._counted()
            if any(self._over(*place) for place in alike):
                return
            if not self._may_repeat(alike[-1][0]):
                self._passed += alike
            elif self._late(counted) and any(self._over(*place, PATIENCE) for place in alike):
                return
        if self._came_later() and any(self._over(*place, PATIENCE) for place in self._passed):
            return
        again = [place for place in places if self._may_repeat(place[0])]
        if not search.rows and self._unclear and any(self._over(*place, PATIENCE) for place in again):
            return
        search.expired = self._bound.expired  # the last probe may have been cut short

    def _sweep(self, looks: Callable[..., None], families: Sequence[str], *, first: bool) -> None:
        """Run a maker's own search for these families; `first`: the usual id has not been tried."""
        link, search, settings = self._link, self._search, self._run.settings
        bounded = not (self._all or self._ids)
        before = link.now() - self._opened if first else 0.0
        task = ScanTask(
            ids=self._ids,
            find_all=self._all,
            silence=SILENT_SECONDS * len(families) - before - ENDING if bounded else None,
            baud=settings.baud,
            patience=settings.timeout,
            own=settings.own,
            progress=lambda text: self._run.prompts.progress(f"{search.link}: {text}"),
        )
        link.event(f"{FAMILY_EVENT}{families[0]} on {search.link}")
        was, self._run.journal.line = self._run.journal.line, LineQuality()
        targets = [probe_of(family).TARGET for family in families]  # type: ignore[attr-defined]
        looks(link, self._run.journal, self._bound, task, targets)
        if task.rows and not search.rows:
            search.line = self._run.journal.line
        self._run.journal.line = was
        self._add(task.rows)
        search.left += task.left
        search.facts |= task.facts
        search.verdict, search.alone = task.failure, first
        for (speed, code), family in product(task.tried.items(), families):
            search.met.setdefault(Step(family, speed), NoAnswer("", code=code) if code != "found" else NoAnswer(""))

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
        self._run.prompts.progress(self._progress)
        set_speed(link, step.speed)
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

    def _late(self, counted: int) -> bool:
        """After one baud rate: whether data arrives, or has arrived, without a request."""
        settled = self._search.rows or self._run.settings.timeout is not None
        if settled or self._guard(self._before) or self._met:
            return False
        return not isinstance(self._link, ByteLink) or bool(self._listened(self._link)) or self._counted() > counted

    def _listened(self, link: ByteLink) -> bytes:
        """Data that arrives without a request."""
        self._run.prompts.progress(f"{self._progress}: listening for late replies")
        late = listened(link, link.deadline(LATE).earlier(self._bound))
        self._run.journal.counters.stray_bytes += len(late)
        return late

    def _came_later(self) -> bool:
        """Whether a frame of a family has come behind its own probe, at speeds that are not asked again else: such a
        device runs its firmware."""
        link, search = self._link, self._search
        if not self._passed or search.rows or self._run.settings.timeout is not None or not isinstance(link, ByteLink):
            return False
        met = b"".join(search.met[step].came for step, _ in self._passed if step in search.met)
        late = self._listened(link)
        return has_frame_of(met, self._families) or has_frame_of(late, self._families)

    def _may_repeat(self, step: Step) -> bool:
        """Whether a step may be asked again although nobody was understood: a hand that was just switched on may have
        become a boot monitor meanwhile, which takes the bytes of other speeds for a firmware download (barrett §8)."""
        return self._safe is None or step.speed is None or step.speed in self._safe or self._guard(step) is not None

    def _guard(self, done: Step | None) -> BootMonitorStep | None:
        """The guard that this step is, None for most."""
        guard = guard_of(done.family) if done is not None else None
        return guard if guard is not None and guard.step == done else None

    def _settled(self, done: Step) -> Step | None:
        """Behind a guard that met silence: listen until the port was open for long enough; the step once more if
        something came."""
        guard, link, search = self._guard(done), self._link, self._search
        if guard is None or not isinstance(link, ByteLink) or search.rows:
            return None
        if (code := search.met[done].code) == "boot-monitor":
            return None
        self._run.prompts.progress(f"{search.link}: listening for a device that starts")
        wait = link.deadline(max(LATE, self._opened + guard.seconds - link.now())).earlier(self._bound)
        came = code != NoAnswer.default_code  # perhaps late echoes of what was asked before
        while not wait.expired:
            came = bool(link.read(wait)) or came
        return done if came else None

    def _found(self, step: Step, patience: float | None) -> bool:
        """One probe, whether it ends the search. What has answered another family's probe with its id is not counted again."""
        link, search = self._link, self._search
        probe: FamilyProbe = probe_of(step.family)
        quiet = Journal(progress=lambda text: self._run.prompts.progress(f"{self._progress}: {text}"))
        quiet.counters = self._run.journal.counters
        quiet.line = search.lines.setdefault(step.family, quiet.line)
        where = {"family": step.family, "link": link.name, "baud": getattr(link, "baud", None), "id": None}
        ids = self._ids[:1] or [1]
        try:
            rows = probe.probe(link, quiet, self._bound, ids, self._run.settings.timeout or patience)
        except (NoAnswer, ProtocolError) as exc:
            search.meet(step, exc)
            return False
        if not search.rows:
            search.line = quiet.line
        self._add([{**where, **row} for row in rows])
        return bool(search.rows) and not self._all

    def _add(self, rows: Sequence[Row]) -> None:
        """Rows of devices that are not known yet."""
        search = self._search
        known = {(row["baud"], row["id"]) for row in search.rows if row["id"] is not None}
        search.rows += [row for row in rows if (row["baud"], row["id"]) not in known]


# -- in which order the families are asked on a kind of link -----------------------------------------------------------


def asking_order(wire: str, families: Sequence[str], speeds: bool, port: int | None = None) -> list[Step]:
    """Which probes, in which order, on a kind of link; without `speeds` each family once, at the link's own.

    `port` is that of a TCP link: whose own it is comes first.
    """
    found = [family for family in SCAN_ORDER if family in families and wire in probe_of(family).WIRES]
    if wire == "tcp":  # who is at home there comes before who is behind a serial server
        found.sort(key=lambda family: "serial" in probe_of(family).WIRES)
        found.sort(key=lambda family: port is None or family_of(family).tcp_port != port)
    if not speeds:
        return [Step(family, None) for family in found]
    # Neighbours of the same speeds are all asked at one speed before the next one is set.
    groups = [(at, list(alike)) for at, alike in groupby(found, key=lambda family: probe_of(family).SPEEDS)]
    steps = [Step(family, speed) for at, members in groups for speed in at for family in members]
    for family in found:  # a boot monitor is excluded before anything that it could take for its trigger is sent
        guard = guard_of(family)
        if guard is not None:
            steps.sort(key=partial(_turn, guard))
    return steps


def _turn(guard: BootMonitorStep, step: Step) -> int:
    """The harmless speeds, each set once; the guard's own step; the other speeds."""
    harmless_to_others = dict(zip(guard.harmless_to_others, range(-len(guard.harmless_to_others), 0), strict=True))
    return harmless_to_others.get(step.speed or 0, 0 if step == guard.step else 1)


class BootMonitorStep(NamedTuple):
    """A step that comes before those at speeds that are not `harmless_to_others`, and how long the port is open before them."""

    step: Step
    seconds: float
    harmless_to_others: tuple[int, ...]


def port_of(link: str) -> int | None:
    """The port of a TCP link, None where it does not say."""
    return number_in(link.rpartition(":")[2])


def guard_of(family: str) -> BootMonitorStep | None:
    """What a family's probe says of it, None for most."""
    found = getattr(probe_of(family), "GUARD", None)
    return None if found is None else BootMonitorStep(Step(family, found[0]), found[1], found[2])


def safe_speeds(steps: Sequence[Step]) -> frozenset[int] | None:
    """The speeds at which no family's boot monitor takes harm, None where all are such."""
    guards = [guard for step in steps if (guard := guard_of(step.family)) is not None]
    return frozenset.intersection(*(frozenset(guard.harmless_to_others) for guard in guards)) if guards else None


def makers_of(families: Iterable[str]) -> list[tuple[Callable[..., None] | None, list[str]]]:
    """Group the families by the search that covers all ids of several of them at once; None = they have no ids."""
    found: dict[Callable[..., None] | None, list[str]] = {}
    for family in dict.fromkeys(families):
        found.setdefault(getattr(probe_of(family), "sweep", None), []).append(family)
    return list(found.items())
