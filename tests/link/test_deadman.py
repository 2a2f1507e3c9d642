"""The child that stops a device when its parent dies: what reaches the line, when, and that it never does otherwise."""

from __future__ import annotations

import functools
import inspect
import os
import pickle
import pty
import select
import signal
import socket
import subprocess
import sys
import textwrap
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from handctl.errors import LinkError
from handctl.link import CanFrame, NoLink, RawAccess, can, deadman, open_link, serial
from handctl.link.deadman import LARGEST, EarlyWrite, _pack, _unpack, guard_link, stop_in_child
from handctl.link.device_lock import InUse, hold
from handctl.model.command_settings import Settings
from handctl.model.stop_sequence import StopContext, StopPlan
from handctl.system import deadman_process
from tests.support.cli import PATIENCE, wait_until
from tests.support.each_row import each_row


def stop(link: Any) -> None:
    """A plan of three writes."""
    for _ in range(3):
        link.write(b"STOP", link.deadline(1.0))
        link.sleep(0.02)


PROGRAM = """
    import os, sys, time
    from handctl.link import open_link
    from handctl.link.deadman import EarlyWrite, guard_link
    from handctl.link.device_lock import hold

    {stop}

    link = open_link(sys.argv[1])
    lock = hold(sys.argv[1], "test")
    link.held = lock.descriptors
    with guard_link(link, stop, print, heartbeat=float(sys.argv[2])) as guard:
        {body}
        print("armed", flush=True)
        time.sleep(60)
"""


def warned(*_words: str) -> None:
    raise AssertionError(_words)


class Place:
    """A device's end of a line; `arrived` are the bytes with the moments when they came."""

    def __init__(self, kind: str) -> None:
        self.arrived: list[tuple[float, bytes]] = []
        self._server: socket.socket | None = None
        if kind == "pty":
            self._end, self._slave = pty.openpty()
            tty.setraw(self._slave)
            self.link = os.ttyname(self._slave)
        else:
            self._server = socket.create_server(("127.0.0.1", 0))
            self.link = f"tcp://127.0.0.1:{self._server.getsockname()[1]}"
            self._end = self._slave = -1

    def take(self, seconds: float = 0.0, until: Callable[[], bool] = lambda: False) -> bytes:
        """What has come in all; waits so long for more, or until the condition holds."""
        end = time.monotonic() + seconds
        while True:
            if self._end < 0 and self._server is not None:
                self._end = self._server.accept()[0].detach()
            over = time.monotonic() >= end or until()
            if not select.select([self._end], [], [], 0.0 if over else 0.01)[0]:
                if over:
                    break
                continue
            with suppress(OSError):
                data = os.read(self._end, 4096)
                if not data:
                    break
                self.arrived.append((time.monotonic(), data))
        return b"".join(data for _, data in self.arrived)

    def again(self) -> None:
        """For another client: nothing has come from it yet."""
        self.arrived.clear()
        if self._server is not None and self._end >= 0:
            os.close(self._end)
            self._end = -1

    def close(self) -> None:
        for descriptor in (self._end, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        if self._server is not None:
            self._server.close()


def at_each_place(test: Callable[..., None]) -> Any:
    """The same on a pseudo-terminal and on TCP."""

    def placed(kind: str, **fixtures: Any) -> None:
        place = Place(kind)
        try:
            test(place=place, **fixtures)
        finally:
            place.close()

    given = inspect.signature(test).parameters
    kind = inspect.Parameter("kind", inspect.Parameter.KEYWORD_ONLY)
    left = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for name, one in given.items() if name != "place"]
    functools.update_wrapper(placed, test).__signature__ = inspect.Signature([*left, kind])  # type: ignore[attr-defined]
    return each_row("kind", ["pty", "tcp"])(placed)


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Locks of these tests are nobody else's."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


def children() -> list[int]:
    """The children of this process that live."""
    return [int(word) for word in Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()]


