"""The layers of the wrist: what it shares with the exo hand knows neither, and CAN is loaded only where it is used."""

from __future__ import annotations

import pytest

from tests.test_layers import OURS, TREES, Import, allowed, heavy, loaded


def test_the_walk_sees_the_wrist() -> None:
    inspire = ("device", "scanner", "scan_report", "canreg", "canbus", "wrist", "wrist_cli", "wrist_raw", "wrist_scan")
    assert {"link.can", *(f"devices.inspire.{name}" for name in inspire)} <= TREES.keys()
    assert Import("devices.inspire.canbus", "link", False) in OURS


def test_rules_for_can_can_be_broken() -> None:
    for module, target in [
        ("devices.inspire.canreg", "link"), ("devices.inspire.canreg", "devices.inspire.registers"), ("link.can", "sim"),
        ("devices.inspire.canbus", "sim.wrist_can"), ("sim.wrist_can", "devices.inspire.canreg"),
    ]:  # fmt: skip
        assert not allowed(Import(module, target, False)), f"{module} -> {target}"
    for module, target in [
        ("devices.inspire.canbus", "link"), ("devices.inspire.wrist_scan", "devices.inspire.scan_report"), ("link.can", "link"),
    ]:  # fmt: skip
        assert allowed(Import(module, target, False)), f"{module} -> {target}"


def test_the_shared_modules_know_no_device() -> None:
    """What the exo hand and the wrist have in common imports neither."""
    shared = ("device", "scanner", "scan_report", "canreg", "canbus", "bus", "blocks", "eb90", "registers")
    for found in OURS:
        if found.module.removeprefix("devices.inspire.") in shared:
            assert not found.target.startswith(("devices.inspire.exo", "devices.inspire.wrist")), found
    wrist = {found.target for found in OURS if found.module == "devices.inspire.wrist"}
    assert not any(target.startswith("devices.inspire.exo") for target in wrist)


@pytest.mark.parametrize("wire", ["--serial", "--can"])
def test_a_wrist_from_the_simulator_loads_neither_python_can_nor_pyserial(wire: str) -> None:
    code, modules = loaded("wrist", "dump", "--fake", wire, "--json")
    assert code == 0
    assert heavy(modules) == set()
    assert "socket" not in modules
    assert ("handctl.sim.canline" in modules) == (wire == "--can")
    assert ("handctl.devices.inspire.canbus" in modules) == (wire == "--can")
    assert "handctl.link.can" not in modules
    assert not {"handctl.sim.slcan", "handctl.sim.serve", "handctl.sim.exo"} & modules


def test_wrist_help_loads_no_link_and_no_simulator() -> None:
    code, modules = loaded("wrist", "-h")
    assert code == 0
    assert heavy(modules) == set()
    assert not any(name.startswith(("handctl.sim", "handctl.link.", "handctl.tools")) for name in modules)


def test_a_can_bus_loads_python_can_and_no_simulator() -> None:
    code, modules = loaded("wrist", "dump", "-p", "can:socketcan:nocan9", "--json")
    assert code == 3
    assert "can" in modules
    assert "handctl.sim" not in modules
