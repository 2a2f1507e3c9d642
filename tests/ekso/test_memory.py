"""The policy of the EksoNR over several runs of the tool: the audit log remembers the last writes (dossier 6)."""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Sequence
from datetime import datetime, timedelta, timezone
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from handctl.command.terminal_prompts import TerminalPrompts
from handctl.devices.ekso.audit_log import AuditLog, Past, logs, recent
from handctl.devices.ekso.parameter_map import EKSO
from handctl.devices.ekso.setting_writer import Writer
from handctl.devices.ekso.write_policy import STEP_SECONDS, write_limits_of
from handctl.errors import CheckFailed, DeviceRefused, Interrupted, NoAnswer, OutputError, UsageError
from handctl.system import user_folders
from tests.ekso.bench import Bench, change
from tests.ekso.commands import ME, unit
from tests.ekso.support import SET, frame, pack
from tests.support.cli import Result, run, sent, spying

PLACE = "fake://unit"
HOST = "bench"


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def do(*args: str | Path, port: str) -> Result:
    return run("ekso", *args, "-p", port, "--json")


def values(trace: Path) -> list[int]:
    """The raw values of the SetValue requests of a transcript."""
    return [int.from_bytes(data[6:8], "big") for data in sent(trace) if data[0] == SET]


def again(bench: Bench, *, stepwise: bool = False, override: bool = False) -> None:
    """A further handctl on the same unit: a new writer with the same log."""
    audit = AuditLog(bench.log, {"operator": "me", "port": "unit"})
    bench.ekso.writer = Writer(
        bench.port, audit, bench._ask, override=override, stepwise=stepwise, prompts=TerminalPrompts(quiet=True)
    )
    bench.ekso.known = None


# -- one run after the other ---------------------------------------------------------------------------------------------


def test_three_sets_in_a_row_do_not_walk_away(tmp_path: Path) -> None:
    """14.75 -> 15.75 -> 16.75 -> 17.5: the second and the third are beyond a step from the value of 10 s ago."""
    port = unit(state=tmp_path / "state")
    codes, texts = [], []
    for value in ("15.75", "16.75", "17.5"):
        result = do("set", f"step_length={value}", *ME, port=port)
        error = result.error if result.code else {"code": "", "text": "", "hint": ""}
        codes.append((result.code, error["code"]))
        texts.append(error["text"] + error["hint"])
    assert codes == [(0, ""), (2, "step-limit"), (2, "step-limit")]
    assert "14.75 in -> 16.75 in within 10 s" in texts[1] and "permitted in" in texts[1]
    assert run("ekso", "get", "step_length", "-p", port, "--format", "plain").out.strip() == "15.75"


def test_small_steps_in_a_row_do_not_walk_away_either(bench: Bench) -> None:
    for value in ("15.9", "16.3", "16.5"):
        bench.set(f"step_length={value}")
        again(bench)
    assert bench.failing(UsageError, "step_length=16.6").code == "step-limit"
    assert bench.set("step_length=15.5") == [15.5], "the way back is free"
    bench.unit.sleep(STEP_SECONDS + 1)
    again(bench)
    assert bench.set("step_length=16.5") == [16.5]


def test_the_time_between_writes_holds_over_runs(bench: Bench) -> None:
    bench.set("step_length=16")
    again(bench)
    bench.set("step_height=2.2")
    first, second = [at for at, request in zip(bench.unit.sent_at, bench.unit.sent, strict=True) if request[0] == SET]
    assert second - first >= 1.0


def test_another_simulator_is_another_memory(tmp_path: Path) -> None:
    """It is what its LINK says; of a real EksoNR nothing tells it from another."""
    one, two = unit(state=tmp_path / "one"), unit(state=tmp_path / "two")
    assert do("set", "step_length=15.75", *ME, port=one).code == 0
    assert do("set", "step_length=13.75", *ME, port=two).code == 0
    assert do("set", "step_length=16.75", *ME, port=one).code == 2


def test_an_override_stays_an_override_but_not_for_legs(bench: Bench) -> None:
    bench.unit.data[18] = 0x1040  # sitting
    again(bench, override=True)
    assert bench.set("step_length=18") == [18.0]
    again(bench, override=True)
    assert bench.set("step_length=20") == [20.0]
    assert bench.set("upper_leg_length=17.5") == [17.5]
    again(bench, override=True)
    assert bench.failing(UsageError, "upper_leg_length=18").code == "step-limit"