@pytest.fixture
def parents() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes that are ended at the end."""
    started: list[subprocess.Popen[bytes]] = []
    yield started
    for process in started:
        process.kill()  # not by its number: that of one that was waited for may be another program's by now
        process.communicate()


def armed(place: Place, body: str = "pass", heartbeat: float = 0.0, **more: Any) -> subprocess.Popen[bytes]:
    """A process of its own, with a guard."""
    program = (
        textwrap.dedent(PROGRAM)
        .replace("{body}", body)
        .replace("{stop}", inspect.getsource(stop).replace("Any", "object"))
    )
    command = [sys.executable, "-c", program, place.link, str(heartbeat)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, **more)
    assert process.stdout is not None
    assert process.stdout.readline() == b"armed\n"
    return process


def guards_of(process: subprocess.Popen[bytes]) -> list[int]:
    return [int(word) for word in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]


def gone(pid: int) -> bool:
    """Whether nothing of it runs any more; a zombie that init has not fetched yet does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


# -- death ---------------------------------------------------------------------------------------------------------------


@pytest.mark.real
@at_each_place
def test_three_stops_however_it_dies(place: Place, parents: list[subprocess.Popen[bytes]]) -> None:
    """How soon is a floor of `tests.bench`."""
    for kill, number in ((os.kill, signal.SIGKILL), (os.killpg, signal.SIGKILL), (os.killpg, signal.SIGHUP)):
        place.again()
        process = armed(place, start_new_session=True)
        parents.append(process)
        (guard,) = guards_of(process)
        kill(process.pid, number)
        assert place.take(PATIENCE, lambda guard=guard: gone(guard)) == b"STOP" * 3  # type: ignore[misc]


@pytest.mark.real
@at_each_place
def test_signals_that_end_a_program_do_not_end_the_guard(place: Place, parents: list[subprocess.Popen[bytes]]) -> None:
    process = armed(place)
    parents.append(process)
    (guard,) = guards_of(process)
    assert os.getsid(guard) == guard != os.getsid(process.pid)
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP, signal.SIGPIPE):
        os.kill(guard, number)
    process.kill()
    assert place.take(PATIENCE, lambda: gone(guard)) == b"STOP" * 3


@pytest.mark.real
@at_each_place
def test_what_goes_first_is_what_was_told_last(place: Place, parents: list[subprocess.Popen[bytes]]) -> None:
    body = "[guard.update([EarlyWrite(str(n).encode(), 0.01), EarlyWrite(b';', 0)]) for n in range(3000)]"
    process = armed(place, body)
    parents.append(process)
    (guard,) = guards_of(process)
    process.kill()
    assert place.take(PATIENCE, lambda: gone(guard)) == b"2999;" + b"STOP" * 3


@pytest.mark.real
@at_each_place
def test_a_frame_that_is_half_sent_is_completed(place: Place, parents: list[subprocess.Popen[bytes]]) -> None:
    """A line that takes no more has a part of a frame: the rest of it comes before the stop."""
    body = """
    from handctl.errors import LinkError
    try:
        while True:
            link.write(bytes(range(251)), link.deadline(0.05))
    except LinkError:
        pass
    """
    process = armed(place, textwrap.indent(textwrap.dedent(body), " " * 4).strip())
    parents.append(process)
    (guard,) = guards_of(process)
    process.kill()
    frames = place.take(PATIENCE, until=lambda: gone(guard)).removesuffix(b"STOP" * 3)
    count, rest = divmod(len(frames), 251)
    assert count and rest == 0
    assert frames == bytes(range(251)) * count


@pytest.mark.real
@at_each_place
def test_who_reads_its_output_is_not_kept_waiting(place: Place, parents: list[subprocess.Popen[bytes]]) -> None:
    """The guard holds no pipe of its parent: the end of the output is seen when the parent dies."""
    process = armed(place)
    parents.append(process)
    (guard,) = guards_of(process)
    os.kill(guard, signal.SIGSTOP)  # it cannot end meanwhile
    process.kill()
    assert process.communicate(timeout=PATIENCE) == (b"", None)
    assert not gone(guard)
    os.kill(guard, signal.SIGCONT)
    assert place.take(PATIENCE, lambda: gone(guard)) == b"STOP" * 3


