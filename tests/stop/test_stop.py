"""`stop` reaches every device: from here, through who holds it, past who sleeps, and without disk, lock or configuration.

Generated over the registry: a family without a stop that its simulator hears fails here.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import resource
import select
import shutil
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from handctl.command.family import load
from handctl.errors import DeviceRefused, NoAnswer
from handctl.families import FAMILIES
from handctl.model.command_settings import Settings
from handctl.model.stop_sequence import Sent, StopContext, exchange_steps, stop_sequence_of, writes_without_replies
from handctl.sim.engine.serve import send_control
from handctl.stop.stop_listener import STOP_SECONDS
from handctl.system import processes
from tests.support.cli import PATIENCE, fake, run, spying, wait_until
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink
from tests.support.stop import HOW, RELEASE, Stand

TRIES = 3
"""A busy machine may keep a holder from hearing of the wish in time."""

MakeStand = Callable[..., Stand]


@pytest.fixture
def stand(tmp_path: Path) -> Iterator[MakeStand]:
    made: list[Stand] = []

    def make(family: str, *more: str) -> Stand:
        folder = tmp_path / f"{family}{len(made)}"
        folder.mkdir()
        made.append(Stand(family, folder, *more))
        return made[-1]

    yield make
    for one in made:
        one.close()


# -- the registry ------------------------------------------------------------------------------------------------------


def test_every_family_has_a_stop() -> None:
    assert set(FAMILIES) == set(HOW)


@each_row("speed", [None, 9600, 600])
@each_row("family", FAMILIES)
def test_a_stop_that_nobody_answers_ends_and_claims_nothing(family: str, speed: int | None) -> None:
    """Before who asked a holder for it gives up."""
    sequence = stop_sequence_of(family, StopContext(Settings(), speed=speed))
    ended = None
    action = next(sequence)
    seconds = 0.0
    for _ in range(200):
        seconds += action.seconds + (10 / action.baud * (len(action.step.data) + action.size) if action.baud else 0.0)
        try:
            action = sequence.send([])
        except StopIteration as end:
            ended = end.value
            break
    assert ended is not None and ended.error is not None and ended.error.exit_code == 4, ended
    assert seconds < (3 if speed is None else STOP_SECONDS), "it takes longer than anybody waits"
    for step in writes_without_replies(stop_sequence_of(family, StopContext(Settings(), speed=speed))):
        assert step.moves and step.meaning


@each_row("can", [False, True])
@each_row("proven", [False, True])
@each_row("family", FAMILIES)
def test_the_first_bytes_of_a_stop_wait_for_one_quick_question_at_the_most(
    family: str, proven: bool, can: bool
) -> None:
    """50 ms (contract §7), also where nothing replies. Only a wrist needs its position first: without that it is sent nothing."""
    if can and "can" not in load(family, "cli").cli.family.wires:
        return
    sequence = stop_sequence_of(family, StopContext(Settings(), can, None if can else 9600, proven=proven))
    action, waited = next(sequence), 0.0
    with suppress(StopIteration):
        while action.reads:
            waited += action.seconds
            action = sequence.send([])
    assert action.reads == (family == "wrist")
    assert action.reads or waited <= (0.0 if proven or can else 0.05), waited


@pytest.mark.real
def test_a_stopper_is_light() -> None:
    """It may be imported in the middle of anything: nothing beside its codec."""
    wanted = ", ".join(one.module("stopper") for one in FAMILIES.values())
    text = f"import sys, {wanted}\nprint(' '.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert not {"rich", "serial", "can", "click", "crcmod", "socket"} & set(done.stdout.split())


# -- from here, and through who holds it -------------------------------------------------------------------------------


@pytest.mark.real
@pytest.mark.parametrize("family", FAMILIES)
def test_stop_with_and_without_a_holder_and_past_one_that_sleeps(family: str, stand: MakeStand) -> None:
    """The bytes are at the device in their order, whoever had it. How soon is a floor of `tests.bench`."""
    place = stand(family)
    result, alone = place.stop()
    assert result.code == 0 and alone >= 0, result
    assert [row["bytes"] for row in result.rows if not row["reads"]], result
    states = {row["state"] for row in result.json["writes"]}
    assert "confirmed" in states or family == "aidin", "no current flowed that could vanish"
    holder = place.hold()
    hint = run(family, "status", "-p", place.link, "--json", env=place.environment).error["hint"]
    assert f"`handctl {family} stop -p {place.link}`" in hint and "stops nothing on the device" in hint
    result, _ = place.stop()
    assert holder.wait(PATIENCE) == (130 if "asked" in result.codes() else -signal.SIGKILL), result
    assert result.code == 0 and str(holder.pid) in result.out, result
    writes = result.json["writes"]
    assert writes and [row["bytes"] for row in writes] == [row["bytes"] for row in result.rows if not row["reads"]]
    assert {row["state"] for row in writes} == states, "as when it is sent from here"

    holder = place.hold()
    os.kill(holder.pid, signal.SIGSTOP)
    wait_until(lambda: processes.sleeps(holder.pid))
    result, _ = place.stop()
    assert (result.code, holder.wait(PATIENCE)) == (0, -signal.SIGKILL), result
    assert "ended" in result.codes() and str(holder.pid) in result.out


DRIVES = [(family, *how.drive) for family, how in HOW.items() if how.drive]


@pytest.mark.real
@pytest.mark.parametrize(("family", "words", "first"), DRIVES, ids=[f"{f}-{w[0]}" for f, w, _ in DRIVES])
def test_stop_goes_ahead_of_what_drives(family: str, words: tuple[str, ...], first: bytes, stand: MakeStand) -> None:
    """What drives ends as the stop does, and sends nothing but stops behind the stop. No stop ends a calibration."""
    place = stand(family)
    code = 4 if words[0] == "calibrate" else 0
    if code:  # an exoskeleton hand answers nothing meanwhile, and is sent its stop all the same
        place.how = place.how._replace(stop=place.how.stop[:1])
    for _ in range(TRIES):
        holder = place.hold(*words, until=first)
        result, _seconds = place.stop()
        told = holder.wait(PATIENCE), holder.stderr.read() if holder.stderr else b""
        if (
            told[0] == 1 and b"took no rows" in told[1]
        ):  # a busy machine kept it from writing a row, and it stopped by itself
            continue
        if told[0] != -signal.SIGKILL:  # a busy machine kept it from hearing of the wish, and it was ended
            break
        assert "ended" in result.codes(), result
    assert (result.code, told[0]) == (code, code or 130), (result, told)
    assert "asked" in result.codes(), result
    assert len(result.json["writes"]) == sum(not row["reads"] for row in result.rows), result
    assert all(any(one in data for one in place.how.stop) for _, data in place.heard()), "nothing but stops behind it"


@pytest.mark.real
def test_currents_of_a_command_that_sleeps_end_at_the_hand(stand: MakeStand) -> None:
    """Seen by the hand itself: it was driven by current, and stands without power."""
    place = stand("aidin")

    def mode() -> str:
        return send_control(str(place.panel), "state").split()[2]

    assert HOW["aidin"].drive is not None
    words, first = HOW["aidin"].drive
    holder = place.hold(*words, until=first)
    assert mode() == "41"
    os.kill(holder.pid, signal.SIGSTOP)
    result, _ = place.stop()
    assert result.code == 0 and mode() == "3", result
    holder.wait(PATIENCE)


GUARDED = """
    import os, signal, sys
    from handctl.link import open_link
    from handctl.link.deadman import guard_link
    from handctl.link.device_lock import hold

    name, frame, seconds = sys.argv[1:]
    link = open_link(name)
    link.held = hold(name, "handctl wrist move", family="wrist", use="writes").descriptors
    def stop(child):
        child.write(bytes.fromhex(frame), child.deadline(1.0))
        child.sleep(float(seconds))

    with guard_link(link, stop, print):
        print("armed", flush=True)
        os.kill(os.getpid(), signal.SIGSTOP)
