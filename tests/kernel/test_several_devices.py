"""One command on several named devices: a column for the device, an envelope for each, the highest exit code."""

from __future__ import annotations

import csv
import io
import json
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from handctl.command.command_lines import parse_line
from handctl.command.several_devices import EachDevice, EveryAccess
from handctl.errors import STOPPED
from handctl.link import ByteLink, open_link
from handctl.model.stop_on_interrupt import NOT_STOPPED
from tests.support.cli import Result, check_schema, environment, in_time, run
from tests.support.each_row import each_row

Go = Callable[..., Result]
LINKS = {
    "left": ("exo", "fake://exo?clock=virtual"),
    "right": ("exo", "fake://exo?clock=virtual&seed=2"),
    "arm": ("barrett", "fake://barrett?clock=virtual"),
    "mute": ("exo", "fake://exo?clock=virtual&fault=silent"),
    "second": ("exo", "fake://exo?clock=virtual&id=2"),
}


@pytest.fixture
def go(tmp_path: Path) -> Go:
    """Run with these devices in the configuration file."""
    config = tmp_path / "config.toml"
    config.write_text(
        "".join(
            f'[devices.{name}]\nkind = "{kind}"\nport = "{link}"\n{"id = 2" if "id=2" in link else ""}\n'
            for name, (kind, link) in LINKS.items()
        )
    )
    return lambda *words: run(*words, env={"HANDCTL_CONFIG": str(config)})


def test_one_table_with_a_column_for_the_device(go: Go) -> None:
    result = go("-d", "left,right", "get", "id", "temperature.index")
    assert result.code == 0 and result.err == "", result
    assert result.lines[0].split()[:2] == ["Device", "Name"] and [line.split()[0] for line in result.lines[1:5]] == [
        "left",
        "left",
        "right",
        "right",
    ]
    told = go("exo", "get", "id", "-d", "left,right", "--csv").out
    rows = list(csv.DictReader(io.StringIO(told)))
    assert [(row["device"], row["value"]) for row in rows] == [("left", "1"), ("right", "1")]
    assert go("get", "--device=left,right", "id", "--format", "plain").lines == ["left\t1", "right\t1"]


def test_one_envelope_with_that_of_each(go: Go) -> None:
    result = go("-d", "left,right", "exo", "status", "--json")
    envelope = result.json
    assert (envelope["command"], envelope["device"], envelope["rows"]) == ("exo status", None, [])
    assert [one["name"] for one in envelope["results"]] == ["left", "right"]
    for one in envelope["results"]:
        alone = go("-d", one.pop("name"), "exo", "status", "--json").json
        check_schema(one)
        assert (
            one["rows"] == alone["rows"] and one["device"] == alone["device"] and one["counters"] == alone["counters"]
        )


def test_a_star_is_every_device_of_the_file(go: Go) -> None:
    result = go("-d", "*", "get", "temperature", "--json", "--timeout", "0.1")
    assert [one["name"] for one in result.json["results"]] == list(LINKS)
    assert {one["device"]["kind"] for one in result.json["results"]} == {"exo", "barrett"}
    assert result.json["command"] == "get" and result.code == 4


def test_the_highest_exit_code_and_the_rows_of_the_others(go: Go) -> None:
    result = go("-d", "mute,left", "get", "id", "--timeout", "0.1")
    assert result.code == 4 and result.lines[1].split()[0] == "left", result
    assert "1 of 2 devices: mute: id 1 on" in result.err
    codes = [
        one["exit_code"] for one in go("-d", "mute,left", "get", "id", "--timeout", "0.1", "--json").json["results"]
    ]
    assert codes == [4, 0]


def test_samples_of_all_in_one_stream(go: Go) -> None:
    result = go("-d", "left,right", "watch", "id", "--count", "3", "--json")
    *rows, last = map(json.loads, result.lines)
    assert sorted((row["device"], row["t"]) for row in rows) == [
        (name, t) for name in ("left", "right") for t in (0.0, 0.1, 0.2)
    ]
    check_schema(last["end"])
    assert [one["stream"]["samples"] for one in last["end"]["results"]] == [3, 3]
    assert go("-d", "left,right", "watch", "id", "--count", "1", "--csv").lines[0].startswith("t_s,device,name")


def test_stop_takes_several(go: Go) -> None:
    for words in (("-d", "left,arm", "stop"), ("-d", "left,right", "exo", "stop")):
        result = go(*words, "--json")
        assert result.code == 0 and all(one["writes"] for one in result.json["results"]), result


@pytest.mark.parametrize(
    "words", ["set position_set=1", "save", "raw 00", "id 3", "describe", "restore x.json", "read 1000 1", "scan"]
)
def test_what_else_there_is_takes_one(go: Go, words: str) -> None:
    result = go("-d", "left,right", "exo", *words.split(), "-y")
    assert result.code == 2 and "takes one device at a time" in result.err, result


def test_what_cannot_be_meant(go: Go, tmp_path: Path) -> None:
    assert "no device is named 'nobody'" in go("-d", "left,nobody", "status").err.casefold()
    assert "is of family barrett" in go("exo", "-d", "left,arm", "status").err
    assert run("-d", "*", "status", env={"XDG_CONFIG_HOME": str(tmp_path / "none")}).code == 2
    assert go("-d", "left,right", "exo", "snapshot", tmp_path / "one.json").code == 2
    assert go("-d", "left,right", "exo", "status", "--trace", tmp_path / "one.txt").code == 2
    for how in (("--format", "openmetrics"), ("--csv", "--wide")):
        assert "several devices" in go("-d", "left,right", "exo", "watch", "id", "--count", "1", *how).err
    assert not (tmp_path / "one.json").exists() and not (tmp_path / "one.txt").exists()


