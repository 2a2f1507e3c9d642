"""Contact with a device that is not the one in the books: frames of another form, a register less, shorter reads."""

from __future__ import annotations

from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from handctl.devices.inspire import eb90
from handctl.devices.inspire.can_bus import CanBus
from handctl.devices.inspire.exo.probe import TARGET as EXO
from handctl.devices.inspire.hand.probe import TARGET as HAND
from handctl.devices.inspire.id_baud_save_reset import probe
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.devices.inspire.register_bus import RegisterBus
from handctl.devices.inspire.scan import sweep
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.devices.inspire.wrist.probe import TARGET as WRIST
from handctl.link import CanFrame, FrameLink, open_link
from handctl.model.result import Journal
from handctl.model.scan_task import ScanTask
from handctl.tools import stop
from tests.contract.cell import tried, wrote
from tests.contract.commands import scratch_of
from tests.inspire.wrist_support import ScriptedFrames
from tests.search.contact_worlds import EB90, RTU, Change, reads_only
from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.odd_devices import odd_registers
from tests.support.scripted import ScriptedLink

STATES = (1606, 18)


def asked(family: str, *words: str, **options: str) -> Result:
    link = "&".join([f"fake://{family}?clock=virtual", *(f"{name}={value}" for name, value in options.items())])
    return run(family, *words, "-p", link, "--json")


@each_row("name", ["length with the sum", "flag with bit 7", "sum inverted", "address left out", "id 0"])
@each_row("family", ["exo", "wrist"])
def test_replies_of_another_form_are_contact_and_no_value(family: str, name: str) -> None:
    with odd_registers(every=reads_only(EB90[name])):
        result = asked(family, "status")
    assert result.code == 5, result
    assert "other-form" in result.codes()
    assert not result.rows


@each_row("fault", ["bad-checksum", "cut-short", "noise", "loopback", "wrong-id"])
def test_a_disturbed_line_is_no_other_form(fault: str) -> None:
    result = asked("exo", "status", fault=fault)
    assert "other-form" not in result.codes(), result


def test_one_reply_of_another_form_is_the_line() -> None:
    """The next question is answered as it should be: then the first was damaged by chance."""
    change, count = reads_only(EB90["sum inverted"]), iter(range(3))

    def at_first(data: bytes) -> bytes:
        return change(data) if next(count, None) is not None else data

    with odd_registers(every=at_first):
        result = asked("exo", "get", "system_voltage")
    assert result.code == 5, result
    assert "bad-checksum" in result.codes()


@pytest.mark.parametrize("change", RTU.values(), ids=RTU)
def test_modbus_replies_of_another_form(change: Change) -> None:
    with odd_registers(every=change):
        result = asked("hand", "status", speaks="modbus")
    assert result.code == 5, result
    assert "other-form" in result.codes()


@pytest.mark.parametrize("most", [2, 4, 8, 10, 16, 64])
def test_a_device_that_answers_shorter_reads_only(most: int) -> None:
    """Groups, and their elements where these are too long, are read one by one: the values are the same."""
    usual = asked("exo", "status").values
    for short in (False, True):
        with odd_registers(most=most, short=short):
            result = asked("exo", "status")
        assert (result.code, result.values) == (0, usual), result
        assert "not-on-this-firmware" not in result.codes()


