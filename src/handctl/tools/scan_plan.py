"""In which order `handctl scan` asks the families on a kind of link. Asks nothing itself."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import groupby
from typing import NamedTuple

from handctl.digits import number_in
from handctl.families import SCANNED
from handctl.tools.probes import family_of, probe_of
from handctl.tools.scan_report import Step


def plan(wire: str, families: Sequence[str], speeds: bool, port: int | None = None) -> list[Step]:
    """Which probes, in which order, on a kind of link; without `speeds` each family once, at the link's own.

    `port` is that of a TCP link: whose own it is comes first.
    """
    found = [family for family in SCANNED if family in families and wire in probe_of(family).WIRES]
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


def _turn(guard: Guard, step: Step) -> int:
    """The harmless speeds, each set once; the guard's own step; the other speeds."""
    harmless = dict(zip(guard.harmless, range(-len(guard.harmless), 0), strict=True))
    return harmless.get(step.speed or 0, 0 if step == guard.step else 1)


class Guard(NamedTuple):
    """A step that comes before those at speeds that are not `harmless`, and how long the port is open before them."""

    step: Step
    seconds: float
    harmless: tuple[int, ...]


def port_of(link: str) -> int | None:
    """The port of a TCP link, None where it does not say."""
    return number_in(link.rpartition(":")[2])


def guard_of(family: str) -> Guard | None:
    """What a family's probe says of it, None for most."""
    found = getattr(probe_of(family), "GUARD", None)
    return None if found is None else Guard(Step(family, found[0]), found[1], found[2])


def safe_speeds(steps: Sequence[Step]) -> frozenset[int] | None:
    """The speeds at which no family's boot monitor takes harm, None where all are such."""
    guards = [guard for step in steps if (guard := guard_of(step.family)) is not None]
    return frozenset.intersection(*(frozenset(guard.harmless) for guard in guards)) if guards else None


def makers_of(families: Iterable[str]) -> list[tuple[Callable[..., None] | None, list[str]]]:
    """The families by what looks for all ids of several of them at once, None = they have no ids."""
    found: dict[Callable[..., None] | None, list[str]] = {}
    for family in dict.fromkeys(families):
        found.setdefault(getattr(probe_of(family), "sweep", None), []).append(family)
    return list(found.items())
