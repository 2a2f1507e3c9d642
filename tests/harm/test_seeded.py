"""Mistakes that somebody could make, put into the host one at a time: the matrix finds each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from handctl.devices.barrett.gcl import session_start
from handctl.devices.inspire import serial_bus
from handctl.devices.inspire.exo import probe as exo_probe
from handctl.model.device import Gate
from tests.harm import lines, states
from tests.harm.cell import cells, try_cell

CLEAR_ERRORS = bytes.fromhex("EB 90 01 04 12 EC 03 01 07")


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("seeded")
    lines.prepare(folder)
    return folder


def ways(name: str, words: str) -> Iterator[tuple[states.State, lines.Line, str]]:
    """All ways in which the lines that begin so are tried on one device."""
    (state,) = [state for state in states.states() if str(state) == name]
    wanted = [line for found in lines.examples().values() for line in found if str(line).startswith(words)]
    return ((state, line, mode) for line, mode in cells(state, wanted))


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
    ask = session_start.SessionStart._ask

    def careless(meeting: Any, early: bytes, seconds: float, _question: bytes = b"") -> bytes:
        return ask(meeting, early, seconds, b"\x03")

    with (
        mock.patch.object(session_start, "SPEEDS", (38400, 9600)),
        mock.patch.object(session_start.SessionStart, "_ask", careless),
    ):
        yield


def loud() -> AbstractContextManager[Any]:
    """What a stranger may act upon is asked at once."""
    return mock.patch.object(serial_bus, "harmless_to_others", lambda *_: True)


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
    for way in ways(device, words):
        with mistake():
            harm = try_cell(*way, scratch).harm
        if harm:
            assert not try_cell(*way, scratch).harm, "without the mistake too"
            return
    pytest.fail("nothing was harmed")
