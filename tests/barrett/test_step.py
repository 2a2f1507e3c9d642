"""`loop.step` of the library: a control loop that a program closes, on the simulated hand on virtual time."""

from __future__ import annotations

import threading
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

import handctl
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, Interrupted, NoAnswer, UsageError
from tests.support.cli import PATIENCE
from tests.support.each_row import each_row

ONE: dict[str, Any] = {"motors": "1", "send": "velocity", "receive": "position"}


def sent(trace: Path) -> list[str]:
    lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if " > " in line]
    pieces = ["".join(words[2:]) for words in lines]
    return pieces[next(number for number, piece in enumerate(pieces) if piece.endswith("4C4F4F500D")) + 1 :]


def test_a_program_closes_the_loop(tmp_path: Path) -> None:
    """Each step is one block with its own feedback, proved by the acknowledgement of a header that carries nothing."""
    trace = tmp_path / "t.txt"
    with handctl.simulate("barrett", initialized=1, trace=str(trace)) as hand:
        with hand.realtime(**ONE) as loop:
            position, times = 0, []
            for _ in range(60):
                rows = loop.step(velocity=max(-40, min(40, round((3000 - position) / 20))))
                position = rows.named()["position.F1"]
                assert not any(row["doubt"] for row in rows)
                times.append(rows[0]["t"])
        assert abs(position - 3000) < 50 and times == sorted(set(times))
        assert abs(hand.get("P.F1")[0]["value"] - position) < 5
        assert hand.envelope["ok"]
    assert sent(trace)[:4] == ["4328", "61", "4328", "61"]


class Numpy:
    """A number of another library, as numpy's: no int, and printed as one."""

    def __str__(self) -> str:
        return "20"


@pytest.mark.parametrize("given", [20, {"F1": 20, "F2": 20}, [20, 20], "F1=20,F2=20", Numpy(), [Numpy(), Numpy()]])
def test_values_in_each_form_hold_until_the_next(given: Any) -> None:
    with (
        handctl.simulate("barrett", initialized=1) as hand,
        hand.realtime(motors="12", send="velocity,gain", gain=9, receive="none") as loop,
    ):
        first = loop.step(velocity=given, gain={"F2": 30})
        assert loop.step().named() == first.named() == {
            "velocity_command.F1": 20, "velocity_command.F2": 20, "gain_command.F1": 9, "gain_command.F2": 30,
        }  # fmt: skip


@pytest.mark.parametrize("fails", [False, True])
def test_its_end_stops_as_the_command_does(fails: bool, tmp_path: Path) -> None:
    """However the `with` ends: velocity 0, ^C, T, and the flags as they were."""
    trace = tmp_path / "t.txt"
    with handctl.simulate("barrett", initialized=1, trace=str(trace)) as hand:
        before = hand.get("LCPG", "LFS", "LFT")
        loop = hand.realtime(**ONE)
        try:
            with loop:
                loop.step(velocity=20)
                assert not fails, "what a program raises"
        except AssertionError as exc:
            assert fails, exc
        assert sent(trace)[2:5] == ["6300", "03", "31540D"]
        assert [row["value"] for row in hand.get("LCPG", "LFS", "LFT")] == [row["value"] for row in before]
        with pytest.raises(UsageError):
            loop.step(velocity=20)


def test_a_stop_that_failed_is_raised_at_its_end() -> None:
    for fault, after, error in (("silent", 20, NoAnswer), ("refuse", 20, DeviceRefused)):
        with handctl.simulate("barrett", initialized=1, fault=fault, after=after) as hand, pytest.raises(error):  # noqa: SIM117
            with hand.realtime(**ONE) as loop:
                for _ in range(3):
                    loop.step(velocity=20)


