"""A stop as a talk, in process: what goes out, how often, and that only an acknowledgement makes it a success."""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.errors import DeviceRefused, NoAnswer, ProtocolError
from handctl.link import Deadline
from handctl.model.command_settings import Settings
from handctl.model.param import Step
from handctl.model.stop_repetition import attempts, single_write_stop
from handctl.model.stop_sequence import (
    TOO_LATE,
    Sent,
    StopContext,
    Stopped,
    StopSequence,
    StopStep,
    TooLate,
    exchange_steps,
    stop_sequence_of,
    writes_without_replies,
)
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink
from tests.support.stop import BEYOND, RELEASE, summed

PLACES = "90EB010D3184038E039803A203AC03F401"
"""The answer to the forces: 900 910 920 930 940, thumb rotation 500 (exo §2.2.1), without the sum."""


def half_deaf(places: str) -> ScriptedLink:
    """A hand that answers the forces and nothing behind them."""
    return ScriptedLink(lambda request: [(0.01, summed(places))] if request == RELEASE else [])


@each_row(
    ("places", "last"),
    [(PLACES, "eb90010b3284038e039803a203ac0345"), (BEYOND, "eb90010d12ce0584038e039803a203ffff49")],
)
def test_a_hold_that_is_not_acknowledged_is_no_stop(places: str, last: str) -> None:
    link, sent = half_deaf(places), list[Sent]()
    stopped = exchange_steps(link, stop_sequence_of("exo", StopContext(Settings())), sent)
    assert stopped.error is NoAnswer, stopped
    assert "but not the next one" in stopped.text and "switch the power off" in stopped.hint
    written = [one for one in sent if not one.reads]
    assert {one.step.data.hex() for one in written} == {RELEASE.hex(), last} and written[-1].came == b"", link.sent
    assert [one.step.data.hex() for one in written[:4]] == [RELEASE.hex(), last] * 2, (
        "the place is read anew for each hold"
    )


def reads_only(*, hold: bool, forces: str = "") -> ScriptedLink:
    """A hand whose acknowledgements are lost, but for that of a `hold`, and that can be read: `forces` are in its registers."""
    held = PLACES[10:30]
    reads = {"0A060C": f"{held}F401", "CE050A": held, "DA050A": forces}

    def answer(request: bytes) -> list[Reply]:
        said = request.hex().upper()
        data = reads.get(said[10:16]) if said[8:10] == "11" else None
        if data:
            return [(0.01, summed(f"90EB01{3 + len(data) // 2:02X}11{said[10:14]}{data}"))]
        return [(0.01, summed(f"90EB010B32{held}"))] if hold and said[8:10] == "32" else []

    return ScriptedLink(answer)


@each_row(
    ("hold", "forces", "error", "said"),
    [
        (False, "", NoAnswer, "acknowledged neither"),
        (False, "00" * 10, NoAnswer, "acknowledged neither"),
        (True, "00" * 10, None, "registers read 0 for each"),
        (True, "6400" * 5, NoAnswer, "unknown whether they are"),
        (True, "", NoAnswer, "unknown whether they are"),
    ],
)
def test_a_hand_that_acknowledges_no_forces_is_held_where_it_reads(
    hold: bool, forces: str, error: type[Exception] | None, said: str
) -> None:
    """Else it would go on to its target: forces of 0 need not end a movement (the manual does not say)."""
    link = reads_only(hold=hold, forces=forces)
    stopped = exchange_steps(link, stop_sequence_of("exo", StopContext(Settings())), [])
    assert (stopped.error, said in stopped.text) == (error, True), stopped
    first = summed("EB90010B3284038E039803A203AC03")
    assert link.sent.index(first) > link.sent.index(RELEASE) and link.now() < 5.0, link.sent
    assert link.sent.count(first) in (1, 2) if hold else link.sent.count(first) > 5, link.sent


def test_a_silent_hand_is_not_waited_for_twice() -> None:
    link = ScriptedLink()
    assert exchange_steps(link, stop_sequence_of("exo", StopContext(Settings())), []).error is NoAnswer
    assert link.now() < 1.3, link.now()


def test_the_command_says_so_too(tmp_path: Path) -> None:
    """The same on a recording: the frame of the forces is confirmed, the hold was only sent."""
    sequence = stop_sequence_of("exo", StopContext(Settings()))
    asked = next(sequence).step.data
    hold = summed("EB90010B3284038E039803A203AC03")
    lines = [f"> {RELEASE.hex(' ')}", f"< {summed(PLACES).hex(' ')}", f"> {hold.hex(' ')}"] * 9
    trace = tmp_path / "t.txt"
    text = "".join(f"{0.1 * moment:.1f} {line}\n" for moment, line in enumerate([f"> {asked.hex(' ')}", *lines]))
    trace.write_text(text, encoding="utf-8")
    result = run("exo", "stop", "-p", f"replay:{trace}", "--json")
    assert result.code == 4, result
    assert "but not the next one: hold at 900 910 920 930 940" in result.error["text"]
    assert "stopped" not in result.codes()
    written = [(bytes.fromhex(row["bytes"]), row["answer"]) for row in result.rows if not row["reads"]]
    assert written[:2] == [(RELEASE, summed(PLACES).hex(" ").upper()), (hold, None)]


