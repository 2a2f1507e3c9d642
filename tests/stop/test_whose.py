"""`handctl stop -p LINK` finds the family: of the holder, the last command, a named device there, or who answers."""

from __future__ import annotations

import os
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from handctl.command import open_links
from handctl.command.run import Run
from handctl.families import FAMILIES
from handctl.link import Deadline, Link, device_lock
from handctl.link.device_lock import Holder, InUse, hold
from handctl.model.command_settings import Settings
from handctl.model.result import Journal
from handctl.model.stop_sequence import StopContext, TwoParts, stop_sequence_of
from handctl.stop.stop_command import _end
from handctl.system import processes
from handctl.tools import stop
from tests.stop.bench import HOST, PORT, Bench, last_family, lock_file
from tests.support.cli import Result, run
from tests.support.each_row import each_row


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def at(family: str) -> str:
    return HOST if family == "aidin" else PORT


def stopped(family: str, result: Result) -> bool:
    """Whether the bytes are those of the stop of this family."""
    wanted = run(family, "stop", "--json", "-p", f"fake://{family}?clock=virtual")
    return result.code == 0 and [row["bytes"] for row in result.rows] == [row["bytes"] for row in wanted.rows]


@each_row("family", FAMILIES)
@each_row("last", ["ended", "killed", "a scan after it"])
def test_the_last_command_tells_the_family(family: str, last: str, bench: Bench) -> None:
    bench.there = f"{family}?"
    link = at(family)
    assert run(family, "status", "-p", link).code in (0, 7)
    assert lock_file().read_text() == f"\n{family}\n"
    if last == "killed":
        lock_file().write_text(f"4194303000\t1\t{family}\twrites\tx\thandctl {family} watch\n{family}\n")
    elif last == "a scan after it":
        held = hold(link, "handctl scan")
        assert held is not None
        held.release()
    result = run("stop", "-p", link, "--json")
    assert stopped(family, result) and bench.asked == [], result


