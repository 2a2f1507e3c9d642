"""The RealTime loop against the simulated hand on virtual time: bytes, order, and how it is left (barrett §6)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import pytest

from handctl.devices.barrett.gcl.codec import Answer
from handctl.devices.barrett.realtime.blocks import Values
from handctl.devices.barrett.realtime.control_values import Controls, Schedule
from handctl.devices.barrett.realtime.loop import SELF_TEST_BLOCKS, RealtimeLoop
from handctl.devices.barrett.realtime.loop_flags import FlagRequest
from handctl.errors import CheckFailed, HandctlError, ProtocolError, UsageError
from handctl.link import Deadline
from handctl.model.prompts import Prompts
from handctl.model.result import Sample
from tests.barrett.realtime import TWENTY, Names, Run, assert_left, example
from tests.barrett.support import ABORT, CR, Simulated, codes, scripted
from tests.support.each_row import each_row
from tests.support.scripted import hexed

# -- the manual's example ---------------------------------------------------------------------------------------------


def test_the_example_byte_for_byte() -> None:
    """§6.4: flags set, 124LOOP, `C` +20 +127, 8 bytes of feedback decoded; zero, ^C, T, flags as before."""
    run = Run("no-load=120,120,120&loop-jump=20,127,0,0", controls=example()).go(2)
    assert run.error is None and run.loop.failure is None
    lines = [data.removesuffix(CR).decode() for data in run.link.sent if data.endswith(CR)]
    entry = lines.index("124LOOP")
    sets = [line for line in lines[:entry] if "SET" in line]
    assert sets == ["124FSET LCPG 0 LFV 0 LFAP 0", "4FSET LCV 0 LFS 0", "PSET LFT 1"]
    assert lines[entry - 1] == "124FGET P"
    assert [hexed(data) for data in run.inside] == ["43 14 7F", "43 14 7F", "63 00 00", "03"]
    assert run.after[0] == "124T"
    assert run.flags() == run.before
    first = run.samples[0]
    assert [(row["name"], row["parameter"], row["motor"], row["value"], row["unit"]) for row in first.rows] == [
        ("velocity_command", "LCV", "F1", 20, "1/16 cts/sample"),
        ("strain", "LFS", "F1", 120, None),
        ("delta", "LFDP", "F1", 20, "cts"),
        ("position", "LFDP", "F1", 20, "cts"),
        ("velocity_command", "LCV", "F2", 127, "1/16 cts/sample"),
        ("strain", "LFS", "F2", 120, None),
        ("delta", "LFDP", "F2", 127, "cts"),
        ("position", "LFDP", "F2", 127, "cts"),
        ("delta", "LFDP", "SPREAD", 0, "cts"),
        ("position", "LFDP", "SPREAD", 0, "cts"),
        ("temperature", "LFT", None, 41.2, "°C"),
    ]
    assert run.stands()


def test_flags_are_what_was_asked_while_inside_and_as_before_afterwards() -> None:
    run = Run(controls=example())
    seen = []
    for _ in run.loop.run(rate=0.0, count=1, duration=None):
        seen.append(run.flags())
    inside = {name: [int(word) for word in text.split() if word.isdigit()] for name, text in seen[0].items()}
    assert {name: values[-4:] for name, values in inside.items()} == {
        "LCV": [1, 1, 1, 0], "LCPG": [0, 0, 1, 0], "LFV": [0, 0, 1, 0], "LFS": [1, 1, 1, 0], "LFAP": [0, 0, 1, 0],
        "LFDP": [1, 1, 1, 1], "LFT": [1],
    }  # fmt: skip
    assert run.flags() == run.before and run.loop.failure is None


def test_flags_that_are_right_are_not_written() -> None:
    run = Run(receive=None, temperature=None).go(3)
    assert run.error is None
    assert not [line for line in run.link.commands if "SET" in line]
    assert [hexed(data) for data in run.inside] == ["41"] * 3 + ["03"]
    assert run.after == []  # nothing was commanded: no T


def test_watching_moves_nothing() -> None:
    """Without control values: `A` only, no T; velocity stays 0 (§6.2.1)."""
    run = Run().go(4)
    assert [hexed(data) for data in run.inside] == ["41"] * 4 + ["03"]
    assert not [line for line in run.after if line.endswith("T") and len(line) < 6]
    assert run.flags() == run.before and run.values("position", "F1") == [0] * 4
    assert not run.values("velocity_command", "F1")


def test_nothing_to_receive_is_acknowledged_only() -> None:
    nothing: Names = {0: (), 1: (), 3: ()}
    watched = Run(receive=nothing, temperature=False).go(2)
    assert [hexed(data) for data in watched.inside] == ["61", "61", "03"]
    driven = Run(receive=nothing, temperature=False, controls=example(), guards=()).go(2)
    assert [hexed(data) for data in driven.inside] == ["63 14 7F", "63 14 7F", "63 00 00", "03"]
    assert driven.stands() and driven.error is None


def test_gain_and_coefficients() -> None:
    """LCVC multiplies the command, LFDPC and LFVC the feedback; gains stay as they were at the end."""
    link = Simulated("initialized=1&loop-jump=500,0,0,0")
    for line in ("1FSET LCVC 3 LFDPC 2 LFVC 4",):
        link.feed(line.encode() + CR)
    controls = Controls({0: ("velocity", "gain")}, {(0, "velocity"): -2, (0, "gain"): 9})
    run = Run(
        link=link, receive={0: ("delta",)}, temperature=False, controls=controls, motors=(0,), guards=(), delta_unit=2
    ).go(3)
    assert [hexed(data) for data in run.inside] == ["43 FE 09"] * 3 + ["63 00 09", "03"]
    assert run.values("delta", "F1")[:2] == [254, 246]  # §6.2.3: 500 counts by two a unit
    assert run.values("position", "F1")[:2] == [254, 500]
    assert set(run.values("velocity_command", "F1")) == {-6} and set(run.values("gain_command", "F1")) == {9}
    assert run.loop.summary()["loop"]["saturated_deltas"] == 1
    assert run.after[0] == "1T"


def test_the_jump_of_the_manual() -> None:
    """§6.2.3: 1500 -> 2000 with LFDPC 2 is +254, +246; then 0."""
    link = Simulated("initialized=1&loop-jump=500,0,0,0")
    link.feed(b"1FSET LFDPC 2" + CR)
    run = Run(link=link, receive={0: ("delta",)}, temperature=False, motors=(0,))
    run.control("position F1 1500")
    run.go(3)
    assert run.values("position", "F1") == [1754, 2000, 2000]


def test_positions_beside_deltas_are_the_hands_own() -> None:
    run = Run("loop-jump=5,0,0,0", receive={0: ("position", "delta")}, temperature=False, motors=(0,)).go(2)
    rows = [(row["parameter"], row["value"]) for row in run.samples[0].rows]
    assert rows == [("LFAP", 5), ("LFDP", 5)]


def test_discarded_deltas_are_told() -> None:
    link = Simulated("initialized=1")
    link.feed(b"PSET LFDPD 1" + CR)
    run = Run(link=link).go(1)
    assert "discard" in codes(run.hand)


@each_row("firmware", ["4.33", "4.34", "4.4"])
def test_every_firmware(firmware: str) -> None:
    run = Run(f"firmware={firmware}&temperature=415", controls=example()).go(3)
    assert run.error is None and run.flags() == run.before
    assert run.values("temperature") == [41.0 if firmware == "4.4" else 41.5] * 3
    assert run.loop.session.layout.feedback_size == (7 if firmware == "4.4" else 8)
    assert hexed(run.inside[0]) == "43 14 7F" and run.stands()


def test_feedback_of_later_firmware() -> None:
    names: Names = {0: ("breakaway_position", "analog")}
    later = Run("firmware=4.4", receive=names, temperature=False, motors=(0,)).go(1)
    assert later.error is None and later.values("analog", "F1") == [31]  # the simulator's own
    older = Run("firmware=4.34", receive=names, temperature=False, motors=(0,)).go(1)
    assert isinstance(older.error, HandctlError) and older.error.exit_code == 6
    assert "LFBP" in older.error.text or "LFAIN" in older.error.text
    assert "LOOP" not in " ".join(older.link.commands) and older.flags() == older.before


@each_row(("name", "sends"), [("LCVC", True), ("LFVC", False), ("LFDPC", False)])
def test_a_coefficient_of_0_is_refused(name: str, sends: bool) -> None:
    """It would divide by zero, or stop the motor for ever; flags are put back."""
    link = Simulated("initialized=1")
    link.feed(f"1FSET {name} 0\r".encode())
    controls = Controls({0: ("velocity",)}, {(0, "velocity"): 1}) if sends else None
    run = Run(link=link, receive={0: ("velocity", "delta")}, temperature=True, motors=(0,), controls=controls).go(1)
    assert isinstance(run.error, HandctlError) and (run.error.exit_code, run.error.code) == (7, "coefficient")
    assert name in run.error.text and "1LOOP" not in run.link.commands and run.flags() == run.before


# -- pace -------------------------------------------------------------------------------------------------------------


class Pace(Simulated):
    """Notes how many bytes of answers had come when each control block went out."""

    def __init__(self, query: str, baud: int) -> None:
        super().__init__(query, baud)
        self.heard = 0
        self.log: list[tuple[bytes, int]] = []

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.log.append((bytes(data), self.heard))
        super().write(data, deadline)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        data = super().read(deadline, 1)  # one byte at a time: the moment of the acknowledgement is exact
        self.heard += len(data)
        return data


@pytest.mark.parametrize("baud", [9600, 38400])
@pytest.mark.parametrize("sequential", [False, True])
def test_never_ahead_of_the_acknowledgement(baud: int, sequential: bool) -> None:
    """Block N+1 goes out after the first byte of answer N (§6.1), with --sequential after the last."""
    link = Pace(f"initialized=1&wire=auto&baud={baud}", baud)
    run = Run(link=link, controls=example(), sequential=sequential).go(20)
    assert run.error is None
    blocks = [(data, heard) for data, heard in link.log if data[:1] == b"C" and len(data) == 3]
    test = 0 if sequential else SELF_TEST_BLOCKS
    assert [data for data, _ in blocks[:test]] == [b"C\0\0"] * test, "the self-test drives nothing"
    blocks = blocks[test:]
    assert [data for data, _ in blocks] == [b"C\x14\x7f"] * 20
    start = blocks[0][1]
    size = run.loop.session.layout.feedback_size
    for number, (_, heard) in enumerate(blocks):
        came = heard - start
        assert came == size * number if sequential or not number else came >= size * (number - 1) + 1
    if not sequential:
        assert min(heard - start - size * number for number, (_, heard) in enumerate(blocks)) < 0


@pytest.mark.parametrize("baud", [9600, 38400])
@pytest.mark.parametrize("sequential", [False, True])
def test_rate_on_an_emulated_line(baud: int, sequential: bool) -> None:
    """At least the overlapped floor of dossier 12 (106.7 and 426.7 Hz) times 0.95, and never above the pipelined one."""
    run = Run(
        link=Simulated(f"initialized=1&wire=auto&baud={baud}", baud), controls=example(), sequential=sequential
    ).go(100)
    assert run.error is None
    summary = run.loop.summary()
    rate = summary["stream"]["rate_hz"]
    scale = baud / 9600
    assert summary["loop"]["line_limit_hz"] == {
        name: pytest.approx(hertz * scale, abs=0.3)
        for name, hertz in (("sequential", 87.3), ("overlapped", 106.7), ("pipelined", 120.0))
    }
    if sequential:
        assert 0.95 * 87.3 * scale <= rate <= 106.8 * scale
    else:
        assert 0.95 * 106.7 * scale <= rate <= 120.1 * scale
    assert (summary["stream"]["samples"], summary["loop"]["latency"]["count"]) == (100, 100)
    assert (summary["loop"]["control_bytes"], summary["loop"]["feedback_bytes"]) == (3, 8)


def test_rate_count_and_duration() -> None:
    run = Run("wire=auto").go(None, rate=20.0, duration=1.0)
    assert 19 <= len(run.samples) <= 21 and run.error is None
    times = [sample[0] for sample in run.samples]
    assert all(0.045 < later - earlier < 0.055 for earlier, later in pairwise(times[2:]))
    assert len(Run().go(7).samples) == 7


@pytest.mark.parametrize("count", [2, 5])
def test_the_rate_told_is_that_between_the_blocks(count: int) -> None:
    run = Run("wire=auto").go(count, rate=20.0)
    assert run.loop.summary()["stream"]["rate_hz"] == pytest.approx(20.0, abs=0.2)
    assert Run("wire=auto").go(1, rate=20.0).loop.summary()["stream"]["rate_hz"] is None


def test_a_slow_line_is_not_flooded_with_late_blocks() -> None:
    run = Run("wire=auto").go(None, rate=1000.0, duration=0.5)
    assert run.error is None and 45 <= len(run.samples) <= 61


def test_a_schedule_is_sent_in_time() -> None:
    rows = [(0.0, dict(TWENTY)), (0.1, {(0, "velocity"): 0}), (0.2, {(1, "velocity"): -5}), (0.3, {})]
    controls = Schedule({0: ("velocity",), 1: ("velocity",), 3: ()}, rows, {})
    run = Run("wire=auto", controls=controls, guards=()).go(None)
    assert run.error is None
    distinct = list(dict.fromkeys(hexed(data) for data in run.inside))
    assert distinct == ["43 14 7F", "43 00 7F", "43 00 FB", "63 00 00", "03"]
    assert run.samples[-1][0] == pytest.approx(0.3, abs=0.03)
    assert run.after[0] == "124T" and run.flags() == run.before


# -- how it ends ------------------------------------------------------------------------------------------------------


def test_ctrl_c() -> None:
    run = Run("wire=auto", controls=example())
    run.link.interrupt_at = run.link.now() + 1.0
    run.go(None)
    assert isinstance(run.error, KeyboardInterrupt)
    assert run.loop.failure is None
    assert_left(run)


@each_row("after", [0.0, *(0.02 + 0.03 * number for number in range(14))])
def test_ctrl_c_at_any_time(after: float) -> None:
    """Also while flags are set and LOOP is entered: flags come back, nothing moves."""
    run = Run("wire=auto", controls=example())
    run.link.interrupt_at = run.link.now() + after
    run.go(None)
    assert isinstance(run.error, KeyboardInterrupt)
    assert run.flags() == run.before and run.stands()
    assert run.hand.line.ask("FGET S").status == 0


def test_the_consumer_stops() -> None:
    """A closed pipe: the generator is closed in the middle."""
    run = Run("wire=auto", controls=example())
    samples: Iterator[Sample] = run.loop.run(rate=0.0, count=None, duration=None)
    next(samples)
    next(samples)
    samples.close()  # type: ignore[attr-defined]
    assert_left(run)


def test_hold_leaves_the_motors_powered() -> None:
    run = Run(controls=example(), hold=True).go(3)
    assert_left(run, power_off=False)


def test_leaving_is_undisturbed() -> None:
    """A second Ctrl-C must not fall between velocity 0 and T."""

    class Shield(Prompts):
        depth = 0

        @contextmanager
        def without_interrupts(self) -> Iterator[None]:
            self.depth += 1
            yield
            self.depth -= 1

    prompts = Shield()
    run = Run(controls=example(), prompts=prompts)
    depths: dict[bytes, int] = {}
    write = run.link.write
    run.link.write = lambda data, deadline: (depths.update({bytes(data): prompts.depth}), write(data, deadline))[1]  # type: ignore[method-assign]
    run.go(2)
    assert [depths[data] for data in (b"C\x14\x7f", b"c\x00\x00", b"\x03", b"124T\r")] == [0, 1, 1, 1]
    assert depths[b"PSET LFT 0\r"] == 1 and prompts.depth == 0


@pytest.mark.parametrize(("status", "fails"), [(0, False), (4, False), (32, True), (8192, True), (8196, True)])
def test_a_t_that_is_refused_is_a_failure(status: int, fails: bool) -> None:
    """Motors that could not be switched off are no success; 4 says that a motor waits for HI, T is done all the same."""
    run = Run(controls=example())
    ask = run.hand.line.ask
    run.hand.line.ask = lambda command, **more: (  # type: ignore[method-assign]
        Answer(command, (), status, b"") if command == "124T" else ask(command, **more)
    )
    run.go(2)
    assert (run.loop.failure is not None) is fails
    if run.loop.failure is not None:
        assert run.loop.failure.exit_code == 6 and str(status) in run.loop.failure.text
        assert "power off" in str(run.loop.failure.hint)


def test_an_echo_that_differs_while_leaving_is_a_failure() -> None:
    run = Run(controls=example())
    write = run.link.write
    run.link.write = lambda data, deadline: write(b"124Q\r" if data == b"124T\r" else data, deadline)  # type: ignore[method-assign]
    run.go(2)
    assert run.loop.failure is not None and run.loop.failure.exit_code == 5
    assert "power off" in str(run.loop.failure.hint)


def test_too_hot_in_the_loop() -> None:
    """OTEMP is passed while it runs: 8192 in place of `*` (§5.4.1), the motors stand."""
    link = Simulated("initialized=1&wire=auto")
    link.feed(b"PSET OTEMP 600\r")
    run = Run(link=link, controls=example())
    samples = run.loop.run(rate=0.0, count=None, duration=None)
    with pytest.raises(HandctlError) as caught:
        for number, _ in enumerate(samples):
            if number == 5:
                run.control("temperature 700")
    assert (caught.value.code, caught.value.exit_code) == ("err-8192", 6)
    assert run.stands() and b"124T\r" in link.sent


@pytest.mark.parametrize("fault", ["loop-error&loop-code=2048", "loop-drop", "loop-extra"])
def test_hold_is_no_licence_to_run_on(fault: str) -> None:
    """Velocity 0 was not taken: powered motors would go on to their stops, so they are switched off all the same."""
    run = Run(f"fault={fault}&loop-after=3&wire=auto", controls=example(), hold=True).go(20)
    assert isinstance(run.error, HandctlError)
    assert "124T" in run.after and run.stands() and run.flags() == run.before


def test_a_bad_live_value_ends_it() -> None:
    class Breaks(Controls):
        def at(self, seconds: float) -> Values | None:
            if seconds > 0.05:
                raise UsageError("line 3")
            return super().at(seconds)

    run = Run("wire=auto", controls=Breaks({0: ("velocity",), 1: ("velocity",), 3: ()}, TWENTY)).go(None)
    assert isinstance(run.error, CheckFailed) and run.error.code == "control"
    assert_left(run)


@pytest.mark.parametrize(
    ("query", "code", "exit_code"),
    [("fault=loop-error&loop-code=2048", "err-2048", 6), ("fault=loop-error&loop-code=8192", "err-8192", 6)],
)
@pytest.mark.parametrize("after", [0, 3])
def test_the_hand_throws_us_out(query: str, code: str, exit_code: int, after: int) -> None:
    """ERR in place of `*`: it is in supervisory mode; T and flags all the same."""
    run = Run(f"{query}&loop-after={after}&wire=auto", controls=example()).go(10)
    assert isinstance(run.error, HandctlError)
    assert (run.error.code, run.error.exit_code) == (code, exit_code), run.error.text
    assert len(run.samples) == after and run.link.name in run.error.text
    assert "124T" in run.after and run.flags() == run.before and run.stands()
    assert run.loop.failure is None


@pytest.mark.parametrize("velocity", [13, 3, 67, 84])
def test_control_data_typed_at_the_prompt(velocity: int) -> None:
    """Thrown out at the header, the data bytes that follow are typed at the prompt: no command may come of them."""
    controls = Controls({0: ("velocity",), 1: ("velocity",), 3: ()}, {(0, "velocity"): velocity, (1, "velocity"): 13})
    run = Run("fault=loop-error&loop-code=2048&loop-after=2&wire=auto", controls=controls).go(10)
    assert isinstance(run.error, HandctlError) and run.error.code == "err-2048"
    assert run.loop.failure is None
    assert "124T" in run.after and run.flags() == run.before and run.stands()
    sent = run.link.sent[run.link.sent.index(b"124LOOP\r") :]
    first = sent.index(b"\x03")
    assert sent[first + 1] == b"!\0\r" and first < sent.index(b"124T\r"), (
        "what was typed is ended before T (dossier 1.3)"
    )


@pytest.mark.parametrize(
    ("fault", "codes_", "exit_code"),
    [
        ("loop-silent", {"no-answer"}, 4),
        ("loop-drop", {"bad-block", "cut-short", "unasked"}, 5),
        ("loop-extra", {"bad-block", "cut-short", "unasked"}, 5),
    ],
)
@pytest.mark.parametrize("sequential", [False, True])
def test_faults_inside(fault: str, codes_: set[str], exit_code: int, sequential: bool) -> None:
    run = Run(f"fault={fault}&loop-after=4&wire=auto", controls=example(), sequential=sequential).go(50)
    assert isinstance(run.error, HandctlError)
    assert (run.error.code in codes_, run.error.exit_code) == (True, exit_code), run.error
    assert run.link.name in run.error.text and run.error.hint
    assert run.hand.journal.counters.bad_frames == (fault != "loop-silent")
    assert hexed(run.inside[-1]) == "03"
    if fault == "loop-silent":  # deaf for good: it can only be said
        assert run.loop.failure is not None and "power" in str(run.loop.failure.hint)
    else:
        assert run.flags() == run.before and run.stands() and "124T" in run.after


def test_a_refusal_that_cannot_be_read() -> None:
    """A prompt without `*` and without a legible ERR: an error with the bytes, never `ERR 0: ready`."""
    hand, link = scripted({"*": "1", "1LOOP": b"1LOOP\n\rER\xb2 4\n\r=> "})
    loop = RealtimeLoop(hand, Prompts(), FlagRequest((0,)), None, sequential=False)
    with pytest.raises(ProtocolError) as caught:
        list(loop.run(rate=0.0, count=1, duration=None))
    assert link.name in caught.value.text and "45 52 B2 20 34" in caught.value.text
    assert link.sent[-1] == ABORT, "it may be in the loop all the same"


def test_a_hand_that_does_not_enter() -> None:
    """§5.5: LOOP gives 4 before HI? then 8192 and 1 as an answer, nothing is left to stop."""
    run = Run("fault=over-temperature", controls=example())
    run.go(1)
    assert isinstance(run.error, HandctlError) and (run.error.code, run.error.exit_code) == ("err-8192", 6)


@pytest.mark.parametrize("fault", ["disconnect"])
def test_a_lost_link_warns_of_motors_that_go_on(fault: str) -> None:
    run = Run(f"fault={fault}&after=20&wire=auto", controls=example()).go(None)
    assert isinstance(run.error, HandctlError) and run.error.exit_code == 3
    assert "power off" in str(run.error.hint)
    assert "leaving" not in codes(run.hand), "what cannot be sent is not tried, and not a second error"


def test_the_deadline_ends_it() -> None:
    link = Simulated("initialized=1&wire=auto")
    run = Run(link=link, controls=example(), bound=Deadline(link.now, 4.0)).go(None)
    assert isinstance(run.error, HandctlError) and (run.error.code, run.error.exit_code) == ("deadline", 4)
    assert len(run.samples) > 50
    assert_left(run)
