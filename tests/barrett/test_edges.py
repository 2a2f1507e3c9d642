"""BarrettHand at the edges: how a loop is left when something fails, a download begun again, the spread's two velocities."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from handctl.devices.barrett.firmware.srecords import parse
from handctl.devices.barrett.gcl.codec import Answer
from handctl.devices.barrett.maintenance import diagnose
from handctl.devices.barrett.maintenance.diagnose import ExaminedHand, Values
from handctl.devices.barrett.realtime.loop import RealtimeLoop
from handctl.devices.barrett.realtime.loop_flags import FlagRequest
from handctl.errors import HandctlError, NoAnswer
from handctl.link import Deadline
from handctl.model.prompts import InterruptCount, Prompts
from tests.barrett.download import DATA, SIZE, Operated, Operator, sha
from tests.barrett.download import Run as Load
from tests.barrett.realtime import Run, example
from tests.barrett.srecords import END, record
from tests.barrett.support import ABORT, QUESTION, Simulated, codes, scripted, simulated
from tests.support.refused import refused

# -- the RealTime loop ------------------------------------------------------------------------------------------------


def test_thrown_out_while_motors_run_there_is_a_second_abort_behind_the_cr() -> None:
    """The CR that ends what was typed at the prompt may begin a command; ^C stops it before T (dossier 6.6)."""
    run = Run("fault=loop-error&loop-code=2048&loop-after=2&wire=auto", controls=example()).go(10)
    assert isinstance(run.error, HandctlError) and run.error.code == "err-2048"
    sent = run.link.sent[run.link.sent.index(b"124LOOP\r") :]
    before_t = sent[: sent.index(b"124T\r")]
    assert before_t[-3:] == [ABORT, QUESTION, ABORT]


def test_flags_are_not_written_to_a_hand_that_may_still_be_in_its_loop() -> None:
    """Letters are headers there: only ^C and T go out to a hand that does not come back to its prompt."""
    run = Run("fault=loop-silent&loop-after=4&wire=auto", controls=example()).go(50)
    assert run.loop.failure is not None
    assert not [line for line in run.after if "SET" in line]
    refused = Run(controls=example())
    ask = refused.hand.line.ask
    refused.hand.line.ask = lambda command, **more: (  # type: ignore[method-assign]
        Answer(command, (), 8192, b"") if command == "124T" else ask(command, **more)
    )
    refused.go(2)
    assert refused.loop.failure is not None
    assert not [line for line in refused.after if "SET" in line]


def test_ctrl_c_while_a_block_is_written_ends_the_loop() -> None:
    class Impatient(Prompts):
        """Presses Ctrl-C in the middle of the third block."""

        def __init__(self) -> None:
            self.blocks = 0

        @contextmanager
        def count_interrupts(self) -> Iterator[InterruptCount]:
            presses = InterruptCount()
            yield presses
            self.blocks += 1
            presses.count = self.blocks == 3

    run = Run(controls=example(), prompts=Impatient()).go(50)
    assert isinstance(run.error, KeyboardInterrupt)
    assert len(run.samples) < 3 and run.stands() and run.flags() == run.before
    assert "124T" in run.after


def test_flags_are_not_put_back_over_a_lost_link() -> None:
    """Watching: nothing moves, so one error is enough."""
    run = Run("fault=disconnect&after=20&wire=auto").go(None)
    assert isinstance(run.error, HandctlError) and run.error.exit_code == 3
    assert run.loop.failure is None and "leaving" not in codes(run.hand)


def test_a_deadline_bounds_the_wait_for_the_loop() -> None:
    """LOOP without an answer: the hand gets its ^C when --deadline is over, not 1.5 s later."""
    script = {"*": "1", "1LOOP": None}
    hand, link = scripted(script)
    with refused(NoAnswer, "no-answer", "1LOOP", "1.5 s"):
        list(
            RealtimeLoop(hand, Prompts(), FlagRequest((0,)), None, sequential=False).run(
                rate=0.0, count=1, duration=None
            )
        )
    entered = link.sent_at[link.sent.index(b"1LOOP\r")]
    assert link.sent_at[link.sent.index(ABORT)] - entered > 1.4
    hand, link = scripted(script)
    end = link.clock + entered + 0.2
    hand.line.bound = Deadline(lambda: link.clock, end)
    with pytest.raises(NoAnswer) as caught:
        list(
            RealtimeLoop(hand, Prompts(), FlagRequest((0,)), None, sequential=False).run(
                rate=0.0, count=1, duration=None
            )
        )
    assert caught.value.code == "deadline"
    assert link.sent_at[link.sent.index(ABORT)] == pytest.approx(end, abs=0.01)


def test_torque_control_of_later_firmware_is_switched_off_for_velocities() -> None:
    """LCT excludes LCV and LCPG (dossier 6.5); it is as before afterwards."""
    link = Simulated("initialized=1&firmware=4.4")
    link.feed(b"124FSET LCT 1\r")
    run = Run(link=link, controls=example())
    before = run.control("ram LCT")
    run.go(2)
    assert run.error is None and run.loop.failure is None
    sets = " ".join(line for line in run.link.commands[: run.link.commands.index("124LOOP")] if "SET" in line)
    assert "LCT 0" in sets
    assert run.control("ram LCT") == before and "1" in before


# -- firmware ---------------------------------------------------------------------------------------------------------


def test_a_download_begun_again_counts_from_nothing() -> None:
    link = Operated("fault=wrong-echo&download-at=0x2C40")

    class Mended(Operator):
        def ask(self, question: str, word: str) -> bool:
            link.control("download-at off")
            link.control("fault healthy")
            return super().ask(question, word)

    prompts = Mended(link, answers=1)
    run = Load(link=link, prompts=prompts)
    assert run.error is None and sha(DATA) in run.image and len(prompts.asked) == 1
    assert any(text.startswith(f"{SIZE} bytes sent") for text in prompts.said), prompts.said
    assert all(int(text.split("%")[0].split()[-1]) <= 100 for text in prompts.shown if "%" in text)


def test_after_the_last_power_cycle_nothing_is_sent_into_the_monitors_window() -> None:
    """A byte that meets the boot monitor is a command to it: the firmware's own first words are waited for (dossier 1.5)."""

    class Quick(Operator):
        """Says at once that the power is on again."""

        on_at = 0.0

        def wait_for_enter(self, text: str) -> bool:
            if "No firmware has replied yet" not in text:
                return super().wait_for_enter(text)
            link.control("power off")
            link.sleep(5.0)
            link.control("power on")
            self.on_at = link.now()
            return True

    link = Operated("download-end=power")
    prompts = Quick(link)
    when: list[float] = []
    write = link.write

    def timed(data: bytes, deadline: Deadline) -> None:
        when.append(link.now())
        write(data, deadline)

    link.write = timed  # type: ignore[method-assign]
    run = Load(link=link, prompts=prompts)
    assert run.error is None and sha(DATA) in run.image
    assert min(at for at in when if at >= prompts.on_at) - prompts.on_at > 0.5


