"""The simulated EksoNR as a server, its loop on virtual time; the system's own terminals and connections are in tests/ekso."""

from __future__ import annotations

import pytest

from tests.sim.ekso_bench import (
    CANCEL,
    CANCEL_OK,
    DATE_4,
    GET_DATE,
    GET_SETTINGS,
    GET_TIME,
    SET_OK,
    SET_STEP,
    SETTINGS,
    TIME_4,
    message,
)
from tests.support.virtual import Client, Loop


def ask(port: Client, request: str, count: int, seconds: float | None = None) -> str:
    return port.ask(bytes.fromhex(request), count, seconds).hex(" ").upper()


def test_served() -> None:
    with Loop("ekso", "--pty", "--set", "preset=vectors", "--control", "control") as loop, loop.open(115200) as port:
        assert ask(port, GET_SETTINGS, 50) == SETTINGS
        assert ask(port, SET_STEP, 8) == SET_OK
        assert ask(port, CANCEL, 8) == CANCEL_OK
        assert loop.tell("counts") == "ok set 1 cancel 1 violations 0"
        assert loop.tell("posture sitting") == "ok posture sitting"
        assert ask(port, message(153, 1).hex(), 60)[120:125] == "10 40"
        assert loop.tell("jump").startswith("error unknown command")
        assert loop.stop() == (0, [], [])
    with Loop("ekso", "--tcp", "127.0.0.1:0", "--set", "preset=vectors") as loop:
        assert ask(loop.open(), GET_DATE, len(bytes.fromhex(DATE_4))) == DATE_4


def test_another_speed_is_not_understood() -> None:
    with Loop("ekso", "--pty") as loop, loop.open(9600) as port:
        assert ask(port, GET_TIME, 10, 1.0) == ""
        port.baudrate = 115200
        assert len(ask(port, GET_TIME, len(bytes.fromhex(TIME_4)))) == len(TIME_4)


def test_boot_time_follows_the_clock() -> None:
    """Through a 115200 line, with a client that does nothing else."""
    with Loop("ekso", "--pty", "--wire", "115200") as loop, loop.open() as port:
        ticks, began = [], loop.moment
        for number in range(40):
            data = port.ask(message(153, number), 60)
            assert data == message(153, number, data[4:-2])
            ticks.append(int.from_bytes(data[54:58], "big"))
    assert loop.moment - began == pytest.approx(40 * 66 * 10 / 115200, rel=0.05)
    assert (ticks[-1] - ticks[0]) / 1000 == pytest.approx(39 * 66 * 10 / 115200, abs=0.01)
    assert all(tick % 2 == 1 for tick in ticks)
