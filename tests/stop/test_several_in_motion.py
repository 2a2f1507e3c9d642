"""A process that has set several devices in motion: each of them is stopped, whichever of them a later line uses.

By Ctrl-C, by the wish of another process, and by the guard where the process dies.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest

import handctl
from handctl import interrupts
from handctl.command.command_lines import ScriptLine
from handctl.command.open_links import Connection, Session
from handctl.errors import STOPPED, Interrupted, LinkError, UsageError
from handctl.link import deadman, open_link, port_users
from handctl.link.fake import FakeLink
from handctl.model.command_settings import Settings
from handctl.model.stop_sequence import StopContext, StopPlan
from handctl.stop import stop_listener
from handctl.stop.stop_listener import StopListener
from handctl.system import local_socket
from tests.stop.bench import noting, noting_access
from tests.support.bus_file import text
from tests.support.cli import PATIENCE, Simulator, clean_environment, run, start
from tests.support.each_row import each_row

EXO_1, EXO_2, EXO_7, WRIST = ("eb90010b31", "eb90020b31", "eb90070b31", "eb90030731")
"""How the stop of each begins: the forces of an exo, the angles of a wrist."""
GO = "exo position 900 900 900 900 900 -y --id"
RAW_2 = "exo raw 'eb 90 02 05 12 ce 05 84 03 73' -y"
"""For another id than that of the command."""
TURN = "wrist set yaw_set=20 move_time=5000 -y --id 3"
DEVICES = [{"kind": "exo", "id": 1}, {"kind": "exo", "id": 2}, {"kind": "wrist", "id": 3}]


def bus(folder: Path) -> Path:
    """The FILE of a line with two exos and a wrist."""
    path = folder / "bus.toml"
    path.write_text(text("clean", DEVICES), encoding="utf-8")
    return path


def stops_in(sent: list[bytes]) -> list[str]:
    """Which devices were stopped, in this order, each once."""
    found = [start for data in sent for start in (EXO_1, EXO_2, EXO_7, WRIST) if data.hex().startswith(start)]
    return list(dict.fromkeys(found))


# -- Ctrl-C ----------------------------------------------------------------------------------------------------------------


@each_row(("lines", "deaf", "code", "stops"), [
    ((f"{GO} 1", f"{GO} 2"), "", 130, {EXO_1, EXO_2}),
    ((f"{GO} 2", "exo status --id 1"), "", 130, {EXO_2}),
    ((TURN, "exo status --id 1"), "", 130, {WRIST}),
    ((TURN, f"{GO} 1", f"{GO} 2"), "", 130, {WRIST, EXO_1, EXO_2}),
    ((f"{GO} 1", f"{GO} 2", "exo stop --id 2"), "", 130, {EXO_1}),
    ((f"{GO} 1", f"{GO} 2"), EXO_1, 4, {EXO_1, EXO_2}),
    ((f"{GO} 1", f"{GO} 2"), EXO_2, 4, {EXO_1, EXO_2}),
    ((RAW_2,), "", 130, {EXO_2}),
    ((f"{GO} 1", RAW_2), "", 130, {EXO_1, EXO_2}),
    ((f"{GO} 1", "exo id 7 -y --id 1"), "", 130, {EXO_7}),
])  # fmt: skip
def test_ctrl_c_stops_each_device_that_a_line_has_left_moving(
    lines: tuple[str, ...], deaf: str, code: int, stops: set[str], tmp_path: Path
) -> None:
    """130 only if each of these stops was acknowledged; that of one that is silent does not keep the next from being sent."""
    with noting(deaf) as sent:

        def pressed(link: FakeLink, seconds: float) -> None:
            if not interrupted:
                interrupted.append(True)
                sent.clear()
                raise KeyboardInterrupt
            time_passes(link, seconds)

        interrupted: list[bool] = []
        time_passes = FakeLink.sleep
        script = "\n".join((*lines, "sleep 30"))
        with mock.patch.object(FakeLink, "sleep", pressed):
            result = run("batch", "-p", f"fake://bus?file={bus(tmp_path)}&clock=virtual", "--json", stdin=script)
    assert (result.code, set(stops_in(sent))) == (code, stops), result


@each_row(("lines", "code", "stops"), [
    ((f"{GO} 1", "exo id 7 -y", "exo stop"), 0, [EXO_7]),
    ((f"{GO} 1", "exo id 7 -y --id 1", "exo stop --id 7"), 0, [EXO_7]),
    ((f"{GO} 1", "exo id 7 -y --id 1", "exo stop --id 1"), 4, [EXO_1]),  # what is typed stands
    ((f"{GO} 2", f"{GO} 1", "exo stop"), 0, [EXO_1, EXO_2]),
    ((f"{GO} 2", "exo id 7 -y --id 2", "exo stop"), 0, [EXO_1, EXO_7]),
    ((f"{GO} 2", TURN, "exo stop"), 0, [EXO_1, EXO_2]),
])  # fmt: skip
def test_a_line_that_stops_reaches_what_earlier_lines_have_left_moving(
    lines: tuple[str, ...], code: int, stops: list[str], tmp_path: Path
) -> None:
    """As a command of its own does: at the id that a line has given the device since, and each other one of its family."""
    with noting() as sent:
        result = run("batch", "-p", f"fake://bus?file={bus(tmp_path)}&clock=virtual", "--json", stdin="\n".join(lines))
    assert (result.code, stops_in(sent)) == (code, stops), result


@each_row(
    ("way", "deaf"),
    [("guard", ""), ("guard", EXO_2), ("ctrl-c", ""), ("ctrl-c", EXO_1), ("asked", ""), ("asked", EXO_2)],
)
def test_each_gets_its_stop_before_one_of_them_is_checked(way: str, deaf: str, tmp_path: Path) -> None:
    """Who is silent has one short try until then."""
    link = f"fake://bus?file={bus(tmp_path)}&clock=virtual"
    pressed, time_passes = list[bool](), FakeLink.sleep

    def interrupted(line: FakeLink, seconds: float) -> None:
        if seconds == 30 and not pressed:
            pressed.append(True)
            sent.clear()
            if way == "asked":
                access[-1].stop("asked")
            raise KeyboardInterrupt
        time_passes(line, seconds)

    with noting(deaf) as sent, noting_access() as access, mock.patch.object(FakeLink, "sleep", interrupted):
        if way == "guard":
            plans = [StopPlan("exo", StopContext(Settings(id=number), speed=115200)) for number in (2, 1)]
            deadman._stop_each(plans, open_link(link))
        else:
            run("batch", "-p", link, "--json", stdin=f"{GO} 1\n{GO} 2\nsleep 30")
    forces_and_checks = [data.hex()[:10] for data in sent if data[4] in (0x31, 0x11)]
    assert set(forces_and_checks[:2]) == {EXO_1, EXO_2}, forces_and_checks


def test_the_id_that_was_typed_comes_before_that_of_the_holder(tmp_path: Path) -> None:
    """And an id that no frame can have holds up nothing."""
    opened, told = Connection.opened, list[dict[str, Any]]()

    def asked(connection: Connection, *args: Any, **more: Any) -> Any:
        line = opened(connection, *args, **more)
        if not told:
            sent.clear()
            assert connection.device_access is not None
            told.append(connection.device_access.stop("asked", ["exo 1", "exo 999999"]))
        return line

    with noting() as sent, mock.patch.object(Connection, "opened", asked):
        run(
            "exo",
            "position",
            "900",
            "900",
            "900",
            "900",
            "900",
            "-y",
            "--id",
            "2",
            "-p",
            f"fake://bus?file={bus(tmp_path)}&clock=virtual",
        )
    assert stops_in(sent) == [EXO_1, EXO_2] and told[0]["error"] == "" and ["exo", 1] not in told[0]["devices"]


def test_ctrl_c_between_two_lines_ends_the_batch(tmp_path: Path) -> None:
    """Behind the result of a line it raises nothing, and the next line begins to count anew."""
    carried_out, begun = ScriptLine.run, list[str]()

    def pressed(line: ScriptLine, session: Session, journal: Any) -> None:
        begun.append(line.command)
        if len(begun) == 3:
            signal.raise_signal(signal.SIGINT)
        carried_out(line, session, journal)

    with noting() as sent, mock.patch.object(ScriptLine, "run", pressed):
        script = f"{GO} 1\nsleep 0.1\nsleep 30\n{GO} 2"
        result = run("batch", "-p", f"fake://bus?file={bus(tmp_path)}&clock=virtual", "--json", stdin=script)
    assert (result.code, begun, stops_in(sent)[-1:]) == (130, ["exo position", "sleep", "sleep"], [EXO_1]), result
    assert not [data for data in sent if data.hex().startswith("eb900213")], "the line behind it was not sent"


def test_a_stop_that_was_not_acknowledged_leaves_the_device_on_the_list(tmp_path: Path) -> None:
    """Of a line `stop`, too: Ctrl-C behind it tries again."""
    interrupted: list[int] = []
    with noting(EXO_1) as sent:

        def pressed(link: FakeLink, seconds: float) -> None:
            if seconds == 30 and not interrupted:
                interrupted.append(len(sent))
                raise KeyboardInterrupt

        link = f"fake://bus?file={bus(tmp_path)}&clock=virtual"
        script = f"{GO} 1\nexo stop --id 1\nsleep 30"
        with mock.patch.object(FakeLink, "sleep", pressed):
            result = run("batch", "-p", link, "--json", "--keep-going", stdin=script)
    assert result.code == 4 and stops_in(sent[: interrupted[0]]) == stops_in(sent[interrupted[0] :]) == [EXO_1], result


# -- the wish of another process -----------------------------------------------------------------------------------------------


@each_row(("lines", "stops"), [
    ((f"{GO} 2", "exo status --id 1"), [EXO_2, EXO_1]),
    ((TURN, f"{GO} 1"), [EXO_1, WRIST]),
])  # fmt: skip
def test_a_wish_stops_each_and_the_batch_ends_by_that(lines: tuple[str, ...], stops: list[str], tmp_path: Path) -> None:
    """First what is known to move; nothing is stopped once more behind it."""
    told: list[Any] = []

    def pressed(link: FakeLink, seconds: float) -> None:
        if not told:
            sent.clear()
            told.append(access[-1].stop("asked"))
            raise KeyboardInterrupt

    with noting() as sent, noting_access() as access, mock.patch.object(FakeLink, "sleep", pressed):
        link = f"fake://bus?file={bus(tmp_path)}&clock=virtual"
        result = run("batch", "-p", link, "--json", stdin="\n".join((*lines, "sleep 30")))
    assert result.code == 130 and "asked: " in result.err, result
    assert told[0]["error"] == "" and stops_in(sent) == stops
    assert len([data for data in sent if data.hex().startswith(stops[0])]) == 1


def test_a_wish_waits_until_a_stop_is_over() -> None:
    """It is answered behind it, those of several one after the other, and breaks nothing off."""
    order: list[str] = []

    def wish(name: str) -> None:
        if interrupts.is_stopping():
            interrupts.behind_stop(lambda: serve(name))
        else:
            serve(name)

    def serve(name: str) -> None:
        with interrupts.stopping():
            order.append(f"{name} begins")
            if name == "first":
                wish("second")
            order.append(f"{name} ends")

    interrupts.end_on_signals(suspend=False)
    before = signal.getsignal(signal.SIGINT)
    with interrupts.stopping():
        with interrupts.stopping():
            wish("first")
        order.append("the stop ends")
    signal.signal(signal.SIGINT, before)
    assert order == ["the stop ends", "first begins", "first ends", "second begins", "second ends"]


class Waiting:
    """A listening socket with one process that waits, and what that has heard."""

    def __init__(self) -> None:
        self.said: list[bytes] = []
        self._waits = [
            SimpleNamespace(send=self.said.append, close=lambda: None, settimeout=lambda _: None, recv=lambda _: b"")
        ]

    def accept(self) -> Any:
        if not self._waits:
            raise BlockingIOError
        return self._waits.pop()


def test_who_wishes_for_the_stop_of_another_link_is_heard_before_the_first_is_stopped() -> None:
    """A stop may take longer than the patience of the other one, who would end this process by force then."""
    doors, heard, ended = [Waiting(), Waiting()], list[int](), list[str]()

    def answer(_meant: list[str]) -> dict[str, Any]:
        heard.append(sum(door.said == [b"heard\n"] for door in doors))
        return {}

    listeners = []
    for door in doors:
        one: Any = StopListener.__new__(StopListener)
        one._answer, one._after, one._busy, one._peers, one._door = answer, ended.append, False, [], door
        listeners.append(one)
    interrupts.end_on_signals(suspend=False)
    with mock.patch.object(stop_listener, "_open", listeners):
        for one in listeners:
            one._called("frame")
    assert heard == [2, 1] and ended == ["frame"]
    assert [len(door.said) for door in doors] == [2, 2], "and each has its answer"


def test_each_listener_of_a_process_is_called_also_where_one_raises() -> None:
    called: list[str] = []

    def first(_frame: Any) -> None:
        called.append("first")
        raise KeyboardInterrupt

    doors: list[Any] = [SimpleNamespace(fileno=lambda: 3), SimpleNamespace(fileno=lambda: -1)]
    listeners = [
        (doors[0], first),
        (doors[1], lambda _: called.append("closed")),
        (doors[0], lambda _: called.append("last")),
    ]
    with mock.patch.object(local_socket, "_listening_here", listeners), pytest.raises(KeyboardInterrupt):
        local_socket._call_all(0, None)
    assert sorted(called) == ["first", "last"]


# -- the guard -----------------------------------------------------------------------------------------------------------------


def plan(number: int) -> StopPlan:
    return StopPlan("exo", StopContext(Settings(id=number)))


def test_a_guard_within_another_one_stops_the_devices_of_both() -> None:
    link: Any = SimpleNamespace(fake=True, replayed=False, held=(), guard=None)
    one, other, again = plan(1), plan(2), plan(1)
    with deadman.guard_link(link, one, print) as outer:
        assert outer.stops == [one] and outer.guards(again)
        with deadman.guard_link(link, other, print) as inner:
            assert link.guard is inner and inner.stops == [other, one]
            with deadman.guard_link(link, again, print) as third:
                assert third.stops == [again, other], "its own device once"
        assert link.guard is outer
    assert link.guard is None


def test_a_guard_beneath_takes_over_from_the_one_that_drives() -> None:
    """As that of a session does: what drives has a plan of its own, and what it leaves moving stays guarded."""
    link: Any = SimpleNamespace(fake=True, replayed=False, held=(), guard=None)
    with deadman.guard_link(link, plan(1), print) as driving:
        lasting = deadman.guard_link(link, plan(1), print, beneath=True)
        guard = lasting.__enter__()
        assert link.guard is driving
    assert link.guard is guard
    lasting.__exit__(None, None, None)
    assert link.guard is None
    with deadman.guard_link(link, plan(1), print) as driving, deadman.guard_link(link, plan(1), print, beneath=True):
        pass
    assert driving.outer is None and link.guard is None


def test_the_child_stops_each_device_whatever_becomes_of_the_stop_before() -> None:
    seen: list[int] = []

    def fails(_link: Any) -> None:
        seen.append(1)
        raise LinkError("lost")

    deadman._stop_each([fails, lambda _link: seen.append(2)], mock.Mock())
    assert seen == [1, 2]


def test_our_own_guard_is_no_rival() -> None:
    found = [port_users.Process(7, "deadman"), port_users.Process(8, "screen")]
    link: Any = SimpleNamespace(raw_access=lambda: SimpleNamespace(descriptor=0), guard=SimpleNamespace(pid=7))
    with (
        mock.patch.object(port_users, "name_of", return_value="/dev/x"),
        mock.patch.object(port_users, "holders", return_value=found),
    ):
        assert port_users.rivals(link).names == found[1:]
        link.guard = None
        assert port_users.rivals(link).names == found


@each_row(("lines", "guarded"), [
    ((f"{GO} 1", "exo status --id 2"), [("exo", 1)]),
    ((f"{GO} 1", f"{GO} 2"), [("exo", 2), ("exo", 1)]),
    ((TURN, "exo get id --id 1"), [("wrist", 3)]),
    ((TURN, f"{GO} 1", "exo get id --id 1 --trace {folder}/t"), [("exo", 1), ("wrist", 3)]),  # it opens the link again
    ((f"{GO} 1 --wait 9 --expect any", "exo get id --id 2"), [("exo", 1)]),
    ((f"{GO} 1", "exo stop --id 1"), []),
    ((RAW_2,), [("exo", 2), ("exo", 1)]),
    ((f"{GO} 1", "exo id 7 -y --id 1"), [("exo", 7), ("exo", 1)]),
    ((f"{GO} 1", TURN, "scan -p {link}"), [("wrist", 3), ("exo", 1)]),  # it has the link for itself
])  # fmt: skip
def test_the_guard_of_a_batch_outlasts_a_line_that_uses_another_device(
    lines: tuple[str, ...], guarded: list[tuple[str, int]], tmp_path: Path
) -> None:
    found: list[list[Any]] = []

    def looked(session: Session, *_: object) -> None:
        (link,) = [one.link for one in session._open.values() if one.link is not None]
        found.append([stop.device for stop in link.guard.stops] if link.guard is not None else [])

    link = f"fake://bus?file={bus(tmp_path)}&clock=virtual"
    script = "\n".join((*lines, "sleep 30")).format(folder=tmp_path, link=link)
    with mock.patch.object(Session, "sleep", looked):
        result = run("batch", "-p", link, stdin=script)
    assert result.code == 0 and found[0] == sorted(guarded, key=lambda one: one != guarded[0]), result


def test_a_restore_that_moves_is_guarded(tmp_path: Path) -> None:
    guarded: list[bool] = []
    file = tmp_path / "exo.json"
    assert run("exo", "snapshot", file, "-p", "fake://exo?clock=virtual").code == 0
    content = json.loads(file.read_text())
    from handctl.command import snapshots

    for name, value in (("position_set.ring", 300), ("force_set.ring", 50)):
        content["values"][name] = value
    content["checksum"] = snapshots._checksum(content)
    file.write_text(json.dumps(content))
    write = FakeLink.write

    def noted(link: FakeLink, data: bytes, deadline: Any) -> None:
        if data[4] == 0x12:
            guarded.append(link.guard is not None)
        write(link, data, deadline)

    with mock.patch.object(FakeLink, "write", noted):
        assert run("exo", "restore", file, "--setpoints", "-y", "-p", "fake://exo?clock=virtual").code == 0
    assert guarded and all(guarded)


# -- a program with the library --------------------------------------------------------------------------------------------------


def test_what_a_program_left_moving_is_stopped_when_ctrl_c_ends_the_with() -> None:
    for error, stopped in ((KeyboardInterrupt, [EXO_1]), (ZeroDivisionError, [EXO_1]), (SystemExit, []), (None, [])):
        with noting() as sent:
            try:
                with handctl.simulate("exo") as hand:
                    hand.position(900, 900, 900, 900, 900, confirm=True)
                    if error is not None:
                        raise error
            except BaseException as exc:  # noqa: BLE001 - SystemExit too
                assert type(exc) is error
        assert stops_in(sent) == stopped, error


def test_a_stop_that_failed_is_raised_behind_ctrl_c() -> None:
    caught: Any = None
    with noting(EXO_1):
        try:
            with handctl.simulate("exo") as hand:
                hand.position(900, 900, 900, 900, 900, confirm=True)
                raise KeyboardInterrupt
        except BaseException as exc:  # noqa: BLE001 - what is raised is the point
            caught = exc
    assert (getattr(caught, "code", caught), getattr(caught, "exit_code", 0)) == ("not-stopped", 4)


@pytest.mark.parametrize("bound", [False, True])
def test_ctrl_c_in_a_call_stops_what_an_earlier_one_left_moving(bound: bool) -> None:
    read, pressing = FakeLink.read, threading.Event()

    def pressed(link: FakeLink, *args: Any) -> bytes:
        if pressing.is_set():
            pressing.clear()
            raise KeyboardInterrupt
        return read(link, *args)

    with noting() as sent, mock.patch.object(FakeLink, "read", pressed), handctl.simulate("exo") as hand:
        if bound:
            hand.get("id")
        hand.position(900, 900, 900, 900, 900, confirm=True)
        pressing.set()
        with pytest.raises(KeyboardInterrupt):
            hand.get("id")
        assert stops_in(sent) == [EXO_1]
        assert hand._line.session.in_motion == []


@pytest.mark.parametrize("what", ["position", "watch", "confirm"])
def test_stop_in_another_thread_ends_the_call(what: str) -> None:
    """It does not wait until the movement is over, and the device can be used afterwards."""
    ended: list[Any] = []
    reached, may_go = threading.Event(), threading.Event()

    def confirm(_question: str, _steps: Any) -> bool:
        reached.set()
        return may_go.wait(PATIENCE)

    def work() -> None:
        try:
            if what == "watch":
                for _ in hand.watch("position_actual", rate=50):
                    reached.set()
            elif what == "confirm":
                hand.position(0, 0, 0, 0, 0, confirm=confirm)
            else:
                hand.position(0, 0, 0, 0, 0, wait=600, confirm=True)
        except handctl.HandctlError as exc:
            ended.append(exc)

    with noting() as sent, handctl.simulate("exo") as hand:
        worker = threading.Thread(target=work)
        sleep = FakeLink.sleep

        def waited(
            link: FakeLink, seconds: float
        ) -> None:  # virtual time would be over before the other thread has begun
            if threading.current_thread() is worker:
                reached.set()
                may_go.wait(PATIENCE)
            sleep(link, seconds)

        with mock.patch.object(FakeLink, "sleep", waited):
            worker.start()
            assert reached.wait(PATIENCE)
            rows = hand.stop()
            may_go.set()
            worker.join(PATIENCE)
        assert not worker.is_alive()
        assert [row["bytes"][12:14] for row in rows if not row["reads"]] == ["31", "32"]
        assert [(type(one), one.code) for one in ended] == [(Interrupted, STOPPED)]
        assert stops_in(sent) == [EXO_1]
        assert hand.get("id")


@each_row("answer", ["n", "", 1, 0, None, [True]])
def test_a_confirm_that_answers_neither_true_nor_false_sends_nothing(answer: Any) -> None:
    with noting() as sent, handctl.simulate("exo") as hand:
        with pytest.raises(UsageError) as caught:
            hand.position(0, 0, 0, 0, 0, confirm=lambda _question, _steps: answer)
        assert caught.value.code == "confirm-answer"
    assert not [data for data in sent if data[4] in (0x12, 0x31, 0x32)]


# -- with processes ------------------------------------------------------------------------------------------------------------


PUSH = "exo force 300 300 300 300 300 -y --id"
SLOW = "wrist set yaw_set=20 move_time=20000 -y --id 3"


@pytest.fixture
def two(tmp_path: Path) -> Iterator[list[Simulator]]:
    """Two lines with two exos and a wrist each."""
    path = bus(tmp_path)
    every = [Simulator(path, "--pty", kind="bus") for _ in range(2)]
    yield every
    for one in every:
        one.stop()


def moving_on(line: Simulator) -> set[str]:
    """What is commanded there as it was before a stop; waits for a guard, which has the lock."""
    found = set()
    for name, words, still in (
        ("exo 1", "exo get force_set.ring --id 1", 300),
        ("exo 2", "exo get force_set.ring --id 2", 300),
        ("wrist", "wrist get yaw_set --id 3", 20),
    ):
        (row,) = run(*words.split(), "-p", line.link, "--json").rows
        found |= {name} if row["value"] == still else set()
    return found


def batch_of(two: list[Simulator], folder: Path) -> subprocess.Popen[bytes]:
    """A batch that has set three devices on two lines in motion, and then read."""
    script = folder / "script"
    one, other = (line.link for line in two)
    lines = [
        f"{PUSH} 1 -p {one}",
        f"{SLOW} -p {one}",
        f"{PUSH} 2 -p {other}",
        f"exo get id --id 1 -p {other}",
        "sleep 60",
    ]
    script.write_text("\n".join(lines))
    process = start(["batch", script, "-y"], clean_environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    while not process.stdout.readline().startswith(b"id "):
        assert process.poll() is None, process.communicate()
    return process


@pytest.mark.real
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_batch_that_is_ended_or_killed_stops_each(number: int, two: list[Simulator], tmp_path: Path) -> None:
    """The guards of both lines, too: each knows all that moves there."""
    process = batch_of(two, tmp_path)
    process.send_signal(number)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == (-number if number == signal.SIGKILL else 130)
    assert [moving_on(line) for line in two] == [set(), set()]


@pytest.mark.real
@pytest.mark.parametrize("first", ["the first line", "the second line", "Ctrl-C"])
def test_wishes_at_both_lines_are_heard_while_it_stops(first: str, two: list[Simulator], tmp_path: Path) -> None:
    """Nobody is killed, nothing is broken off, and who asks waits for the result."""
    process = batch_of(two, tmp_path)
    if first == "Ctrl-C":
        process.send_signal(signal.SIGINT)
    order = [one.link for one in (two if first != "the second line" else two[::-1])]
    asking = [start(["stop", "-p", link], clean_environment(), stderr=subprocess.PIPE) for link in order]
    said = [one.communicate(timeout=PATIENCE)[1].decode() for one in asking]
    _, told = process.communicate(timeout=PATIENCE)
    assert ([one.returncode for one in asking], process.returncode) == ([0, 0], 130), (said, told)
    assert [moving_on(line) for line in two] == [set(), set()]


PROGRAM = """
import sys, time, handctl
hand = handctl.connect("exo", sys.argv[1])
hand.force(300, 300, 300, 300, 300, confirm=True)
print("moving", flush=True)
{end}
"""


@pytest.mark.real
@pytest.mark.parametrize(
    ("end", "number", "moving"),
    [
        ("time.sleep(60)", signal.SIGKILL, set()), ("time.sleep(60)", signal.SIGTERM, set()),
        ("time.sleep(60)", signal.SIGINT, set()), ("1 / 0", 0, set()), ("", 0, set()), ("hand.disconnect()", 0, {"exo 1"}),
    ],
)  # fmt: skip
def test_a_program_that_ends_with_the_link_open_stops_the_device(
    end: str, number: int, moving: set[str], two: list[Simulator]
) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(end=end), two[0].link], env=clean_environment(), stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline() == b"moving\n", process.communicate()
    if number:
        process.send_signal(number)
    process.communicate(timeout=PATIENCE)
    assert moving_on(two[0]) == moving