@pytest.mark.real
@at_each_place
def test_nobody_gets_the_lock_before_the_stop_is_out(place: Place, parents: list[subprocess.Popen[bytes]]) -> None:
    process = armed(place, "guard.update([EarlyWrite(b'', 0.2), EarlyWrite(b'S')])")
    parents.append(process)
    (guard,) = guards_of(process)
    os.kill(guard, signal.SIGSTOP)
    process.kill()
    process.wait()
    with pytest.raises(InUse):
        hold(place.link, "second", patience=0.0)
    os.kill(guard, signal.SIGCONT)
    lock = hold(place.link, "third", patience=PATIENCE)  # it waits
    assert lock is not None
    assert place.take() == b"S" + b"STOP" * 3
    lock.release()
    wait_until(lambda: gone(guard))


@pytest.mark.real
@at_each_place
def test_a_suspended_parent_is_not_dead(place: Place, parents: list[subprocess.Popen[bytes]]) -> None:
    process = armed(place)
    parents.append(process)
    (guard,) = guards_of(process)
    os.kill(process.pid, signal.SIGSTOP)
    assert place.take(0.1) == b""
    process.kill()
    assert place.take(PATIENCE, lambda: gone(guard)) == b"STOP" * 3


@pytest.mark.real
@at_each_place
def test_a_parent_that_may_not_stand_still_is_stopped(place: Place, parents: list[subprocess.Popen[bytes]]) -> None:
    """Its device does not end by itself what it was told. Once it wakes it writes nothing more, and ends as by Ctrl-C."""
    body = (
        'exec(\'while True: link.write(b".", link.deadline(1.0)) or print("armed", flush=True) or time.sleep(0.01)\')'
    )
    process = armed(place, body, heartbeat=0.3, stderr=subprocess.PIPE)
    parents.append(process)
    (guard,) = guards_of(process)
    os.kill(process.pid, signal.SIGSTOP)
    assert place.take(PATIENCE, lambda: gone(guard)).endswith(b"." + b"STOP" * 3)
    os.kill(process.pid, signal.SIGCONT)
    assert process.stdout is not None and process.stderr is not None
    told = process.stdout.read() + process.stderr.read()
    assert b"stood-still" in told and b"KeyboardInterrupt" in told
    assert place.take(0.05).endswith(b"." + b"STOP" * 3)


@pytest.mark.real
@at_each_place
def test_a_kill_by_name_leaves_it(place: Place, parents: list[subprocess.Popen[bytes]]) -> None:
    """Neither its name nor its command line has anything of its parent's (`killall`, `pkill`, `pkill -f`)."""
    process = armed(place)
    parents.append(process)
    (guard,) = guards_of(process)
    assert Path(f"/proc/{guard}/comm").read_bytes() == b"deadman\n"
    line = Path(f"/proc/{guard}/cmdline").read_bytes().rstrip(b"\0")
    assert line and b"deadman: stops the device when the command that drives it has died".startswith(line[:60])
    assert b"handctl" not in line and b"python" not in line


@pytest.mark.real
@at_each_place
def test_a_fork_that_outlives_the_parent_does_not_keep_the_guard_waiting(
    place: Place, parents: list[subprocess.Popen[bytes]]
) -> None:
    if not hasattr(os, "pidfd_open"):
        pytest.skip("only Linux lets the parent itself be watched")
    process = armed(place, "(os.fork() or (time.sleep(600), os._exit(0)))")
    parents.append(process)
    guard, fork = guards_of(process)
    try:
        process.kill()
        assert place.take(PATIENCE, lambda: gone(guard)) == b"STOP" * 3
        assert gone(guard) and not gone(fork)
    finally:
        os.kill(fork, signal.SIGKILL)


# -- an end in order -------------------------------------------------------------------------------------------------------


@pytest.mark.real
@at_each_place
def test_an_end_in_order_sends_nothing_and_leaves_nobody(place: Place) -> None:
    link = open_link(place.link)
    before, open_before = children(), os.listdir("/dev/fd")
    with guard_link(link, stop, warned) as guard:
        assert len(children()) == len(before) + 1
        guard.update([EarlyWrite(b"HALT")])
    assert children() == before
    with pytest.raises(ZeroDivisionError), guard_link(link, stop, warned):
        raise ZeroDivisionError
    # Those of an earlier test may close meanwhile, but none is new.
    assert children() == before and not set(os.listdir("/dev/fd")) - set(open_before)
    link.close()
    assert place.take(0.05) == b""