def test_a_code_that_is_no_percentage_has_no_distance(bench: Bench) -> None:
    """50 % -> Adapt -> 45 %, each asked for twice; but 10 % a 10 s between percentages."""
    assert bench.set("left_swing_assist=Adapt") == [21]
    again(bench)
    assert bench.set("left_swing_assist=45 %") == [9]
    again(bench)
    assert bench.failing(UsageError, "left_swing_assist=35 %").code == "step-limit"


@pytest.mark.parametrize("files", [("a", "b", "c"), (None, "b", None), ("b", None, "b")])
def test_an_audit_log_of_its_own_for_each_write_changes_nothing(files: tuple[str | None, ...], tmp_path: Path) -> None:
    port = unit(state=tmp_path / "state")
    codes = []
    for value, file in zip(("15.75", "16.75", "17.5"), files, strict=True):
        more = () if file is None else ("--audit", tmp_path / file)
        codes.append(do("set", f"step_length={value}", *ME, *more, port=port).code)
    assert codes == [0, 2, 2]
    own = (tmp_path / "handctl" / "ekso-audit.jsonl").read_text(encoding="utf-8").splitlines()
    assert len(own) == 2, "one intent and its result"
    if files[0] is not None:
        named = (tmp_path / files[0]).read_text(encoding="utf-8").splitlines()
        assert [json.loads(line)["new"] for line in named] == [json.loads(line)["new"] for line in own]


def test_a_port_that_came_back_under_another_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """15.00 to 18.00 within 2 s: the tty number was another one at each write."""
    bench = Bench(tmp_path)
    codes = []
    for number, value in enumerate(("16", "17", "18")):
        always = {"operator": "me", "port": "/dev/serial/by-id/ekso", "place": f"tty 166:{number}", "simulated": False}
        bench.ekso.writer = Writer(bench.port, logs(None, always), bench._ask, override=False)
        bench.ekso.known = None
        try:
            bench.set(f"step_length={value}")
            codes.append("")
        except UsageError as exc:
            codes.append(exc.code)
    assert codes == ["", "step-limit", "step-limit"]


PORT = {"operator": "me", "port": "/dev/ttyACM0", "place": "tty 166:0", "host": HOST, "simulated": False}


@pytest.fixture
def shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of all users of this machine."""
    folder = tmp_path / "shared"
    folder.mkdir()
    monkeypatch.setattr(user_folders, "shared_folder", lambda: str(folder))
    return folder


def walk(
    bench: Bench,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    *,
    users: Sequence[int] = (),
    places: Sequence[str] = (),
    last: str = "17.75",
) -> list[str]:
    """Three steps of a leg length, the last two too far from the first value.

    Each with a state folder of its own, and of a user and at a place where there are some.
    """
    bench.unit.data[18] = 0x1040  # sitting
    codes = []
    for number, value in enumerate(("17.5", "18", last)):
        monkeypatch.setenv("XDG_STATE_HOME", str(folder / f"state{number}"))
        if users:
            monkeypatch.setattr(os, "getuid", lambda user=users[number]: user)
            monkeypatch.setattr(user_folders, "own", lambda _found: True)
        always = {**PORT, "place": places[number]} if places else PORT
        bench.ekso.writer = Writer(bench.port, logs(None, always), bench._ask, override=False)
        bench.ekso.known = None
        try:
            bench.set(f"upper_leg_length={value}")
            codes.append("")
        except UsageError as exc:
            codes.append(exc.code)
    return codes


@pytest.mark.parametrize("users", [(), (1000, 1000, 1000), (1000, 1001, 1000), (0, 1000, 1001)])
def test_another_state_folder_or_user_is_no_other_device(
    users: tuple[int, ...], bench: Bench, tmp_path: Path, shared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """XDG_STATE_HOME was another one at each write: three of them moved it by 1.5 in within 1.2 s."""
    assert walk(bench, tmp_path, monkeypatch, users=users) == ["", "step-limit", "step-limit"]
    for file in shared.iterdir():
        assert file.stat().st_mode & 0o777 == 0o644
        for line in file.read_text().splitlines():
            assert not {"operator", "user", "port", "command"} & set(json.loads(line)), "all users can read it"


def test_what_stands_for_a_device_here_is_what_its_place_says(
    bench: Bench, tmp_path: Path, shared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = ("tcp 127.0.0.1:4001", "tcp 127.0.0.1:4002", "tcp 127.0.0.1:4002")
    assert walk(bench, tmp_path, monkeypatch, places=places, last="18.25") == ["", "", "step-limit"]


@pytest.mark.parametrize("what", ["folder", "foreign", "missing"])
def test_without_the_shared_memory_nothing_is_written(
    what: str, bench: Bench, tmp_path: Path, shared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = shared / f"handctl-ekso-{os.getuid()}"
    if what == "folder":
        file.mkdir()
    elif what == "foreign":
        monkeypatch.setattr(user_folders, "own", lambda _found: False)
    else:
        shared.rmdir()
    bench.ekso.writer = Writer(bench.port, logs(None, PORT), bench._ask, override=False)
    assert bench.failing(OutputError, "step_length=15").code == "audit"
    assert not [request for request in bench.unit.sent if request[0] == SET]


@pytest.mark.parametrize("what", ["folder", "/dev/full"])
def test_without_the_memory_nothing_is_written(what: str, tmp_path: Path) -> None:
    """Wherever --audit leads: refused, with the memory's own file as the reason."""
    own = tmp_path / "handctl" / "ekso-audit.jsonl"
    own.parent.mkdir()
    own.mkdir() if what == "folder" else own.symlink_to(what)
    trace = tmp_path / "t.txt"
    result = do("set", "step_length=15", *ME, "--audit", tmp_path / "mine", "--trace", trace, port=unit())
    assert (result.code, result.error["code"], values(trace)) == (1, "audit", [])
    assert str(own) in result.error["text"] and "--audit" not in result.error["hint"]
    cancelled = do("cancel", "--audit", tmp_path / "mine", port=unit())
    assert cancelled.code == 0, "what stops does not depend on it"


