"""The tables of `tests/contract/facts/outcomes`: every fault of every simulator is in them, and no other."""

from __future__ import annotations

import pytest

from handctl.families import FAMILIES
from handctl.sim import model_class
from handctl.sim.barrett import boot_monitor, realtime_loop
from handctl.sim.engine.can_line import CAN_FAULTS
from handctl.sim.engine.line_and_faults import LINE_FAULTS
from handctl.sim.hand.registers import MODBUS_FAULTS, SERIAL_FAULTS, TCP_FAULTS
from tests.contract.facts.outcomes import outcomes_of

OF_WIRE = {
    "eb90": SERIAL_FAULTS,
    "rtu": {**MODBUS_FAULTS, **SERIAL_FAULTS},
    "tcp": {**MODBUS_FAULTS, **TCP_FAULTS},
}
"""Faults of the RH56 hands that are of one wire."""
OTHERS = {"barrett": {*realtime_loop.FAULTS, *boot_monitor.FAULTS}}
"""Faults that only meet commands with tests of their own: `realtime` and the firmware's."""


@pytest.mark.parametrize("family", FAMILIES)
def test_every_fault_of_the_simulator_is_there(family: str) -> None:
    for wire, own in outcomes_of(family).wires.items():
        line = CAN_FAULTS if "bus=can" in own.options else LINE_FAULTS
        of_wire = OF_WIRE.get(wire, {}) if family == "hand" else {}
        every = {"healthy", *line, *model_class(family).FAULTS, *of_wire}
        told = {*own.line, *own.device}
        assert told - every == set() == every - told - elsewhere(family, wire) - OTHERS.get(family, set()), (
            wire,
            told ^ every,
        )


def elsewhere(family: str, wire: str) -> set[str]:
    """Faults that the simulator of the family has on its other wires."""
    return {fault for at, own in outcomes_of(family).wires.items() if at != wire for fault in own.device}


@pytest.mark.parametrize("family", FAMILIES)
def test_a_table_names_commands_that_are_there(family: str) -> None:
    table = outcomes_of(family)
    names = {row.name for row in table.rows}
    for wire, own in table.wires.items():
        for fault, codes in own.device.items():
            assert set(codes) <= names, (wire, fault)
    for _, fault, name in table.exceptions:
        assert name in names and any(fault in {*own.line, *own.device} for own in table.wires.values()), (fault, name)
    assert all(not name or name in names for _, name in table.untold)