"""
"""Has the device, is asleep, and leaves a last stop of its own, behind which its child stays on the port for some seconds."""


@pytest.mark.real
def test_the_last_stop_of_a_holder_that_was_ended_comes_first(stand: MakeStand) -> None:
    """Two on one port would take each other's answers, and destroy each other's frames on two wires."""
    place = stand("wrist")
    last, seconds = "EB 90 01 07 31 0E 04 00 00 00 00 4B", 1.2
    holder = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(GUARDED), place.link, last, str(seconds)],
        env={**os.environ, **place.environment}, stdout=subprocess.PIPE,
    )  # fmt: skip
    assert holder.stdout is not None and holder.stdout.readline() == b"armed\n"
    wait_until(lambda: processes.sleeps(holder.pid))
    place.heard()
    heard = []
    place.reached = lambda begun: heard.extend(place.heard()) or begun  # type: ignore[method-assign, func-returns-value]
    result, begun = place.stop()
    assert (result.code, holder.wait(PATIENCE)) == (0, -signal.SIGKILL), result
    assert "ended" in result.codes() and "confirmed" in {row["state"] for row in result.json["writes"]}, result
    holder.stdout.close()
    frame = bytes.fromhex(last)
    assert b"".join(data for _, data in heard).startswith(frame), heard
    behind = next(
        at for number, (at, _) in enumerate(heard, 1) if sum(len(one) for _, one in heard[:number]) > len(frame)
    )
    assert behind - begun >= seconds, "the last stop goes out behind the start of the command, and its silence is kept"


PATIENT = f"""
    import sys
    from handctl.cli import main
    from handctl.stop import stop_command

    stop_command.HEARD_SECONDS = {PATIENCE}
    sys.exit(main())