@each_row(("family", "held"), [("exo", "EB90010B32"), ("wrist", "EB90010731")])
def test_what_comes_in_place_of_the_acknowledgement_of_a_hold_is_no_silence(family: str, held: str) -> None:
    """The reply to a question of somebody else: exit code 5, and the message has its bytes."""
    other = summed("90EB010530000407FF")
    first = half_deaf(PLACES).answer if family == "exo" else wrist("01").answer
    link = ScriptedLink(lambda one: [(0.01, other)] if one.hex().upper().startswith(held) else first(one))
    stopped = exchange_steps(link, stop_sequence_of(family, StopContext(Settings())), [])
    assert stopped.error is ProtocolError and other.hex(" ").upper() in stopped.text, stopped


def wrist(taken: str, silent: int = 0) -> ScriptedLink:
    """A wrist at pitch 1.00°, yaw 2.00° that answers its hold with `taken`, and the first questions for its angles not at all."""
    angles = bytes.fromhex("EB90010430FC0304")
    asked: list[bytes] = []

    def answer(request: bytes) -> list[Reply]:
        if request.startswith(angles):
            asked.append(request)
            return [(0.01, summed("90EB010730FC036400C800"))] if len(asked) > silent else []
        if request[4] == 0x30:
            return [(0.01, summed(f"90EB010530{request[5:7].hex()}0700"))]
        return [(0.01, summed(f"90EB0104310E04{taken}"))] if request[4:7] == bytes.fromhex("310E04") else []

    return ScriptedLink(answer)


def test_a_wrist_is_held_where_it_is_yaw_first() -> None:
    link = wrist("01")
    stopped = exchange_steps(link, stop_sequence_of("wrist", StopContext(Settings())), [])
    assert stopped.error is None and "pitch 1.00°, yaw 2.00° and acknowledged it" in stopped.text, stopped
    assert summed("EB900107310E04 C800 6400") in link.sent, "yaw_set with pitch_set behind it (wrist §2.1)"


def test_a_wrist_that_refuses_its_hold_was_not_stopped() -> None:
    stopped = exchange_steps(wrist("00"), stop_sequence_of("wrist", StopContext(Settings())), [])
    assert stopped.error is DeviceRefused and "rejected" in stopped.text, stopped


def test_a_wrist_that_is_silent_twice_is_asked_a_third_time() -> None:
    assert exchange_steps(wrist("01", silent=2), stop_sequence_of("wrist", StopContext(Settings())), []).error is None
    assert (
        exchange_steps(wrist("01", silent=9), stop_sequence_of("wrist", StopContext(Settings())), []).error is NoAnswer
    )


def test_a_stop_that_is_one_write_goes_out_until_it_is_acknowledged() -> None:
    step = Step("the stop", b"STOP", moves=True)
    link = ScriptedLink(lambda _: [(0.01, b"ok")] if len(link.sent) == 2 else [])
    context = StopContext(Settings())
    assert exchange_steps(link, single_write_stop(step, b"ok", "it stands", context), []).error is None
    assert link.sent == [b"STOP", b"STOP"]
    silent = ScriptedLink()
    assert exchange_steps(silent, single_write_stop(step, b"ok", "it stands", context), []).error is NoAnswer
    assert len(silent.sent) == attempts(context) and 1.0 <= silent.now() < 1.2
    other = ScriptedLink(lambda _: [(0.01, b"?")])
    assert exchange_steps(other, single_write_stop(step, b"ok", "", context), []).error is ProtocolError


def test_who_cannot_listen_sends_what_changes_something() -> None:
    """The child that stands in for a command that died: the forces of a hand, but no question."""
    assert [step.data for step in writes_without_replies(stop_sequence_of("exo", StopContext(Settings())))] == [RELEASE]
    assert writes_without_replies(stop_sequence_of("wrist", StopContext(Settings()))) == []


class Flood(ScriptedLink):
    """A line on which 4 KiB lie whenever someone reads."""

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        self._reads += 1
        assert self._reads < 200, "it listens for longer than it may"
        return b"\x55" * size


def test_a_line_full_of_noise_does_not_hold_a_stop_up() -> None:
    """64 KiB are enough of what is no answer, however soon they come."""
    link = Flood()
    assert exchange_steps(link, stop_sequence_of("exo", StopContext(Settings())), []).error is ProtocolError
    assert RELEASE in link.sent


def test_of_several_devices_a_deadline_leaves_what_was_seen_of_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """And says at which one it passed."""

    def steps(context: StopContext) -> StopSequence:
        if context.number > 1:
            yield StopStep(Step("", b""), 0.0, bool)
        return Stopped("stands")

    monkeypatch.setattr("handctl.devices.inspire.exo.stopper.stop_steps", steps)
    sequence = stop_sequence_of("exo", StopContext(Settings(), going=(("exo", 1), ("exo", 2), ("exo", 3))))
    next(sequence)
    with pytest.raises(StopIteration) as ended:
        sequence.throw(TooLate())
    found = ended.value.value
    assert (found.error, found.text) == (NoAnswer, f"exo id 1: stands. Exo id 2: {TOO_LATE}"), found
