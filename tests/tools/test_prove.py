"""`handctl prove`: changed simulators are found fact by fact, and facts set the switches. Odd lines: tests/search/prove.py."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from handctl.command.family import load
from handctl.devices.ekso.audit_log import default_path
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.families import FAMILIES
from handctl.link.fake import FakeLink
from handctl.model.proofs import LEVELS, READ
from handctl.sim.aidin.device import Device as AidinSimulator
from handctl.sim.engine.facts_file import Twin
from tests.search.prove import CHANGED, STAYS, STOP, WRITES, healthy, prove, shown, state_of
from tests.support.bus_file import text
from tests.support.cli import run, spying
from tests.support.each_row import each_row
from tests.support.person import person, pressed_at


@each_row("family,said,fact,value,words", CHANGED)
def test_a_change_of_the_simulator_is_found(
    family: str, said: str, fact: str, value: object, words: tuple[str, ...], tmp_path: Path
) -> None:
    """And a simulator with this fact shows it too; with all of its facts is a matter of the search."""
    path, only = tmp_path / "facts.json", words if "--only" in words else (*words, "--only", fact)
    assert facts(family, said, path, *only)["facts"][fact]["value"] == value
    assert healthy(family).get(fact) != value, "the simulator shows that without the option as well"
    twin = shown(prove(family, f"{state_of(said)}&facts={path}".lstrip("&"), *only))[fact]
    assert twin == value or fact == "reply-time", "what is measured is measured anew"


def test_a_second_master_gives_no_false_fact(tmp_path: Path) -> None:
    path, logger = tmp_path / "bus.toml", {"ask": "EB 90 01 04 11 E8 03 01 02", "every_ms": 37}
    path.write_text(text("half-duplex", [{"kind": "exo", "id": 1}], [logger]))
    result = run("prove", "exo", "-p", f"fake://bus?file={path}&clock=virtual", "--json")
    found = shown(result)
    assert {
        fact: value for fact, value in found.items() if fact != "reply-time" and value != healthy("exo")[fact]
    } == {}


def test_silence_at_the_start_is_the_error_of_every_command() -> None:
    assert {family: prove(family, "fault=silent").code for family in FAMILIES} == dict.fromkeys(FAMILIES, 4)
    assert run("prove", "exo", "-p", "fake://hand?clock=virtual&model=df", "--json").code == 6


def test_the_list_needs_no_device_and_says_everything() -> None:
    for family in FAMILIES:
        rows = run("prove", family, "--list", "--level", "permanent", "--json").rows
        assert [row["fact"] for row in rows] == [proof.name for proof in load(family, "proofs").PROOFS]
        assert all(
            row[key] for row in rows for key in ("fact", "family", "level", "says", "assumed", "how", "verdicts")
        )
        assert all(row["level"] in LEVELS for row in rows)
    assert {row["level"] for row in run("prove", "exo", "--list", "--json").rows} == {READ}


# -- what stays, what is typed, what goes on --------------------------------------------------------------------------


def test_what_cannot_be_put_back_is_asked_for_by_name(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    link = ("-p", "fake://exo?clock=virtual")
    assert run("prove", "exo", *link, "--level", "move", "--only", "save-frames", "-y", "--json").code == 2
    assert run("prove", "exo", *link, "--level", "permanent", "--only", "save-frames", "--json").code == 8
    result = run("prove", "exo", *link, "--level", "permanent", "-y", "--trace", str(trace), "--json")
    assert result.code == 0 and not {"save-frames", "calibration-frames"} & {row["fact"] for row in result.rows}
    assert "EB 90 01 04 12 ED 03" not in trace.read_text(), "a save"


def test_a_save_happens_once_however_often_is_asked(tmp_path: Path) -> None:
    result = prove("exo", "", *STAYS, "save-frames", "--repeat", "5")
    assert [row["repetitions"] for row in result.rows] == [1] and len(result.json["writes"]) == 1
    assert {row["state"] for row in result.json["writes"]} == {"confirmed"}
    failed = prove("exo", "fault=save-fails", *STAYS, "save-frames", "--only", "calibration-frames")
    assert (failed.code, failed.error["code"], failed.rows) == (6, "save-failed", []), "it ends there"


def test_the_supply_against_a_voltmeter() -> None:
    for family, model in (("exo", ""), ("hand", "model=df")):
        found = shown(prove(family, model, "--only", "supply-scale", "--meter", "24"))
        assert found["supply-scale"] == 23.25, "558 counts"
    assert shown(prove("hand", "model=tp", "--only", "supply-scale", "--meter", "24")) == {}, "it has no such register"
    (row,) = prove("exo", "", "--only", "supply-scale").rows
    assert (row["verdict"], row["why"]) == ("not-shown", "no-sign"), "nobody typed a reading"
    assert prove("exo", "", "--only", "gap-bytes", "--meter", "24").code == 2
    typed = person("prove", "exo", "-p", "fake://exo?clock=virtual", "--only", "supply-scale", answers=["23,9"])
    assert "23.35" in typed.data


def test_a_motor_that_goes_on_after_the_loop_is_stopped_by_t(tmp_path: Path) -> None:
    state, trace = tmp_path / "hand.json", tmp_path / "t.txt"
    words = ("--level", "move", "-y", "--only", "motors-after-loop")
    with spying() as spy:
        result = prove("barrett", f"initialized=1&state={state}", *words, "--repeat", "2", "--trace", str(trace))
        assert shown(result) == {"motors-after-loop": "run on"}
        motor = spy.lines[-1].device.hand.motors[0]
    assert motor.drive is None and not motor.powered
    sent = [line.split(" > ")[1] for line in trace.read_text().splitlines() if " > " in line]
    assert "43 02" in sent and "43 00" not in sent and "63 00" not in sent, "it was left with its velocity"
    assert sent.count("31 54 0D") == 2
    assert {step["state"] for step in result.json["writes"]} == {"confirmed"}, "each block was answered before ^C"
    assert prove("barrett", "", *words).code == 6, "not initialized: nothing moves"


def test_the_question_of_a_proof_is_no_refused_write() -> None:
    result = prove("barrett", "", *WRITES, "unknown-command")
    assert (shown(result), result.json["writes"]) == ({"unknown-command": "ERR 32"}, [])


@each_row("seconds", [1.0, 1.3, 1.6, 1.9, 2.2, 2.5])
def test_ctrl_c_behind_the_loop_stops_at_once(seconds: float) -> None:
    with spying() as spy, pressed_at(seconds):
        seen = person("prove", "barrett", "-p", "fake://barrett?clock=virtual&initialized=1&wire=auto", "--level", "move", "-y", "--only", "motors-after-loop")  # fmt: skip
    assert seen.code == 130, seen.data
    device = spy.lines[-1].device
    assert device.hand.motors[0].drive is None and device.now < seconds + 0.6


HOMING = ("--level", "move", "-y", "--only", "homing-lasts", "--repeat", "2")


def test_whether_the_homing_belongs_to_the_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    """The simulator keeps its origin, as no manual says otherwise; a hand that forgets it is made of it here."""
    assert shown(prove("aidin", "start=homed&rate=20", *HOMING)) == {"homing-lasts": "kept"}
    said = AidinSimulator.reconnected

    def forgetful(device: AidinSimulator) -> None:
        said(device)
        device.hand.homed = False

    monkeypatch.setattr(AidinSimulator, "reconnected", forgetful)
    assert shown(prove("aidin", "start=homed&rate=20", *HOMING)) == {"homing-lasts": "lost"}


def test_a_finger_that_does_not_obey_shows_nothing_of_the_homing() -> None:
    result = prove("aidin", "start=homed&rate=20&fault=held&motor=3", *HOMING)
    assert shown(result) == {} and result.code in (0, 7)


def test_a_link_that_cannot_be_opened_again_moves_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    monkeypatch.setattr(FakeLink, "reconnect", lambda self, seconds: False)
    (row,) = prove("aidin", "start=homed&rate=20", *HOMING, "--trace", str(trace)).rows
    assert (row["verdict"], row["why"]) == ("not-shown", "no-sign")
    assert b"hand_mode".hex(" ").upper() not in trace.read_text()


# -- a setting of a worn device ------------------------------------------------------------------------------------------


SEATED = "fake://ekso?clock=virtual&posture=sitting"
ONCE = ("--level", "write-back", "--only", "write-back", "--operator", "me")


def written(trace: Path) -> list[str]:
    """The SetValue frames that went out."""
    return (
        [line.split(" > ")[1] for line in trace.read_text().splitlines() if " > 9B" in line] if trace.exists() else []
    )


@each_row(
    "fault,value,code",
    [
        ("", "accepted", 0),
        ("&fault=not-taken", "accepted", 0),  # of a value that it had nobody can tell
        ("&fault=refuse", "status 1", 0),
        ("&fault=refuse&refuse-status=3", "status 3", 0),
        ("&fault=acknowledge-set", "acknowledged", 0),
        ("&fault=neighbour", None, 7),
        ("&fault=set-unanswered", None, 4),
    ],
)
def test_one_setting_of_an_ekso_is_written_back_once(fault: str, value: str | None, code: int, tmp_path: Path) -> None:
    """However often is asked: SetValue goes out once, with the value that was read."""
    trace = tmp_path / "t.txt"
    result = run("prove", "ekso", "-p", SEATED + fault, *ONCE, "-y", "--repeat", "5", "--trace", trace, "--json")
    assert (result.code, shown(result).get("write-back")) == (code, value), result.err
    (frame,) = written(trace)
    assert frame.split()[4:8] == ["00", "CB", "00", "AF"], "step_height (203) = 1.75 in"
    (write,) = result.json["writes"]
    assert (write["state"] == "confirmed") is (value == "accepted" or fault == "&fault=neighbour")
    entries = [json.loads(line) for line in default_path().read_text().splitlines()][-2:]
    assert [(one["event"], one["operator"], one["old"] == one["new"]) for one in entries] == [("intent", "me", True), ("result", "me", True)]  # fmt: skip


@each_row(
    "link,words,code",
    [
        (SEATED, ("--operator", "me"), 8),  # nobody to ask
        (SEATED, ("-y",), 2),  # nobody is named
        (SEATED.replace("sitting", "standing"), ("-y", "--operator", "me"), 0),
        (SEATED.replace("sitting", "walking"), ("-y", "--operator", "me"), 0),
    ],
)
def test_no_setting_is_written_unless_somebody_stands_for_it_and_the_wearer_sits(link: str, words: tuple[str, ...], code: int, tmp_path: Path) -> None:  # fmt: skip
    trace = tmp_path / "t.txt"
    result = run("prove", "ekso", "-p", link, *ONCE[:4], *words, "--trace", trace, "--json")
    assert result.code == code and written(trace) == []
    assert [(row["verdict"], row["why"]) for row in result.rows] == ([("not-shown", "no-sign")] if code == 0 else [])


def test_a_person_types_the_value_before_it_is_written_back(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    words = ("prove", "ekso", "-p", SEATED, *ONCE[:4], "--trace", trace)
    for answers, frames in ((["n"], 0), (["y", "2"], 0), (["y", "1.75"], 1)):
        seen = person(*words, answers=answers)
        assert seen.code == (0 if frames else 8) and len(written(trace)) == frames, seen.data
        assert "wearing" in seen.data + seen.err
    plain = run("prove", "ekso", "-p", SEATED, "--json", "--trace", trace)
    assert plain.code == 0 and written(trace) == [] and "write-back" not in shown(plain)


# -- the facts file -----------------------------------------------------------------------------------------------------


def facts(family: str, said: str, path: Path, *words: str) -> dict[str, Any]:
    """The file of that device."""
    result = prove(family, said, "-o", str(path), *words)
    assert result.code == 0, result.err
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


@each_row("family", FAMILIES)
def test_the_facts_file_has_its_schema_and_names_no_device(family: str, tmp_path: Path) -> None:
    schema = json.loads(resources.files("handctl").joinpath("schema", "facts-1.json").read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    path = tmp_path / "facts.json"
    said = "fault=block-silent" if family == "exo" else ""  # its errors name the link
    content = facts(family, said, path)
    Draft202012Validator(schema).validate(content)
    assert content["simulated"] is True
    assert "device" not in content
    assert not [
        word for word in ("fake:", "192.168", str(tmp_path), "4711") if word in path.read_text(encoding="utf-8")
    ]
    named = facts(family, "", path, "--identify")
    Draft202012Validator(schema).validate(named)
    assert named["device"]["kind"] == family


def test_diff_compares_two_devices(tmp_path: Path) -> None:
    one, other = tmp_path / "a.json", tmp_path / "b.json"
    facts("ekso", "", one)
    facts("ekso", "time-body=3", other)
    assert run("prove", "diff", str(one), str(one), "--json").code == 0
    result = run("prove", "diff", str(one), str(other), "--json")
    assert (result.code, [row["fact"] for row in result.rows if row["equal"] is False]) == (7, ["time-body"])
    assert run("prove", "diff", str(one), str(other), "-o", str(one), "--json").code == 2
    assert json.loads(one.read_text())["family"] == "ekso"


def test_diff_of_what_is_measured_is_no_difference_of_the_devices(tmp_path: Path) -> None:
    """As with two attempts on one device: 2 and 4 ms are one reply time, 2 and 48 are not."""
    one, near, far = (tmp_path / name for name in ("a.json", "b.json", "c.json"))
    facts("exo", "turnaround=0.002", one, "--only", "reply-time")
    facts("exo", "turnaround=0.004", near, "--only", "reply-time")
    facts("exo", "turnaround=0.05", far, "--only", "reply-time")
    result = run("prove", "diff", str(one), str(near), "--json")
    assert (result.code, len({result.rows[0]["a"], result.rows[0]["b"]})) == (0, 2)
    assert run("prove", "diff", str(one), str(far), "--json").code == 7


@each_row(
    "content",
    ["", "{}", "[]", '{"schema": "handctl/facts-2"}', '{"schema": "handctl/facts-1", "family": "exo", "facts": [1]}'],
)
def test_a_file_that_is_none_is_refused_before_anything_is_sent(content: str, tmp_path: Path) -> None:
    path = tmp_path / "facts.json"
    path.write_text(content)
    result = run("exo", "get", "id", "-p", "fake://exo?clock=virtual", "--facts", str(path), "--json")
    assert (result.code, result.error["code"]) == (2, "facts")


# -- facts set the switches ------------------------------------------------------------------------------------------


@each_row(
    "family,said,words",
    [
        ("ekso", "length=frame", ("get", "step_length")),
        ("aidin", "exchange=poll&reader=nul", ("get", "motor_pos")),
    ],
)
def test_what_is_silent_without_the_facts_answers_with_them(
    family: str, said: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    link, path = ("-p", f"fake://{family}?clock=virtual&{said}"), tmp_path / "facts.json"
    facts(family, said, path)
    assert run(family, *words, *link, "--json").code == 4
    result = run(family, *words, *link, "--facts", str(path), "--json")
    assert result.code == 0, result.err
    (told,) = [message["text"] for message in result.json["messages"] if message["code"] == "facts-used"]
    assert told.startswith("On this device:")


@each_row("family", ["exo", "wrist", "hand"])
def test_reads_across_gaps_are_not_tried_where_they_were_silent(family: str, tmp_path: Path) -> None:
    link, path = ("-p", f"fake://{family}?clock=virtual&fault=block-silent"), tmp_path / "facts.json"
    facts(family, "fault=block-silent", path)
    assert "block-silent" in run(family, "dump", *link, "--json").codes()
    assert "block-silent" not in run(family, "dump", *link, "--facts", str(path), "--json").codes()


def test_the_generation_and_the_protocol_of_a_hand_come_from_its_facts(tmp_path: Path) -> None:
    path, said = tmp_path / "facts.json", "model=f1&speaks=modbus"
    facts("hand", said, path)
    link = ("-p", f"fake://hand?clock=virtual&{said}", "--json")
    with_facts = run("hand", "get", "angle_actual", "--facts", str(path), *link)
    assert with_facts.code == 0
    assert with_facts.json["counters"]["sent"] < run("hand", "get", "angle_actual", *link).json["counters"]["sent"]
    other = run(
        "hand", "get", "angle_actual", "--facts", str(path), "-p", "fake://hand?clock=virtual&model=df", "--json"
    )
    assert other.code == 6, "the facts of another device"


def test_an_option_wins_over_a_fact_and_another_family_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "facts.json"
    facts("aidin", "", path)
    link = ("-p", "fake://aidin?clock=virtual&exchange=poll")
    assert run("aidin", "get", "motor_pos", *link, "--facts", str(path), "--json").code == 4
    assert run("aidin", "get", "motor_pos", *link, "--facts", str(path), "--exchange", "poll", "--json").code == 0
    assert run("exo", "get", "id", "-p", "fake://exo", "--facts", str(path), "--json").error["code"] == "facts"


def test_a_named_device_has_its_facts_in_the_configuration(tmp_path: Path) -> None:
    path, config = tmp_path / "facts.json", tmp_path / "config.toml"
    facts("ekso", "length=n-2", path)
    port = "fake://ekso?clock=virtual&length=n-2"
    config.write_text(f'[devices.unit]\nkind = "ekso"\nport = "{port}"\nfacts = "{path}"\n')
    assert run("-d", "unit", "get", "step_length", "--json", env={"HANDCTL_CONFIG": str(config)}).code == 0


def test_the_sign_of_a_position_comes_from_the_facts(tmp_path: Path) -> None:
    path, said = tmp_path / "facts.json", f"initialized=1&position-sign=unsigned&state={tmp_path / 'state.json'}"
    facts("barrett", said, path, *STOP)
    result = run("barrett", "get", "P.F1", "-p", f"fake://barrett?clock=virtual&{said}", "--facts", str(path), "--json")
    assert [row["value"] for row in result.rows] == [-50]
    (told,) = [message["text"] for message in result.json["messages"] if message["code"] == "unsigned-position"]
    assert told.startswith("On this device")


def test_what_moves_asks_and_ends_at_what_the_hand_refuses() -> None:
    assert prove("barrett", "", "--level", "move", "--only", "position-at-stop").code == 8
    result = prove("barrett", "", *STOP)
    assert (result.code, result.json["rows"]) == (6, []), "the motors are not initialized"


# -- the twin -------------------------------------------------------------------------------------------------------------


def test_a_twin_counts_its_facts_and_refuses_those_of_another(tmp_path: Path) -> None:
    path = tmp_path / "facts.json"
    content = facts("ekso", "time-body=3", path)
    twin = Twin("ekso", {"facts": str(path), "quantum": "10"})
    assert (len(twin.taken), twin.left, twin.raw["time-body"], twin.raw["quantum"]) == (8, [], "3", "10")
    content["facts"]["unlisted-codes"] |= {"value": "sit_mode", "verdict": "differs"}
    path.write_text(json.dumps(content))
    assert Twin("ekso", {"facts": str(path)}).left == ["unlisted-codes"]
    assert run("exo", "get", "id", "-p", f"fake://exo?facts={path}", "--json").code == 2
    assert run("ekso", "get", "step_length", "-p", f"fake://ekso?facts={tmp_path / 'none'}", "--json").code == 2


# -- what writes puts it back -----------------------------------------------------------------------------------------


@each_row(
    "family,fact,get,value",
    [("exo", "id-acknowledged-by", "id", 1), ("hand", "id-acknowledged-by", "id", 1), ("barrett", "highest-speed", "baud_rate", 96)],
)  # fmt: skip
def test_what_was_written_is_put_back(family: str, fact: str, get: str, value: int, tmp_path: Path) -> None:
    state, written = tmp_path / "state.json", ("--level", "write-back", "--only", fact)
    assert prove(family, f"state={state}", *written).code == 8, "nobody was asked"
    result = prove(family, f"state={state}", *written, "-y")
    assert result.code == 0, result.err
    assert {row["state"] for row in result.json["writes"]} == {"confirmed"}
    (row,) = run(family, "get", get, "-p", f"fake://{family}?clock=virtual&state={state}", "--json").rows[:1]
    assert row["value"] == value


@each_row("after", range(6, 32))
def test_a_hand_that_falls_silent_meanwhile_gives_no_fact(after: int) -> None:
    result = prove("exo", f"fault=silent&after={after}", *WRITES, "id-acknowledged-by")
    home = [row["state"] for row in result.json["writes"] if row["meaning"].startswith("write id = 1,")]
    there = [row["state"] for row in result.json["writes"] if row["meaning"].startswith("write id = 253")]
    assert result.code in (4, 7)
    if result.code == 4:  # between two repetitions: all is as before
        assert home == ["confirmed"] * len(there)
    assert result.json["rows"] == []


@each_row("behind", range(9, 26))
def test_ctrl_c_in_the_middle_puts_it_back(behind: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state, count, exchange = tmp_path / "state.json", [0], SerialBus.exchange

    def pressed(self: SerialBus, *args: Any, **more: Any) -> Any:
        count[0] += 1
        mine = count[0]
        try:
            return exchange(self, *args, **more)
        finally:
            if mine == behind:
                raise KeyboardInterrupt

    monkeypatch.setattr(SerialBus, "exchange", pressed)
    result = prove("exo", f"state={state}", *WRITES, "id-acknowledged-by")
    monkeypatch.undo()
    assert result.code == 130
    assert "exo scan" not in result.error["hint"], "the hand is not lost"
    (row,) = run("exo", "get", "id", "-p", f"fake://exo?clock=virtual&state={state}", "--json").rows
    assert row["value"] == 1


def test_a_dry_run_shows_the_way_there_and_back() -> None:
    rows = run("prove", "exo", *WRITES[:2], "--only", "id-acknowledged-by", "-n", "--json").rows
    assert [row["bytes"][6:8] for row in rows] == ["01", "FD"]