def test_two_handctl_at_once(bench: Bench, tmp_path: Path) -> None:
    """While one writes, from the look at the last writes to its result, the other is refused and sends nothing."""
    port = unit(state=tmp_path / "state")
    log = tmp_path / "handctl" / "ekso-audit.jsonl"
    log.parent.mkdir()
    with log.open("a") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        result = do("set", "step_length=15", *ME, port=port)
        assert (result.code, result.error["code"]) == (3, "busy")
    assert do("set", "step_length=15", *ME, port=port).code == 0

    def meddle(_msg_id: int, body: bytes) -> None:
        with bench.log.open() as mine, pytest.raises(BlockingIOError):
            fcntl.flock(mine, fcntl.LOCK_EX | fcntl.LOCK_NB)
        tried.append(body)

    tried: list[bytes] = []
    bench.unit.on = {SET: meddle}
    bench.set("step_length=16")
    assert len(tried) == 1


# -- what the log says, and what it does not -----------------------------------------------------------------------------


def entry(event: str = "intent", *, ago: float = 3.0, now: float = 1000.0, **more: Any) -> str:
    fields = {
        "event": event, "utc": (datetime.now(timezone.utc) - timedelta(seconds=ago)).isoformat(), "host_monotonic_s": now - ago,
        "host": HOST, "port": PLACE, "place": PLACE, "name": "step_length", "old": {"raw": 1500}, "new": {"raw": 1600},
        **({"verdict": "applied"} if event == "result" else {}), **more,
    }  # fmt: skip
    return json.dumps(fields) + "\n"


def log_of(folder: Path, text: str | bytes) -> AuditLog:
    path = folder / "log.jsonl"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return AuditLog(path, {"host": HOST, "port": PLACE, "place": PLACE})


def ages(folder: Path, text: str | bytes, now: float = 1000.0) -> list[float]:
    return [round(now - past.at, 3) for past in recent(log_of(folder, text), now)]


