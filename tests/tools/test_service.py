"""`handctl service`: the fault's own remedy is proposed, nothing is written, and the one report is played, compared and continued."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from handctl.command.family import load, map_of
from handctl.families import FAMILIES
from handctl.files import PAGE_DATA, in_page
from handctl.link.fake import meaning_of
from handctl.link.transcript import parse
from handctl.model.device_picture import remedies_of
from handctl.tools import doctor, service_steps
from handctl.tools.service import STEPS
from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row
from tests.support.machine import System
from tests.support.page import Page
from tests.support.person import once, person, pressed_at

QUICK = ("--count", "3", "--watch", "0.2")
BITS = ("over-temperature", "locked-rotor", "over-current", "motor-abnormal", "communication")
REMEDIES = [  # family, options of its simulator, key of the family's table of remedies
    *((kind, f"fault={fault}", fault.replace("-", "_")) for kind in ("exo", "wrist") for fault in BITS),
    *(("hand", f"fault={fault}", fault.replace("-", "_")) for fault in BITS if fault != "motor-abnormal"),
    ("hand", "fault=motor-abnormal", "motor"),
    *((kind, "fault=unknown-bits", "unknown_bit") for kind in ("exo", "wrist", "hand")),
    ("barrett", "fault=hot&initialized=1", "hot"),
    ("barrett", "fault=no-board&initialized=1", "No motor board found (1)"),
    ("barrett", "fault=no-motor&initialized=1", "No motor found (2)"),
    ("barrett", "fault=unknown-codes&initialized=1", "unknown"),
    ("barrett", "fault=not-homed", "Motor not initialized (4)"),
    ("aidin", "fault=degrees", "no-angle"),
    ("ekso", "fault=hip-offset", "hip"),
    ("ekso", "fault=frozen-clock", "boot-still"),
    ("ekso", "fault=clock-jump", "boot-off"),
]
LINES = [  # family, options, step that met it, its code or check: the next step is the hint of that row
    ("barrett", "fault=silent", "doctor", "answer"),
    ("aidin", "fault=silent", "doctor", "answer"),
    ("aidin", "fault=not-json", "doctor", "answer"),
    ("aidin", "fault=nan", "status", "not-finite"),
    ("aidin", "fault=wrong-length", "status", "bad-length"),
    ("aidin", "fault=missing-key", "watch", "missing-key"),
    ("ekso", "fault=bad-checksum", "doctor", "answer"),
    ("ekso", "fault=echo", "doctor", "echo"),
    ("ekso", "fault=silent", "doctor", "answer"),
]


@pytest.fixture(autouse=True)
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[System]:
    """A healthy computer without ports, and a folder of its own."""
    system = System(tmp_path / "machine")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(doctor, "machine_checks", lambda machine: [])
    with mock.patch.object(service_steps, "Machine", system.machine):
        yield system


def served(kind: str, options: str, *args: str, file: str = "r.html") -> Result:
    link = f"fake://{kind}?clock=virtual&{options}"
    return run("service", link, "--family", kind, "--report", file, *QUICK, "--json", *args)


def data(file: str = "r.html") -> dict[str, Any]:
    page = Page(Path(file).read_text(encoding="utf-8"))
    assert page.count["table"]
    found: dict[str, Any] = json.loads(in_page(Path(file).read_text(encoding="utf-8"), PAGE_DATA))
    return found


def _map(kind: str) -> Any:
    found = map_of(kind)
    assert found is not None
    return found


def steps(result: Result) -> dict[str, str]:
    return {name: step["code"] or step["state"] for name, step in result.json["service"]["steps"].items()}


# -- what is proposed -----------------------------------------------------------------------------------------------


@each_row(("kind", "options", "key"), REMEDIES)
def test_the_next_step_is_the_remedy_of_the_fault(kind: str, options: str, key: str) -> None:
    result = served(kind, options, "--force")
    assert result.code == 7
    following = result.json["service"]["next"]
    assert remedies_of(kind)[key].step.casefold() in following["text"].casefold()
    assert result.error["code"] == "findings"
    assert following["state"] == "proposed"
    assert data()["service"]["next"] == following


@each_row(("kind", "options", "step", "check"), LINES)
def test_the_next_step_is_what_a_failed_check_says(kind: str, options: str, step: str, check: str) -> None:
    result = served(kind, options, "--force")
    assert result.code == 7
    (row, *_) = [row for row in result.rows if (row["step"], row["check"]) == (step, check)]
    assert row["remedy"].rstrip(".").casefold() == result.json["service"]["next"]["text"].rstrip(".").casefold()


def test_six_faults_of_each_family_are_here() -> None:
    told = [(row[0], row[1]) for row in (*REMEDIES, *LINES)]
    assert {kind: sum(kind == one for one, _ in told) >= 6 for kind in FAMILIES} == dict.fromkeys(FAMILIES, True)


@each_row("kind", list(FAMILIES))
def test_nothing_is_written_and_nothing_is_left_out(kind: str) -> None:
    """Every frame of the whole service, the proposed step included, is one that the family's own rules call a reading one."""
    result = served(kind, "fault=healthy", "--follow", "--include-ids", file="w.html")
    assert result.code in (0, 7)
    lines = in_page(Path("w.html").read_text(encoding="utf-8"), "pre").splitlines()
    rules = load(kind, "write_rules").words()
    out = [entry for entry in parse(lines) if entry.mark == ">"]
    assert out or kind == "aidin", "which sends by itself"
    assert [entry for entry in out if list(rules.sent(entry.data, entry.can_id))] == []
    assert {step["state"] for step in result.json["service"]["steps"].values()} <= {"done", "skipped"}
    Path("w.html").unlink()


