"""The wrist: angles with two decimals, the order of writes, the dump on both wires, and how it judges itself (wrist §2.1)."""

from __future__ import annotations

from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.command.get_set_watch import select
from handctl.devices.inspire.wrist.device import status_view
from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, NoAnswer, UsageError
from handctl.model.param import Element
from tests.inspire.wrist_support import (
    WIRES,
    ScriptedFrames,
    can,
    fake_port,
    fake_wrist,
    frames,
    sent_texts,
    wrist_on,
    writes_of,
)
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink, hexed, script, unhex

POWER_ON = {
    "pitch_actual": -3.45, "yaw_actual": 11.25, "current_1024": 111, "current_1026": 222, "error_1": 0, "error_2": 0,
    "temperature_1": 31, "temperature_2": 34, "yaw_set": 11.0, "pitch_set": -3.0, "move_time": 700,
}  # fmt: skip
ADDRESSES = dict(zip(POWER_ON, (1020, 1022, 1024, 1026, 1028, 1030, 1032, 1033, 1038, 1040, 1042), strict=True))
WHOLE = "A7 FE 65 04 6F 00 DE 00 00 00 00 00 1F 22 00 00 00 00 4C 04 D4 FE BC 02"
READ_WHOLE, WHOLE_REPLY = "EB 90 01 04 30 FC 03 18 4C", f"90 EB 01 1B 30 FC 03 {WHOLE} C7"
ASSUMED = "bit names assumed from the hand"


def changes(*texts: str) -> list[tuple[Element, float]]:
    return list(WRIST.assignments(texts))


# -- the map ----------------------------------------------------------------------------------------------------------


def test_addresses_are_those_of_the_manual() -> None:
    """wrist §2.1: actual angles pitch first, set angles yaw first, error bytes two apart."""
    assert {register.name: register.address for register in WRIST} == ADDRESSES
    assert [register.name for register in WRIST if register.size == 1] == [
        "error_1", "error_2", "temperature_1", "temperature_2",
    ]  # fmt: skip
    assert [register.name for register in WRIST if register.writable] == ["yaw_set", "pitch_set", "move_time"]
    assert WRIST["move_time"].signed is False


@each_row(
    ("name", "text", "raw", "value"),
    [
        ("pitch_set", "22.12", "A4 08", 22.12), ("pitch_set", "-22.66", "26 F7", -22.66),
        ("yaw_set", "25.50", "F6 09", 25.5), ("yaw_set", "-25.50", "0A F6", -25.5),
        ("yaw_set", "-0.01", "FF FF", -0.01), ("yaw_set", "0.01", "01 00", 0.01), ("yaw_set", "0", "00 00", 0.0),
        ("yaw_set", "11.25", "65 04", 11.25), ("pitch_set", "-10", "18 FC", -10.0), ("pitch_set", "10.03", "EB 03", 10.03),
        ("yaw_set", "+1.5", "96 00", 1.5), ("move_time", "1", "01 00", 1), ("move_time", "32767", "FF 7F", 32767),
        ("move_time", "1000", "E8 03", 1000),
    ],
)  # fmt: skip
def test_values_and_their_bytes(name: str, text: str, raw: str, value: float) -> None:
    register = WRIST[name]
    assert register.parse(text) == value
    assert hexed(register.encode(register.parse(text))) == raw
    assert register.decode(unhex(raw)) == value


@each_row(
    ("name", "text", "code"),
    [
        ("pitch_set", "22.13", "out-of-range"), ("pitch_set", "-22.67", "out-of-range"), ("pitch_set", "30", "out-of-range"),
        ("yaw_set", "25.51", "out-of-range"), ("yaw_set", "-25.51", "out-of-range"), ("yaw_set", "1000", "out-of-range"),
        ("move_time", "0", "out-of-range"), ("move_time", "32768", "out-of-range"), ("move_time", "-1", "out-of-range"),
        ("yaw_set", "1.001", "not-a-number"), ("yaw_set", "nan", "not-a-number"), ("yaw_set", "inf", "not-a-number"),
        ("yaw_set", "1_0", "not-a-number"), ("yaw_set", "", "not-a-number"), ("move_time", "1.5", "not-a-number"),
    ],
)  # fmt: skip
def test_what_is_refused(name: str, text: str, code: str) -> None:
    """Never clamped, never rounded."""
    with pytest.raises(UsageError) as caught:
        WRIST[name].parse(text, name)
    assert caught.value.code == code
    assert name in caught.value.text