@each_row(
    ("family", "span", "name", "options"),
    [
        ("exo", (1594, 10), "current", {}),
        ("exo", (1000, 1), "id", {}),
        ("exo", (1472, 2), "system_voltage", {}),
        ("wrist", (1024, 2), "current_1024", {}),
        ("wrist", (1038, 2), "yaw_set", {"bus": "can"}),
        ("hand", STATES, "error", {}),
        ("hand", (1594, 12), "current", {"speaks": "modbus"}),
        ("hand", (1606, 6), "error", {"bus": "modbus-tcp", "model": "tp"}),
        ("hand", (1618, 6), "temperature", {"bus": "can"}),
    ],
)
@pytest.mark.parametrize("verb", ["status", "dump"])
def test_a_register_that_is_not_there_is_left_out(
    verb: str, family: str, span: tuple[int, int], name: str, options: dict[str, str]
) -> None:
    usual = asked(family, verb, **options).values
    with odd_registers(without=(span,)):
        result = asked(family, verb, **options)
    assert result.code == 0, result
    assert "not-on-this-firmware" in result.codes()
    assert set(usual) - set(result.values)
    assert not {row["name"] for row in result.rows} & {name}
    assert not [row for row in result.rows if "error" in row]


@each_row(
    ("family", "span", "options"),
    [
        ("exo", (1606, 5), {}),
        ("exo", (1618, 5), {}),
        ("hand", STATES, {}),
        ("hand", (1606, 6), {"bus": "modbus-tcp", "model": "tp"}),
        ("hand", (1612, 6), {"speaks": "modbus"}),
        ("hand", (1618, 6), {"bus": "can"}),
    ],
)
def test_what_does_not_report_its_health_is_not_healthy(
    family: str, span: tuple[int, int], options: dict[str, str]
) -> None:
    with odd_registers(without=(span,)):
        result = asked(family, "status", "--check", **options)
    assert (result.code, result.error["code"]) == (7, "unhealthy"), result


def test_a_hand_that_shows_itself_in_part_is_read_and_not_written_to(tmp_path: Path) -> None:
    scratch_of(tmp_path)
    with odd_registers(without=((1606, 6),)):
        assert asked("hand", "status").code == 0
        result, _, envelope, passed = tried("hand", "set", tmp_path)
    assert result.code == 6
    assert "in-part" in {message["code"] for message in envelope["messages"]}
    assert not wrote("hand", "set", passed)


@each_row(
    ("lacks", "options", "code"),
    [
        ((1472, 2), {}, 0),
        ((1546, 12), {}, 0),
        ((1472, 2), {"speaks": "modbus"}, 0),
        ((1472, 2), {"bus": "can"}, 0),
        ((1472, 76), {"speaks": "modbus"}, 0),
        ((1472, 76), {"bus": "modbus-tcp"}, 0),
        ((1472, 86), {"bus": "can"}, 4),
    ],
)
def test_a_hand_that_replies_to_any_first_question_is_asked_on(
    lacks: tuple[int, int], options: dict[str, str], code: int
) -> None:
    """It lacks the states, which show what it is, and one first question or both: an exception is a reply, too.

    Where none of the three has a reply of any kind, nobody is there.
    """
    with odd_registers(without=((1606, 6), lacks)):
        assert asked("hand", "get", "force_actual", **options).code == code


def test_a_wrist_is_one_whichever_of_its_currents_it_has(tmp_path: Path) -> None:
    for span in ((1024, 2), (1026, 2)):
        with odd_registers(without=(span,)):
            assert tried("wrist", "move", tmp_path)[0].code == 0


def test_silence_to_one_register_by_name_stays_silence() -> None:
    with odd_registers(without=((1594, 10),)):
        assert asked("exo", "get", "current").code == 4
        result = asked("exo", "get", "current", "system_voltage")
    assert (result.code, "no-answer" in result.codes()) == (4, True)


at_every_read = partial(odd_registers, without=((0, 65536),))


def test_a_device_that_answers_nothing_is_silent() -> None:
    for family, options in (("exo", {}), ("wrist", {}), ("hand", {"speaks": "eb90"})):
        with at_every_read():
            assert asked(family, "status", **options).code == 4


# -- who is there, whatever it lacks ----------------------------------------------------------------------------------

MOST_2 = {"most": 2, "short": True}