def test_a_step_that_reads_is_followed_and_one_that_writes_is_told() -> None:
    reads = served("ekso", "fault=clock-jump", "--follow")
    assert reads.json["service"]["next"]["state"] == "done"
    assert reads.json["service"]["next"]["rows"][0]["check"]
    writes = served("exo", "fault=locked-rotor", "--follow", "--force")
    assert writes.json["service"]["next"]["state"] == "proposed"
    assert writes.json["service"]["next"]["command"].startswith("handctl exo clear-errors -p ")
    assert all(row["step"] != "next" for row in writes.rows)


def test_the_command_is_data_and_never_read_out_of_a_sentence() -> None:
    """A report whose hint was edited to name another command proposes the one that is its data, or none."""
    served("exo", "fault=over-current", "--skip", "watch")
    for commands, proposed in (({"status": "exo get error"}, "handctl exo get error -p "), ({}, None)):
        found = data()
        found["service"] |= {"hints": {"status": "run `handctl exo dump`"}, "commands": commands}
        Path("e.html").write_text(f"<!DOCTYPE html><{PAGE_DATA}>{json.dumps(found)}</script>", encoding="utf-8")
        link = "fake://exo?clock=virtual"
        told = run(
            "service", link, "--family", "exo", "--resume", "e.html", *QUICK, "--json", "--report", "n.html", "--force"
        )
        command = told.json["service"]["next"]["command"]
        assert command is None if proposed is None else command.startswith(proposed)


def test_a_healthy_device() -> None:
    result = served("exo", "fault=healthy", "--complaint", "slow", "--ticket", "17")
    assert result.code == 0
    assert steps(result) == {**dict.fromkeys(("find", *STEPS), "done"), "diagnose": "no-diagnosis"}
    assert data()["service"]["complaint"] == "slow"
    assert "slow" in Path("r.html").read_text(encoding="utf-8").partition('id="findings"')[0]


# -- what goes wrong ------------------------------------------------------------------------------------------------


def test_a_step_that_fails_is_a_row_with_its_code_and_the_rest_goes_on() -> None:
    result = served("aidin", "fault=nan")
    assert result.code == 7
    assert steps(result)["status"] == steps(result)["watch"] == "not-finite"
    assert result.json["service"]["steps"]["status"]["state"] == "failed"
    assert [row["status"] for row in result.rows if row["check"] == "not-finite"] == ["fail"] * 3
    assert steps(result)["doctor"] == "done"


def test_nobody_there_is_a_report_too() -> None:
    result = run("service", "fake://exo?clock=virtual&fault=silent", *QUICK, "--report", "r.html", "--json")
    assert result.code == 7
    assert set(steps(result).values()) == {"done", "not-reached"}
    assert data()["service"]["steps"]["status"] == {"state": "failed", "code": "not-reached"}


