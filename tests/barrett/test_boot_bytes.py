"""Whatever is sent to whom nobody knows yet, a BarrettHand in its boot window hears no trigger of its monitor in it."""

from __future__ import annotations

import random
from collections.abc import Iterable
from pathlib import Path

import pytest

from handctl.sim.bus.wire_pair import resample
from tests.barrett import unanswered
from tests.barrett.line_receiver import MONITOR, TRIGGER, bursts, heard, hears
from tests.barrett.unanswered import Way
from tests.support.each_row import each_row


def triggers(ways: Iterable[Way]) -> list[str]:
    """The ways whose bytes hold a trigger, with the bytes."""
    found = []
    for name, writes in ways:
        for burst in bursts(writes):
            if any(TRIGGER in one for one in hears(burst)):
                found.append(f"{name}: {' | '.join(f'{data.hex(chr(32))} at {baud}' for baud, data, _ in burst)}"[:200])
    return list(dict.fromkeys(found))


def test_no_stop_opens_the_boot_monitor() -> None:
    """But for those of Inspire's devices, typed where a BarrettHand is: their frames are theirs, and a stop is not held up."""
    found = triggers(unanswered.stops())
    assert [one for one in found if not one.startswith(TYPED)] == []


TYPED = ("exo stop at", "hand stop at")
"""Their questions are harmless. No byte ahead makes the frame that stops them so at every speed, and a stop that was typed is not held up."""


@pytest.mark.parametrize("ways", [unanswered.interrupts, unanswered.connects])
def test_no_interrupt_and_no_connect_opens_the_boot_monitor(ways: object) -> None:
    assert triggers(ways()) == []  # type: ignore[operator]


def test_no_death_opens_the_boot_monitor() -> None:
    assert triggers(unanswered.deaths()) == []


def test_no_command_that_looks_for_somebody_opens_the_boot_monitor(tmp_path: Path) -> None:
    assert triggers(unanswered.commands(tmp_path)) == []


def test_no_read_opens_the_boot_monitor_whatever_its_id() -> None:
    """A share of the ids; the suite `boot-bytes` of `tests/search` takes all."""
    assert triggers(unanswered.scans(range(1, 255, 23))) == []


# -- the receiver ------------------------------------------------------------------------------------------------------


@each_row(
    ("data", "sent", "listens", "wanted"),
    [("0D", 9600, 38400, "78 00"), ("0D", 9600, 19200, "E6 80"), ("0A 0D 3D 3E 20", 9600, 19200, "98 80 E6 80 E6 18 18 F8")],
)  # fmt: skip
def test_the_samples_of_the_dossier(data: str, sent: int, listens: int, wanted: str) -> None:
    """Its fourth, of a prompt at 19200, is that of one sample a bit."""
    assert bytes.fromhex(wanted) in heard(bytes.fromhex(data), sent, listens, (0,))


def test_the_simulator_hears_the_same() -> None:
    """Its receiver has one phase for each byte: where a bit lasts whole samples, there is no other; else its first byte is one of ours."""
    dice = random.Random(1)
    for _ in range(100):
        data = dice.randbytes(dice.randint(1, 12))
        for sent in (600, 4800, 9600, 19200, 38400):
            assert resample(data, sent, MONITOR, "sci") in heard(data, sent, MONITOR, (0,)), (data, sent)
        for sent in (57600, 115200):
            first = {one[:1] for one in heard(data[:1], sent, MONITOR, (0,))}
            assert resample(data[:1], sent, MONITOR, "sci")[:1] in first, (data, sent)


@each_row(
    ("data", "baud"), [("03", 38400), ("EB 90 01 04 30 00 04 02 3B", 57600), ("EB 90 01 04 11 C0 05 02 DD", 57600)]
)
def test_what_was_a_trigger(data: str, baud: int) -> None:
    """^C alone, and what a scan asked: FF in one phase out of three."""
    came = heard(bytes.fromhex(data), baud, MONITOR, (0,))
    assert any(TRIGGER in one for one in came)
    assert baud == 38400 or not all(TRIGGER in one for one in came)
    led = bytes(1 if baud == 38400 else 2) + bytes.fromhex(data)
    assert not any(TRIGGER in one for one in heard(led, baud))
