"""What the start of a BarrettHand command loads."""

from __future__ import annotations

import pytest

from tests.support.each_row import each_row
from tests.support.loading import back_ends, heavy, loaded

pytestmark = pytest.mark.real


@each_row("args", [("barrett", "-h"), ("barrett", "describe", "--json"), ("barrett", "open", "-n")])
def test_barrett_without_a_device_loads_no_simulator(args: tuple[str, ...]) -> None:
    code, modules = loaded(*args)
    assert code == 0
    assert heavy(modules) == set()
    assert "readline" not in modules
    assert back_ends(modules) == set()
    assert not any(name.startswith(("handctl.sim", "handctl.devices.inspire")) for name in modules)


def test_a_dump_of_barrett_loads_its_family_only() -> None:
    code, modules = loaded("barrett", "dump", "--fake", "--json")
    assert code == 0
    assert heavy(modules) == set()
    assert not {"socket", "readline"} & modules
    assert "handctl.sim.barrett.device" in modules
    assert not any(
        name.startswith(("handctl.sim.exo.device", "handctl.sim.wrist.device", "handctl.sim.engine.serve"))
        for name in modules
    )
    assert all(name.startswith("handctl.devices.barrett") for name in modules if name.startswith("handctl.devices."))