def test_the_old_firmware_that_started_is_told_once() -> None:
    link = Operated("image=blank")
    prompts = Operator(link)
    prompts.ready = False
    inner = link.inner.read
    texts = iter([b"\n\r=> "])

    def started(deadline: Deadline, size: int = 4096) -> bytes:
        asked = any("ON. The download" in text for text in prompts.said)
        return (next(texts, b"") if asked else b"") or inner(deadline, size)

    link.inner.read = started  # type: ignore[method-assign]
    run = Load(link=link, prompts=prompts)
    assert run.failed[:2] == ("no-monitor", 4)
    assert len([text for text in prompts.said if "too late for the download" in text]) == 1


def test_the_first_record_goes_byte_by_byte_whatever_the_window() -> None:
    """Whether the monitor echoes its triggers is known only behind it."""
    run = Load(window=4)
    assert run.error is None
    sent = run.link.sent
    begin = sent.index(b"X")
    first = sent[begin + 1 : begin + 1 + 1 + 4 + 33]  # trigger; trigger, address, count; trigger, data
    assert {len(piece) for piece in first} == {1}
    assert {len(piece) for piece in sent[begin + 40 :] if b"VERS" not in piece} > {1}, "the others do not"


def test_a_header_behind_data_is_a_damaged_record() -> None:
    """One wrong bit makes `S1` an `S0`; the type is not in the checksum (dossier 7.4)."""
    lines = [record(0x2000, b"\x01"), record(0x2001, b"\x02", "0"), END]
    found = {finding.check: finding.status for finding in parse("x", "\n".join(lines).encode()).findings}
    assert found["types"] == "fail"


# -- checks -----------------------------------------------------------------------------------------------------------


def test_a_breakaway_that_could_not_be_read_is_not_skipped() -> None:
    """Only ERR 64 says that the firmware does not have it."""
    values = Values()
    values.errors = {"BD": NoAnswer("silent"), "BP": NoAnswer("silent")}
    with pytest.raises(NoAnswer):
        diagnose.breakaway(SimpleNamespace(read=lambda *_: values))  # type: ignore[arg-type]


# -- the spread -------------------------------------------------------------------------------------------------------


def test_the_spread_is_timed_against_the_velocity_of_its_way() -> None:
    """It closes with MCV and opens with MOV (barrett §5.5)."""
    hand, _ = simulated("initialized=1")
    hand.checked(hand.line.ask("4FSET MCV 60 MOV 40"))
    found = diagnose.run_all(ExaminedHand(hand), ["spread_time"], "123", Prompts())
    assert [finding.evidence.rpartition(" at ")[2] for finding in found] == ["MCV 60", "MOV 40"]
    assert [finding.evidence[:2] for finding in found] == ["4C", "4O"]
