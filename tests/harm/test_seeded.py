"""Mistakes that somebody could make, put into the host one at a time: the matrix finds each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from handctl.devices.barrett.gcl import meet
from handctl.devices.inspire import bus
from handctl.devices.inspire.exo import probe as exo_probe
from handctl.model.device import Gate
from tests.harm import lines, states
from tests.harm.cell import Cell, cells, try_cell

CLEAR_ERRORS = bytes.fromhex("EB 90 01 04 12 EC 03 01 07")


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("seeded")
    lines.prepare(folder)
    return folder


def harmed(name: str, words: str, scratch: Path) -> tuple[list[Cell], int]:
    """The harmed cells of the lines that begin so, against one device, and how many cells there are."""
    (state,) = [state for state in states.states() if str(state) == name]
    wanted = [line for found in lines.examples().values() for line in found if str(line).startswith(words)]
    tried = [try_cell(state, line, mode, scratch) for line, mode in cells(state, wanted)]
    return [cell for cell in tried if cell.harm], len(tried)


def unchecked() -> AbstractContextManager[Any]:
    """The look at who is there is left out."""
    return mock.patch.object(Gate, "check", lambda *_: None)


def writing_scan() -> AbstractContextManager[Any]:
    """The probe of exo writes before it reads."""
    probe = exo_probe.probe

    def careless(link: Any, *more: Any) -> Any:
        link.write(CLEAR_ERRORS, link.deadline(1.0))
        return probe(link, *more)

    return mock.patch.object(exo_probe, "probe", careless)


@contextmanager
def triggering() -> Iterator[None]:
    """The first question to a BarrettHand is ^C, at a speed at which its boot monitor hears that as FF, the trigger."""
    ask = meet.Meeting._ask

    def careless(meeting: Any, early: bytes, seconds: float, _question: bytes = b"") -> bytes:
        return ask(meeting, early, seconds, b"\x03")

    with mock.patch.object(meet, "SPEEDS", (38400, 9600)), mock.patch.object(meet.Meeting, "_ask", careless):
        yield


def loud() -> AbstractContextManager[Any]:
    """What a stranger may act upon is asked at once."""
    return mock.patch.object(bus, "harmless", lambda *_: True)


@pytest.mark.parametrize(
    ("mistake", "device", "words"),
    [
        (unchecked, "RH56, df at rest", "exo"),
        (unchecked, "wrist with hand, at rest", "exo"),
        (unchecked, "hand without wrist, at rest", "wrist"),
        (writing_scan, "exo, has errors", "scan"),
        (writing_scan, "wrist with hand, has errors", "scan"),
        (triggering, "BarrettHand, blank", "barrett status"),
        (triggering, "BarrettHand, booting", "barrett version"),
        (loud, "BarrettHand, closing, tcp", "exo id"),
    ],
)
def test_a_mistake_is_found(
    mistake: Callable[[], AbstractContextManager[Any]], device: str, words: str, scratch: Path
) -> None:
    before, count = harmed(device, words, scratch)
    assert count and not before
    with mistake():
        after, again = harmed(device, words, scratch)
    print(f"{mistake.__name__}, {device}: {len(after)} of {again} cells harmed, e.g. {_told(after)}")
    assert after


def _told(found: Sequence[Cell]) -> str:
    return f"handctl {found[0].line}: {found[0].harm}" if found else "none"