def test_what_counts(tmp_path: Path) -> None:
    assert ages(tmp_path, "") == []
    assert ages(tmp_path, entry()) == [3.0], "a write without a result counts"
    assert ages(tmp_path, entry(ago=9) + entry("result", ago=8.5) + entry() + entry("result", ago=2.5)) == [2.5, 8.5]
    assert ages(tmp_path, entry(ago=10.5)) == []
    assert ages(tmp_path, entry(ago=10.5) + entry("result", ago=9.9)) == [9.9], "it acts until its result at the latest"
    assert ages(tmp_path, entry() + entry("result", verdict="not sent: interrupted")) == []
    assert ages(tmp_path, entry(place="tty 166:0", port="/dev/ttyACM0")) == [3.0], "a port is no device"
    assert ages(tmp_path, entry(simulated=True)) == [3.0]
    assert ages(tmp_path, entry(place="tty 166:0", port="/dev/ttyACM0", simulated=True)) == []
    assert ages(tmp_path, entry("cancel")) == []


@pytest.mark.parametrize("hours", [-24, -1, 1, 24])
def test_a_wall_clock_that_was_set_changes_nothing(tmp_path: Path, hours: int) -> None:
    """The monotonic clock of this machine tells."""
    moment = (datetime.now(timezone.utc) + timedelta(hours=hours)).isoformat()
    assert ages(tmp_path, entry(utc=moment)) == [3.0]
    assert ages(tmp_path, entry(ago=60, utc=moment)) == []


def test_after_a_restart_of_the_machine_its_uptime_has_passed(tmp_path: Path) -> None:
    text = entry(now=90_000.0)
    assert ages(tmp_path, text, now=4.0) == [4.0]
    assert ages(tmp_path, text, now=30.0) == []


@pytest.mark.parametrize("other", [{"host": "elsewhere"}, {"host": None}])
def test_the_clock_of_another_machine_is_not_ours(tmp_path: Path, other: dict[str, Any]) -> None:
    assert ages(tmp_path, entry(ago=3, host_monotonic_s=5.0, **other)) == [pytest.approx(3, abs=0.5)]
    assert ages(tmp_path, entry(ago=3, host_monotonic_s=999.0, **other)) == [1.0], "the younger of the two"
    ahead = (datetime.now(timezone.utc) + timedelta(seconds=100)).isoformat()
    with pytest.raises(CheckFailed) as caught:
        ages(tmp_path, entry(utc=ahead, **other))
    assert caught.value.code == "clock-set-back"


@pytest.mark.parametrize(
    "damage",
    [b"\0\0\0\0\n", b"garbage\n", b"[1]\n", b'{"event": "intent"}\n', entry(old=None).encode(), entry(utc="soon").encode(),
     entry(name=7).encode(), entry(host_monotonic_s="x").encode(), b"\xff\xfe\n", b'"intent"\n'],
)  # fmt: skip
def test_a_damaged_end_is_refused_until_it_is_old(tmp_path: Path, damage: bytes) -> None:
    log = log_of(tmp_path, entry(ago=60).encode() + damage)
    with pytest.raises(CheckFailed) as caught:
        recent(log, 1000.0)
    assert caught.value.code == "audit-damaged"
    os.utime(log.path, (time.time() - STEP_SECONDS - 1,) * 2)
    assert recent(log, 1000.0) == []
    assert ages(tmp_path, damage + entry(ago=60).encode()) == [], "what stands before an old entry is older"


def test_half_a_line_of_a_killed_writer_is_no_damage(tmp_path: Path) -> None:
    """Its frame never went out; half a result follows its intent, which counts."""
    assert ages(tmp_path, entry()[:40]) == []
    assert ages(tmp_path, entry() + entry("result")[:80] + "\n") == [3.0]


@pytest.mark.parametrize("place", ["/dev/null", "/dev/full"])
def test_a_log_without_memory_is_no_log(place: str, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="regular file"):
        AuditLog(Path(place), {}).check()
    result = do("set", "step_length=15", *ME, "--audit", place, port=unit())
    assert (result.code, result.json["counters"]["sent"] < 8) == (1, True)


# -- restore in steps ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "old", "new", "expected"),
    [
        ("step_length", 1825, 1550, [1725, 1625, 1550]), ("step_length", 1550, 1650, [1650]),
        ("upper_leg_length", 1700, 1850, [1750, 1800, 1850]), ("forward_shift", 25, -125, [-25, -75, -125]),
        ("left_swing_assist", 10, 15, [12, 14, 15]), ("left_swing_assist", 21, 5, [5]), ("walk_mode", 0, 3, [3]),
    ],
)  # fmt: skip
def test_the_way(name: str, old: int, new: int, expected: list[int]) -> None:
    assert [one.new for one in change(name, old, new).way(False)] == expected
    assert [one.new for one in change(name, old, new).way(True)] == (
        [new] if not write_limits_of(EKSO[name]).firm else expected
    )