@each_row("device", ["exo?fault=silent", "exo?fault=bad-checksum", "ekso?fault=split", "wrist?fault=silent&after=8"])
def test_all_steps_and_the_one_that_follows_have_one_deadline(device: str) -> None:
    args = ("--family", "exo", "--follow", "--deadline", "2", "--report", "r.html", "--force", *QUICK, "--json")
    with spying() as spy:
        result = run("service", f"fake://{device}&clock=virtual", *args)
    assert (result.code, result.json["service"]["next"]["state"]) == (7, "proposed")
    assert sum(line.now for line in spy.lines) < 2.1


def test_no_port_is_a_finding() -> None:
    result = run("service", "--report", "r.html", "--json")
    assert (result.code, steps(result)["find"]) == (7, "no-port")


@each_row("args", [
    ("fake://exo", "-p", "fake://exo"), ("--finding", "x"), ("--demo", "exo", "--family", "exo"),
    ("fake://exo", "--resume", "none.html"), ("fake://exo", "--against", "none.html"), ("--fake",), ("fake://none",), ("--demo", "exo", "--finding", "x"),
])  # fmt: skip
def test_what_makes_no_sense_is_refused(args: tuple[str, ...]) -> None:
    assert run("service", *args).code == 2
    assert not list(Path.cwd().glob("*.html"))


def test_it_is_no_line_of_a_batch() -> None:
    """Which understands each line before it begins: this one has nothing to be understood without its device."""
    Path("lines.txt").write_text("service fake://exo\n", encoding="utf-8")
    assert run("batch", "lines.txt").code == 2


def test_no_file_is_replaced_unasked() -> None:
    Path("r.html").write_text("mine", encoding="utf-8")
    assert served("exo", "fault=healthy").code == 2
    assert Path("r.html").read_text(encoding="utf-8") == "mine"


# -- the report -----------------------------------------------------------------------------------------------------


@each_row("kind", ["exo", "wrist", "barrett", "hand"])
def test_the_report_is_played_and_compared(kind: str) -> None:
    link = f"fake://{kind}?clock=virtual"
    more = ("--setpoints",) if kind == "wrist" else ()  # it has no settings
    result = run("service", link, "--include-ids", "--report", f"{kind}.html", *QUICK, "--json")
    assert result.code in (0, 7)
    assert result.json["device"]["kind"] == kind, "found by looking"
    played = run(kind, "status", "-p", f"replay:{kind}.html", "--json")
    assert played.json["rows"] == data(f"{kind}.html")["status"]
    assert run(kind, "diff", f"{kind}.html", f"{kind}.html", *more).code == 0
    assert run(kind, "diff", f"{kind}.html", "-p", link, *more).code == 0


