"""Every state in which a hand may be found x every command of `handctl barrett`, scan and doctor: no image is harmed.

The simulated hand decides: whether the firmware in its RAM is as it was, and whether a reading command ended what moved.
Boot windows of 0.1 to 5 s are entered at every 20 ms, with both receivers, at 9600 and at a remembered 38400. Commands come
from the command tree, so a new one is in here by itself.
"""

from __future__ import annotations

import contextlib
import json
import random
import re
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import pytest

from handctl.devices.barrett import state_files
from handctl.devices.barrett.gcl import connect_table as table
from handctl.devices.barrett.gcl.codec import ABORT
from handctl.devices.barrett.gcl.connect_table import FILL, QUESTION, SAFE_ABORT
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError
from handctl.files import state_path
from handctl.link import Deadline
from handctl.model.other_family_bytes import renamed
from handctl.sim.barrett.shared_state import STATES
from handctl.sim.bus.wire_pair import RECEIVERS, resample
from tests.barrett.support import Simulated, codes, hand_on
from tests.barrett.sweep import Row, begin, files, leaves, lines, outcome, reads, starts, words
from tests.barrett.sweep import sweep as commands_begun
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink

SPEEDS = (9600, 38400, 19200, 4800, 2400, 1200, 600)


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    return files(tmp_path)


def image(state: Path) -> str:
    """What the simulator kept of its image: whether it starts."""
    kept = json.loads(state.read_text())
    found = kept.get("image") or kept["device"]["image"]
    return "whole" if found["firmware"] and not (found["partial"] or found["spoiled"]) else "gone"


def test_no_reading_command_ends_a_movement(scratch: Path) -> None:
    """No ^C goes out; a movement goes on to its end, and RealTime is left by a question that no block takes for ^C."""
    trace = scratch / "trace.txt"
    for state in ("moving", "loop-moving"):
        for leaf in (leaf for leaf in leaves() if reads(leaf)):
            trace.unlink(missing_ok=True)
            link = f"fake://barrett?clock=virtual&found={state}&initialized=1"
            run("barrett", *words(leaf, scratch), "-p", link, "--json", "--deadline", "60", "--trace", str(trace))
            sent = (
                [line.split()[2:] for line in trace.read_text().splitlines() if " > " in line] if trace.exists() else []
            )
            assert not [data for data in sent if "03" in data], (state, leaf, sent)


@pytest.mark.parametrize("state", [state for state in STATES if state not in ("monitor", "record")])
def test_no_command_harms_the_image(state: str, scratch: Path) -> None:
    """A share of the commands; the suite `boot` of `tests/search` tries all, at every 20 ms of a boot window too."""
    for leaf in ("get", "set", "stop", "scan", "firmware check", "realtime", "reset"):
        unharmed(state, leaf, scratch)


def unharmed(state: str, leaf: str, scratch: Path) -> int:
    """One command on a hand in this state; its exit code. Raises AssertionError where its image does not start any more."""
    kept = scratch / "kept.json"
    kept.unlink(missing_ok=True)
    result = begin(leaf, scratch, f"fake://barrett?clock=virtual&found={state}&state={kept}&initialized=1")
    assert result.code != 1, (leaf, result)
    assert not kept.exists() or image(kept) == "whole", (leaf, result)
    return result.code


# -- the boot window ---------------------------------------------------------------------------------------------------


class Trial:
    """One connect, `at` s into the boot window of a hand whose receiver is `receiver`."""

    def __init__(self, window: float, at: float, receiver: str, baud: int, remembered: int, interrupt: bool) -> None:
        query = f"found=boot&boot={window}&window={window}&uart={receiver}&baud={baud}&wire=auto"
        self.link = Simulated(query, baud=remembered)
        self.link.sleep(at)
        self.link.read(Deadline(self.link.now, self.link.now()))  # the port is opened now: what was said before is lost
        hand = hand_on(self.link, interrupt=interrupt)
        self.error: HandctlError | None = None
        try:
            hand.line.connect()
            hand.line.ask("FGET P")
        except HandctlError as exc:
            self.error = exc
        self.hand = hand

    @property
    def image(self) -> str:
        line = self.link.inner._line  # type: ignore[attr-defined]
        line.advance(self.link.now())
        return str(line.command("image")).partition(",")[0]