def test_each_has_its_own_files(go: Go, tmp_path: Path) -> None:
    pattern = tmp_path / "{name}.json"
    assert go("-d", "left,right", "exo", "snapshot", pattern).code == 0
    assert {path.name for path in tmp_path.glob("*.json")} == {"left.json", "right.json"}
    assert go("-d", "left,right", "exo", "diff", pattern).code == 0
    assert go("-d", "left,right", "exo", "report", tmp_path / "{name}.html", "--watch", "0").code == 0
    assert go("-d", "left,right", "exo", "status", "-o", tmp_path / "all.csv", "--csv").out == ""
    assert "right" in (tmp_path / "all.csv").read_text(encoding="utf-8")


@pytest.mark.real
def test_they_run_at_the_same_time(tmp_path: Path) -> None:
    config = tmp_path / "config.toml"
    config.write_text(
        "".join(f'[devices.d{number}]\nkind = "exo"\nport = "fake://exo?fault=silent"\n' for number in range(8))
    )
    words = ("-d", "*", "get", "id", "--timeout", "0.5", "--retries", "0", "--baud", "115200")

    def asked() -> None:
        assert run(*words, env={"HANDCTL_CONFIG": str(config)}).code == 4

    in_time(asked, 0.5, 8 * 0.5)


def test_the_highest_exit_code_counts_wherever_it_stands(tmp_path: Path) -> None:
    links = {"mute": "silent", "garbled": "bad-checksum"}
    config = tmp_path / "config.toml"
    config.write_text(
        "".join(
            f'[devices.{name}]\nkind = "exo"\nport = "fake://exo?clock=virtual&fault={fault}"\n'
            for name, fault in links.items()
        )
    )
    for names in ("mute,garbled", "garbled,mute"):
        result = run("-d", names, "get", "id", "--timeout", "0.1", env={"HANDCTL_CONFIG": str(config)})
        assert result.code == 5 and "2 of 2 devices" in result.err, result


def test_two_devices_are_compared_with_each_other(go: Go) -> None:
    same = go("-d", "left,right", "diff", "--json")
    assert (same.code, same.rows, same.codes()) == (0, [], ["equal"]), same
    other = go("-d", "left,second", "diff", "--json")
    assert (other.code, [(row["name"], row["a"], row["b"]) for row in other.rows]) == (7, [("id", 1, 2)])
    assert other.error["code"] == "differ" and [one["name"] for one in other.json["results"]] == ["left", "second"]
    shown = go("-d", "left,second", "exo", "diff").lines
    assert shown[0].split() == ["Name", "left", "second"] and shown[1].split() == ["id", "1", "2"]
    assert go("-d", "left,right", "diff", "--setpoints", "--format", "plain").code == 0


@each_row(("words", "code"), [
    (("-d", "left,arm", "diff"), 2), (("-d", "left,right,second", "diff"), 2), (("-d", "left", "diff"), 2),
    (("-d", "left,mute", "diff"), 4), (("-d", "*", "diff"), 2),
])  # fmt: skip
def test_what_cannot_be_compared(go: Go, words: tuple[str, ...], code: int) -> None:
    assert go(*words).code == code


@each_row(
    ("names", "code", "exit_code"),
    [(("left", "arm"), STOPPED, 130), (("left", "mute"), NOT_STOPPED, 4), (("mute", "left"), NOT_STOPPED, 4)],
)
def test_the_stop_key_stops_all_and_a_device_that_did_not_answer_decides(
    tmp_path: Path, names: tuple[str, ...], code: str, exit_code: int
) -> None:
    """Links that are not open are opened for it; the streams of a view that has them open are in tests/stop/test_key.py."""
    config = tmp_path / "config.toml"
    config.write_text(
        "".join(
            f'[devices.{name}]\nkind = "{kind}"\nport = "{link}"\n'
            for name, (kind, link) in LINKS.items()
            if "id=2" not in link
        )
    )
    with environment({"HANDCTL_CONFIG": str(config)}):
        every = [EachDevice(name, parse_line([LINKS[name][0], "watch", "-d", name], {})) for name in names]
        access = EveryAccess(every[0].run, lambda: every)
        access.stop("stopped by the key S")
    assert access.pressed_once.is_set() and access.stopped is not None
    assert (access.stopped.code, access.stopped.exit_code) == (code, exit_code)
    assert all(f"{name}: " in access.stopped.text.lower() for name in names)


def test_what_another_thread_does_on_a_link_that_is_being_stopped_is_interrupted() -> None:
    link = open_link("fake://exo?clock=virtual")
    assert isinstance(link, ByteLink)
    link.only_this_thread()
    link.write(b"x", link.deadline(1))
    ended: list[str] = []

    def use(what: str) -> None:
        try:
            link.write(b"x", link.deadline(1)) if what == "write" else link.read(link.deadline(1))
        except KeyboardInterrupt:
            ended.append(what)

    for what in ("write", "read"):
        thread = threading.Thread(target=use, args=(what,))
        thread.start()
        thread.join()
    assert ended == ["write", "read"]
    link.close()