def test_the_command_of_the_next_step_hides_the_home_folder_in_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the screen it is as it is typed; a page goes to colleagues."""
    monkeypatch.setattr("os.path.expanduser", lambda path: path.replace("~", str(tmp_path), 1))
    result = served("exo", f"fault=locked-rotor&state={tmp_path}/s.json", "--force")
    assert str(tmp_path) in result.json["service"]["next"]["command"]
    shown = data("r.html")["service"]["next"]["command"]
    assert shown.startswith("handctl exo clear-errors -p ") and str(tmp_path) not in shown


def test_a_report_whose_settings_were_changed_is_no_snapshot() -> None:
    served("exo", "fault=healthy")
    page = Path("r.html").read_text(encoding="utf-8")
    Path("r.html").write_text(
        page.replace('"position_set.little": 151', '"position_set.little": 152'), encoding="utf-8"
    )
    assert run("exo", "diff", "r.html", "r.html").code == 2


@each_row(("key", "value"), [
    *(((key,), value) for key in ("schema", "made", "device", "watch", "service", "snapshot", "dump") for value in (5, [5])),
    (("service", "rows"), [{"step": "find"}]), (("service", "rows"), 5), (("service", "steps"), {"find": 5}), (("service", "hints"), {"find": 5}),
    (("service", "commands"), {"find": 5}),
])  # fmt: skip
def test_a_report_that_was_changed_is_refused(key: tuple[str, ...], value: object) -> None:
    if not Path("r.html").exists():
        served("exo", "fault=healthy")
    found = place = data()
    for one in key[:-1]:
        place = place[one]
    place[key[-1]] = value
    Path("bad.html").write_text(f"<!DOCTYPE html><{PAGE_DATA}>{json.dumps(found)}</script>", encoding="utf-8")
    for option in ("--resume", "--against"):
        assert run("service", "fake://exo?clock=virtual", option, "bad.html", "--report", "new.html").code == 2
    assert not Path("new.html").exists()


def test_what_differs_from_an_older_report() -> None:
    served("hand", "fault=healthy", file="old.html")
    result = served("hand", "fault=locked-rotor&speed=700", "--against", "old.html")
    found = {row["name"]: (row["was"], row["is"]) for row in result.json["service"]["against"]["differences"]}
    assert found["check unhealthy"] == (None, "warning")
    assert data()["service"]["against"]["differences"]
    assert not served("hand", "fault=healthy", "--skip", "dump", "--against", "old.html", "--force").json["service"][
        "against"
    ]["differences"]
    assert run("hand", "report", "plain.html", "-p", "fake://hand?clock=virtual").code == 0
    plain = served("hand", "fault=locked-rotor", "--against", "plain.html", "--force")
    assert plain.json["service"]["against"]["differences"] == [], "it has neither settings nor checks"
    same = served("hand", "fault=healthy", "--against", "old.html", "--force")
    assert same.json["service"]["against"]["differences"] == []


def test_what_was_done_is_not_repeated() -> None:
    """The steps that were skipped are done now; the bytes of both parts are in the report."""
    assert steps(served("exo", "fault=over-current", "--skip", "watch", "--skip", "dump"))["watch"] == "skipped"
    first = data()
    resumed = run("service", "fake://exo?clock=virtual", "--resume", "r.html", *QUICK, "--json")
    assert steps(resumed)["watch"] == steps(resumed)["dump"] == steps(resumed)["status"] == "done"
    assert resumed.json["service"]["steps"]["status"]["from"] == first["made"]
    assert "unhealthy" in [row["check"] for row in resumed.rows], "found before"
    assert remedies_of("exo")["over_current"].step.casefold() in resumed.json["service"]["next"]["text"].casefold()
    assert resumed.json["service"]["next"]["command"].startswith("handctl exo clear-errors -p "), "kept as data"
    assert data()["dump"]
    assert data()["status"] == first["status"]
    assert run("exo", "status", "-p", "replay:r.html").code == 0
    assert run("service", "fake://wrist?clock=virtual", "--resume", "r.html").code == 2


def test_whose_device_it_is_stays_out() -> None:
    assert served("ekso", "fault=healthy").code == 0
    assert not [one for kind in FAMILIES for one in _map(kind).kept() if one.param.private], "none is in a snapshot"
    assert {row["value"] for row in data()["dump"] if row["name"] == "pilot_id"} == {"redacted"}
    found = run("service", "fake://barrett?clock=virtual", "--report", "found.html", *QUICK, "--json")
    assert "serial number redacted" in [row["evidence"] for row in found.rows if row["step"] == "find"][-1], (
        "it was found by a scan that shows its number"
    )
    assert "serial number 1042" not in Path("found.html").read_text(encoding="utf-8")
    for kind in ("ekso", "barrett"):
        assert served(kind, "fault=healthy", "--force").code in (0, 7)
        played = run(kind, "status", "-p", "replay:r.html", "--json")
        assert (played.code, played.error["code"]) == (3, "left-out"), "and that no reply came would be untrue"


def test_an_interrupt_ends_in_a_report_that_is_continued() -> None:
    with pressed_at(2.0):
        result = run("service", "fake://exo?clock=virtual", "--watch", "60", "--report", "r.html", "--json")
    assert result.code == 130
    assert (steps(result)["watch"], steps(result)["dump"]) == ("interrupted", "interrupted")
    assert steps(run("service", "fake://exo?clock=virtual", "--resume", "r.html", *QUICK, "--json"))["dump"] == "done"


# -- somebody at the terminal ---------------------------------------------------------------------------------------


def test_a_person_is_asked_and_skips() -> None:
    answers = ["does not close", "4711", "", "", "s", ""]
    screen = person(
        "service", "fake://exo?clock=virtual&fault=locked-rotor", *QUICK, "--report", "r.html", answers=answers
    )
    assert screen.code == 7
    found = data()["service"]
    assert (found["complaint"], found["ticket"]) == ("does not close", "4711")
    assert {name for name, step in found["steps"].items() if step["state"] == "skipped"} == {"diagnose", "watch"}


@each_row(("answer", "state"), [("y", "done"), ("", "proposed")])
def test_a_person_follows_or_does_not(answer: str, state: str) -> None:
    answers = ["", "", "", "", "s", "s", answer]
    link = "fake://ekso?clock=virtual&fault=clock-jump"
    assert person("service", link, "--count", "5", "--report", "r.html", "--force", answers=answers).code == 7
    assert data()["service"]["next"]["state"] == state


@each_row("question", ["status: ", "only reads"])
def test_ctrl_c_at_a_question_leaves_a_report(question: str) -> None:
    answers = ["", "", "", "", "s", "s", "y"]
    link = "fake://ekso?clock=virtual&fault=clock-jump"
    words = ("service", link, "--count", "5", "--report", "r.html")
    Path("r.html").unlink(missing_ok=True)
    assert person(*words, answers=answers, press=once(lambda seen: question in seen)).code == 130
    assert data()["service"]["steps"]["doctor"]["state"] == "done"


def test_what_the_firmware_lacks_is_in_the_report() -> None:
    """It is no finding, but what a colleague would look for; a number alone would not name what it is of."""
    served("aidin", "fault=missing-key")
    assert [row["evidence"] for row in data()["service"]["rows"] if row["check"] == "not-on-this-firmware"] == [
        "not on this firmware: current_state"
    ]
    seen: list[str] = []

    def kept(text: str) -> str:
        seen.append(text)
        return ""

    person("service", "fake://barrett?clock=virtual&fault=no-board&initialized=1", *QUICK, answers=[kept] * 8)
    assert "fail: status.F2: " in seen[-1]


# -- practice -------------------------------------------------------------------------------------------------------


@each_row("kind", list(FAMILIES))
def test_a_demo_knows_its_fault(kind: str) -> None:
    practice = tuple(load(kind, "remedies").TRAINING_FAULTS)
    assert len(practice) >= 6
    seeds = {random.Random(seed).choice(practice): seed for seed in range(200)}
    assert seeds.keys() == set(practice)
    for fault, seed in seeds.items():
        judged = run("service", "--demo", kind, "--seed", str(seed), "--finding", fault, *QUICK, "--json")
        assert (judged.code, judged.json["service"]["demo"]["fault"], judged.json["service"]["demo"]["right"]) == (
            0,
            fault,
            True,
        )
        assert [row for row in judged.rows if row["status"] in ("fail", "warning")], "there is something to find"
        assert meaning_of(kind, fault)
    wrong = run(
        "service", "--demo", kind, "--seed", str(seeds[practice[0]]), "--finding", practice[1], *QUICK, "--json"
    )
    assert (wrong.code, wrong.error["code"]) == (7, "wrong-finding")
    open_ = run("service", "--demo", kind, "--seed", "1", *QUICK, "--json")
    assert (open_.code, open_.json["service"]["demo"]["right"]) == (0, None)
    assert not list(Path.cwd().glob("*.html"))


def test_a_trainee_types_a_number() -> None:
    told = run("service", "--demo", "exo", "--seed", "3", *QUICK, "--json").json["service"]["demo"]
    number = list(load("exo", "remedies").TRAINING_FAULTS).index(told["fault"]) + 1
    assert person("service", "--demo", "exo", "--seed", "3", *QUICK, answers=[str(number)]).code == 0
    assert person("service", "--demo", "exo", "--seed", "3", *QUICK, answers=["7"]).code == 7

    def unsaid(seen: str) -> str:
        assert "fault=" not in seen
        return "silent"

    seed = next(
        str(seed)
        for seed in range(99)
        if random.Random(seed).choice(tuple(load("barrett", "remedies").TRAINING_FAULTS)) == "silent"
    )
    assert person("service", "--demo", "barrett", "--seed", seed, *QUICK, answers=[unsaid]).code == 0