"""
"""A stop that takes no holder for asleep: on a busy machine one may take longer to hear of the wish than a stop waits."""


@pytest.mark.real
def test_two_stops_at_once(stand: MakeStand) -> None:
    place = stand("exo")
    holder = place.hold()
    place.heard()
    both = [
        subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(PATIENT), "exo", "stop", "-p", place.link],
            env={**os.environ, **place.environment}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )
        for _ in range(2)
    ]  # fmt: skip
    told = [one.communicate(timeout=PATIENCE) for one in both]
    assert ([one.returncode for one in both], holder.wait(PATIENCE)) == ([0, 0], 130), told
    place.reached(0.0)


@pytest.mark.real
def test_a_holder_whose_reader_sleeps_is_stopped(stand: MakeStand) -> None:
    """It is blocked in writing its rows: the wish reaches it all the same."""
    place = stand("aidin")
    reader, writer = os.pipe()
    os.set_blocking(writer, True)
    fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, 4096)
    holder = subprocess.Popen(
        [sys.executable, "-m", "handctl", "aidin", "watch", "--rate", "0", "--json", "-p", place.link],
        env={**os.environ, **place.environment}, stdin=subprocess.DEVNULL, stdout=writer, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    wait_until(lambda: not select.select([], [writer], [], 0)[1])
    os.close(writer)
    result, _ = place.stop()
    assert result.code == 0, result
    os.close(reader)
    holder.kill()
    holder.wait(PATIENCE)


# -- a wrist is no exoskeleton hand ------------------------------------------------------------------------------------


@each_row(("typed", "there"), [("exo", "wrist"), ("wrist", "exo")])
def test_what_was_typed_is_what_is_stopped(typed: str, there: str) -> None:
    """A force frame would be a write to a wrist, and a wrist's own frame one to a hand: the other is named, not written to."""
    result = run(typed, "stop", "-p", f"fake://{there}?clock=virtual", "--json")
    assert result.code == (6 if typed == "exo" else 4), result
    assert all(row["reads"] for row in result.rows), result


