"""What is bounded by time ends, with every family, on each of its wires, however fast it may ask: no time stands still."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import handctl
from handctl.api import Device, Method, methods
from handctl.errors import NoAnswer
from handctl.families import FAMILIES
from tests.support.each_row import each_row

WIRES: dict[str, tuple[dict[str, str], ...]] = {
    "wrist": ({}, {"bus": "can"}),
    "hand": ({}, {"bus": "can"}, {"bus": "modbus-tcp"}),
    "aidin": ({}, {"exchange": "poll"}),
}
NEEDED: dict[str, dict[str, Any]] = {
    "log": {"file": "log.csv"},
    "currents": {"values": ["index.m1=50"]},
    "strain": {"live": True},
    "fingertips": {"live": True},
    "tactile": {"watch": True},
}
DURATION = 0.05
MOST = 500
"""Samples of a twentieth of a second: a line that answers 10,000 times a second is none."""


def bounded() -> Iterator[tuple[str, Method, dict[str, str], bool]]:
    """Each command of each family that takes a duration, on each wire, with the time of that wire and without any."""
    for family in FAMILIES:
        for method in methods(family).values():
            if any(argument.name == "duration" for argument in method.arguments):
                for wire in WIRES.get(family, ({},)):
                    yield from ((family, method, wire, timed) for timed in (True, False))


def opened(family: str, wire: dict[str, str], *, timed: bool) -> Device:
    if timed:
        return handctl.simulate(family, **wire)
    options = {"clock": "virtual", **wire}
    return handctl.connect(family, f"fake://{family}?" + "&".join(f"{key}={value}" for key, value in options.items()))


@each_row("case", list(bounded()))
def test_a_duration_ends(case: tuple[str, Method, dict[str, str], bool], tmp_path: Path, monkeypatch: Any) -> None:
    family, method, wire, timed = case
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("handctl.link.fake.STANDSTILL", 25)  # sooner than otherwise
    more = {"duration": DURATION, **NEEDED.get(method.words, {})}
    if any(argument.name == "rate" for argument in method.arguments):
        more["rate"] = 0
    (tmp_path / "log.csv").unlink(missing_ok=True)
    with opened(family, wire, timed=timed) as device:
        if family == "barrett":
            device.init(confirm=True)
        found = getattr(device, method.name)(confirm=True, **more)
        try:
            for count, _ in enumerate(found):
                assert count < MOST, f"{family} {method.words} on {wire} goes on"
        except NoAnswer as exc:
            assert (method.words, exc.code) == ("listen", "nothing-heard")


def test_a_simulated_device_takes_the_time_of_its_line() -> None:
    """The bytes of an exo's answers at 115,200 bit/s, and no exchange for nothing."""
    with handctl.simulate("exo") as exo:
        samples = list(exo.watch("temperature", rate=0, duration=1.0))
        assert 100 < len(samples) < 1000
        assert exo.envelope["stream"]["seconds"] == pytest.approx(1.0, abs=0.02)