@pytest.mark.parametrize("name", ["pitch_set", "yaw_set", "pitch_actual", "yaw_actual"])
def test_every_raw_angle_survives_text_and_bytes(name: str) -> None:
    register = WRIST[name]
    assert register.low is not None and register.high is not None
    for raw in range(round(register.low * 100), round(register.high * 100) + 1):
        data = raw.to_bytes(2, "little", signed=True)
        value = register.decode(data)
        text = register.text(value)
        whole, hundredths = divmod(abs(raw), 100)
        assert text == f"{'-' * (raw < 0)}{whole}.{hundredths:02d}"
        assert register.parse(text) == value
        assert register.encode(value) == data
    assert not register.allowed(register.decode((round(register.high * 100) + 1).to_bytes(2, "little")))


def test_ranges_are_those_of_the_manual() -> None:
    """wrist §1."""
    for axis, low, high in (("pitch", -22.66, 22.12), ("yaw", -25.5, 25.5)):
        for name in (f"{axis}_set", f"{axis}_actual"):
            assert (WRIST[name].low, WRIST[name].high, WRIST[name].unit) == (low, high, "°")


# -- reading ----------------------------------------------------------------------------------------------------------


def test_dump_is_one_serial_read() -> None:
    link = ScriptedLink(script((READ_WHOLE, [WHOLE_REPLY])))
    table = wrist_on(link).dump()
    assert {row["name"]: row["value"] for row in table.rows} == POWER_ON
    assert {row["name"]: row["address"] for row in table.rows} == ADDRESSES
    assert table.extra == {"blocks": [{"address": 1020, "raw": WHOLE}]}
    assert len(link.sent) == 1


def test_dump_is_three_can_reads_of_the_same_values() -> None:
    wrist, link = fake_wrist("can")
    rows = wrist.dump().rows
    assert len(link.sent) == 3
    assert [frame.can_id >> 14 for frame in link.sent] == [
        4 << 12 | 1020,
        4 << 12 | 1028,
        4 << 12 | link.sent[2].can_id >> 14 & 4095,
    ]  # type: ignore[union-attr]
    assert rows == fake_wrist("serial")[0].dump().rows
    assert {row["name"]: row["value"] for row in rows} == POWER_ON


@each_row("wire", WIRES)
def test_rows_have_the_keys_of_the_contract(wire: str) -> None:
    wrist, _ = fake_wrist(wire)
    rows = wrist.table(wrist.read(select(WRIST, ("yaw_actual", "current_1024", "error_1", "temperature_2")))).rows
    assert rows[0] == {
        "name": "yaw_actual", "finger": None, "address": 1022, "value": 11.25, "unit": "°", "raw": "65 04", "label": None,
        "path": "yaw_actual",
    }  # fmt: skip
    assert rows[1] == {
        "name": "current_1024", "finger": None, "address": 1024, "value": 111, "unit": "mA", "raw": "6F 00",
        "label": "actuator #2 by the register table, #1 by the CAN example", "path": "current_1024",
    }  # fmt: skip
    assert (rows[2]["value"], rows[2]["raw"], rows[2]["label"]) == (0, "00", "ok")
    assert (rows[3]["value"], rows[3]["unit"], rows[3]["label"]) == (34, "°C", "unit assumed")