ANGLES = bytes.fromhex("90EB010730FC036400C800")
"""pitch 1.00, yaw 2.00 degrees (wrist §2.2), without the sum of its bytes."""


def late_wrist(latency: float, acknowledges: bool = True) -> ScriptedLink:
    """A wrist behind a slow adapter: it knows flags 30 and 31 and answers nothing else."""

    def answer(request: bytes) -> list[tuple[float, bytes]]:
        if request[4] == 0x30:
            reply = ANGLES if request[5:7] == b"\xfc\x03" else bytes.fromhex("90EB010530") + request[5:7] + b"\x07\x00"
        elif request[4:7] == bytes.fromhex("310E04") and acknowledges:
            reply = bytes.fromhex("90EB0104310E0401")
        else:
            return []
        return [(latency, reply + bytes([sum(reply[2:]) % 256]))]

    return ScriptedLink(answer)


LATE = [0.03, 0.062, 0.12, 0.2, 0.3, 0.4, 0.5]
STAY = bytes.fromhex("EB900107310E04C800640077")


@each_row("latency", LATE)
def test_a_late_wrist_is_stopped(latency: float) -> None:
    link = late_wrist(latency)
    stopped = exchange_steps(link, stop_sequence_of("wrist", StopContext(Settings())), [])
    assert stopped.error is None and STAY in link.sent and RELEASE not in link.sent, stopped


@each_row("latency", LATE)
def test_a_late_wrist_that_was_typed_as_a_hand_is_named(latency: float) -> None:
    """50 ms and the time on the wire: so long the question holds up the stop of a hand, and no longer."""
    link = late_wrist(latency)
    stopped = exchange_steps(link, stop_sequence_of("exo", StopContext(Settings())), [])
    assert stopped.error is DeviceRefused and "handctl wrist stop" in stopped.hint and STAY not in link.sent, stopped
    forces = [at for at, data in zip(link.sent_at, link.sent, strict=True) if data == RELEASE]
    assert bool(forces) == (latency > 0.06) and all(at >= 0.05 for at in forces) and min(forces, default=0) < 0.06


@each_row("typed", ["exo", "wrist"])
def test_silence_is_said_plainly(typed: str) -> None:
    sent: list[Sent] = []
    stopped = exchange_steps(ScriptedLink(), stop_sequence_of(typed, StopContext(Settings())), sent)
    assert stopped.error is NoAnswer and "switch the power off" in stopped.hint
    last = [True]  # an exo is asked once more where it is
    assert [one.reads for one in sent] == [True, *([typed == "wrist"] * len(sent[1:-1])), *last]
    assert len(sent) >= 5, "again and again"
    unacknowledged = exchange_steps(
        late_wrist(0.01, acknowledges=False), stop_sequence_of("wrist", StopContext(Settings())), []
    )
    assert unacknowledged.error is NoAnswer and "did not acknowledge" in unacknowledged.text


@each_row("latency", [0.06, 0.2, 0.35, 0.45])
def test_a_late_hand_is_stopped_and_believed(latency: float) -> None:
    """Its answer to the forces may come while a late wrist is listened for: it is an answer, and the fingers are held."""

    def answer(request: bytes) -> list[tuple[float, bytes]]:
        if request == RELEASE:
            reply = bytes.fromhex("90EB010D3184038E039803A203AC03F401")
        elif request[4] == 0x32:
            reply = bytes.fromhex("90EB010B3200000000000000000000")
        elif request[4] == 0x11:  # the positions are also the targets, and no force is set
            data = bytes(10) if request[5:7] == b"\xda\x05" else bytes.fromhex("84038E039803A203AC03F401")
            reply = bytes([0x90, 0xEB, 1, request[7] + 3, *request[4:7], *data[: request[7]]])
        else:
            return []
        return [(latency, reply + bytes([sum(reply[2:]) % 256]))]

    link = ScriptedLink(answer)
    stopped = exchange_steps(link, stop_sequence_of("exo", StopContext(Settings())), [])
    held = "the hand acknowledged two commands: all forces to 0, then hold at 900 910 920 930 940"
    assert stopped.error is None and held in stopped.text, stopped
    assert bytes.fromhex("EB90010B3284038E039803A203AC0345") in link.sent


