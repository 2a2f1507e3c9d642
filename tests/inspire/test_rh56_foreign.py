"""The host of the RH56 hands against a public Modbus server that holds the golden hand: pymodbus, RTU and TCP.

Neither side was written with the other in mind. The other way round, public clients at our simulator, is
tests/sim/hand/test_served.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from handctl.devices.inspire.hand.detect_generation import ModelGate
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.link import ByteLink, open_link
from handctl.model.result import Journal
from tests.support import modbus_server
from tests.support.cli import run
from tests.support.each_row import each_row

pytestmark = pytest.mark.real

GOLDEN = {
    "default_speed": [701, 702, 703, 704, 705, 706],
    "default_force": [501, 502, 503, 504, 505, 506],
    "stroke_set": [111, 222, 333, 444, 555, 666],
    "angle_set": [-1] * 6,
    "force_limit": [401, 402, 403, 404, 405, 406],
    "speed_set": [601, 602, 603, 604, 605, 606],
    "stroke_actual": [211, 322, 433, 544, 655, 766],
    "angle_actual": [110, 220, 330, 440, 550, 660],
    "force_actual": [-11, 12, -13, 14, -15, 16],
    "current": [21, -22, 23, 24, 25, 26],
    "error": [0] * 6,
    "status": [2, 1, 2, 3, 2, 0],
    "temperature": [31, 32, 33, 34, 35, 36],
}
"""rh56 §10."""
F1_ANGLES = [1010, 1120, 1230, 1340, 1150, 1560]
SERVED = [("df", "rtu"), ("tp", "rtu"), ("tp", "tcp"), ("f1", "rtu")]


@contextmanager
def hand_on(model: str, wire: str) -> Iterator[Hand]:
    serve = modbus_server.over_tcp if wire == "tcp" else modbus_server.over_rtu
    with serve(model) as where:
        link = open_link(where)
        assert isinstance(link, ByteLink)
        gate = ModelGate(None, False)
        bus = ModbusBus(link, 1, Journal(), tcp=wire == "tcp", timeout=20.0, retries=0)
        bus.gate = gate
        try:
            yield Hand(bus, gate)
        finally:
            link.close()


@each_row(("model", "wire"), SERVED)
def test_a_public_server_shows_the_golden_hand(model: str, wire: str) -> None:
    with hand_on(model, wire) as hand:
        table = hand.dump()
        assert hand.found().model == model
        assert table.failure is None
        values: dict[str, list[object]] = {}
        for row in table.rows:
            values.setdefault(row["name"], []).append(row.get("value"))
    expected = {**GOLDEN, "id": [1], "baud_code": [0]}
    if model == "df":
        expected |= {"current_limit": [901, 902, 903, 904, 905, 906], "system_voltage": [558]}
    elif model == "tp":
        expected |= {"ip_address": [192, 168, 11, 210]}
    else:
        expected |= {"current_limit": [901, 902, 903, 904, 905, 906], "angle_actual": F1_ANGLES, "mode": [0]}
    found = {name: values[name] for name in expected}
    if model == "f1":
        found["mode"] = found["mode"][:1]
    assert found == expected


@each_row(("model", "wire"), [("df", "rtu"), ("tp", "tcp")])
def test_a_public_server_takes_a_setting(model: str, wire: str) -> None:
    with hand_on(model, wire) as hand:
        speeds = hand.map["default_speed"].each
        hand.write([(element, 300 + element.index) for element in speeds])
        assert [reading.value for reading in hand.read(speeds)] == [300, 301, 302, 303, 304, 305]
        assert [reading.value for reading in hand.read(hand.map["default_force"].each)] == GOLDEN["default_force"]


# -- the command line ---------------------------------------------------------------------------------------------------


@each_row(("model", "wire"), SERVED)
def test_the_commands_read_a_public_server(model: str, wire: str) -> None:
    serve = modbus_server.over_tcp if wire == "tcp" else modbus_server.over_rtu
    words = () if wire == "tcp" else ("--protocol", "modbus")
    with serve(model) as where:
        answer = run("hand", "dump", "-p", where, "--timeout", "20", *words, "--json")
    assert answer.code == 0, answer
    assert answer.json["device"]["model"] == model
    values: dict[str, list[object]] = {}
    for row in answer.rows:
        values.setdefault(row["name"], []).append(row["value"])
    expected = {**GOLDEN, **({"angle_actual": F1_ANGLES} if model == "f1" else {})}
    assert {name: values[name] for name in expected} == expected


def test_the_skin_of_a_public_server() -> None:
    with modbus_server.over_tcp("tp") as where:
        answer = run("hand", "tactile", "-p", where, "--json")
    assert answer.code == 0, answer
    assert [row["value"] for row in answer.rows] == list(range(1062))
    assert answer.json["counters"]["sent"] <= 17


def test_a_public_server_is_moved_after_a_yes() -> None:
    """pymodbus moves nothing: what was commanded stands there, what is measured stays as it was."""
    with modbus_server.over_tcp("tp") as where:
        unasked = run("hand", "set", "angle_set.index=300", "-p", where, "--json")
        assert (unasked.code, unasked.error["code"]) == (8, "not-confirmed")
        moved = run("hand", "set", "angle_set.index=300", "-p", where, "--yes", "--json")
        held = run("hand", "get", "angle_set", "angle_actual.index", "-p", where, "--format", "plain")
    assert moved.code == 0, moved
    assert held.out.split() == ["-1", "-1", "-1", "300", "-1", "-1", "440"]
