"""A scan of one link: what to search for, and what was found. Passed from the scan to a family's search. Does no I/O."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handctl.errors import HandctlError
    from handctl.model.result import Journal, Row

LABEL_HINT = "check the label on the device: its replies do not show which device it is"
NOT_ASKED = "not-asked"
"""Code of a family that a search of all families passes over on a link, because its question may harm a stranger there."""


@dataclass(slots=True)
class ScanTask:
    """The scan sets the first fields; the search fills the others.

    ids       to ask, the likely ones first; () = every id that such a device can have
    find_all  go on behind the first device, and ask a silent line again with more patience
    silence   seconds for which a silent line is asked, None = until everything was asked
    baud      the only speed in bit/s, None = all
    patience  seconds allowed for an answer, None = what the line needs
    own       options of the families, by name
    rows      the devices that were found
    failure   why there is none, or none of the families that were asked for
    twins     ids that two devices have
    tried     speed in bit/s (None = the link has none) -> code of what came
    left      what was not asked, in words, each with how to ask it
    facts     figures for a program
    """

    ids: Sequence[int] = ()
    find_all: bool = False
    silence: float | None = None
    baud: int | None = None
    patience: float | None = None
    own: Mapping[str, Any] = field(default_factory=dict)
    progress: Callable[[str], None] = lambda _text: None
    rows: list[Row] = field(default_factory=list)
    failure: HandctlError | None = None
    twins: list[int] = field(default_factory=list)
    tried: dict[int | None, str] = field(default_factory=dict)
    left: list[str] = field(default_factory=list)
    facts: dict[str, Any] = field(default_factory=dict)


def ended_at_first(journal: Journal, left: list[str], link: str, what: str) -> None:
    """Report that the scan of a link ended at the first device, and `what` it has not tried, which goes into `left` as well."""
    journal.info(
        "first", f"{link}: the scan ended at the first device. Not tried: {what}", hint="use --all to look for more"
    )
    left.append(f"{what}: --all tries these")