@each_row("typed", ["exo", "wrist"])
def test_an_echo_or_other_bytes_are_not_silence(typed: str) -> None:
    echo = exchange_steps(
        ScriptedLink(lambda request: [(0.001, request)]), stop_sequence_of(typed, StopContext(Settings())), []
    )
    other = exchange_steps(
        ScriptedLink(lambda _: [(0.001, b"=> ")]), stop_sequence_of(typed, StopContext(Settings())), []
    )
    assert echo.error is not None and other.error is not None and {echo.error.exit_code, other.error.exit_code} == {5}
    assert "only our own bytes came back" in echo.text and "3D 3E 20" in other.text, (echo, other)


def test_a_hand_that_does_not_answer_is_sent_its_stop() -> None:
    result = run("exo", "stop", "-p", fake(fault="silent"), "--json")
    assert (result.code, result.error["code"]) == (4, "no-answer"), result
    asked, forces, where = result.rows
    assert (asked["bytes"], forces["bytes"]) == ("EB 90 01 04 30 00 04 02 3B", HOW["exo"].stop[0].hex(" ").upper())
    assert where["bytes"] == "EB 90 01 04 11 0A 06 0C 32", "it may be read all the same"
    assert forces["times"] >= 5, "and nothing that holds FF"


# -- bad places --------------------------------------------------------------------------------------------------------


def full_disk() -> None:
    """No file takes a byte."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))


@pytest.mark.real
@pytest.mark.parametrize("family", ["exo", "aidin"])
def test_neither_disk_nor_lock_hold_up_a_stop(family: str, stand: MakeStand) -> None:
    """A full disk, a stdout that takes nothing, a folder of locks that somebody else made before."""
    place = stand(family)
    result, _ = place.stop(preexec_fn=full_disk)
    assert result.code == 0, result
    with open("/dev/full", "wb") as full:
        result, _ = place.stop(stdout=full)
    assert result.code == 1 and "cannot be written" in result.err, "sent first, then told"
    assert re.search("handctl: (note|warning): writes: ", result.err), "and what was sent, too"
    shutil.rmtree(place.runtime / "handctl")
    (place.runtime / "handctl").write_text("squatted")
    result, _ = place.stop()
    assert result.code == 0 and "no-lock" in result.codes(), result


BROKEN = {"broken": "port = [", "unknown key": "colour = 1\n", "not utf-8": "\udcff"}


@each_row("content", [*BROKEN.values(), None])
def test_the_configuration_does_not_hold_up_a_stop(content: str | None, tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    if content is not None:
        path.write_bytes(content.encode("utf-8", "surrogateescape"))
    env = {"HANDCTL_CONFIG": str(path), "HANDCTL_BAUD": "fast", "HANDCTL_FORMAT": "pretty"}
    result = run("exo", "stop", "-p", fake(), "--json", env=env)
    assert result.code == 0, result
    messages = result.json["messages"]
    assert any(str(path) in message["text"] for message in messages), messages
    assert any("HANDCTL_BAUD" in message["text"] for message in messages), messages
    assert run("exo", "get", "id", "-p", fake(), env=env).code == 2, "what reads says so before it begins"


def test_neither_trace_nor_output_hold_up_a_stop() -> None:
    result = run("exo", "stop", "-p", fake(), "--json", "--trace", "/dev/null/t.txt")
    assert result.code == 0 and "trace" in result.codes(), result
    with spying() as spy:
        result = run("exo", "stop", "-p", fake(), "-o", "/dev/null/o.txt")
    assert (result.code, result.said[-1]) == (1, "output"), result
    assert spy.requests >= 2


# -- handctl stop ------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_the_lock_tells_the_family(stand: MakeStand) -> None:
    place = stand("aidin")
    result, _ = place.stop("aidin", "stop", "--json")
    assert result.code == 0
    result, _ = place.stop("stop", "--json")
    assert result.code == 0, "who had it last has ended, and its lock file still tells"
    holder = place.hold()
    result, _ = place.stop("stop", "--json")
    assert (result.code, holder.wait(PATIENCE)) == (0, 130), result
    holder = place.hold()
    holder.kill()
    holder.wait(PATIENCE)
    result, _ = place.stop("stop", "--json")
    assert result.code == 0, "who had it was killed, and its lock still tells"


PROGRAM = """
    import signal, sys, threading, time
    import handctl

    def ask(*_):
        print("asked", flush=True)
        if sys.argv[2] == "ends":
            sys.exit(7)

    signal.signal(signal.SIGTERM, ask)

    def work():
        with handctl.connect("exo", sys.argv[1]) as hand:
            hand.get("id")
            print("begun", flush=True)
            time.sleep(60)

    threading.Thread(target=work, daemon=True).start()
    while True:
        time.sleep(60)