@pytest.mark.real
@at_each_place
def test_a_guard_that_was_killed_is_replaced(place: Place) -> None:
    link = open_link(place.link)
    before = children()
    with guard_link(link, stop, warned):
        (first,) = set(children()) - set(before)
        os.kill(first, signal.SIGKILL)
        wait_until(lambda: gone(first))
        link.write(b"the next frame", link.deadline(1.0))  # type: ignore[attr-defined]
        (second,) = set(children()) - set(before)
        assert second != first
    assert children() == before
    link.close()


def test_a_guard_that_has_gone_or_acted_is_seen_before_the_next_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that has gone is replaced; one that has acted ends the command as by Ctrl-C."""
    states, started, told = ["lives", "gone", "lives", "acts"], list[deadman_process.Job](), list[str]()
    monkeypatch.setattr(
        deadman_process, "started", lambda job: started.append(job) or deadman_process.DeadmanChild(1, -1, -1)
    )
    monkeypatch.setattr(deadman_process, "state", lambda _heir: states.pop(0))
    monkeypatch.setattr(deadman_process, "ended", lambda _heir: None)
    monkeypatch.setattr(deadman_process, "finished", lambda _heir, _seconds: None)
    link = WayOut(-1)
    with pytest.raises(KeyboardInterrupt), guard_link(link, stop, lambda code, *_: told.append(code)):
        for count in (1, 1, 2, 2):
            assert len(started) == count
            link.way.before()
    assert (len(started), told, states) == (2, ["stood-still"], [])


# -- where there is none ---------------------------------------------------------------------------------------------------


def test_simulators_in_this_process_have_no_child() -> None:
    before = children()
    link = open_link("fake://exo?clock=virtual")
    with guard_link(link, stop, warned) as guard:
        guard.update([])
        assert children() == before
    link.close()


def test_a_link_without_a_way_out_is_told_of() -> None:
    told: list[tuple[str, ...]] = []
    with guard_link(NoLink(), stop, lambda *words: told.append(words)):
        pass
    ((code, text, hint),) = told
    assert code == "unguarded" and "nothing stops the device" in text and hint


class WayOut(NoLink):
    """A link of which a child could write to this descriptor."""

    def __init__(self, descriptor: int) -> None:
        self.way = RawAccess(descriptor)

    def raw_access(self) -> RawAccess:
        return self.way


def test_without_fork_it_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "fork")
    told: list[tuple[str, ...]] = []
    with guard_link(WayOut(-1), stop, lambda *words: told.append(words)):
        pass
    assert [words[0] for words in told] == ["unguarded"]


def test_where_no_process_can_be_started_nothing_is_driven() -> None:
    reader, writer = os.pipe()
    before = os.listdir("/dev/fd")
    refuse = mock.patch.object(os, "fork", side_effect=BlockingIOError(11, "Resource temporarily unavailable"))
    driven = False
    with refuse, pytest.raises(LinkError) as caught, guard_link(WayOut(writer), stop, warned):
        driven = True
    assert not driven
    assert (caught.value.exit_code, caught.value.code) == (3, "no-guard")
    assert not set(os.listdir("/dev/fd")) - set(before)
    os.close(writer)
    assert os.read(reader, 100) == b""
    os.close(reader)


def test_a_job_is_the_same_in_another_process() -> None:
    """On Windows the child gets it by a pipe: the way out with its codec, and the plan with the device's own id."""
    frame = CanFrame(0x057C8001, bytes(8))
    ways = [serial.raw_access_of(mock.Mock(_port_handle=7), "COM7"), RawAccess(7, can._slcan_frame, can._slcan_frames)]
    context = StopContext(Settings(id=9), speed=115200, fixed=True)
    for way, power in product(ways, (False, True)):
        assert way is not None
        way.before, way.note_unfinished = (lambda: None), (lambda _rest: None)  # of a guard, which stays here
        plan = StopPlan("wrist", context._replace(powered=power))
        job = deadman_process.Job(
            7, (), partial(deadman._stop_and_close, way, plan), deadman_process.message(b"text", 0.5), 3.0
        )
        there = pickle.loads(pickle.dumps(job))  # noqa: S301 - our own
        gone, told = there.act.args
        assert (gone.descriptor, gone.baud) == (way.descriptor, way.baud)
        assert gone.encode(frame.data, frame.can_id) == way.encode(frame.data, frame.can_id)
        assert (gone.decode is None) == (way.decode is None)
        assert told.context == plan.context and next(told.sequence()).step.data[2] == 9
        assert (there.first, there.bound) == (job.first, job.bound)


