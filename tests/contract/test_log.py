"""`log FILE` of every family: rows with host time, holes, marks, settings at both ends, and an end in every case."""

from __future__ import annotations

import csv
import itertools
import json
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import handctl
from handctl.command import log_command
from handctl.devices.inspire.exo.device import ExoHand
from handctl.errors import NoAnswer
from handctl.families import FAMILIES
from handctl.link.fake import FakeLink
from handctl.model.export_formats import FORMATS
from handctl.model.param import Element, Reading
from handctl.record import csv_and_sidecar
from handctl.record.marks import MOST, Heard, Marks
from handctl.record.recording_loop import Loop
from handctl.sim import model_class
from handctl.system import clock
from tests.contract.facts import facts_of
from tests.support.cli import Result, run
from tests.support.each_row import each_row

ANSWERS: dict[str, dict[str, object]] = {"aidin": {"exchange": "poll"}}
"""A stream goes on by the clock: which of its objects a row has is not the same twice."""
LEAD = ["host_utc_s", "host_mono_s", "t_s", "segment", "seq", "rtt_ms"]


def log(kind: str, path: Path, *args: str, **options: object) -> Result:
    state = facts_of(kind).state
    link = f"fake://{kind}?clock=virtual" + "".join(f"&{key}={value}" for key, value in options.items())
    return run(kind, "log", path, *args, "-p", f"{link}&{state}".rstrip("&"), "--json")


