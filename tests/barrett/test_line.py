"""The supervisory line: finding the hand's speed and prompt, deadlines, what follows a lost answer (barrett §5.1.1)."""

from __future__ import annotations

import pytest

from handctl.devices.barrett.gcl.codec import Answer
from handctl.errors import DeviceRefused, HandctlError, LinkError, NoAnswer, ProtocolError, command_of
from handctl.sim.bus.wire_pair import RECEIVERS, resample
from tests.barrett.support import (
    ABORT,
    MET,
    PROMPT,
    QUESTION,
    REST,
    ScriptedHand,
    Simulated,
    codes,
    gcl,
    hand_on,
    scripted,
    simulated,
)
from tests.support.each_row import each_row
from tests.support.refused import refused
from tests.support.scripted import Babble, ScriptedLink

SPEEDS = [9600, 38400, 19200, 4800, 2400, 1200, 600]


# -- connect ----------------------------------------------------------------------------------------------------------


def test_connect_asks_once() -> None:
    """One round trip. A bare CR would carry out what somebody left typed, ^C would end what moves (dossier 1.5)."""
    link = ScriptedHand()
    hand_on(link).line.connect()
    assert link.sent == [QUESTION]
    assert link.bauds == []


def test_only_who_may_interrupt_sends_abort() -> None:
    link = ScriptedHand()
    hand_on(link, interrupt=True).line.connect()
    assert link.sent == [ABORT, QUESTION]


@each_row("receiver", RECEIVERS)
def test_an_interrupt_is_no_trigger_to_a_boot_monitor_at_any_speed(receiver: str) -> None:
    """Somebody may have switched the hand off and on: its monitor hears 9600, and FF begins a download (dossier 7.2)."""
    for speed in SPEEDS[:2]:
        link = ScriptedLink(baud=speed)
        line = hand_on(link, interrupt=True, speed=speed).line
        assert line.leave_loop() == b""
        with pytest.raises(NoAnswer):
            line.connect()
        assert len([data for data in link.sent if data[-1:] == ABORT]) > 1
        for data in link.sent:
            assert speed == 9600 or 0xFF not in resample(data, speed, 9600, receiver), (speed, data)


def test_abort_has_150_ms_before_the_question() -> None:
    link = ScriptedHand()
    link.on_abort = None
    hand_on(link, interrupt=True).line.connect()
    assert link.sent == [ABORT, QUESTION]
    assert link.sent_at[1] - link.sent_at[0] == pytest.approx(0.15 + 32 * 10 / 9600)


def test_connect_once() -> None:
    hand, link = scripted({"FGET P": "0 0 0 0"})
    hand.line.connect()
    hand.line.ask("FGET P")
    assert link.sent == [b"FGET P\r"]


class LateBlank(ScriptedHand):
    """Behind a USB adapter that hands on the last byte of an answer 20 ms after the others."""

    def _reply(self, request: bytes) -> list[tuple[float, bytes]]:
        data = self._data(request)
        return [(0.03, data[:-1]), (0.05, data[-1:])]


@each_row("baud,pause", [(baud, pause) for baud in (9600, 38400) for pause in (0.0, 0.1)])
def test_the_late_blank_of_a_prompt_is_no_stray_byte(baud: int, pause: float) -> None:
    link = LateBlank({"FGET P": "0 0 0 0"}, speed=baud, baud=baud)
    line = hand_on(link, speed=baud).line
    for _ in range(3):
        line.ask("FGET P")
        link.sleep(pause)
    assert line.journal.counters.stray_bytes == 0
    assert link.commands == ["FGET P"] * 3
    link.sleep(0.1)
    line.drain()
    link.put(0.0, b" ")
    line.ask("FGET P")
    assert line.journal.counters.stray_bytes == 1, "the second blank belongs to no prompt"


def test_a_blank_behind_a_whole_prompt_is_a_stray_byte() -> None:
    hand, link = scripted({"FGET P": "0 0 0 0"})
    hand.line.ask("FGET P")
    link.put(0.0, b" ")
    hand.line.ask("FGET P")
    assert hand.journal.counters.stray_bytes == 1


@each_row("interrupt", [False, True])
@each_row("typed", ["O", "12FSET TSTOP 9999", "HI", "\x00\xff"])
def test_a_half_typed_line_is_never_executed(typed: str, interrupt: bool) -> None:
    link = Simulated("initialized=1")
    link.feed(typed.encode("latin-1"))
    hand = hand_on(link, interrupt=interrupt)
    before = hand.line.ask("FGET P TSTOP").lines
    assert before == hand.line.ask("FGET P TSTOP").lines
    assert before[1] == "30 30 30 30"
    assert hand.line.ask("FGET S").lines == ("0 0 0 0",)