WAYS = ((9600, 9600, False), (9600, 38400, False), (38400, 38400, True), (9600, 19200, True), (38400, 9600, False))
"""Speed of the hand, speed that was remembered, whether ^C may be sent."""


def test_a_share_of_the_boot_window() -> None:
    for window in (0.1, 1.0):
        for receiver in RECEIVERS:
            for way in WAYS:
                for at in starts(window, 0.22):
                    connected(window, receiver, way, at)


def connected(window: float, receiver: str, way: tuple[int, int, bool], at: float) -> None:
    """Connect once. Raises AssertionError where an image was harmed, or the hand was not found again."""
    trial = Trial(window, at, receiver, *way)
    assert trial.image == "image valid" and trial.error is None, (window, receiver, way, at, trial.image, trial.error)


def harmed(found: Iterable[Row]) -> list[Row]:
    """The starts that harmed an image, or met a defect of ours."""
    return [row for row in found if not row[2].whole or row[2].code == 1]


def test_a_share_of_commands_in_the_boot_window(scratch: Path) -> None:
    found = list(commands_begun([0.2], 0.1, scratch, ["get", "set", "stop", "scan"]))
    assert len(found) == 2 * 4 * 4
    assert harmed(found) == []


@pytest.mark.parametrize("at", [0.0, 1.2, 2.6])
def test_a_scan_asks_nothing_again_that_a_boot_monitor_could_take_for_firmware(scratch: Path, at: float) -> None:
    """The probes of the slow speeds wake the monitor of a hand whose window is long; a second round would erase it."""
    assert outcome("boot", "scan", scratch, at, boot=5.0, window=5.0, uart="sci").whole


def test_the_table_tells_what_was_sent_and_changed(scratch: Path) -> None:
    shared = [("loop", leaf, outcome("loop", leaf, scratch)) for leaf in ("get", "status", "set")]
    assert list(lines(shared)) == [
        "loop: 3 starts, 0 images harmed",
        "    sent: !, commands; changed: mode; exit 0", "        get, status",
        "    sent: ^C, !, commands; changed: mode, parameters; exit 0", "        set",
    ]  # fmt: skip
    assert next(lines([("boot", "get", shared[0][2]._replace(whole=False))])) == "boot: 1 starts, 1 images harmed"


# -- bits ------------------------------------------------------------------------------------------------------------------


@each_row("receiver", RECEIVERS)
@each_row("speed", [speed for speed in SPEEDS if speed != 9600])
def test_what_a_connect_sends_is_no_trigger(speed: int, receiver: str) -> None:
    for data in (QUESTION, FILL, SAFE_ABORT if speed > 9600 else ABORT):
        assert 0xFF not in resample(data, speed, 9600, receiver), data
    assert resample(table.LOOPED, table.LOOP_SPEED, 9600, receiver) == b""


def test_a_plain_abort_at_38400_would_be_one() -> None:
    assert all(resample(ABORT, 38400, 9600, receiver) == b"\xff" for receiver in RECEIVERS)


# -- the table ----------------------------------------------------------------------------------------------------------------


def test_the_table_is_whole() -> None:
    """Each state and each thing that is seen has one row; every way ends; what is sent is known."""
    assert len(table.RULES) == len(table.TABLE)
    for state in table.STATES:
        seen = {row.seen for row in table.TABLE if row.state == state}
        assert seen == ({table.ECHO, table.NOTHING} if state == table.ECHOED else set(table.SEEN)), state
    for row in table.TABLE:
        assert row.next in {**table.STATES, **table.ENDS}, row
        assert row.send in (table.SEND_NOTHING, table.ASK, table.REST, table.ABORTS, table.LOOP_TEST), row
        if row.next in (table.BOOTING, table.SILENT, table.RESTARTED, *table.ENDS):
            assert row.send == table.SEND_NOTHING, row
    assert set(table.SECONDS) == set(table.STATES)
    reached, new = {table.OPENED}, [table.OPENED]
    while new:
        state = new.pop()
        for row in table.TABLE:
            if row.state == state and row.next not in reached:
                reached.add(row.next)
                new.append(row.next)
    assert reached | {table.REMEMBERED, table.FILLED_FIRST, table.AGAIN, table.NOBODY, table.GARBAGE} == {
        *table.STATES,
        *table.ENDS,
    }


