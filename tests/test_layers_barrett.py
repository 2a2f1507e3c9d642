"""The layers of the BarrettHand: what its language may know, and what the start of a command loads."""

from __future__ import annotations

import pytest

from tests.test_layers import OURS, SANS_IO, WORLD, calls_of, heavy, imports_of, loaded


def test_the_language_of_barrett_is_sans_io() -> None:
    assert {"devices.barrett.language", "devices.barrett.parameters"} <= set(SANS_IO)
    ours = {found.target for found in OURS if found.module == "devices.barrett.commands"}
    assert ours == set(), "the book of commands is data"
    assert {found.target.split(".")[0] for found in imports_of("devices.barrett.commands")} & WORLD == set()


@pytest.mark.parametrize("name", ["realtime", "download", "srecord", "schedule", "guards"])
def test_blocks_records_and_schedules_are_sans_io(name: str) -> None:
    """They know no link and no clock, and touch nothing of the world."""
    module = f"devices.barrett.{name}"
    assert {found.target.split(".")[0] for found in imports_of(module)} & WORLD == set()
    assert calls_of(module, {"open", "print", "input"}) == []
    assert not {found.target for found in OURS if found.module == module} & {"link", "guide", "result", "latency"}


@pytest.mark.parametrize("args", [("barrett", "-h"), ("barrett", "describe", "--json"), ("barrett", "open", "-n")])
def test_barrett_without_a_device_loads_no_simulator(args: tuple[str, ...]) -> None:
    code, modules = loaded(*args)
    assert code == 0
    assert heavy(modules) == set()
    assert "readline" not in modules
    assert not any(name.startswith(("handctl.sim", "handctl.link.", "handctl.devices.inspire")) for name in modules)


def test_a_dump_of_barrett_loads_its_family_only() -> None:
    code, modules = loaded("barrett", "dump", "--fake", "--json")
    assert code == 0
    assert heavy(modules) == set()
    assert not {"socket", "readline"} & modules
    assert "handctl.sim.barrett" in modules
    assert not any(name.startswith(("handctl.sim.exo", "handctl.sim.wrist", "handctl.sim.serve")) for name in modules)
    assert all(name.startswith("handctl.devices.barrett") for name in modules if name.startswith("handctl.devices."))