@each_row("wire", WIRES)
def test_what_the_manual_leaves_open_stands_beside_the_address(wire: str) -> None:
    """Current #1 is 1026 by the table, 1024 by the CAN example (dossier W6)."""
    rows = {
        row["name"]: row
        for row in run("wrist", "get", "current_1024", "current_1026", "-p", fake_port(wire), "--json").rows
    }
    assert "#2 by the register table" in rows["current_1024"]["label"]
    assert "#1 by the CAN example" in rows["current_1024"]["label"]
    assert "#1 by the register table" in rows["current_1026"]["label"]
    text = run("wrist", "status", "-p", fake_port(wire)).out
    assert "#2 by the register table" in text
    assert "#1 by the register table" in text


def test_a_wrist_silent_across_gaps_is_read_register_by_register() -> None:
    wrist, _ = fake_wrist("serial", "fault=block-silent")
    assert {row["name"]: row["value"] for row in wrist.dump().rows} == POWER_ON
    assert [entry.code for entry in wrist.journal.messages] == ["block-silent"]


def test_silence_names_the_wrists_own_next_step() -> None:
    result = run("wrist", "dump", "-p", fake_port("serial", "fault=silent"), "--json")
    assert result.code == 4
    assert "exo" not in result.error["hint"]


# -- writing ----------------------------------------------------------------------------------------------------------

SETTINGS = {"yaw_set": "10", "pitch_set": "-10", "move_time": "1000"}
SUBSETS = [subset for size in (1, 2, 3) for subset in combinations(SETTINGS, size)]
PLANS = {
    ("yaw_set",): ["EB 90 01 05 31 0E 04 E8 03 34"],
    ("pitch_set",): ["EB 90 01 05 31 10 04 18 FC 5F"],
    ("move_time",): ["EB 90 01 05 31 12 04 E8 03 38"],
    ("yaw_set", "pitch_set"): ["EB 90 01 07 31 0E 04 E8 03 18 FC 4A"],
    ("yaw_set", "move_time"): ["EB 90 01 05 31 12 04 E8 03 38", "EB 90 01 05 31 0E 04 E8 03 34"],
    ("pitch_set", "move_time"): ["EB 90 01 07 31 10 04 18 FC E8 03 4C"],
    ("yaw_set", "pitch_set", "move_time"): ["EB 90 01 09 31 0E 04 E8 03 18 FC E8 03 37"],
}
CAN_PLANS = {
    ("yaw_set",): ["15038001 [2] E8 03"],
    ("pitch_set",): ["15040001 [2] 18 FC"],
    ("move_time",): ["15048001 [2] E8 03"],
    ("yaw_set", "pitch_set"): ["15038001 [4] E8 03 18 FC"],
    ("yaw_set", "move_time"): ["15048001 [2] E8 03", "15038001 [2] E8 03"],
    ("pitch_set", "move_time"): ["15040001 [4] 18 FC E8 03"],
    ("yaw_set", "pitch_set", "move_time"): ["15038001 [6] E8 03 18 FC E8 03"],
}


@each_row("subset", SUBSETS, ids="+".join)
@each_row("wire", WIRES)
def test_time_goes_with_or_before_the_angles(wire: str, subset: tuple[str, ...]) -> None:
    """dossier 4.16; the plan is what is sent, and a dry run prints it."""
    texts = [f"{name}={SETTINGS[name]}" for name in subset]
    expected = (PLANS if wire == "serial" else CAN_PLANS)[subset]
    wrist, link = fake_wrist(wire)
    steps = wrist.plan(changes(*texts))
    assert [step.wire for step in steps] == expected
    assert any(step.moves for step in steps) == (subset != ("move_time",))
    assert not any(step.strands for step in steps)
    readings = wrist.write(changes(*texts))
    assert writes_of(link) == expected
    assert {reading.element.param.name: reading.value for reading in readings} == {
        name: float(SETTINGS[name]) for name in subset
    }
    dry = run("wrist", "set", *texts, "--dry-run", "--json", "--fake", f"--{wire}")
    assert (dry.code, [row["bytes"] for row in dry.rows], dry.json["counters"]["sent"]) == (0, expected, 0)