def far_away(folder: Path) -> tuple[str, Path]:
    """A unit whose step_length is 2.75 in from its snapshot."""
    port, file = unit(state=folder / "state"), folder / "s.json"
    assert do("snapshot", file, port=port).code == 0
    assert do("set", "step_length=17.5", *ME, "--override-step-limit", port=port).code == 0
    return port, file


def test_restore_leads_back_in_permitted_steps(tmp_path: Path) -> None:
    port, file = far_away(tmp_path)
    trace = tmp_path / "t.txt"
    with spying() as spy:
        result = do("restore", file, *ME, "--trace", trace, port=port)
    assert result.code == 0, result
    assert values(trace) == [1650, 1550, 1475]
    assert spy.now >= 2 * STEP_SECONDS
    at = [float(line.split()[0]) for line in trace.read_text().splitlines() if " > 9B" in line]
    assert all(b - a >= STEP_SECONDS for a, b in pairwise(at))
    assert "3 steps (16.50, 15.50, 14.75), about 20 s" in result.err and "waiting 10 s" in result.err
    assert do("diff", file, port=port).code == 0
    states = [row["state"] for row in result.json["writes"]]
    assert states == ["confirmed"] * 3


def stepwise(bench: Bench) -> None:
    bench.unit.settings[2] = 1825
    again(bench, stepwise=True)


def test_a_step_that_fails_ends_it_and_says_where_it_stands(bench: Bench) -> None:
    stepwise(bench)

    def second_fails(msg_id: int, _body: bytes) -> list[Any] | None:
        return [(0.001, frame(SET, msg_id, pack([2])))] if len(bench.unit.written()) == 2 else None

    bench.unit.on = {SET: second_fails}
    error = bench.failing(DeviceRefused, "step_length=15.5")
    assert "step_length had reached 17.25 in on its way to 15.50 in" in error.hint
    assert [int.from_bytes(body[2:], "big") for body in bench.unit.written()] == [1725, 1625]
    assert len(bench.asked) == 1


def test_ctrl_c_in_a_wait_says_where_it_stands_and_the_next_run_goes_on(bench: Bench) -> None:
    stepwise(bench)
    bench.unit.interrupt_at = bench.unit.clock + 5
    error = bench.failing(Interrupted, "step_length=15.5")
    assert error.text == "interrupted. step_length is at 17.25 in on its way to 15.50 in"
    assert bench.unit.settings[2] == 1725 and len(bench.unit.written()) == 1
    again(bench, stepwise=True)
    assert bench.set("step_length=15.5") == [15.5]
    assert [int.from_bytes(body[2:], "big") for body in bench.unit.written()] == [1725, 1625, 1550]
    at = [when for when, request in zip(bench.unit.sent_at, bench.unit.sent, strict=True) if request[0] == SET]
    assert at[1] - at[0] >= STEP_SECONDS, "the log remembers the first run"


def test_somebody_else_who_writes_all_the_time_ends_the_waits(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    stepwise(bench)
    always = [Past(0.0, "step_length", 1825, 1725)]
    monkeypatch.setattr(
        "handctl.devices.ekso.setting_writer.recent", lambda _audit, now: [past._replace(at=now - 1) for past in always]
    )
    always[0] = always[0]._replace(old=2000)
    error = bench.failing(CheckFailed, "step_length=15.5")
    assert error.code == "step-limit"
    assert bench.unit.written() == []


def test_a_deadline_ends_the_waits(bench: Bench) -> None:
    stepwise(bench)
    bench.port.bound = bench.unit.deadline(5)
    error = bench.failing(NoAnswer, "step_length=15.5")
    assert "step_length had reached 17.25 in" in error.hint
    assert len(bench.unit.written()) == 1


def test_a_wearer_who_moves_in_a_wait_ends_it(bench: Bench) -> None:
    stepwise(bench)

    def then_moves(_msg_id: int, _body: bytes) -> None:
        bench.unit.moving = {11: 6.0}

    bench.unit.on = {SET: then_moves}
    error = bench.failing(CheckFailed, "step_length=15.5")
    assert error.code == "not-still" and "had reached 17.25 in" in error.hint
    assert len(bench.unit.written()) == 1
