"""`handctl stop`: stop a device of any family at once, given its LINK or its name.

Nothing that is asked to find that out writes to a device or moves it: they are the questions of a scan, each once, in its order.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import click

from handctl.command.command_tree import Command
from handctl.command.config_file import Device, read_config
from handctl.command.family import load
from handctl.command.options import COMMAND_LINE, NAMED, Source
from handctl.command.run import Run
from handctl.errors import OTHER_DEVICE, DeviceRefused, HandctlError, Hint, UsageError, joined
from handctl.families import FAMILIES, SCAN_ORDER
from handctl.link import open_link
from handctl.link.device_lock import OURS, Reached, canonical, hold, remembered
from handctl.model.result import Journal, Row, Table
from handctl.model.stop_sequence import TwoParts, stop_sequence_of
from handctl.stop.stop_command import at_place, each_stopped, is_said, stopped_as, stopped_elsewhere, tell_gone, unheard
from handctl.system.user_folders import config_path
from handctl.tools.family_probe import family_of, has_speed, probe_of, set_speed, usual_ports, wire_of

if TYPE_CHECKING:
    from handctl.link import Link


@click.command("stop", cls=Command, writes=True, stops=True)
def cli(run: Run) -> Table:
    """Stop a device at once, even while another handctl command is using it.

    With -p, it stops each device on that link that a handctl command has set in motion, the last one first. If there is none,
    handctl takes the family from the handctl command that is using the device or reached it last. With -d, it takes the family
    from the entry of the named device.
    Otherwise it looks for a named device on this port, then tries for 0.5 s to detect the device. It also does that if the stop
    gets no reply, or one from another device, and then stops the device that it found. If it finds none, it sends the stop of
    each device that may not reply while it moves: a BarrettHand, and on TCP an AIDIN-hand too.
    If that fails, use `handctl FAMILY stop`. A handctl command that was using the device ends with exit code 130 if the stop
    was acknowledged. An EksoNR has no stop command and only gets a CancelAction, which may not stop it.
    """
    elsewhere = stopped_elsewhere(run)
    table = _stopped(run)
    table.failure = table.failure or elsewhere
    tell_gone(run)
    return table


def _stopped(run: Run) -> Table:
    kind = _kind(run)
    reached: set[tuple[str, int]] = set()
    going, others = [], []
    unknown: list[int] = []
    parts = None
    if kind:
        parts = _in_two_parts(run, kind)
        table: Table | None = stopped_as(run, kind, reached, sequence=parts)
    else:
        going = _set_going(run)
        if going:
            kind = going[0].family
            table = each_stopped(run, going, reached)
        else:
            kind = family_at(run)
            parts = _in_two_parts(run, kind) if kind else None
            try:
                table = stopped_as(run, kind, reached, sequence=parts) if kind else None
            except UsageError as exc:  # it was met by another name of this place, which is none of its LINKs
                run.journal.warn("passed-over", exc.text)
                kind, parts, table = "", None, None
        others = list(_used_by_others(run, unknown))
        if others and parts is not None and parts.paused:  # nothing else is looked for
            table = stopped_as(run, kind, reached, table, sequence=parts.rest)
        missed, before = None, len(table.rows) if table is not None else 0
        if others and not going and table is not None and table.failure is not None and _missed(table):
            missed, table.failure = table.failure, None
        table = each_stopped(run, others, reached, table)
        if missed is not None and table is not None and len(table.rows) == before:  # nothing else was stopped
            table.failure = missed
        elif missed is not None:  # another device is there now than the one that was met
            run.journal.warn("other-device", missed.text)
    # What a command of another user is using is there: nothing else is looked for.
    if table is None or not (others or not _missed(table)):
        table = _other_stopped(run, kind, table, reached, parts=parts, going=bool(going))
    for pid in unknown:
        text = f"another handctl (pid {pid}) is using {run.settings.port}, too, and it is not known what it has set in motion"
        hint = f"end it with `kill {pid}`: it then stops that, as with Ctrl-C"
        run.journal.warn("others", text, hint)
        table.failure = table.failure or DeviceRefused(text, hint=hint, code="others")
    return table


def _in_two_parts(run: Run, kind: str) -> TwoParts | None:
    """The stop of the family that is expected at a port, paused where nothing replies: before it has been sent at each baud rate and for
    its whole second, the device that is really there gets its own. None where it is known which one that is."""
    if run.settings.dry_run or (run.settings.port or "").startswith(OURS):
        return None
    return TwoParts(partial(stop_sequence_of, kind))


def _other_stopped(
    run: Run, kind: str, first: Table | None, reached: set[tuple[str, int]], *, parts: TwoParts | None, going: bool
) -> Table:
    """The stop of the device that is really there, after the `first` one as `kind`; that one where no other is found.

    What is kept of a place may be out of date: another device is behind the port now. With `going` a command has set the first
    one going: then its failure stays. `parts`: what may be left of the first one. Raises UsageError where nothing tells what to send.
    """
    link, expected = run.settings.port or "", run.settings
    failure = first.failure if first is not None else None
    if "id" not in run.sources:
        run.settings = run.settings._replace(id=None)  # the one of the family before, as shipped
    found = _replying_family(run, link)
    if parts is not None and parts.paused and found in (None, "", kind, FAMILIES[kind].beside):
        asked, run.settings = run.settings, expected
        first = stopped_as(run, kind, reached, first, sequence=parts.rest)
        if not _missed(first):
            return first
        failure, run.settings = first.failure, asked
    if first is not None and ((found == kind and not going) or (found, run.settings.id or 1) in reached):
        return first
    then = first
    for other in [found] if found else _silent_families(run, link):
        if other == kind and not found:
            continue
        if found and failure is not None:
            run.journal.warn("other-device", f"{failure.text}. Stopping the {found} instead")
        then = stopped_as(run, other, reached, then)
        if found or not _missed(then):
            if not found and failure is not None:
                run.journal.warn("other-device", f"{failure.text}. The stop of a {other} was acknowledged")
            # That this one replies does not show that the first one is gone.
            if going or (kind and FAMILIES[kind].beside == other):
                then.failure = then.failure or failure
            return then
        if found is None and (found := _replying_family(run, link)):  # another command had the link until now
            return then if found == other else stopped_as(run, found, reached, then)
    if then is None:
        raise _unknown(link, UsageError)
    if first is not None:
        run.family = load(kind, "cli").cli.family
        then.failure = failure
    else:
        assert then.failure is not None
        then.failure = _unknown(link, type(then.failure), then.failure.text)
    return then


def _missed(stopped: Table) -> bool:
    """Whether no device of the family that it was for has acknowledged this stop."""
    failure = stopped.failure
    if failure is None:
        return False
    return failure.code == OTHER_DEVICE or unheard(type(failure).__name__, stopped.rows)


def _silent_families(run: Run, link: str) -> list[str]:
    """The families whose device may be behind this LINK, and move, although no question finds it."""
    from handctl.tools.scan_link import asking_order, port_of

    if link.startswith(("fake://", "replay:")) or run.settings.dry_run:
        return []
    wire = wire_of(link)
    silent = [family for family in SCAN_ORDER if FAMILIES[family].silent]
    return [
        step.family for step in asking_order(wire, silent, speeds=False, port=port_of(link) if wire == "tcp" else None)
    ]


def _unknown(link: str, kind: type[HandctlError], sent: str = "") -> HandctlError:
    """The error where nothing tells the family of the device; `sent` is what was sent all the same, and what came."""
    return kind(
        joined(
            f"{link}: no handctl command has reached this device, it has no name, and its family could not be detected",
            sent,
        ),
        hint=f"run `handctl FAMILY stop -p {link}` with one of {', '.join(FAMILIES)}",
        code="no-family",
    )


def _kind(run: Run) -> str:
    """The family of the device as far as it is known before anything is sent, "" where it is not. Raises UsageError without a LINK."""
    settings = run.settings
    if settings.kind is not None:
        return settings.kind
    if settings.port is None:
        raise UsageError(
            "no device given", hint=Hint("give -p LINK or -d NAME (see {})", "devices list"), code="no-link"
        )
    simulated = settings.port.removeprefix("fake://").partition("?")[0].rstrip("/")
    return simulated if settings.port.startswith("fake://") and simulated in FAMILIES else ""


# -- whose the device at a LINK is, told by what is kept, else by who answers ------------------------------------------


SECONDS = 0.5
"""For all questions together: by then the bytes of the stop have to go out."""
EACH = 0.03
"""For the answer to one of them: an adapter that holds answers back for 16 ms is within that."""


def _remembered(link: str) -> tuple[Reached | None, list[Reached]]:
    """See `device_lock.remembered`; of what was damaged nothing."""
    ports = usual_ports() if link.startswith("tcp://") else []
    met, going = next(filter(any, (remembered(link, port) for port in (None, *ports))), (None, []))
    known = [one for one in going if one.family in FAMILIES]
    return (met if met is not None and met.family in FAMILIES else None), known


def _set_going(run: Run) -> list[Reached]:
    """The devices at --port that handctl has set going and not stopped, the last one first, then the one that it met last; [] where it
    has set none going. With an id that was typed, or is that of the named device, those with that one."""
    met, moving = _remembered(run.settings.port or "")
    typed = run.settings.id if is_said(run.sources.get("id")) else None
    moving = [one for one in moving if typed is None or one.key[1] == typed or not family_of(one.family).ids]
    return [*moving, *([met] if met is not None and typed is None else [])] if moving else []


def _used_by_others(run: Run, unknown: list[int]) -> Iterator[Reached]:
    """The devices at --port that handctl commands are using without our lock: those of another user, or with other folders.

    Those whose command line does not tell the device, as a batch, are added to `unknown` by their number. The holder of our lock has
    said what it has stopped, and ends.
    """
    from handctl.link.port_users import handctl_commands, has_open, option_in

    link = run.settings.port or ""
    if link.startswith(OURS):
        return
    is_there = at_place(link)
    for pid, words in handctl_commands(is_there):
        pairs = pairwise(["", *words])
        family = next((word for before, word in pairs if word in FAMILIES and before not in ("-d", "--device")), "")
        if family:
            number = option_in(words, "", "--id")
            run.journal.info("others", f"handctl {family} (pid {pid}) is using {link}, too")
            yield Reached(family, {"id": int(number)} if number.isdecimal() and number != "1" else {})
        elif has_open(pid, is_there, hidden=True) and not any(
            one.code in ("asked", "ended") for one in run.journal.messages
        ):
            unknown.append(pid)


def family_at(run: Run) -> str:
    """The family of the device at --port: from its holder, the last command that reached it, or a named device there; else "".

    What a named device there says of it holds, as with -d; else what the last command needed to reach it.
    """
    met, _ = _remembered(run.settings.port or "")
    found = met.family if met is not None else ""
    named = [one for one in _named_at(run.settings.port or "") if one.kind and found in ("", one.kind)]
    kinds = {one.kind for one in named}
    if len(kinds) == 1:
        found = named[0].kind
        _as_named(run, named)
    elif met is not None:
        run.settings = run.settings.having(
            {key: value for key, value in met.settings.items() if key not in run.sources}
        )
    return found


def _canonical(link: str, kind: str) -> str:
    return canonical(link, family_of(kind).tcp_port if kind and link.startswith("tcp://") else None)


def _named_at(link: str) -> list[Device]:
    """The named devices whose LINK is the same port. Errors in the file are ignored."""
    try:
        devices = read_config(passed=[]).devices.values()
    except UsageError:
        return []
    ports = [(one, one.entries["port"].value) for one in devices if "port" in one.entries]
    return [one for one, port in ports if _canonical(port, one.kind) == _canonical(link, one.kind)]


def _as_named(run: Run, named: list[Device]) -> None:
    """Use the settings of the named device that nothing else sets; if several are on one line, only note that."""
    if len(named) > 1:
        names = ",".join(one.name for one in named)
        run.journal.warn("several", f"{names} are at {run.settings.port}", Hint("{} stops each", f"stop -d {names}"))
        return
    (device,) = named
    said = {key: entry for key, entry in device.entries.items() if key not in ("port", *run.sources)}
    sources = {key: Source(NAMED, f"{config_path()}:{entry.line}") for key, entry in said.items()}
    run.settings = run.settings.having({key: entry.value for key, entry in said.items()})
    run.sources = {**run.sources, **sources}


def _replying_family(run: Run, link: str) -> str | None:
    """The family that replies within SECONDS, and the baud rate; "" without a reply, None if nothing was asked: the link is in use."""
    if link.startswith("replay:") or run.settings.dry_run:
        return None
    wire = wire_of(link)
    try:
        with ExitStack() as held:
            opened = run.link
            if opened is None:
                if (lock := hold(link, f"handctl {run.command}", use="stops", patience=0.0)) is not None:
                    held.callback(lock.release)
                opened = held.enter_context(closing(open_link(link, exclusive=False)))
            else:  # the questions of other families are no writes of this one
                held.callback(setattr, opened, "observers", opened.observers)
                opened.observers = run.connection.observers
            row = _asked(opened, wire, _ids(run), run.journal)
    except HandctlError:
        return None  # the stop itself says what is wrong with the link
    if row is None:
        return ""
    if row["baud"] is not None:
        run.settings = run.settings._replace(baud=row["baud"])
    if row.get("id") not in (None, run.settings.id):
        run.settings = run.settings._replace(id=row["id"])
    run.journal.info("found", f"{link}: {row['family']} replies: {row['evidence']}")
    return str(row["family"])


def _ids(run: Run) -> list[int]:
    """The ids to ask: the one that was given, and unless it was typed or is that of a named device, the one as shipped."""
    number, source = run.settings.id, run.sources.get("id")
    if number is None or not 1 < number <= 254:
        return [1]
    return [number] if source == COMMAND_LINE or (source and source.level == NAMED) else [number, 1]


def _asked(link: Link, wire: str, ids: list[int], journal: Journal) -> Row | None:
    """The first row of a scan's questions, each family at its usual speed."""
    from handctl.tools.scan_link import asking_order, port_of

    speeds = has_speed(link) and wire == "serial"
    bound = link.deadline(SECONDS)
    done: set[str] = set()
    quiet = Journal()
    quiet.counters = journal.counters
    for step in asking_order(wire, SCAN_ORDER, speeds, port_of(link.name) if wire == "tcp" else None):
        if step.family in done or bound.expired:
            continue
        done.add(step.family)
        try:
            set_speed(link, step.speed)
            rows = probe_of(step.family).probe(link, quiet, bound, ids, EACH)
        except HandctlError as exc:
            if exc.code == "boot-monitor":
                return None  # what comes next could be a trigger
            continue
        if rows and rows[0].get("family", step.family) is not None:
            return {"family": step.family, "evidence": "", **rows[0], "baud": step.speed}
    return None