@each_row("speed", SPEEDS)
def test_seven_speeds_are_tried(speed: int) -> None:
    link = ScriptedHand(speed=speed)
    hand = hand_on(link)
    hand.line.connect()
    place = SPEEDS.index(speed)
    assert link.bauds == SPEEDS[1 : place + 1]
    assert link.baud == speed
    assert link.sent == [QUESTION, *[REST, *[QUESTION] * place][: 2 * place]]
    assert codes(hand) == ([] if speed == 9600 else ["speed"])
    if speed != 9600:
        assert f"{speed} bit/s" in hand.journal.messages[0].text
        assert f"--baud {speed}" in hand.journal.messages[0].hint
        assert link.sent_at[2] >= 3.0, "a hand that is starting must have been given its time"


@each_row("speed", SPEEDS)
def test_the_simulated_hand_is_found_at_every_speed(speed: int) -> None:
    hand = hand_on(Simulated(f"baud={speed}"))
    assert hand.version() == "4.33"
    assert hand.line.link.baud == speed


def test_the_last_known_speed_comes_first_then_9600() -> None:
    link = ScriptedHand(speed=600, baud=2400)
    hand_on(link).line.connect()
    assert link.bauds == [9600, 38400, 19200, 4800, 1200, 600]


def test_baud_of_the_command_line_is_the_only_one() -> None:
    link = ScriptedHand(speed=38400)
    with pytest.raises(NoAnswer) as caught:
        hand_on(link, speed=19200).line.connect()
    assert set(link.bauds) == {19200}
    assert "19200" in caught.value.text


def test_a_link_without_speeds_is_asked_at_once() -> None:
    link = ScriptedHand(baud=None)
    link.can_set_baud = False
    hand_on(link).line.connect()
    assert (link.sent, link.bauds) == ([QUESTION], [])


@each_row("end", [b"\n\r=> ", b"\r\n=> ", b"\n\r=>", b"\n\rERR 32\n\r=> "])
def test_prompts(end: bytes) -> None:
    link = ScriptedLink(lambda request: [(0.01 * place, bytes([byte])) for place, byte in enumerate(b"!" + end)], 9600)
    hand_on(link).line.connect()
    assert link.sent == [QUESTION]


def test_silence() -> None:
    link = ScriptedLink(baud=9600)
    with pytest.raises(NoAnswer) as caught:
        hand_on(link).line.connect()
    assert caught.value.exit_code == 4
    assert all(str(speed) in caught.value.text for speed in SPEEDS)
    for word in ("power", "cable", "firmware", "moves", "stop"):
        assert word in caught.value.hint
    assert link.sent == [QUESTION, REST, *[QUESTION] * 7], "the first speed once more: it may have been busy"
    assert link.clock < 7.0


def test_garbage() -> None:
    link = ScriptedLink(lambda request: [(0.0, b"\x55\xaa")], 9600)
    with pytest.raises(ProtocolError) as caught:
        hand_on(link).line.connect()
    assert (caught.value.code, caught.value.exit_code) == ("garbage", 5)
    assert "55 AA" in caught.value.text
    assert link.sent == [QUESTION, REST, *[QUESTION] * 7]


def test_a_wire_is_told_from_a_monitor() -> None:
    """Both give our bytes back at 9600; at 115200 the monitor hears nothing of a pulse of 9 us (its bit has 104 us)."""
    link = ScriptedLink(lambda request: [(0.0, request)], 9600)
    with pytest.raises(ProtocolError) as caught:
        hand_on(link).line.connect()
    assert (caught.value.code, caught.value.exit_code) == ("echo", 5)
    assert (link.sent, link.bauds) == ([QUESTION, b"\x7f"], [115200, 9600])
    monitor = Simulated("found=monitor&monitor-echo=1")
    with pytest.raises(DeviceRefused) as refused:
        hand_on(monitor).line.connect()
    assert (refused.value.code, refused.value.exit_code) == ("boot-monitor", 6)
    assert refused.value.code == "boot-monitor"
    assert monitor.sent == [QUESTION, b"\x7f"]


def test_at_one_speed_a_wire_and_a_monitor_are_not_told_apart() -> None:
    """A device server has no 115200 to try: both are named, and so is what tells them apart."""
    link = ScriptedLink(lambda request: [(0.0, request)], 9600)
    link.can_set_baud = False
    with pytest.raises(ProtocolError) as caught:
        hand_on(link).line.connect()
    assert (caught.value.code, command_of(caught.value.hint)) == ("echo-or-monitor", "barrett listen --duration 30")
    assert link.sent == [QUESTION]


