"""What the start of a wrist command loads: CAN only where it is used."""

from __future__ import annotations

import pytest

from tests.support.each_row import each_row
from tests.support.loading import back_ends, heavy, loaded

pytestmark = pytest.mark.real


@each_row("wire", ["--serial", "--can"])
def test_a_wrist_from_the_simulator_loads_neither_python_can_nor_pyserial(wire: str) -> None:
    code, modules = loaded("wrist", "dump", "--fake", wire, "--json")
    assert code == 0
    assert heavy(modules) == set()
    assert "socket" not in modules
    assert ("handctl.sim.engine.can_line" in modules) == (wire == "--can")
    assert ("handctl.devices.inspire.can_bus" in modules) == (wire == "--can")
    assert "handctl.link.can" not in modules
    assert not {"handctl.sim.engine.slcan", "handctl.sim.engine.serve", "handctl.sim.exo.device"} & modules


def test_wrist_help_loads_no_link_and_no_simulator() -> None:
    code, modules = loaded("wrist", "-h")
    assert code == 0
    assert heavy(modules) == set()
    assert back_ends(modules) == set()
    assert not any(name.startswith(("handctl.sim", "handctl.tools")) for name in modules)


def test_a_can_bus_loads_python_can_and_no_simulator() -> None:
    code, modules = loaded("wrist", "dump", "-p", "can:socketcan:nocan9", "--json")
    assert code == 3
    assert "can" in modules
    assert "handctl.sim" not in modules