@each_row(
    ("family", "how", "options"),
    [
        ("exo", {"without": ((1546, 12),)}, {}),
        ("exo", {"without": ((1546, 12),), "short": True}, {}),
        ("exo", {"most": 2}, {}),
        ("exo", MOST_2, {}),
        ("wrist", {"without": ((1020, 2),)}, {}),
        ("wrist", {"without": ((1022, 2),)}, {}),
        ("wrist", MOST_2, {}),
        ("wrist", {"without": ((1022, 2),)}, {"bus": "can"}),
        ("hand", {"without": ((1546, 12),)}, {}),
        ("hand", MOST_2, {}),
        ("hand", {"most": 2}, {"bus": "can"}),
        ("hand", MOST_2, {"bus": "can"}),
        ("hand", {"without": ((1548, 2),)}, {"bus": "can"}),
    ],
)
def test_a_scan_finds_whoever_answers_two_questions(family: str, how: dict[str, Any], options: dict[str, str]) -> None:
    """The register that confirms a hit may be missing, or be answered in part: then another one confirms it."""
    with odd_registers(**how):
        result = asked(family, "scan", "--ids", "1-3", **options)
    assert (result.code, [(row["family"], row["id"]) for row in result.rows]) == (0, [(family, 1)]), result
    assert not {"unconfirmed", "wrong-id", "cut-short"} & set(result.codes())


@each_row(
    ("family", "without", "options"),
    [
        ("exo", 1472, {}),
        ("wrist", 1024, {}),
        ("wrist", 1020, {"bus": "can"}),
        ("hand", 1472, {}),
        ("hand", 1546, {"bus": "can"}),
        ("hand", 1546, {"speaks": "modbus"}),
        ("hand", 1472, {"bus": "modbus-tcp", "model": "tp"}),
    ],
)
def test_a_device_without_the_register_that_is_asked_first_is_found(
    family: str, without: int, options: dict[str, str]
) -> None:
    """Another harmless question is asked as well, and a refusal is an answer: contact is evident."""
    size = 12 if options == {"bus": "can"} and family == "hand" else 2  # there a part of it would confirm a hit
    with odd_registers(without=((without, size),)):
        result = asked(family, "scan", **options)
    assert (result.code, [(row["family"], row["id"]) for row in result.rows]) == (0, [(family, 1)]), result


@each_row("wire", ["eb90", "flag 30", "can", "rtu", "tcp"])
def test_an_id_is_taken_by_whoever_answers_anything(wire: str) -> None:
    """A device that lacks the register of one question answers, or refuses, another: two would share the id else."""
    family = "wrist" if wire == "flag 30" else "hand"
    query = {"can": "bus=can", "rtu": "speaks=modbus", "tcp": "bus=modbus-tcp&model=tp"}.get(wire, "")
    with closing(open_link(f"fake://{family}?clock=virtual&{query}")) as link:
        bus: RegisterBus
        if isinstance(link, FrameLink):
            bus = CanBus(link, 1, Journal(), family=family)
        elif wire in ("rtu", "tcp"):
            bus = ModbusBus(link, 1, Journal(), tcp=wire == "tcp")
        else:
            bus = SerialBus(link, 1, Journal(), family=family)
        refuses = wire in ("rtu", "tcp")  # and so may lack them all
        with odd_registers(without=bus.first_questions if refuses else (bus.presence,)):
            assert probe(bus, 1)
            assert wire == "tcp" or not probe(bus, 2)


def test_an_exo_without_a_register_is_no_silence() -> None:
    """What may erase settings on another hand is refused, by what is missing."""
    with odd_registers(without=((1546, 2),)):
        kept = asked("exo", "save", "-y")
    assert (kept.code, "in-part" in kept.codes()) == (6, True)
    assert not [step for step in kept.json["writes"] if step["state"] != "not-sent"]