@given(
    st.dictionaries(st.sampled_from(["yaw_set", "pitch_set"]), st.integers(-2266, 2212)),
    st.none() | st.integers(1, 32767),
    st.sampled_from(WIRES),
    st.randoms(),
)
def test_never_eight_bytes_never_a_gap_time_first(
    angles: dict[str, int], time: int | None, wire: str, shuffle: object
) -> None:
    texts = [f"{name}={raw / 100:.2f}" for name, raw in angles.items()] + ([f"move_time={time}"] if time else [])
    shuffle.shuffle(texts)  # type: ignore[attr-defined]
    wrist = wrist_on(ScriptedLink() if wire == "serial" else ScriptedFrames())
    written: dict[int, int] = {}
    for step in wrist.plan(changes(*texts)):
        address, data = (
            (int.from_bytes(step.data[5:7], "little"), step.data[7:-1])
            if step.can_id is None
            else (step.can_id >> 14 & 0xFFF, step.data)
        )
        flag = step.data[4] if step.can_id is None else step.can_id >> 26
        assert flag == (0x31 if wire == "serial" else 5)
        assert len(data) in (2, 4, 6)
        assert address >= 1038 and address + len(data) <= 1044
        for offset in range(0, len(data), 2):
            written[address + offset] = int.from_bytes(data[offset : offset + 2], "little", signed=True)
    wanted = {ADDRESSES[name]: raw for name, raw in angles.items()} | ({1042: time} if time else {})
    assert written == wanted
    order = list(written)
    if time and "yaw_set" in angles and "pitch_set" not in angles:
        assert order.index(1042) < order.index(1038)


def test_a_write_that_did_not_take_is_a_failed_check() -> None:
    wrist = wrist_on(
        ScriptedFrames(frames(("15038001 [2] E8 03", ["15038001 [0]"]), ("11038001 [1] 02", ["11038001 [2] 4C 04"])))
    )
    with pytest.raises(CheckFailed) as caught:
        wrist.write(changes("yaw_set=10"))
    assert (caught.value.code, caught.value.exit_code) == ("read-back", 7)
    assert "11.0" in caught.value.text and "10.0" in caught.value.text


@each_row(("wire", "query"), [("serial", "fault=refuse"), ("can", "fault=refuse&ack-dlc=1")])
def test_a_refused_write_is_exit_6(wire: str, query: str) -> None:
    wrist, link = fake_wrist(wire, query)
    with pytest.raises(DeviceRefused):
        wrist.write(changes("yaw_set=10", "move_time=900"))
    assert len(writes_of(link)) == 1


@each_row("wire", WIRES)
def test_a_lost_acknowledgement_is_read_back_not_repeated(wire: str) -> None:
    wrist, link = fake_wrist(wire, "fault=silent&every=3")
    wrist.bus.read(1020, 2)
    wrist.bus.read(1020, 2)
    readings = wrist.write(changes("yaw_set=10"))
    assert [reading.value for reading in readings] == [10.0]
    assert len(writes_of(link)) == 1
    assert [entry.code for entry in wrist.journal.messages] == ["ack-lost"]


@each_row(("time", "warned"), [(99, True), (100, False), (5000, False), (5001, True), (1, True)])
def test_an_unusual_time_is_remarked(time: int, warned: bool) -> None:
    wrist, _ = fake_wrist()
    wrist.write(changes(f"move_time={time}"))
    assert [entry.code for entry in wrist.journal.messages] == ["move-time"] * warned


# -- status -----------------------------------------------------------------------------------------------------------


@each_row("wire", WIRES)
@each_row(
    ("query", "findings"),
    [
        ("", []),
        ("fault=faults", ["error_1: locked_rotor", "error_2: over_current"]),
        ("fault=over-temperature", ["error_2: over_temperature"]),
        ("fault=unknown-bits", ["error_2: unknown_bit_5, unknown_bit_7"]),
        ("fault=foreign", ["pitch_actual = 30.00 ", "yaw_actual = 30.01 "]),
    ],
)
def test_findings(wire: str, query: str, findings: list[str]) -> None:
    wrist, _ = fake_wrist(wire, query)
    table = wrist.status(True)
    told = [entry.text for entry in wrist.journal.messages if entry.code == "unhealthy"]
    assert len(told) == len(findings)
    for text, start in zip(told, findings, strict=True):
        assert text.startswith(start)
    assert (table.failure is not None) == bool(findings)
    if table.failure is not None:
        assert (table.failure.code, table.failure.exit_code) == ("unhealthy", 7)
    assert wrist.status(False).failure is None