def test_of_many_messages_the_last_one_counts() -> None:
    first, last, pulse = (
        deadman_process.message(b"a", 0.0),
        deadman_process.message(b"b", 0.5),
        deadman_process.PULSE,
    )
    stream = first + pulse + last + pulse
    for cut in range(len(stream) + 1):
        told, rest = deadman_process._heard(b"before", stream[:cut])
        told, rest = deadman_process._heard(told, rest + stream[cut:])
        assert (told, rest) == (last[2:], b"")


# -- the messages ------------------------------------------------------------------------------------------------------------


def test_messages_come_back_as_they_went() -> None:
    first = [EarlyWrite(b"", 0.25), EarlyWrite(b"\x03", 0.0), EarlyWrite(bytes(range(256)), 1.0)]
    for owed in (b"", b"x", bytes(300)):
        text = _pack(owed, first)
        assert _unpack(text) == (owed, first)
        assert deadman_process.message(text, 0.5) == (len(text) + 2).to_bytes(2, "big") + b"\x01\xf4" + text


def test_a_message_goes_whole_or_not_at_all() -> None:
    with pytest.raises(AssertionError):
        _pack(bytes(LARGEST), ())


def test_frames_of_a_bus_are_written_and_read_as_the_adapter_has_them() -> None:
    from handctl.link.can import _slcan_frame, _slcan_frames, _socketcan_frame, _socketcan_frames

    frame = CanFrame(0x15038001, bytes.fromhex("E803"))
    line, packed = b"\rT150380012E803\r", bytes.fromhex("01800395 02 000000 E803000000000000")
    assert _slcan_frame(frame.data, frame.can_id) == line and _socketcan_frame(frame.data, frame.can_id) == packed
    assert _slcan_frames(b"z\r\a" + line + b"t1230\rT15\rT1503") == ([frame], b"T1503")
    standard, error = b"\x23\x01\0\0" + bytes(12), b"\x01\0\0\xa0" + bytes(12)
    assert _socketcan_frames(standard + packed + error + packed[:5]) == ([frame], packed[:5])


@each_row("frames", [False, True])
def test_a_child_has_a_link_of_its_own(frames: bool) -> None:
    """Silence, an answer, a lost connection; what was half sent is completed, then what goes first, then the stop."""
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    encode, decode = (lambda data, can_id: b"%d:" % can_id + data, lambda data: ([CanFrame(7, data)], b""))
    raw_access = RawAccess(ours.fileno(), encode, decode) if frames else RawAccess(ours.fileno(), baud=9600)  # type: ignore[arg-type]
    heard: list[Any] = []

    def talk(link: Any) -> None:
        if frames:
            link.send(CanFrame(7, b"stop"), link.deadline(1.0))
            heard.append(link.receive(link.deadline(0.0)))
            theirs.send(b"ok")
            heard.append(link.receive(link.deadline(1.0)))
        else:
            link.write(b"stop", link.deadline(1.0))
            heard.append(link.read(link.deadline(0.0)))
            theirs.send(b"ok")
            heard.append(link.read(link.deadline(1.0)))
        theirs.close()
        with pytest.raises(LinkError):
            heard.append((link.receive if frames else link.read)(link.deadline(1.0)))

    seen: list[bytes] = []
    stop_in_child(
        raw_access, lambda link: (seen.append(theirs.recv(100)), talk(link)), _pack(b"rest", [EarlyWrite(b"first")])
    )
    assert seen == [b"restfirst"]
    assert heard == ([None, CanFrame(7, b"ok")] if frames else [b"", b"ok"])
    ours.close()