@each_row(("family", "wire"), [("exo", "serial"), ("wrist", "serial"), ("wrist", "can"), ("hand", "can")])
def test_an_answer_that_comes_again_confirms_nothing(family: str, wire: str) -> None:
    """The same frame again and again is late, or somebody's else: one register alone shows no device."""
    first = {"exo": (1472, 2), "wrist": (1020, 2) if wire == "can" else (1024, 2), "hand": (1546, 2)}[family]
    link: ScriptedFrames | ScriptedLink
    if wire == "can":
        flag = 4 if family == "wrist" else 0
        ours = flag << 26 | first[0] << 14 | 1
        repeated = [(0.001 + 0.06 * number, CanFrame(ours, b"\xa7\x02")) for number in range(20)]
        link = ScriptedFrames(lambda frame: repeated if frame.can_id == ours else [])
    else:
        question = eb90.read_request(1, *first, eb90.WRIST_READ if family == "wrist" else eb90.READ)
        answer = eb90.Frame(eb90.DEVICE, 1, question[4], question[5:7] + b"\xa7\x02").encode()
        late = [(0.002 + 0.06 * number, answer) for number in range(80)]
        link = ScriptedLink(lambda data: late if question in data else [], baud=115200)
    target = {"exo": EXO, "wrist": WRIST, "hand": HAND}[family]
    task, journal = ScanTask(ids=[1, 2], find_all=True, baud=115200), Journal()
    sweep(link, journal, None, task, [target])
    assert not task.rows
    assert task.failure is not None and "unconfirmed" in {message.code for message in journal.messages}


def test_what_the_line_is_shows_without_the_register_that_is_asked_first() -> None:
    with odd_registers(without=((1546, 12),)):
        assert asked("exo", "doctor").json["line"]["half_duplex"] is False
        assert "wrong-speed" in asked("exo", "get", "system_voltage", baud="57600").codes()


@pytest.mark.parametrize("most", [2, 4])
def test_a_hand_on_can_that_answers_in_part_is_contact(most: int, tmp_path: Path) -> None:
    """As on the other wires: it is there, which one it is stays open, and whoever knows reads every value."""
    usual = asked("hand", "get", "angle_actual", bus="can").values
    scratch_of(tmp_path)
    with odd_registers(most=most, short=True):
        status = asked("hand", "status", bus="can")
        known = asked("hand", "get", "angle_actual", "--model", "tp", bus="can")
        result, _, _, passed = tried("hand", "set", tmp_path, options=("bus=can",))
    assert (status.code, result.code) == (5, 5)
    assert "not-shown" in status.codes() and not status.rows
    assert (known.code, known.values) == (0, usual)
    assert not wrote("hand", "set", passed)


def test_a_snapshot_of_a_hand_without_the_first_of_its_settings(tmp_path: Path) -> None:
    """Nothing else was read by then: what follows shows that it is missing, not that nobody is there."""
    with odd_registers(without=((1032, 12),)):
        result = asked("hand", "snapshot", str(tmp_path / "file.json"), bus="can")
        assert asked("hand", "get", "default_speed", "default_force", bus="can").code == 4
    assert (result.code, "not-on-this-firmware" in result.codes()) == (0, True)
    assert result.rows and not [row for row in result.rows if row["name"].startswith("default_speed")]


@pytest.mark.parametrize("family", ["exo", "hand"])
def test_a_search_of_all_families_guesses_none(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bytes at a time show that somebody is there, and not who."""
    monkeypatch.setattr(stop, "SECONDS", 60.0)
    name = f"fake://{family}?clock=virtual"
    with odd_registers(**MOST_2):
        result, doctor = run("scan", "-p", name, "--json"), run("doctor", "-p", name, "--json")
        with closing(open_link(name)) as link:
            assert stop._asked(link, "serial", None, Journal()) is None
    assert (result.code, [row["family"] for row in result.rows]) == (6, [None])
    (device,) = [row for row in doctor.rows if row["check"] == "device"]
    assert (doctor.code, device["status"]) == (7, "warning")
    with odd_registers(without=((1546, 12),)):
        assert [row["family"] for row in run("scan", "-p", name, "--json").rows] == [family]