PIECES = (b"", b"\n\r=> ", b"\r\n ERR 2048\r\n=> ", b"BarrettHand Firmware\n\rVersion 4.33\n\r=> ",
          b"BarrettHand Firmware\n\rVersion 4.33\n\r=> \0", b":", QUESTION, b"\xff\x80", b"!\0\r ERR 32\r\n=> ")  # fmt: skip


def test_a_banner_without_a_prompt_is_asked_once_more() -> None:
    """Its prompt may have been disturbed; a hand that goes on so is given up, however often the banner comes."""
    banner = PIECES[4]
    replies = iter([banner, b"!\0\r\n\r ERR 32\n\r=> "])
    link = ScriptedLink(lambda request: [(0.0, next(replies))], 9600)
    hand = hand_on(link)
    hand.line.connect()
    assert (link.sent, codes(hand)) == ([QUESTION, QUESTION], ["restarted"])
    link = ScriptedLink(lambda request: [(0.0, banner)], 9600)
    with pytest.raises(ProtocolError) as caught:
        hand_on(link).line.connect()
    assert (caught.value.code, link.sent, link.clock < 15.0) == ("garbage", [QUESTION, QUESTION, QUESTION], True)


def test_every_walk_ends() -> None:
    """Whatever comes, in whatever order: no device leads a connect round in a circle."""
    for seed in range(150):
        dice = random.Random(seed)
        link = ScriptedLink(partial(some, dice, dice.sample(PIECES, 3)), 9600)
        with contextlib.suppress(ProtocolError, NoAnswer, DeviceRefused):
            hand_on(link).line.connect()
        assert link.clock < 60.0, seed


def some(dice: random.Random, pieces: list[bytes], _request: bytes) -> list[tuple[float, bytes]]:
    """Three of these pieces, at once and later."""
    return [(dice.choice((0.0, 0.2, 3.0, 7.0)), dice.choice(pieces)) for _ in range(3)]


def test_a_connect_at_the_remembered_speed_is_one_round_trip() -> None:
    for baud in SPEEDS:
        link = Simulated(f"baud={baud}&wire=auto", baud=baud)
        hand = hand_on(link)
        hand.line.connect()
        assert link.sent == [QUESTION]
        assert link.now() <= 20 * 10 / baud
        assert codes(hand) == []


SAID = {
    "boot": ("restarted", "must be initialized (HI)"),
    "loop": ("loop", "was in RealTime"),
    "loop-block": ("loop", "in a control block that was cut off"),
    "loop-moving": ("moving", "counts in 0.1 s"),
    "moving": ("busy", "running an earlier command"),
    "saving": ("busy", "running an earlier command"),
}


@each_row("state", SAID)
def test_what_was_found_out_is_said(state: str) -> None:
    link = Simulated(f"found={state}&initialized=1&wire=auto")
    hand = hand_on(link)
    hand.line.connect()
    code, text = SAID[state]
    found = [message.text for message in hand.journal.messages if message.code == code]
    assert found and text in found[0], hand.journal.messages
    assert not [data for data in link.sent if ABORT in data]


@each_row(
    ("data", "seen"),
    [
        (b":", table.COLON), (b"!\0\r:", table.COLON), (b"\n\r12:\0\r\n", table.COLON), (b'{"motor_pos":', table.BYTES),
        (b'0]}\n{"motor_pos" : ', table.BYTES), (b'{"a":1}\n', table.BYTES),
    ],
)  # fmt: skip
def test_a_colon_of_json_is_no_boot_monitor(data: bytes, seen: str) -> None:
    assert table.seen_in(data) == seen