def test_the_guards_are_stronger() -> None:
    with handctl.simulate("barrett", initialized=1) as hand:
        with hand.realtime(**ONE) as loop:
            held = [loop.step(velocity=127) for _ in range(150)]
        assert held[-1].named()["velocity_command.F1"] == 0 and held[-1][0]["guard"] == "window"
        assert hand.get("P.F1")[0]["value"] <= 17000
        hand.set({"LCVC.F1": 8}, force=True)
        with hand.realtime(**ONE) as loop, pytest.raises(CheckFailed) as caught:
            loop.step(velocity=20)
            loop.step(velocity=-127)
        assert caught.value.code == "opening-speed"


@each_row(
    ("options", "values"),
    [
        (ONE, {"velocity": 1.5}),
        (ONE, {"velocity": None}),
        (ONE, {"velocity": 128}),
        (ONE, {"velocity": float("nan")}),
        (ONE, {"velocity": {"F9": 3}}),
        (ONE, {"velocity": [1, 2]}),
        (ONE, {"gain": 3}),
        (ONE, {"speed": 3}),
        ({"motors": "1"}, {"velocity": 3}),
        ({"motors": "1", "law": ["velocity.F1 = 3"]}, {"velocity": 3}),
    ],
)
def test_a_value_that_cannot_be_sent_is_refused_and_ends_it(options: dict[str, Any], values: dict[str, Any]) -> None:
    with (
        handctl.simulate("barrett", initialized=1) as hand,
        pytest.raises(UsageError),
        hand.realtime(**options) as loop,
    ):
        loop.step(**values)


def test_other_streams_take_no_values() -> None:
    with handctl.simulate("exo") as hand, hand.watch("temperature", count=2) as stream:
        with pytest.raises(UsageError):
            stream.step(velocity=3)
        assert stream.step().named()["temperature.index"] > 0
        stream.step()
        with pytest.raises(HandctlError):
            stream.step()


def stepped(loop: handctl.Stream, began: threading.Event, ended: list[BaseException]) -> None:
    """Steps without rest, until it must not."""
    try:
        while True:
            loop.step(velocity=20)
            began.set()
    except BaseException as exc:  # noqa: BLE001 - all that a thread ends with
        ended.append(exc)


@each_row("way", ["with", "close", "disconnect", "stop", "error"])
def test_a_loop_that_another_thread_steps_ends_and_stops_the_hand(way: str, tmp_path: Path) -> None:
    """The `with` promises it for whatever reason it ends; a thread that is in a step is no reason to go on driving."""
    trace, ended = tmp_path / "t.txt", list[BaseException]()
    hand = handctl.simulate("barrett", initialized=1, trace=str(trace))
    loop, began = hand.realtime(**ONE), threading.Event()
    thread = threading.Thread(target=stepped, args=(loop, began, ended))
    thread.start()
    assert began.wait(PATIENCE)
    with pytest.raises(RuntimeError) if way in ("with", "error") else nullcontext():
        match way:
            case "with":
                with loop:
                    raise RuntimeError
            case "error":
                with hand:
                    raise RuntimeError
            case _:
                {"close": loop.close, "disconnect": hand.disconnect, "stop": hand.stop}[way]()
    thread.join(PATIENCE)
    hand.disconnect()
    assert not thread.is_alive() and isinstance(ended[0], UsageError | Interrupted), ended
    lines = sent(trace)
    assert any(line in ("31540D", "540D") for line in lines[-12:]) and not any(
        line.startswith("43") for line in lines[-4:]
    )


def test_several_threads_take_turns_in_a_loop() -> None:
    """As in all other calls: none meets another one in the middle of a block, and each gets the block that it has sent."""
    with handctl.simulate("barrett", initialized=1) as hand, hand.realtime(**ONE) as loop:
        got: list[tuple[int, int]] = []

        def steps(velocity: int) -> None:
            got.extend((velocity, loop.step(velocity=velocity).named()["velocity_command.F1"]) for _ in range(20))

        threads = [threading.Thread(target=steps, args=(velocity,)) for velocity in range(1, 5)]
        for one in threads:
            one.start()
        for one in threads:
            one.join(PATIENCE)
        assert len(got) == 80 and all(sent == shown for sent, shown in got)