def test_what_is_kept_is_nobody_who_has_the_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the family is kept, and no number that could be another process by now."""
    held = hold(PORT, "handctl exo watch", family="exo")
    assert held is not None
    lock_file().write_text("\nexo\n")
    monkeypatch.setattr(device_lock, "LAST_STOP_SECONDS", 0.0)
    with pytest.raises(InUse) as caught:
        hold(PORT, "handctl exo get")
    assert caught.value.holder is None and last_family(PORT) == "exo"
    held.release()
    for text in ("", "exo", "\n", f"{os.getpid()}\n", "\x00\xff\n\x00\n"):
        lock_file().write_text(text)
        assert last_family(PORT) not in FAMILIES


@each_row("family", FAMILIES)
@each_row("name", ["{place}", "{alias}", "spy://{place}", "can:slcan:{place}"])
def test_a_named_device_at_the_place_tells_the_family(family: str, name: str, bench: Bench, tmp_path: Path) -> None:
    """By whatever name; and what it says of the device holds."""
    if family == "aidin" or (name.startswith("can:") and family not in ("wrist", "hand")):
        return
    can = name.startswith("can:")
    bench.there = f"{family}?bus=can&" if can else f"{family}?"
    alias = tmp_path / "by-id"
    alias.symlink_to(PORT)
    path = tmp_path / "config.toml"
    port = name.format(place=PORT, alias=alias)
    ids = "id = 1\n" if family in ("exo", "wrist", "hand") else ""
    path.write_text(f"[devices.other]\nkind = 'exo'\nport = '/dev/zero'\n[devices.left]\nkind = '{family}'\nport = '{port}'\n{ids}[devices.bad]\nkind = 3\n")  # fmt: skip
    env = {"HANDCTL_CONFIG": str(path)}
    result = run("stop", "-p", port if can else PORT, "--json", env=env)
    assert result.code == 0 and bench.asked == [] and result.json["command"] == "stop", result
    assert can or stopped(family, result), result


def test_the_id_of_the_named_device_holds(bench: Bench, tmp_path: Path) -> None:
    bench.there = "exo?id=7&"
    path = tmp_path / "config.toml"
    path.write_text(f"[devices.left]\nkind = 'exo'\nport = '{PORT}'\nid = 7\n")
    env = {"HANDCTL_CONFIG": str(path)}
    result = run("stop", "-p", PORT, "--json", env=env)
    assert result.code == 0 and all(row["bytes"].startswith("EB 90 07") for row in result.rows), result
    assert run("stop", "-p", PORT, "--id", "8", env=env).code == 4, "what is typed stands before it"
    path.write_text(path.read_text() + f"[devices.right]\nkind = 'exo'\nport = '{PORT}'\nid = 8\n")
    result = run("stop", "-p", PORT, "--json", env=env)
    assert result.code == 4 and "stop -d left,right" in str(result.json["messages"]), result


@each_row("family", FAMILIES)
def test_who_answers_tells_the_family(family: str, bench: Bench) -> None:
    bench.there, bench.asked = f"{family}?", []
    result = run("stop", "-p", at(family), "--json")
    assert stopped(family, result) and "found" in result.codes(), result
    assert len(bench.asked) == 1 and bench.asked[0] <= stop.SECONDS, bench.asked


@each_row("family", FAMILIES)
def test_where_nobody_answers_the_next_step_is_said(family: str, bench: Bench) -> None:
    bench.there, bench.asked = f"{family}?fault=silent&", []
    result = run("stop", "-p", at(family), "--json")
    assert result.code == 4 and result.error["code"] == "no-family", result
    assert "03" in [row["bytes"] for row in result.rows], "a BarrettHand that moves replies to nothing else"
    assert f"handctl FAMILY stop -p {at(family)}" in result.error["hint"] and bench.asked[0] <= stop.SECONDS + 0.05
    for words in (("-p", "replay:/nothing"), ("-p", at(family), "-n")):
        unsent = run("stop", *words, "--json")
        assert (unsent.code, unsent.error["code"]) == (2, "no-family") and not unsent.json["counters"]["sent"], unsent


MOVING = "barrett?initialized=1&"


@each_row("before", ["nothing", "a command that failed", "a command that reached it", "a name", "a name and -d"])
@each_row("family", [family for family in FAMILIES if family not in ("barrett", "aidin")])
def test_a_hand_that_moves_and_replies_to_its_stop_alone_is_stopped(
    family: str, before: str, bench: Bench, tmp_path: Path
) -> None:
    """A BarrettHand is silent until its movement ends. What is kept of the port, or its name, may be out of date."""
    path = tmp_path / "config.toml"
    path.write_text(f"[devices.left]\nkind = '{family}'\nport = '{PORT}'\n" if before.startswith("a name") else "")
    if before == "a command that reached it":
        bench.there = f"{family}?"
        assert run(family, "status", "-p", PORT).code in (0, 7)
    bench.there, bench.first = MOVING, b"FSET MCV 16\rC\r"
    if before == "a command that failed":
        assert run(family, "status", "-p", PORT).code in (4, 5)
        assert last_family(PORT) == "", "it has not met a device of its family"
    where = ("-d", "left") if before == "a name and -d" else ("-p", PORT)
    result = run("stop", *where, "--json", env={"HANDCTL_CONFIG": str(path)})
    assert (result.code, result.json["device"]["kind"]) == (0, "barrett"), result
    last = [(row["bytes"], row["answer"]) for row in result.rows[-3:]]
    assert [wire for wire, _ in last] == [
        "03",
        "54 0D",
        b"FGET P\r".hex(" ").upper(),
    ] and b"ERR 16384" in bytes.fromhex(last[0][1]), result
    assert [write["state"] for write in result.json["writes"][-2:]] == ["confirmed"] * 2
    assert last_family(PORT) == "barrett"


def test_what_reads_what_failed_and_what_wrote_tell_the_family_as_they_should(bench: Bench) -> None:
    """Only a device that was met, or written to, is of the family of its command; a stop shows it by its acknowledgement."""
    for command, there, kept in (
        (("exo", "status"), "exo?fault=silent&", ""),
        (("exo", "stop"), "exo?fault=silent&", ""),
        (("exo", "status"), "hand?", ""),
        (("ekso", "status"), "ekso?", "ekso"),
        (("exo", "stop"), "barrett?", "ekso"),
        (("wrist", "scan"), "barrett?", "ekso"),
        (("exo", "stop"), "exo?", "exo"),
    ):
        bench.there = there
        run(*command, "-p", PORT)
        assert last_family(PORT) == kept, (command, there)


@each_row("named", ["barrett", "exo", "wrist", "hand", "ekso"])
def test_a_name_of_another_family_refuses_no_stop(named: str, bench: Bench, tmp_path: Path) -> None:
    """The device that is found is stopped, and the result says which it is."""
    path = tmp_path / "config.toml"
    ids = "id = 1\n" if named in ("exo", "wrist", "hand") else ""
    path.write_text(f"[devices.left]\nkind = '{named}'\nport = '{PORT}'\n{ids}")
    there = "exo" if named == "ekso" else "ekso"
    bench.there = f"{there}?"
    result = run("stop", "-d", "left", "--json", env={"HANDCTL_CONFIG": str(path)})
    wanted = run(there, "stop", "--json", "-p", f"fake://{there}?clock=virtual")
    assert (result.code, result.json["device"]["kind"]) == (wanted.code, there), result
    assert [row["bytes"] for row in result.rows][-len(wanted.rows) :] == [row["bytes"] for row in wanted.rows]
    assert "other-device" in result.codes() and result.json["writes"][-1]["state"] == "confirmed"
    sent = [write for write in result.json["writes"] if write["next"]]
    assert all(f"handctl {there}" not in write["next"] for write in sent), "each step in the words of its own family"


SERIAL = [family for family in FAMILIES if family != "aidin"]


@each_row("before", SERIAL)
def test_another_device_than_the_last_one_is_stopped(before: str, bench: Bench) -> None:
    """What is kept of a port may be out of date: who answers there is stopped, by its own bytes, and it is told."""
    for there in SERIAL:
        if (before, there) == ("hand", "wrist"):
            continue  # a wrist passes on what is for the hand behind it
        bench.there = f"{before}?"
        assert run(before, "status", "-p", PORT).code in (0, 7)
        bench.there = f"{there}?"
        result = run("stop", "-p", PORT, "--json")
        wanted = run(there, "stop", "--json", "-p", f"fake://{there}?clock=virtual")
        rows = [row["bytes"] for row in result.rows]
        code = 4 if (before, there) == ("wrist", "hand") else 0  # the wrist may be there all the same, and move
        assert result.code == code and rows[-len(wanted.rows) :] == [row["bytes"] for row in wanted.rows], (
            there,
            result,
        )
        assert [row["step"] for row in result.rows] == list(range(1, len(rows) + 1))
        assert ("other-device" in result.codes()) == (there != before), (there, result)
        assert result.json["device"]["kind"] == there and result.json["writes"][-1]["state"] != "not-sent"


@each_row(
    ("before", "there", "first", "latest"),
    [
        ("barrett", "exo", "EB 90 01 0B 31", 1.2),
        ("barrett", "wrist", "EB 90 07 31 0E", 1.2),
        ("barrett", "hand", "EB 90 01 0F 12", 1.2),
        ("barrett", "ekso", "9C 02", 0.9),
        ("ekso", "exo", "EB 90 01 0B 31", 1.0),
    ],
)
def test_a_device_that_is_there_instead_does_not_wait_for_the_stop_of_the_last_one(
    before: str, there: str, first: str, latest: float, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is expected gets its bytes at once; after half a second of silence the one that is there gets its own, not after 4 s."""
    bench.there = f"{before}?"
    assert run(before, "status", "-p", PORT).code in (0, 7)
    bench.there = f"{there}?"
    sent, opened = list[tuple[float, bytes]](), open_links.open_link

    def noted(name: str, **options: Any) -> Link:
        link: Any = opened(name, **options)
        write = link.write

        def written(data: bytes, deadline: Deadline) -> None:
            sent.append((link.now(), data))
            write(data, deadline)

        link.write = written
        return link  # type: ignore[no-any-return]

    monkeypatch.setattr(open_links, "open_link", noted)
    result = run("stop", "-p", PORT, "--json")
    assert result.code == 0 and result.json["device"]["kind"] == there, result
    begin = bytes.fromhex(first) if there != "wrist" else bytes.fromhex("31 0E")
    came = min(when for when, data in sent if begin in data)
    assert sent[0][0] < 0.01 and came < latest, (came, sent[:3])