def test_a_device_that_talks_json_is_named() -> None:
    """Its text may be cut anywhere, behind a key's ':' too; a monitor would be met with 6 s of waiting and another name."""
    text = b'{"motor_pos": [0, 0, 0], "hand_mode":'
    link = ScriptedLink(lambda request: [(0.0, text)], 9600)
    with pytest.raises(ProtocolError) as caught:
        hand_on(link).line.connect()
    named = renamed(caught.value, "barrett")
    assert (named.exit_code, "monitor" in named.text, "`handctl aidin`" in named.hint) == (6, False, True)


@each_row("missing", range(1, 9))
@each_row("baud", [9600, 38400])
def test_a_control_block_that_was_cut_off_is_ended(missing: int, baud: int) -> None:
    """Whatever is missing of it: 0 is sent for it, RealTime is left, and no motor has begun to move."""
    link = Simulated(f"found=loop&initialized=1&wire=auto&baud={baud}", baud=baud)
    link.feed(b"C" + bytes(8 - missing))
    hand = hand_on(link)
    hand.line.connect()
    assert link.sent[:2] == [QUESTION, FILL if missing > 2 else b"FGET P\r"]
    assert link.now() < 2.0
    assert "loop" in codes(hand)
    assert hand.line.ask("FGET P").lines == ("0 0 0 0",)


@each_row("state", ["monitor", "record"])
@each_row("echo", ["0", "1"])
def test_a_blank_hand_is_no_echo(state: str, echo: str) -> None:
    link = Simulated(f"found={state}&monitor-echo={echo}&wire=auto")
    with pytest.raises(HandctlError) as caught:
        hand_on(link).line.connect()
    assert caught.value.exit_code == (4 if (state, echo) == ("monitor", "0") else 6), (
        "a silent one cannot be told from none"
    )
    assert re.search("firmware", caught.value.text + caught.value.hint)


# -- the remembered speed --------------------------------------------------------------------------------------------------------


class Port:
    can_set_baud, fake, replayed, name = True, False, False, "/dev/ttyX"

    def __init__(self, baud: int) -> None:
        self.baud = baud


def test_the_last_speed_is_kept_per_port() -> None:
    assert state_files.recall(Port(9600)) is None  # type: ignore[arg-type]
    state_files.remember(Port(38400))  # type: ignore[arg-type]
    assert state_files.recall(Port(9600)) == 38400  # type: ignore[arg-type]
    state_files.remember(Port(9600))  # type: ignore[arg-type]
    assert state_files.recall(Port(9600)) is None  # type: ignore[arg-type]


@each_row("content", ["", "{", "[1]", '{"/dev/ttyX": "fast"}', '{"/dev/ttyX": 57600}', '{"/dev/ttyX": [9600]}'])
def test_a_damaged_file_is_as_good_as_none(content: str) -> None:
    path = state_path(state_files.NAME)
    path.parent.mkdir(parents=True)
    path.write_text(content)
    assert state_files.recall(Port(9600)) is None  # type: ignore[arg-type]
    state_files.remember(Port(38400))  # type: ignore[arg-type]
    assert state_files.recall(Port(9600)) == 38400  # type: ignore[arg-type]


def test_a_state_folder_that_cannot_be_made_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/proc/none")
    state_files.remember(Port(38400))  # type: ignore[arg-type]
    assert state_files.recall(Port(9600)) is None  # type: ignore[arg-type]


@pytest.mark.parametrize("command", [("status", "--check"), ("diagnose",)])
def test_a_check_says_when_it_moves(command: tuple[str, ...]) -> None:
    """S is 0 while RealTime drives the motors, and a prompt does not end that: P is read twice."""
    moving = run(
        "barrett", *command, "-p", "fake://barrett?clock=virtual&wire=auto&found=loop-moving&initialized=1", "--json"
    )
    assert moving.code == 7
    assert "F1 " in moving.out and ("the hand is moving: F1" in moving.out or "P changes: F1" in moving.out)
    stands = run("barrett", *command, "-p", "fake://barrett?clock=virtual&wire=auto&found=loop&initialized=1", "--json")
    assert "it moves" not in stands.out and "P changes" not in stands.out