"""
"""Uses the library in a thread, where nobody can ask for a stop; `ends` when it is asked to, or `stays`."""


@pytest.mark.real
@pytest.mark.parametrize(("kind", "code", "told"), [("ends", 7, "It ended after SIGTERM"), ("stays", -signal.SIGKILL, "within 1 s of SIGTERM")])  # fmt: skip
def test_a_program_that_uses_the_library_is_asked_first(kind: str, code: int, told: str, stand: MakeStand) -> None:
    place = stand("exo")
    holder = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(PROGRAM), place.link, kind],
        env={**os.environ, **place.environment}, stdout=subprocess.PIPE,
    )  # fmt: skip
    assert holder.stdout is not None and holder.stdout.readline() == b"begun\n"
    result, _ = place.stop("stop", "--json")
    assert (result.code, holder.wait(PATIENCE)) == (0, code), result
    assert holder.stdout.readline() == b"asked\n"
    holder.stdout.close()
    (message,) = [one for one in result.json["messages"] if one["code"] == "ended"]
    assert told in message["text"] and str(holder.pid) in message["text"], message


@pytest.mark.real
def test_another_way_to_the_port_is_not_another_device(stand: MakeStand) -> None:
    place = stand("exo")
    holder = place.hold()
    other = run("exo", "get", "id", "-p", f"alt://{place.link}", env=place.environment)
    assert other.code == 3 and f"(pid {holder.pid})" in other.err, other
    place.link, link = f"alt://{place.link}?class=PosixPollSerial", place.link
    result, _ = place.stop("stop", "--json")
    assert (result.code, holder.wait(PATIENCE)) == (0, 130) and "asked" in result.codes(), result
    place.link = link


def test_a_name_tells_the_family(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text('[devices.left]\nkind = "barrett"\nport = "fake://barrett?clock=virtual"\n')
    result = run("stop", "-d", "left", "--json", env={"HANDCTL_CONFIG": str(path)})
    assert result.code == 0 and result.json["device"]["kind"] == "barrett", result
    assert run("stop").code == 2


# -- what is said ------------------------------------------------------------------------------------------------------


def test_an_ekso_has_no_stop_and_it_is_said() -> None:
    result = run("ekso", "stop", "--fake", "--json")
    assert result.code == 0 and "The DataPort has no stop" in json.dumps(result.json["messages"])


@each_row("family", FAMILIES)
def test_a_dry_run_sends_nothing(family: str) -> None:
    result = run(family, "stop", "--fake", "-n", "--json")
    assert result.code == 0 and result.json["counters"]["sent"] == 0 and result.rows, result