@each_row("colon", [b"", b":"])
def test_a_monitor_that_was_only_seen_to_echo_may_be_another_device(colon: bytes) -> None:
    """Another device that echoes at 9600 is silent at 115200 too. Only the ':' is a monitor's alone."""
    link = ScriptedLink(lambda request: [(0.0, request)] if link.baud == 9600 else [], 9600)
    if colon:
        link.put(0.0, colon)
    with pytest.raises(DeviceRefused) as caught:
        hand_on(link).line.connect()
    assert caught.value.code == "boot-monitor"
    assert ("barrett listen" in caught.value.hint) == (not colon)


@each_row("interrupt", [False, True])
def test_a_hand_that_does_not_echo_is_not_busy(interrupt: bool) -> None:
    """Half duplex, or a server that swallows the echo: no command has ended, and no reply can be matched with its request."""
    hand = hand_on(ScriptedLink(lambda request: [(0.0, b"\n\rERR 32\n\r=> " if b"!" in request else PROMPT)], 9600))
    hand.line.interrupt = interrupt
    with pytest.raises(ProtocolError) as caught:
        hand.line.connect()
    assert (caught.value.code, caught.value.exit_code) == ("no-echo", 5)
    assert codes(hand) == []


@each_row("keeps", [False, True])
def test_a_hand_whose_command_has_just_ended_is_met(keeps: bool) -> None:
    """Its prompt has no echo of the request; it carries that out then, or has dropped it and is asked again."""
    link = ScriptedLink(None, 9600)
    answers = [[(0.1, PROMPT), *([(0.2, MET)] if keeps else [])], [(0.0, MET)]]
    link.answer = lambda request: answers.pop(0)
    hand = hand_on(link)
    hand.line.connect()
    assert (codes(hand), len(link.sent)) == (["busy"], 2 - keeps)


def test_a_babbling_line_ends() -> None:
    link = Babble(baud=9600)
    with pytest.raises(ProtocolError) as caught:
        hand_on(link).line.connect()
    assert caught.value.code == "garbage"
    assert link.clock < 60.0


@each_row("needed", [1, 3, 9])
def test_a_hand_in_its_loop_is_taken_out(needed: int) -> None:
    """A lost control block may expect up to 8 bytes: as many ^C go into it (dossier 1.5 step 4, §6.1)."""
    heard = 0

    def answer(request: bytes) -> list[tuple[float, bytes]]:
        nonlocal heard
        if request == QUESTION:
            return [(0.0, b"*")]
        heard += 1
        return [(0.0, PROMPT)] if heard == needed + 1 else [(0.0, b"\x00")]

    link = ScriptedLink(answer, 9600)
    hand = hand_on(link, interrupt=True)
    hand.line.connect()
    assert link.sent == [ABORT, QUESTION] + [ABORT] * needed
    (message,) = hand.journal.messages
    assert message.code == "loop"
    assert f"{needed} ^C" in message.text
    gaps = [b - a for a, b in zip(link.sent_at[2:], link.sent_at[3:], strict=False)]
    assert all(0.02 <= gap < 0.05 for gap in gaps)


def test_ten_aborts_are_the_most() -> None:
    link = ScriptedLink(lambda request: [(0.0, b"*")], 9600)
    link.can_set_baud = False
    with pytest.raises(ProtocolError):
        hand_on(link, interrupt=True).line.connect()
    assert [data for data in link.sent if data == ABORT] == [ABORT] * 11, (
        "before each of two questions, and nine between"
    )


# -- commands ---------------------------------------------------------------------------------------------------------


@each_row(
    ("command", "seconds"),
    [
        ("FGET P", 3), ("PGET TEMP", 3), ("VERS", 3), ("FSET DP 1", 3), ("PLOAD", 3), ("FSAVE", 15), ("PSAVE", 15),
        ("C", 20), ("12M 5000", 20), ("STO", 20), ("HI", 30), ("GHI", 30), ("FOO", 3),
    ],
)  # fmt: skip
def test_deadlines_by_kind(command: str, seconds: int) -> None:
    """Dossier 1.3: query 3 s + twice the wire time, save 15 s, movement 20 s, HI 30 s."""
    hand, link = scripted({command: command.encode()})
    start = link.clock
    with pytest.raises(ProtocolError) as caught:
        hand.line.ask(command)
    assert (caught.value.exit_code, caught.value.code) == (5, "cut-short")
    wire = 2 * (len(command) + 1 + 512) * 10 / 9600
    assert link.clock - start >= seconds + wire - 0.001
    assert link.clock - start < seconds + wire + 5.0


