"""Moving the wrist: arrival, an axis that is held, Ctrl-C, --deadline; and settings through files (wrist §2.1)."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.errors import CheckFailed, HandctlError, Interrupted, NoAnswer, UsageError
from handctl.link import CanFrame, Deadline
from handctl.link.fake import FakeFrames
from handctl.model.param import Element
from handctl.model.prompts import Prompts
from handctl.model.result import Table
from handctl.model.stop_on_interrupt import NOT_STOPPED
from handctl.sim.wrist import mechanics
from tests.inspire.wrist_support import WIRES, RecordedFrames, Wrist, can, fake_port, fake_wrist, writes_of
from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row
from tests.support.odd_devices import odd_registers
from tests.support.scripted import NotedGuide, RecordedLink
from tests.support.swap import swapped

SIX = {
    "serial": "EB 90 01 09 31 0E 04 E8 03 18 FC E8 03 37",
    "can": "15038001 [6] E8 03 18 FC E8 03",
}


def move(wrist: Wrist, pitch: float | None, yaw: float | None, time: int | None, wait: float | None = None) -> Table:
    return wrist.move(wrist.targets(pitch, yaw, time), Prompts(), wait=wait)


def reached(table: Table) -> dict[str, tuple[float, float | None]]:
    return {row["name"]: (row["value"], row["target"]) for row in table.rows}


# -- arrival ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wire", WIRES)
def test_it_arrives_and_says_so(wire: str) -> None:
    wrist, link = fake_wrist(wire)
    table = move(wrist, -10.0, 10.0, 1000)
    assert reached(table) == {"pitch_actual": (-10.0, -10.0), "yaw_actual": (10.0, 10.0)}
    assert table.failure is None
    assert writes_of(link) == [SIX[wire]]
    assert 1.0 <= link.now() < 1.5
    assert "arrived" in [entry.code for entry in wrist.journal.messages]


@each_row("wire", WIRES)
def test_one_axis_leaves_the_other_alone(wire: str) -> None:
    wrist, link = fake_wrist(wire)
    table = move(wrist, None, -20.5, 300)
    assert reached(table) == {"pitch_actual": (-3.45, None), "yaw_actual": (-20.5, -20.5)}
    assert len(writes_of(link)) == 2
    assert "12 04 2C 01" in writes_of(link)[0] or writes_of(link)[0] == "15048001 [2] 2C 01"


@pytest.mark.parametrize("wire", WIRES)
def test_without_a_time_the_one_it_holds_counts(wire: str) -> None:
    """The stored 700 ms are read, not written."""
    wrist, link = fake_wrist(wire)
    table = move(wrist, -10.0, 10.0, None)
    assert table.failure is None
    assert writes_of(link) == [
        "EB 90 01 07 31 0E 04 E8 03 18 FC 4A" if wire == "serial" else "15038001 [4] E8 03 18 FC"
    ]
    assert 0.7 <= link.now() < 1.2


def test_a_stored_long_time_is_waited_for() -> None:
    wrist, link = fake_wrist()
    wrist.bus.write(1042, (12000).to_bytes(2, "little"))
    assert move(wrist, 20.0, None, None).failure is None
    assert 12.0 <= link.now() < 12.5  # and it stands there


def test_a_slow_axis_does_not_pass_for_a_held_one() -> None:
    """0.60 degree in 30 s: the reading stays the same for half a second each time."""
    wrist, link = fake_wrist()
    assert reached(move(wrist, None, 11.85, 30000))["yaw_actual"] == (11.85, 11.85)
    assert link.now() == pytest.approx(30.0, abs=1.0)


def test_progress_is_told() -> None:
    wrist, _ = fake_wrist()
    prompts = NotedGuide()
    wrist.move(wrist.targets(5.0, 5.0, 500), prompts, wait=None)
    assert any("pitch" in text and "yaw" in text for text in prompts.shown)


@pytest.mark.parametrize("wire", WIRES)
@pytest.mark.parametrize(("axis", "other"), [("pitch", "yaw"), ("yaw", "pitch")])
def test_a_held_axis_is_told_with_where_it_stands(wire: str, axis: str, other: str) -> None:
    wrist, link = fake_wrist(wire)
    inner = link.inner
    inner._line.device.body.blocked[("pitch", "yaw").index(axis)] = True  # type: ignore[attr-defined]
    table = move(wrist, -10.0, 20.0, 500)
    held = {"pitch": -3.45, "yaw": 11.25}
    targets = {"pitch": -10.0, "yaw": 20.0}
    assert reached(table)[f"{axis}_actual"] == (held[axis], targets[axis])
    assert reached(table)[f"{other}_actual"] == (targets[other], targets[other])
    assert table.failure is not None
    assert (table.failure.code, table.failure.exit_code) == ("blocked", 7)
    assert {row["name"]: row["arrival"] for row in table.rows} == {
        f"{axis}_actual": "blocked",
        f"{other}_actual": "reached",
    }
    assert f"{axis} is blocked at {held[axis]:.2f}°" in table.failure.text and other not in table.failure.text
    assert "arrived" not in [entry.code for entry in wrist.journal.messages]
    assert link.now() < 0.5 * 1.5 + 2.5


@each_row("wire", WIRES)
def test_a_move_that_outlasts_its_wait_is_not_arrived(wire: str) -> None:
    wrist, link = fake_wrist(wire)
    table = move(wrist, 20.0, None, 5000, wait=1.0)
    assert table.failure is not None
    assert table.failure.code == "still-moving"
    assert link.now() == pytest.approx(1.0, abs=0.1)
    assert len(writes_of(link)) == 1


@pytest.mark.parametrize("wire", WIRES)
def test_a_wrist_that_does_not_move_touches_nothing(wire: str) -> None:
    """An actuator draws 222 mA at rest: which one turns which axis is open (W6)."""
    with odd_registers(
        holds={1020: (-345).to_bytes(2, "little", signed=True) + (1125).to_bytes(2, "little"), 1026: b"\xde\x00"}
    ):
        result = run(
            *["wrist", "move", "--pitch", "5", "--time", "300", "--expect", "contact", "--json", "-p"], fake_port(wire)
        )
    assert (result.code, result.error["code"]) == (7, "not-reached")
    assert [row["arrival"] for row in result.rows] == ["unmoved", None]


def test_within_half_a_degree_counts_as_arrived() -> None:
    wrist, link = fake_wrist()
    body = link.inner._line.device.body  # type: ignore[attr-defined]
    body.blocked[0] = True
    with swapped((mechanics, "STALL_TIME", 60.0)):  # no error bit tells of it
        assert move(wrist, -2.96, None, 100).failure is None
        assert move(wrist, -2.94, None, 100).failure is not None


# -- what is refused --------------------------------------------------------------------------------------------------


@each_row(
    ("args", "words"),
    [
        (("--pitch", "30"), ("-22.66..22.12", "wrist §1", "30")),
        (("--pitch", "-22.67"), ("-22.66..22.12", "wrist §1")),
        (("--yaw", "25.51"), ("-25.5", "25.5", "wrist §1")),
        (("--pitch", "5", "--time", "0"), ("1..32767", "wrist §2.1")),
        (("--pitch", "5", "--time", "32768"), ("1..32767",)),
        (("--pitch", "1.005"), ("2 decimals",)),
        (("--yaw", "nan"), ("2 decimals",)),
        ((), ("--pitch",)),
        (("--time", "500"), ("--pitch",)),
    ],
)
@each_row("wire", WIRES)
def test_impossible_moves_send_nothing(wire: str, args: tuple[str, ...], words: tuple[str, ...]) -> None:
    result = run("wrist", "move", *args, "-p", fake_port(wire), "--json")
    assert result.code == 2
    assert result.json["counters"]["sent"] == 0
    for word in words:
        assert word in result.error["text"] + result.error["hint"]


def test_targets_are_checked_without_a_link() -> None:
    wrist, link = fake_wrist()
    with pytest.raises(UsageError):
        wrist.targets(None, None, 500)
    with pytest.raises(UsageError):
        wrist.targets(22.13, None, None)
    assert link.sent == []


# -- Ctrl-C and --deadline --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wire", WIRES)
def test_ctrl_c_holds_the_axes_where_they_are(wire: str) -> None:
    wrist, link = fake_wrist(wire)
    link.interrupt_at = 0.5
    with pytest.raises(Interrupted) as caught:
        move(wrist, 20.0, -20.0, 2000)
    hold = writes_of(link)[-1]
    assert caught.value.exit_code == 130
    data = can(hold).data if wire == "can" else bytes.fromhex(hold)[7:-1]
    yaw, pitch = (int.from_bytes(data[k : k + 2], "little", signed=True) for k in (0, 2))
    assert hold.startswith("15038001 [4]" if wire == "can" else "EB 90 01 07 31 0E 04")
    assert (pitch, yaw) == (pytest.approx(241, abs=45), pytest.approx(344, abs=45))  # a quarter of the way
    assert f"pitch {pitch / 100:.2f}°, yaw {yaw / 100:.2f}°" in caught.value.text
    link.sleep(10.0)
    assert wrist.bus.read(1020, 4) == data[2:] + data[:2]


def test_ctrl_c_before_anything_was_written_writes_nothing() -> None:
    wrist, link = fake_wrist()
    link.interrupt_at = 0.0
    with pytest.raises(KeyboardInterrupt):
        move(wrist, 20.0, None, None)
    assert writes_of(link) == []


def test_a_wrist_that_cannot_be_held_is_told() -> None:
    wrist, link = fake_wrist("can")
    device = link.inner._line  # type: ignore[attr-defined]
    link.interrupt_at = 0.5

    class Off(Prompts):
        def done(self) -> None:
            device.device.powered = False

    with pytest.raises(NoAnswer) as caught:
        wrist.move(wrist.targets(20.0, None, 2000), Off(), wait=None)
    assert (caught.value.exit_code, caught.value.code) == (4, NOT_STOPPED)
    assert "power off" in caught.value.hint


def test_angles_out_of_range_are_not_commanded_by_ctrl_c() -> None:
    """Out of range is never sent, not even to hold."""
    wrist, link = fake_wrist("serial", "fault=foreign")
    link.interrupt_at = 0.3
    with pytest.raises(CheckFailed) as caught:
        move(wrist, 10.0, None, 2000)
    assert len(writes_of(link)) == 1
    assert caught.value.code == NOT_STOPPED and "power off" in caught.value.hint


@each_row("wire", WIRES)
def test_the_deadline_ends_the_wait_and_the_wrist_is_stopped(wire: str) -> None:
    """Nobody watches it any more: it is held, which takes the second look of a stop."""
    link: RecordedLink | RecordedFrames
    wrist, link = fake_wrist(wire)
    wrist.bus.bound = link.deadline(0.5)
    with pytest.raises(NoAnswer) as caught:
        move(wrist, 20.0, None, 2000)
    assert (caught.value.code, caught.value.exit_code) == ("deadline", 4)
    assert "may still move" not in caught.value.text and not caught.value.left.moving
    assert 1.0 < link.now() < 1.4
    assert len(writes_of(link)) == 2
    wrist.bus.bound = None
    at = wrist.read([Element(WRIST[name], 0) for name in ("yaw_actual", "yaw_set")])
    assert at[0].value == at[1].value, "it is held where it is"


@each_row("wire", WIRES)
@each_row(("fault", "exit_code"), [("disconnect", 3), ("silent", 4), ("truncate", 5)])
def test_a_movement_that_cannot_be_watched_any_more_may_go_on(wire: str, fault: str, exit_code: int) -> None:
    wrist, link = fake_wrist(wire, f"fault={fault}&after=4")
    with pytest.raises(HandctlError) as caught:
        move(wrist, 20.0, None, 2000)
    assert caught.value.exit_code == exit_code
    assert "The wrist may still move" in caught.value.text and caught.value.left.moving
    assert len(writes_of(link)) >= 1


@each_row("wire", WIRES)
def test_an_interrupted_set_is_held(wire: str) -> None:
    """`set` moves as `move` does (wrist §2.1)."""
    link: RecordedLink | RecordedFrames
    wrist, link = fake_wrist(wire, "turnaround=0.2")
    link.interrupt_at = 0.1
    with pytest.raises(Interrupted) as caught:
        wrist.write(WRIST.assignments(["yaw_set=20", "move_time=500"]))
    assert "commanded to stay" in caught.value.text


# -- at the command line ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wire", WIRES)
def test_move_of_the_issue(wire: str) -> None:
    result = run(*["wrist", "move", "--pitch", "-10", "--yaw", "10", "--time", "1000"], "-p", fake_port(wire), "--json")
    assert result.code == 0
    assert result.values == {"pitch_actual": -10.0, "yaw_actual": 10.0}
    assert "arrived" in result.codes()


@pytest.mark.parametrize("wire", WIRES)
def test_move_without_yes_and_without_a_terminal_asks_nothing(wire: str) -> None:
    """A wrist move on its own bench asks nothing (cli contract, section 7)."""
    assert run(*["wrist", "move", "--pitch", "1", "--time", "100"], "-p", fake_port(wire)).code == 0
    assert run("wrist", "set", "yaw_set=1", "-p", fake_port(wire)).code == 0


@each_row("wire", WIRES)
def test_dry_run_prints_the_frame(wire: str) -> None:
    result = run(
        *["wrist", "move", "--pitch", "-10", "--yaw", "10", "--time", "1000", "-n", "--fake", "--format", "plain"],
        f"--{wire}",
    )
    assert (result.code, result.lines) == (0, [SIX[wire]])


@pytest.mark.parametrize("wire", WIRES)
def test_center(wire: str) -> None:
    result = run(*["wrist", "center", "--time", "300"], "-p", fake_port(wire), "--json")
    assert (result.code, result.values) == (0, {"pitch_actual": 0.0, "yaw_actual": 0.0})
    dry = run(*["wrist", "center", "-n", "--fake", "--format", "plain"], f"--{wire}")
    assert dry.lines == ["EB 90 01 07 31 0E 04 00 00 00 00 4B" if wire == "serial" else "15038001 [4] 00 00 00 00"]


def test_blocked_at_the_command_line_is_exit_7_with_the_rows() -> None:
    result = run(
        *["wrist", "move", "--pitch", "10", "--time", "300", "--json", "-p"], fake_port("serial", "fault=blocked")
    )
    assert result.code == 7
    assert result.values["pitch_actual"] == -3.45
    assert result.error["code"] == "blocked"


# -- snapshot, diff, restore ------------------------------------------------------------------------------------------


def snapshot(tmp_path: Path, wire: str) -> Path:
    file = tmp_path / "wrist.json"
    assert run("wrist", "snapshot", file, "-p", fake_port(wire)).code == 0
    return file


@pytest.mark.parametrize("wire", WIRES)
def test_a_snapshot_holds_the_three_settings(tmp_path: Path, wire: str) -> None:
    content = json.loads(snapshot(tmp_path, wire).read_text(encoding="utf-8"))
    assert content["values"] == {"yaw_set": 11.0, "pitch_set": -3.0, "move_time": 700}


@pytest.mark.parametrize("wire", WIRES)
def test_restore_writes_one_frame_reads_back_and_is_safe_to_repeat(tmp_path: Path, wire: str) -> None:
    file = snapshot(tmp_path, "serial")
    state, port = tmp_path / "state", fake_port(wire, f"state={tmp_path / 'state'}")
    assert run("wrist", "set", "yaw_set=-0.01", "pitch_set=22.12", "move_time=1500", "-p", port).code == 0
    assert state.exists()
    assert run("wrist", "diff", file, "--setpoints", "-p", port).code == 7
    refused: Result = run("wrist", "restore", file, "--setpoints", "-p", port, "--json")
    assert (refused.code, refused.error["code"]) == (8, "not-confirmed")
    trace = tmp_path / "trace"
    assert run("wrist", "restore", file, "--setpoints", "-p", port, "--yes", "--trace", trace).code == 0
    written = [line.split("> ")[1] for line in trace.read_text(encoding="utf-8").splitlines() if "> " in line]
    expected = "EB 90 01 09 31 0E 04 4C 04 D4 FE BC 02 " if wire == "serial" else "can 15038001 [6] 4C 04 D4 FE BC 02"
    assert [text for text in written if text.startswith(("EB 90 01 09 31", "can 15"))] == [
        text for text in written if text.startswith(expected)
    ]
    assert sum(text.startswith(expected) for text in written) == 1
    again = run("wrist", "restore", file, "--setpoints", "-p", port, "--yes", "--json")
    assert (again.code, "equal" in again.codes(), "not-covered" in again.codes()) == (0, True, True)
    assert run("wrist", "diff", file, "--setpoints", "-p", port).code == 0


def test_a_snapshot_out_of_range_is_refused_before_anything_is_sent(tmp_path: Path) -> None:
    from handctl.command import snapshots as files

    file = tmp_path / "bad.json"
    files.write(str(file), files.make("wrist", {"kind": "wrist", "id": 1}, {"yaw_set": 25.51}, link="x", fake=True))
    with spying() as spy:
        result = run("wrist", "restore", file, "--setpoints", "-p", fake_port(), "--yes", "--json")
    assert (result.code, spy.lines) == (2, [])


def test_a_late_error_names_what_was_written() -> None:
    """The time was written, then the wire broke."""
    wrist, link = fake_wrist("serial", "fault=disconnect&after=1")
    with pytest.raises(HandctlError) as caught:
        wrist.write(wrist.targets(None, 10.0, 500))
    assert caught.value.exit_code == 3
    assert "Already written: move_time" in caught.value.hint
    assert len(writes_of(link)) == 2


# -- an axis that is not named ------------------------------------------------------------------------------------------


@each_row(
    ("words", "code"),
    [
        (("move", "--pitch", "5", "--time", "300"), 8),
        (("move", "--yaw", "5", "--time", "300"), 0),
        (("move", "--yaw", "5", "--pitch", "5", "--time", "300"), 0),
        (("center", "--time", "300"), 0),
        (("set", "pitch_set=5"), 8),
        (("set", "yaw_set=5"), 0),
        (("set", "move_time=300"), 8),
        (("write", "1040", "F401"), 8),
        (("write", "1038", "F401"), 0),
        (("move", "--pitch", "5", "-n"), 0),
    ],
)
def test_an_axis_that_is_off_its_set_angle_is_not_turned_unasked(words: tuple[str, ...], code: int) -> None:
    """After power-on: the set angles are 0, and yaw stands at 11.25° (wrist §2.1 says nothing of what a write to the other axis does)."""
    with spying() as spy, odd_registers(holds={1038: bytes(2)} if code == 8 else {}):
        result = run("wrist", *words, "-p", fake_port(), "--json")
    assert result.code == code, result
    if code == 8:
        assert spy.requests and result.json["writes"][0]["state"] != "confirmed", result


@each_row(("time", "code"), [("0000", 7), ("FFFF", 7), ("E803", 0)])
def test_a_movement_time_that_is_none_is_not_moved_with(time: str, code: int) -> None:
    with odd_registers(holds={1042: bytes.fromhex(time)}):
        result = run("wrist", "move", "--pitch", "5", "-p", fake_port(), "--json")
        named = run("wrist", "move", "--pitch", "5", "--time", "1000", "-p", fake_port(), "--json")
    assert result.code == code and (code == 0 or result.error["code"] == "no-time"), result
    assert code == 0 or {row["state"] for row in result.json["writes"]} == {"not-sent"}, result
    assert named.json["ok"] or named.error["code"] != "no-time", named


def test_a_movement_of_which_a_part_was_taken_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wrist has taken the yaw alone, and says so: two bytes. It turns, which is no refusal."""
    send, receive, whole = FakeFrames.send, FakeFrames.receive, list[CanFrame]()

    def first_is_cut(link: FakeFrames, frame: CanFrame, deadline: Deadline) -> None:
        if frame.can_id == 0x15038001 and not whole:
            whole.append(frame)
            frame = frame._replace(data=frame.data[:2])
        send(link, frame, deadline)

    def told(link: FakeFrames, deadline: Deadline) -> CanFrame | None:
        frame = receive(link, deadline)
        if frame is not None and len(whole) == 1 and frame.can_id == 0x15038001:
            whole.append(frame)
            frame = frame._replace(data=b"\x02")
        return frame

    monkeypatch.setattr(FakeFrames, "send", first_is_cut)
    monkeypatch.setattr(FakeFrames, "receive", told)
    port = "fake://wrist?bus=can&clock=virtual"
    result = run("wrist", "move", "--pitch", "20", "--yaw", "-20", "--time", "4000", "-p", port, "--json")
    first, then = result.json["writes"]
    assert (result.code, first["state"], then["state"]) == (7, "sent", "confirmed"), result
    assert then["bytes"].startswith("15038001 [4]") and len(whole) == 2
