"""`FAMILY scan`: the search of `handctl scan` with this family alone, by the same code and with the same options."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import click

from handctl.families import COMMANDS
from handctl.frame.clikit import Group
from handctl.frame.run import Run
from handctl.model.result import Table

NAME = "scan"


def scan_options(body: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator: how far a search goes."""
    for option in (
        click.option(
            "--all",
            "find_all",
            is_flag=True,
            help="Keep searching after the first device, and search a silent line again with longer timeouts.",
        ),
        click.option(
            "--ids",
            metavar="FROM-TO",
            help="Ids to try, such as 1-20 (default: --id, or all, the usual one first).",
        ),
    ):
        body = option(body)
    return body


def add_scan(group: Group) -> None:
    """Add the verb to a family's group."""

    @scan_options
    def scan(run: Run, ids: str | None, find_all: bool) -> Table:
        """Search for devices of this family: baud rate and id.

        Read-only. It tries the usual id at each baud rate first, then all ids, and reports anything it skipped.
        """
        assert run.family is not None
        found: Table = import_module(COMMANDS[NAME][0]).scan_family(run, ids, find_all)
        return found

    group.verb(NAME, "Service")(scan)
