"""`handctl stop`: stop a device of any family at once, given its LINK or its name.

Nothing that is asked to find that out writes to a device or moves it: they are the questions of a scan, each once, in its order.
"""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import click

from handctl.command.command_tree import Command
from handctl.command.config import Device, read_config
from handctl.command.family import load
from handctl.command.options import COMMAND_LINE, NAMED, Source
from handctl.command.run import Run
from handctl.errors import HandctlError, Hint, UsageError
from handctl.families import FAMILIES, SCAN_ORDER
from handctl.link import ByteLink, open_link
from handctl.link.device_lock import canonical, hold, last_family
from handctl.model.result import Journal, Row, Table
from handctl.system.user_folders import config_path
from handctl.tools.family_probe import family_of, has_speed, probe_of, usual_ports, wire_of

if TYPE_CHECKING:
    from handctl.link import Link


@click.command("stop", cls=Command, writes=True, stops=True)
def cli(run: Run) -> Table:
    """Stop a device at once, even while another handctl command is using it.

    handctl takes the family from the entry of the named device (-d), or from the handctl command that is using the device or
    used it last.
    Otherwise it looks for a named device on this port, then tries for 0.5 s to detect the device. It also does that if the stop gets no
    reply, or one from another device, and then stops the device that it found.
    If that fails, use `handctl FAMILY stop`. A handctl command that was using the device ends with exit code 130 if the stop
    was acknowledged. An EksoNR has no stop command and only gets a CancelAction, which may not stop it.
    """
    from handctl.stop import stop_command

    run.family = load(_kind(run), "cli").cli.family
    table = stop_command.stop(run)
    return _other_stopped(run, table) or table


def _other_stopped(run: Run, first: Table) -> Table | None:
    """The stop of the device that is really there, after that of the family it was taken for; None where that stands.

    What is kept of a place may be out of date: another device is behind the port now.
    """
    from handctl.stop import stop_command

    failure, family, link = first.failure, run.family, run.settings.port or ""
    error = type(failure).__name__
    if failure is None or not (failure.code == stop_command.OTHER_DEVICE or stop_command.unheard(error, first.rows)):
        return None
    if "id" not in run.sources:
        run.settings = run.settings._replace(id=None)  # the one of the family before, as shipped
    found = _replying_family(run, link) if family is not None else ""
    if family is None or found in ("", family.kind):
        return None
    run.journal.warn("other-device", f"{failure.text}. Stopping the {found} instead")
    run.family = load(found, "cli").cli.family
    run.journal.ledger.words = None  # those of the family before
    then = stop_command.stop(run)
    then.rows = [{**row, "step": at} for at, row in enumerate([*first.rows, *then.rows], 1)]
    if FAMILIES[family.kind].beside == found:  # that this one replies does not show that the other is gone
        then.failure = then.failure or failure
    return then


def _kind(run: Run) -> str:
    """The family of the named device. Raises UsageError if it cannot be determined."""
    settings = run.settings
    if settings.kind is not None:
        return settings.kind
    if settings.port is None:
        raise UsageError(
            "no device given",
            hint=Hint("give -p LINK or -d NAME (see {})", "devices list"),
            code="no-link",
        )
    simulated = settings.port.removeprefix("fake://").partition("?")[0].rstrip("/")
    if settings.port.startswith("fake://") and simulated in FAMILIES:
        return simulated
    return family_at(run)


# -- whose the device at a LINK is, told by what is kept, else by who answers ------------------------------------------


SECONDS = 0.5
"""For all questions together: by then the bytes of the stop have to go out."""
EACH = 0.03
"""For the answer to one of them: an adapter that holds answers back for 16 ms is within that."""


def family_at(run: Run) -> str:
    """The family of the device at --port: from its holder, the last holder, a named device there, or its reply.

    What a named device there says of it holds, as with -d. Raises UsageError where nothing tells the family.
    """
    link = run.settings.port or ""
    ports = usual_ports() if link.startswith("tcp://") else []
    found = next(filter(None, (last_family(link, port) for port in (None, *ports))), "")
    found = found if found in FAMILIES else ""
    named = [one for one in _named_at(link) if found in ("", one.kind)]
    kinds = {one.kind for one in named}
    if len(kinds) == 1:
        found = named[0].kind
        _as_named(run, named)
    if not found:
        found = _replying_family(run, link)
    if found:
        return found
    raise UsageError(
        f"{link}: no handctl command has used this device, it has no name, and its family could not be detected",
        hint=f"run `handctl FAMILY stop -p {link}` with one of {', '.join(FAMILIES)}",
        code="no-family",
    )


def _canonical(link: str, kind: str) -> str:
    return canonical(link, family_of(kind).tcp_port if link.startswith("tcp://") else None)


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


def _replying_family(run: Run, link: str) -> str:
    """The family that replies within SECONDS, and the baud rate; "" without a reply, or if the link is in use."""
    if link.startswith("replay:") or run.settings.dry_run:
        return ""
    wire = wire_of(link)
    try:
        with ExitStack() as held:
            opened = run.link
            if opened is None:
                if (lock := hold(link, f"handctl {run.command}", patience=0.0)) is not None:
                    held.callback(lock.release)
                opened = held.enter_context(closing(open_link(link, exclusive=False)))
            else:  # the questions of other families are no writes of this one
                held.callback(setattr, opened, "observers", opened.observers)
                opened.observers = run.connection.observers
            row = _asked(opened, wire, _ids(run), run.journal)
    except HandctlError:
        return ""  # the stop itself says what is wrong with the link
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
    from handctl.tools.scan_link import plan, port_of

    speeds = has_speed(link) and wire == "serial"
    bound = link.deadline(SECONDS)
    done: set[str] = set()
    quiet = Journal()
    quiet.counters = journal.counters
    for step in plan(wire, SCAN_ORDER, speeds, port_of(link.name) if wire == "tcp" else None):
        if step.family in done or bound.expired:
            continue
        done.add(step.family)
        try:
            if step.speed is not None and isinstance(link, ByteLink) and link.baud != step.speed:
                link.set_baud(step.speed)
            speed = step.speed
            rows = probe_of(step.family).probe(link, quiet, bound, ids, EACH)
        except HandctlError as exc:
            if exc.code == "boot-monitor":
                return None  # what comes next could be a trigger
            continue
        if rows and rows[0].get("family", step.family) is not None:
            return {"family": step.family, "evidence": "", **rows[0], "baud": speed}
    return None