@each_row("command", ["FGET P", "HI", "C", "FSAVE"])
def test_silence_instead_of_an_echo(command: str) -> None:
    """The echo has 1 s and twice its wire time (dossier 1.3)."""
    hand, link = scripted({command: None})
    start = link.clock
    with pytest.raises(NoAnswer) as caught:
        hand.line.ask(command)
    assert (caught.value.exit_code, caught.value.code) == (4, "no-answer")
    assert caught.value.text.endswith(f": no reply to {command} at 9600 bit/s within 1 s")
    assert 1.0 <= link.clock - start < 4.0


@each_row(("command", "shorter"), [("FGET P", True), ("FSET DP 1", True), ("HI", False), ("C", False)])
def test_timeout_is_for_queries(command: str, shorter: bool) -> None:
    hand, link = scripted({command: command.encode()}, timeout=0.5)
    start = link.clock
    with pytest.raises(ProtocolError):
        hand.line.ask(command)
    assert (link.clock - start < 2.0) == shorter


def test_a_slow_answer_is_waited_for() -> None:
    hand, link = scripted({"HI": ""})
    link.thinks = 29.0
    assert hand.line.ask("HI").status == 0


@each_row("command", ["C", "12M 5000", "HI"])
def test_a_movement_that_does_not_end_is_stopped(command: str) -> None:
    """On a timeout ^C is sent (dossier 1.3): nobody else will stop it."""
    hand, link = scripted({command: command.encode()})
    with pytest.raises(ProtocolError):
        hand.line.ask(command)
    assert link.commands == [command]
    assert ABORT in link.sent[1:]


@each_row("dead", [True, False])
def test_that_the_motors_stand_is_said_where_the_prompt_came(dead: bool) -> None:
    hand, link = scripted({"C": b"C"})
    link.on_abort = b"\n\rERR 16384" + PROMPT
    hand.line.connect()
    if dead:
        link.answer = lambda request: [(0.0, b"C")] if request == b"C\r" else []
    with pytest.raises(ProtocolError) as caught:
        hand.line.ask("C")
    assert ("the motors should have stopped" in caught.value.hint) != dead
    assert ("^C was sent, but the hand did not reply: switch the power supply off" in caught.value.hint) == dead


@each_row("command", ["FGET", "PGET", "12FGET"])
def test_a_get_of_nothing_may_answer_nothing(command: str) -> None:
    hand, _ = scripted({command: ""})
    assert hand.line.ask(command).lines == ()


@each_row("command", ["GC", "HI", "FGET P"])
def test_a_link_lost_in_a_movement_warns_of_it(command: str) -> None:
    hand, _ = simulated("initialized=1&fault=disconnect&after=1")
    with pytest.raises(LinkError) as caught:
        hand.line.ask(command)
    assert ("power off" in caught.value.hint) == (command != "FGET P"), caught.value.hint


def test_deadline_bounds_everything() -> None:
    link = ScriptedHand({"C": b"C", "FGET P": None})
    hand = hand_on(link)
    hand.line.bound = link.deadline(2.0)
    with refused(NoAnswer, "deadline", "--deadline") as over:
        hand.line.ask("C")
    assert over.value.code == "deadline" and "^C was sent" in over.value.hint
    assert link.clock <= 4.0 and ABORT in link.sent
    link.sent.clear()
    with pytest.raises(NoAnswer) as caught:
        hand.line.ask("FGET P")
    assert caught.value.code == "deadline"
    assert link.commands == []


@each_row("seconds", [0.1, 1.0])
def test_deadline_bounds_the_search(seconds: float) -> None:
    link = ScriptedLink(baud=9600)
    hand = hand_on(link, bound=link.deadline(seconds))
    with pytest.raises(HandctlError):
        hand.line.ask("FGET P")
    assert link.clock <= seconds + 0.5
    assert link.sent == ([QUESTION] if seconds == 0.1 else [QUESTION, REST])


def test_reads_are_retried_after_a_resynchronisation() -> None:
    hand, link = scripted({"FGET P": [None, "1 2 3 4"]})
    assert hand.line.read("FGET P").lines == ("1 2 3 4",)
    assert link.sent == [b"FGET P\r", QUESTION, b"FGET P\r"]
    assert hand.journal.counters.retries == 1
    gap = link.sent_at[1] - link.sent_at[0]
    assert 1.2 < gap < 1.5, "1 s for the echo, 200 ms of silence before the question"