def kept(path: Path) -> tuple[list[dict[str, str]], dict[str, Any]]:
    """The rows and the sidecar."""
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    return rows, json.loads(Path(f"{path}.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_log_has_a_row_for_each_answer_and_a_sidecar(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = log(kind, path, "--count", "5", "--rate", "20", "--mark", "begin")
    assert done.code == 0, done
    rows, about = kept(path)
    assert [name for name in rows[0] if name in LEAD] == LEAD
    assert [row["seq"] for row in rows] == [*"12345"] and rows[0]["mark"] == "begin"
    moments = [float(row["host_mono_s"]) for row in rows]
    assert [moment - moments[0] for moment in moments] == pytest.approx([0, 0.05, 0.1, 0.15, 0.2], abs=0.011)
    assert (about["schema"], about["complete"], about["missing"], about["rows"]) == (
        f"handctl-{kind}-log/1",
        True,
        [],
        5,
    )
    assert about["simulated"] is True and about["settings_changed"] == []
    assert about["settings_before"] == about["settings_after"]
    told = run(kind, "dump", "-p", done.json["device"]["link"], "--json").json["device"]
    assert done.json["device"].get("model") == told.get("model")
    named = {str(column["column"]) for column in about["columns"]}
    assert named < set(rows[0]) and all(row[name] != "" for row in rows for name in named)


@pytest.mark.parametrize("kind", FAMILIES)
def test_what_was_there_stays_until_there_is_a_row(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    assert log(kind, path, "--count", "5").code == 0
    earlier = [path.read_bytes(), Path(f"{path}.json").read_bytes()]
    for answers in range(40):  # the settings are read, and then the device falls silent
        silent: dict[str, object] = {"fault": "deaf", "after": answers, **ANSWERS.get(kind, {})}
        done = log(kind, path, "--force", "--silence", "1", "--count", "2", **silent)
        if done.rows and done.rows[0]["rows"]:
            break
        assert done.code == 4 and [path.read_bytes(), Path(f"{path}.json").read_bytes()] == earlier, (answers, done)
    assert log(kind, path, "--force", "--count", "2").code == 0
    rows, about = kept(path)
    assert (len(rows), about["rows"], about["complete"]) == (2, 2, True)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.csv", "a.csv.json"]


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_port_that_comes_back_goes_on_in_the_same_file(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = log(kind, path, "--rate", "20", "--duration", "5", unplug="2.03:1.3")
    assert done.code == 0, done
    rows, about = kept(path)
    (hole,) = about["holes"]
    before, after = rows[hole["row"] - 2], rows[hole["row"] - 1]
    assert (before["segment"], after["segment"]) == ("1", "2") and after["mark"].startswith("[port lost]")
    length = float(after["host_mono_s"]) - float(before["host_mono_s"])
    assert 1.3 <= length < 1.6 and hole["length_s"] == pytest.approx(length, abs=0.0011)
    assert (about["complete"], "port-lost" in about["missing"]) == (False, True)
    assert about["duration_s"] == pytest.approx(
        float(rows[-1]["host_mono_s"]) - float(rows[0]["host_mono_s"]), abs=0.06
    )


@pytest.mark.parametrize("kind", FAMILIES)
def test_ctrl_c_ends_a_log_with_all_its_rows(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, sleep = tmp_path / "a.csv", FakeLink.sleep

    def pressed(link: FakeLink, seconds: float) -> None:
        if path.exists() and path.read_bytes().count(b"\n") == 8 and not done:
            done.append(1)
            raise KeyboardInterrupt
        sleep(link, seconds)

    done: list[int] = []
    monkeypatch.setattr(FakeLink, "sleep", pressed)
    ended = log(kind, path, "--rate", "20")
    rows, about = kept(path)
    assert (ended.code, len(rows), about["ended"], about["complete"]) == (130, 7, "interrupted", True), ended


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_duration_ends_it_where_time_passes_only_with_what_is_done(kind: str, tmp_path: Path) -> None:
    """On virtual time, as fast as the device answers; from the library as well."""
    path = tmp_path / "a.csv"
    assert log(kind, path, "--duration", "0.5").code == 0
    assert 0.4 <= kept(path)[1]["duration_s"] <= 0.5
    with handctl.simulate(kind) as device:  # type: ignore[call-overload]
        device.log(str(tmp_path / "b.csv"), duration=0.5)
    assert 0.4 <= kept(tmp_path / "b.csv")[1]["duration_s"] <= 0.5


@pytest.mark.parametrize("kind", FAMILIES)
def test_append_records_the_next_trial_into_a_file_with_its_number(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    names = ["walk.csv", "walk-2.csv", "walk-3.csv"]
    for number, name in enumerate(names, 1):
        done = log(kind, path, "--append", "--count", str(number))
        assert (done.code, done.rows[0]["trial"], Path(done.rows[0]["file"]).name) == (0, number, name), done
    assert [kept(tmp_path / name)[1]["trial"] for name in names] == [1, 2, 3]
    assert [len(kept(tmp_path / name)[0]) for name in names] == [1, 2, 3]
    (tmp_path / "walk-2.csv").unlink()
    (tmp_path / "walk-2.csv.json").unlink()
    assert log(kind, path, "--append", "--count", "1").rows[0]["trial"] == 4, "a number is never given twice"


@each_row(("misses", "code"), [(range(1, 9), 4), (range(2, 4), 0), (range(0), 0)], ids=["never", "twice", "whole"])
def test_what_was_not_read_is_missing(
    misses: range, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, reads, read = tmp_path / "a.csv", itertools.count(), ExoHand.read

    def lame(device: ExoHand, elements: Sequence[Element]) -> list[Reading]:
        found = read(device, elements)
        silent = {"temperature.index"} if len(elements) == 10 and next(reads) + 1 in misses else set[str]()
        return [
            one._replace(value=None, error=NoAnswer("no reply")) if one.element.full_name in silent else one
            for one in found
        ]

    monkeypatch.setattr(ExoHand, "read", lame)
    done = log("exo", path, "force_actual", "temperature", "--count", "4", "--rate", "20")
    rows, about = kept(path)
    count = sum(row["temperature.index_°C"] == "" for row in rows)
    assert (done.code, len(rows), count, all(row["temperature.ring_°C"] for row in rows)) == (
        code, 4, min(4, len(misses)), True,
    )  # fmt: skip
    assert (about["complete"], about["missing"]) == (not count, ["unread"] if count else [])
    assert about["unread"] == ({"temperature.index_°C": count} if count else {})
    assert ("unread" in done.codes()) is bool(count)
    assert run("exo", "log", "--check", path).code == (7 if count else 0)


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_name_that_is_no_utf8_spoils_no_recording(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "caf\udce9.csv"
    done = log(kind, path, "--count", "2")
    _, about = kept(path)
    assert (done.code, about["file"], Path(done.rows[0]["file"]).name) == (0, "caf\\xe9.csv", "caf\\xe9.csv")
    sidecar = Path(f"{path}.json")
    for older in (sidecar.read_bytes(), json.dumps(about | {"file": path.name}).encode()):
        sidecar.write_bytes(older)
        assert run(kind, "log", "--check", path).code == 0
        for form, one in FORMATS.items():
            if one.library:
                pytest.importorskip(one.library)
            out = tmp_path / f"{len(older)}.{form}"
            assert run(kind, "export", path, "--to", form, "-o", out).code == 0, form
            for file in [out] if out.is_file() else (one for one in out.rglob("*") if one.is_file()):
                assert b"\\udce9" not in file.read_bytes(), file


MARKS = ("x" * 66_000, "é" * 60_000, '"' * 500)


@each_row("by", ["option", "line", "udp", "key", "lsl"])
@pytest.mark.parametrize("text", MARKS, ids=["x", "é", "quotes"])
def test_a_long_mark_keeps_its_beginning(by: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    with closing(Marks(lambda: text if by == "key" else "")) as marks:
        if by in ("line", "udp"):
            marks.hear(text, by)
        elif by == "lsl":
            marks.hear(text, by, 1.0)
        (mark,) = log_command._first(text if by == "option" else "", marks.take)()
    assert mark.text == text[:200]
    assert log("exo", path, "--count", "2", "--mark", text).code == 0
    rows, about = kept(path)
    assert rows[0]["mark"] == about["marks"][0]["text"] == text[:200]
    assert run("exo", "log", "--check", path).code == 0


def test_a_clock_that_is_set_during_a_log_moves_no_mark_and_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By another server of time, or because the computer slept: rows and marks have the time of day of one moment."""
    wall = FakeLink.wall
    monkeypatch.setattr(FakeLink, "wall", lambda link: wall(link) - 7200.5 * (link.now() > 0.1))
    path = tmp_path / "a.csv"
    done = log("exo", path, "--count", "5", "--rate", "20")
    assert (done.code, done.codes().count("clock-set")) == (0, 1), done
    rows, about = kept(path)
    assert about["clock_set_s"] == -7200.5
    assert len({round(float(row["host_utc_s"]) - float(row["host_mono_s"]), 6) for row in rows}) == 1
    with closing(Marks(str)) as marks:
        marks.hear("before", "udp")
        monkeypatch.setattr(clock, "wall", lambda: 0.0)
        marks.hear("behind", "udp")
        marks.hear("earlier", "lsl", clock.now() - 5)
        before, behind, earlier = ((one.utc_s or 0.0) - (one.mono_s or 0.0) for one in marks.take())
    assert behind == pytest.approx(before, abs=2e-6) and earlier == pytest.approx(before, abs=2e-6)


@pytest.mark.parametrize("kind", FAMILIES)
def test_no_mark_is_a_formula_where_none_is_wanted(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    for more, text in (((), "=1+1"), (("--no-formulas",), "'=1+1")):
        assert log(kind, path, "--count", "2", "--mark", "=1+1", "--force", *more).code == 0
        rows, about = kept(path)
        assert rows[0]["mark"] == about["marks"][0]["text"] == text
        assert run(kind, "log", "--check", path).code == 0


def test_many_marks_at_once_go_to_rows_that_can_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, lines = tmp_path / "a.csv", [f"{number} {MARKS[1][:190]}" for number in range(100)]
    monkeypatch.setattr(log_command, "_first", lambda *_: lambda: [Heard(lines.pop(0)) for _ in [*lines]])
    assert log("exo", path, "--count", "5", "--rate", "20").code == 0
    rows, about = kept(path)
    assert [row["mark"].count("é") // 190 for row in rows] == [MOST, MOST, 100 - 2 * MOST, 0, 0]
    assert [one["row"] for one in about["marks"]] == [1, 2, 3]
    assert run("exo", "log", "--check", path).code == 0


@pytest.mark.parametrize("more", [(), ("--force",)], ids=str)
def test_of_two_that_begin_a_trial_at_once_one_gets_the_next_number(
    more: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = log_command.refuse_existing

    def begun_by_another(path: str, force: bool, *, final: bool) -> None:
        looks(path, force, final=final)
        Path(path).write_text("theirs\n")

    monkeypatch.setattr(log_command, "refuse_existing", begun_by_another)
    done = log("exo", tmp_path / "walk.csv", "--append", "--count", "2", *more)
    assert (done.code, done.rows[0]["trial"], kept(tmp_path / "walk-2.csv")[1]["trial"]) == (0, 2, 2)
    assert (tmp_path / "walk.csv").read_text() == "theirs\n"


@pytest.mark.parametrize("more", [(), ("--force",)], ids=str)
def test_of_two_that_begin_in_one_folder_at_once_both_record(
    more: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a left and a right hand, which a script starts in the same second."""
    monkeypatch.setattr(log_command, "file_name", lambda folder, _kind: f"{folder}/exo-now.csv")
    rows = [log("exo", tmp_path, "--count", "2", *more).rows[0] for _ in range(3)]
    assert [Path(row["file"]).name for row in rows] == ["exo-now.csv", "exo-now-2.csv", "exo-now-3.csv"]
    assert not any("trial" in row for row in rows) and len(list(tmp_path.glob("*.json"))) == 3


def test_a_trial_whose_name_cannot_be_had_is_refused(tmp_path: Path) -> None:
    for name in ("walk-999999.csv", "walk-1000000.csv"):
        (tmp_path / name).touch()
    assert log("exo", tmp_path / "walk.csv", "--append", "--count", "2").code == 2


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_replay_gives_the_rows_that_were_recorded(kind: str, tmp_path: Path) -> None:
    """What --trace kept of a log plays the device: the same values in the same order, and the same settings."""
    path, again, trace = tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "a.trace"
    assert (
        log(kind, path, "--count", "12", "--rate", "20", "--trace", str(trace), use="on", **ANSWERS.get(kind, {})).code
        == 0
    )
    done = run(kind, "log", again, "--count", "12", "--rate", "20", "-p", f"replay:{trace}", "--json")
    assert done.code == 0, done
    (first, about), (second, told) = kept(path), kept(again)
    named = [str(column["column"]) for column in about["columns"]]
    values = [[[row[name] for name in named] for row in rows] for rows in (first, second)]
    assert values[0] == values[1] and told["settings_before"] == about["settings_before"]
    if model_class(kind).CONTROL:  # else nobody can use its simulator
        assert len({tuple(row) for row in values[0]}) > 1, "nothing moved, so nothing is shown"


@pytest.mark.parametrize("kind", [kind for kind in FAMILIES if kind != "ekso"])
def test_only_the_named_quantities(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    with handctl.simulate(kind) as device:  # type: ignore[call-overload]
        live = next(row["path"] for row in device.dump() if "error" not in row)
    done = log(kind, path, live, "--count", "2")
    assert done.code == 0, done
    assert [column["name"] for column in kept(path)[1]["columns"]] == [live]
    assert log(kind, tmp_path / "b.csv", "nonsense", "--count", "2").code == 2
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.parametrize("kind", FAMILIES)
def test_two_never_record_into_one_file(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each wrote at its own place: rows of both and zeros between them, and both ended with exit code 0."""
    path, again = tmp_path / "a.csv", []
    take = Loop.step

    def step(loop: Loop) -> None:
        take(loop)
        if not again:
            again.append(log(kind, path, "--count", "2", "--force"))

    monkeypatch.setattr(Loop, "step", step)
    assert log(kind, path, "--count", "5").code == 0
    assert (again[0].code, again[0].error["code"]) == (2, "file-exists")
    assert len(kept(path)[0]) == 5 and run(kind, "log", "--check", path).code == 0
    assert log(kind, path, "--count", "2", "--force").code == 0 and len(kept(path)[0]) == 2


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_mark_port_that_is_taken_leaves_no_file(kind: str, tmp_path: Path) -> None:
    """An empty recording was left: the next try was refused, or had the number of the next trial."""
    with closing(Marks(str, port=0)) as taken:
        done = log(kind, tmp_path / "a.csv", "--count", "2", "--mark-udp", str(taken.port), "--append")
    assert (done.code, done.error["code"]) == (3, "mark-udp") and not list(tmp_path.iterdir())


EDITS: dict[str, Callable[[list[str]], list[str]]] = {
    "two names swapped": lambda row: [*row[:8], row[9], row[8], *row[10:]],
    "a unit more": lambda row: [*row[:8], f"{row[8]}_g", *row[9:]],
    "a column less": lambda row: [*row[:8], *row[9:]],
    "a column more": lambda row: [*row[:8], "7", *row[8:]],
}
"""What somebody did to a file: with its header alone, or with all of its rows."""


@pytest.mark.parametrize("kind", FAMILIES)
def test_columns_that_are_not_those_of_the_sidecar_are_refused(kind: str, tmp_path: Path) -> None:
    """A value under another name or unit is worse than none."""
    path = tmp_path / "a.csv"
    assert log(kind, path, "--count", "2").code == 0
    rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    for what, edit in EDITS.items():
        some = len(rows) if "column" in what else 1
        with path.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([*map(edit, rows[:some]), *rows[some:]])
        for args in (("log", "--check", path), ("export", path, "--to", "xdf", "-o", tmp_path / "a.xdf")):
            done = run(kind, *args, "--json")
            assert (done.code, done.error["code"]) == (2, "damaged-log"), what


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_log_whose_disk_was_full_says_so_when_it_is_checked(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No room for the last sidecar: the first one gets the reason in its own room, and handctl was not killed."""
    path, write, calls = tmp_path / "a.csv", csv_and_sidecar.atomic_write, []

    def full(place: str) -> Any:
        calls.append(place)
        if len(calls) > 1:
            raise OSError(28, "No space left on device")
        return write(place)

    monkeypatch.setattr(csv_and_sidecar, "atomic_write", full)
    assert log(kind, path, "--count", "3", "--rate", "20").code == 1
    rows, sidecar = kept(path)
    assert (len(rows), sidecar["closed"], sidecar["ended"]) == (3, False, "limit")
    done = run(kind, "log", "--check", path, "--json")
    assert done.code == 7 and "killed" not in done.out
