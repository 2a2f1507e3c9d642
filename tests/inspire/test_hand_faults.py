"""Every fault of the simulator times commands of the RH56 hands on each wire: the right value or the right exit code.

Never a wrong value, a traceback or a hang; on virtual time. The codes are in `hand_faults`.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.sim.engine.canline import CAN_FAULTS
from handctl.sim.engine.line import LINE_FAULTS
from handctl.sim.hand.options import FAULTS, MODBUS_FAULTS, SERIAL_FAULTS, TCP_FAULTS
from tests.inspire import hand_faults as table
from tests.inspire.hand_faults import COMMANDS, WIRES, Cell, allowed

pytestmark = pytest.mark.faults

VARIANTS: dict[str, dict[str, int]] = {
    "always": {},
    "after-1": {"after": 1},
    "after-3": {"after": 3},
    "every-2": {"every": 2},
}
CELLS = [(wire, fault) for wire in WIRES for fault in [*table.LINE_FAULTS[wire], *table.device_faults(wire)]]
LONG = ("dump", "watch", "set", "angle", "save")


def test_every_fault_of_the_simulator_is_in_the_tables() -> None:
    for wire in WIRES:
        known = {"healthy", *(CAN_FAULTS if wire == "can" else LINE_FAULTS)}
        assert known == set(table.LINE_FAULTS[wire])
        own = {
            "eb90": SERIAL_FAULTS,
            "rtu": {**MODBUS_FAULTS, **SERIAL_FAULTS},
            "tcp": {**MODBUS_FAULTS, **TCP_FAULTS},
            "can": {},
        }
        assert {*FAULTS, *own[wire]} == set(table.device_faults(wire))


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
@pytest.mark.parametrize(("wire", "fault"), CELLS)
def test_fault(tmp_path: Path, wire: str, fault: str, command: table.Command) -> None:
    """States of the device do not count requests: they are there always."""
    for variant, options in VARIANTS.items():
        if variant == "always" or fault in table.LINE_FAULTS[wire]:
            cell = Cell(tmp_path, wire, command, fault, "--timeout", "1", **options)
            cell.holds(allowed(wire, fault, command, variant))


@pytest.mark.parametrize(("wire", "fault"), [(wire, fault) for wire in WIRES for fault in table.LINE_FAULTS[wire]])
def test_deadline_bounds_the_whole_command(tmp_path: Path, wire: str, fault: str) -> None:
    """--deadline counts for all that a command does: retries, fallbacks, the questions between, the wait for the arrival."""
    for command in (command for command in COMMANDS if command.name in LONG):
        cell = Cell(tmp_path, wire, command, fault, "--deadline", "0.25", "--timeout", "1")
        cell.sound()
        assert cell.spy.now <= 0.27, (cell.spy.now, cell)
        assert cell.result.code in allowed(wire, fault, command, "after-1") | {4, 5, 7}, cell


@pytest.mark.parametrize("model", ["df", "f1", "dg2"])
@pytest.mark.parametrize("fault", ["healthy", "silent", "truncate", "late", "every-2"])
@pytest.mark.parametrize("wire", ["eb90", "rtu"])
def test_other_generations(tmp_path: Path, wire: str, fault: str, model: str) -> None:
    """What is not certain is not written to, on a bad line neither."""
    partly = {"every": 2} if fault == "every-2" else {}
    for name in ("status", "dump", "set"):
        cell = Cell(
            tmp_path, wire, table.BY_NAME[name], "silent" if partly else fault, "--timeout", "1", model=model, **partly
        )
        cell.sound()
        if model != "df":
            assert cell.before == cell.after or name != "set", cell
            assert not (name == "set" and cell.result.code == 0), cell