def test_a_stop_that_pauses_sends_all_that_it_would_have_sent() -> None:
    """Nobody replies: the rest of it follows, in the same order."""
    for family in FAMILIES:
        context, sent = StopContext(Settings(), speed=9600 if family == "barrett" else 115200), list[bytes]()
        parts = TwoParts(partial(stop_sequence_of, family))
        for sequence in (parts, parts.rest):
            with suppress(StopIteration):
                steps = sequence(context)
                action = next(steps)
                while True:
                    sent += [action.step.data] if action.sends else []
                    action = steps.send([])
            assert parts.paused == (sequence == parts), family
        whole, steps = list[bytes](), stop_sequence_of(family, context)
        with suppress(StopIteration):
            action = next(steps)
            while True:
                whole += [action.step.data] if action.sends else []
                action = steps.send([])
        assert sent == whole and len(whole) > 1, family


@each_row("family", ["exo", "wrist", "hand"])
def test_an_id_that_nobody_has_holds_up_no_stop(family: str, bench: Bench, tmp_path: Path) -> None:
    """Neither that of a variable nor that of a named device; what is typed stands. The id and its origin are told."""
    path = tmp_path / "config.toml"
    named = f"[devices.left]\nkind = '{family}'\nport = '{PORT}'\nid = 9\n"
    path.write_text(named)
    file = {"HANDCTL_CONFIG": str(path)}
    for words, env in (
        ((family, "stop", "-p", PORT), {"HANDCTL_ID": "9"}),
        (("stop", "-p", PORT), {"HANDCTL_ID": "9"}),
        ((family, "stop", "-d", "left"), file),
        (("stop", "-d", "left"), file),
    ):
        bench.there = f"{family}?"
        result = run(*words, "--json", env=env)
        assert result.code == 0 and result.json["device"]["id"] == 1, (words, result)
        assert "passed-over" in result.codes() or "found" in result.codes(), result
        assert any("9" in message["text"] for message in result.json["messages"]) or words[0] == "stop", result
    typed = run(family, "stop", "-p", PORT, "--id", "9", "--json")
    assert (typed.code, typed.json["device"]["id"]) == (4, 9) and "id 9 (command line)" in typed.error["text"], typed
    path.write_text(named + named.replace("left", "right").replace("9", "1"))
    result = run(family, "stop", "-d", "left", "--json", env=file)
    assert result.code == 4 and f"id 9 ({path}:4)" in result.error["text"], (
        "the other device is not the one that is meant"
    )