def test_a_movement_time_outside_this_tools_range_is_not_unhealthy() -> None:
    """The manual gives no range (wrist §2.1): 0 may be what a wrist wakes up with."""
    wrist, link = fake_wrist()
    link.inner._line.command("set 1042 0000")  # type: ignore[attr-defined]
    table = wrist.status(True)
    assert (table.failure, wrist.journal.messages) == (None, [])
    assert next(row["value"] for row in table.rows if row["name"] == "move_time") == 0


def test_error_bits_are_said_to_be_assumed() -> None:
    wrist, _ = fake_wrist("serial", "fault=faults")
    rows = {row["name"]: row["label"] for row in wrist.dump().rows}
    assert rows["error_1"] == f"locked_rotor ({ASSUMED})"
    assert rows["error_2"] == f"over_current ({ASSUMED})"


def test_out_of_range_angles_are_named_with_their_section() -> None:
    """The ranges are those of wrist §1."""
    wrist, _ = fake_wrist("serial", "fault=foreign")
    wrist.status(True)
    text = " ".join(entry.text for entry in wrist.journal.messages)
    assert "-22.66..22.12" in text
    assert "wrist §1" in text


def test_status_shows_axes_actuators_and_currents() -> None:
    wrist, _ = fake_wrist("serial", "fault=faults")
    axes, actuators, currents = status_view(wrist.status(False).rows)
    assert axes.lines == (("pitch", "-3.45", "-3.00"), ("yaw", "11.25", "11.00"))
    assert "700 ms" in axes.notes[0]
    assert [line[0] for line in actuators.lines] == ["#1", "#2"]
    assert [line[:2] for line in currents.lines] == [("current_1024", "111"), ("current_1026", "222")]


def test_status_with_unread_registers_shows_question_marks() -> None:
    def answer(frame: object) -> list[tuple[float, object]]:
        if str(frame) == "10FF0001 [1] 08":
            return [(0.0, can("10FF0001 [8] A7 FE 65 04 6F 00 DE 00"))]
        return []  # to the same question in parts, too: whether the rest is there is not known

    wrist = wrist_on(ScriptedFrames(answer), retries=0)  # type: ignore[arg-type]
    table = wrist.status(True)
    assert isinstance(table.failure, NoAnswer)
    assert [row["name"] for row in table.rows if "error" in row] == [
        "error_1", "error_2", "temperature_1", "temperature_2", "yaw_set", "pitch_set", "move_time",
    ]  # fmt: skip
    assert "not-on-this-firmware" not in [entry.code for entry in wrist.journal.messages]
    assert status_view(table.rows)[0].lines[0][1] == "-3.45"


def test_identity_says_only_what_the_manual_has() -> None:
    assert fake_wrist("can", "id=300", 300)[0].identity() == {"kind": "wrist", "id": 300}


@each_row("wire", WIRES)
def test_no_command_of_the_map_uses_the_hands_flags(wire: str) -> None:
    """11/12 (CAN 0/1) at these addresses are current limits and power-on speeds (dossier X2)."""
    wrist, link = fake_wrist(wire)
    wrist.dump()
    wrist.status(True)
    wrist.write(changes("yaw_set=1", "pitch_set=1", "move_time=100"))
    flags = {text.split()[4] if wire == "serial" else int(text[:8], 16) >> 26 for text in sent_texts(link)}
    assert flags == ({"30", "31"} if wire == "serial" else {4, 5})


@given(st.binary(max_size=80))
def test_any_bytes_end_in_values_or_an_error(noise: bytes) -> None:
    wrist = wrist_on(ScriptedLink(lambda request: [(0.001, noise)]), retries=0, timeout=0.05)
    try:
        wrist.dump()
    except HandctlError as exc:
        assert exc.exit_code in (4, 5)
