"""The commands of the families in the registry, and the files that they take."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click

from handctl.command import snapshots
from handctl.command.command_tree import Command
from handctl.command.family import load
from handctl.families import FAMILIES
from tests.contract.facts import facts_of
from tests.support.inputs import made_once

SECONDS = 20.0
"""No command over virtual time takes so long."""
ELSEWHERE = {
    ("barrett", "firmware download"): "needs a power switch",
    ("barrett", "firmware check"): "reaches no device, and takes an image",
    ("hand", "pair"): "needs two hands, and somebody who sees which one moves",
    ("ekso", "gait"): "reaches no device, and takes logs",
    ("ekso", "terminal"): "sends requests to read, and nothing else that an EksoNR knows",
    **{(family, "listen"): "asks nothing, and most devices say nothing unasked" for family in FAMILIES},
    **{(family, "export"): "reaches no device, and takes a log" for family in FAMILIES},
    **{(family, "doctor"): "looks at this computer as well, which is another one each time" for family in FAMILIES},
}
"""Commands with tests of their own only, and why."""


def commands(family: str) -> Iterator[tuple[str, Command]]:
    """Every command of a family by the words behind the family's, as they are typed."""

    def below(group: click.Group, path: str) -> Iterator[tuple[str, Command]]:
        context = click.Context(group)
        for name in group.list_commands(context):
            command = group.get_command(context, name)
            if isinstance(command, click.Group):
                yield from below(command, f"{path}{name} ")
            elif isinstance(command, Command):
                yield f"{path}{name}", command

    yield from below(load(family, "cli").cli, "")


def writing_commands(family: str) -> list[str]:
    """Those that write, without those that have tests of their own."""
    return [name for name, command in commands(family) if command.writes and (family, name) not in ELSEWHERE]


@made_once
def scratch_of(folder: Path) -> None:
    """A folder with a snapshot of each family that has settings."""
    for kind in FAMILIES:
        if values := facts_of(kind).snapshot:
            content = snapshots.make(kind, {"kind": kind}, dict(values), link="x", fake=True)
            snapshots.write(str(folder / f"{kind}.json"), content)