def test_the_result_names_the_id_and_counts_the_frames(bench: Bench) -> None:
    bench.there = "exo?"
    result = run("exo", "stop", "-p", PORT, "--json")
    counters = result.json["counters"]
    assert result.json["device"]["id"] == 1
    assert (counters["sent"], counters["received"]) == (
        sum(row["times"] for row in result.rows),
        sum(row["answer"] is not None for row in result.rows),
    )
    assert counters["received"] >= 5


@each_row(
    "command, state, asked, told",
    [
        ("handctl library", "R", 1.0, "within 1 s of SIGTERM"),
        ("handctl library", "T", 0.0, "asleep or blocked"),
        ("handctl exo watch", "R", 0.0, "asleep or blocked"),
    ],
)
def test_a_program_is_asked_before_it_is_ended_by_force(
    command: str, state: str, asked: float, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What else a program does is not ours to cut off. One that is asleep cannot hear, and a command of ours does nothing else."""
    ends: list[tuple[int, str, float]] = []

    def end(pid: int, start: str, _seconds: float, asking: float = 0.0) -> str:
        ends.append((pid, start, asking))
        return processes.KILLED

    monkeypatch.setattr(processes, "end", end)
    monkeypatch.setattr(processes, "sleeps", lambda _pid: state == "T")
    journal = Journal()
    _end(cast("Run", SimpleNamespace(journal=journal)), Holder(77, "5", "exo", "writes", PORT, command))
    assert ends == [(77, "5", asked)]
    (message,) = journal.messages
    assert message.code == "ended" and told in message.text and "by force" in message.text, message