@each_row("retries", [0, 1, 5])
def test_reads_are_retried_so_often(retries: int) -> None:
    hand, link = scripted({"FGET P": None}, retries=retries)
    with pytest.raises(NoAnswer):
        hand.line.read("FGET P")
    assert link.commands == ["FGET P"] * (retries + 1)


@each_row("command", ["FSET DP 1", "FSAVE", "HI", "C", "1T", "PSET LFT 1"])
def test_what_changes_something_is_asked_once(command: str) -> None:
    hand, link = scripted({command: None})
    with pytest.raises(NoAnswer):
        hand.line.ask(command)
    assert link.commands == [command]


def test_resynchronisation_ends_while_the_line_babbles() -> None:
    link = Babble(baud=9600)
    line = hand_on(link).line
    line.resynchronise()
    assert link.clock < 4.0


def test_a_late_answer_does_not_pass_for_the_next() -> None:
    """What came too late is gone before the question is repeated."""
    hand, link = scripted({"FGET P": ["1 1 1 1", "2 2 2 2"]}, timeout=1.0)
    link.put(0.0, gcl("FGET P", "9 9 9 9"))
    assert hand.line.read("FGET P").lines == ("1 1 1 1",)
    assert hand.journal.counters.stray_bytes == len(gcl("FGET P", "9 9 9 9"))


@each_row("late", ["0.3", "0.45", "0.6", "0.9", "1.3"])
def test_on_a_late_line_no_answer_is_taken_for_that_of_the_next_question(late: str) -> None:
    """All questions are echoed at once and answered later: two are out when the first prompt comes."""
    right, _ = simulated("initialized=1")
    try:
        hand, _ = simulated(f"initialized=1&fault=late&late={late}")
    except ProtocolError:
        assert float(late) > 0.6, "from there on the hand is not found"
        return
    for name in ("DP", "DS", "HSG", "MPE"):
        assert hand.line.read(f"FGET {name}").lines == right.line.read(f"FGET {name}").lines


@each_row(
    ("answer", "code"),
    [
        (b"FGET P\n\r1 2 3 4\n\r", "cut-short"), (b"FGET P", "cut-short"), (b"FGET Q\n\r1\n\r=> ", "echo-differs"),
        (b"\xff\xff", "echo-differs"), (b"\n\r1 2 3 4\n\r=> ", "echo-differs"),
    ],
)  # fmt: skip
def test_invalid_answers(answer: bytes, code: str) -> None:
    hand, _ = scripted({"FGET P": answer})
    with pytest.raises(ProtocolError) as caught:
        hand.line.ask("FGET P")
    assert (caught.value.code, caught.value.exit_code) == (code, 5)
    assert answer[:4].hex(" ").upper() in caught.value.text
    if code == "echo-differs":
        assert "46 47 45 54 20 50 0D" in caught.value.text


@each_row("end", [b"\n\r", b"\r\n"])
@each_row("prompt", [b"=> ", b"=>"])
@each_row("dribble", [0.0, 0.001, 0.02])
def test_line_ends_prompts_and_pieces(end: bytes, prompt: bytes, dribble: float) -> None:
    """Nothing is left over for the next command, and nothing counts as stray."""
    first, second = (gcl("FGET P", f"{n} 2 3 4", end=end, prompt=prompt) for n in (1, 5))
    hand, link = scripted({"FGET P": [first, second]})
    link.dribble = min(dribble, 0.001) if prompt.endswith(b" ") else dribble
    assert hand.line.ask("FGET P").lines == ("1 2 3 4",)
    assert hand.line.ask("FGET P").lines == ("5 2 3 4",)
    assert hand.journal.counters.stray_bytes == 0
    assert (hand.journal.counters.sent, hand.journal.counters.received) == (2, 2)


# -- abort ------------------------------------------------------------------------------------------------------------


def test_abort() -> None:
    hand, link = scripted()
    link.on_abort = b"\n\rERR 16384\n\r=> "
    assert hand.line.abort() == Answer("", (), 16384, b"\n\n\rERR 16384\n\r=> ")
    assert link.sent == [ABORT]


def test_abort_without_a_prompt_gives_up() -> None:
    hand, link = scripted()
    link.on_abort = None
    start = link.clock
    assert hand.line.abort() is None
    assert 1.5 <= link.clock - start < 2.0


def test_abort_really_stops_the_motion() -> None:
    hand, link = simulated()
    link.write(b"GC\r", link.deadline(1.0))
    link.sleep(0.3)
    answer = hand.line.abort()
    assert answer is not None
    assert answer.status == 16384
    first = hand.line.ask("GFGET P").lines
    link.sleep(2.0)
    assert hand.line.ask("GFGET P").lines == first
    assert all(100 < int(place) < 16900 for place in first[0].split())
