"""No command stops a calibration (exo §2.3.6, rh56 §9): neither Ctrl-C nor a stop is a success while it runs. In process."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from handctl.devices.inspire import modbus_frames
from handctl.devices.inspire.exo.calibration import calibrate
from handctl.errors import DeviceRefused, HandctlError
from handctl.link.device_lock import hold
from handctl.model.command_settings import Settings
from handctl.model.prompts import Prompts
from handctl.model.stop_on_interrupt import NOT_STOPPED
from handctl.stop.device_access import DeviceAccess
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink, hand_on
from tests.support.stop import RELEASE

START = bytes.fromhex("EB90010412F103010C")


class Hand:
    """Answers everything, as a stop would wish, and calibrates on all the same."""

    def __init__(self, *, silent: bool = False) -> None:
        self.link = ScriptedLink(self.answer)
        self.silent, self.begun = silent, False
        self.targets = bytes(10)

    def answer(self, request: bytes) -> list[Reply]:
        flag = request[4]
        if request == START:
            self.begun = True
        elif self.silent and self.begun:
            return []
        if flag == 0x30:
            return []
        if flag in (0x31, 0x32):
            self.targets = request[5:15] if flag == 0x32 else self.targets
            body = bytes([flag]) + bytes(12 if flag == 0x31 else 10)
        elif flag == 0x12:
            body = request[4:7] + b"\x01"
        else:
            body = request[4:7] + bytes(request[7])
        whole = bytes([1, len(body)]) + body
        return [(0.001, b"\x90\xeb" + whole + bytes([sum(whole) % 256]))]


class Asking(Prompts):
    """Another process asks for a stop as soon as the calibration runs; then this one ends as by Ctrl-C."""

    def __init__(self, hand: Hand) -> None:
        run: Any = SimpleNamespace(
            prompts=self,
            settings=Settings(),
            writes=False,
            opened=None,
            family=SimpleNamespace(kind="exo"),
            session=None,
        )
        self.access = DeviceAccess(run, None)
        self.access.link = hand.link
        self.hand = hand
        self.told: dict[str, Any] = {}

    def say(self, text: str) -> None:
        if self.hand.begun and not self.told:
            self.told = self.access.stop("stopped")
            raise KeyboardInterrupt


@pytest.fixture
def locked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulated devices have the lock of a real one: its file outlives the command."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(
        "handctl.stop.device_access.lock_for", lambda run, name, patience=None: hold("tcp://192.0.2.7:8000", "handctl")
    )
    monkeypatch.setattr("handctl.stop.stop_command.lock_for", lambda *_: hold("tcp://192.0.2.7:8000", "handctl"))


FAKES = {
    "exo": ("fake://exo?clock=virtual", START),
    "hand": ("fake://hand?clock=virtual&model=df", START),
    "rtu": ("fake://hand?clock=virtual&model=df", modbus_frames.rtu(1, bytes.fromhex("06 03F1 0001"))),
}


@pytest.mark.parametrize("wire", FAKES)
def test_a_stop_knows_of_a_calibration_that_another_command_has_started(locked: None, wire: str) -> None:
    """With `raw`, by a handctl that has ended: the hand rests between two of its steps, and goes on."""
    link, start = FAKES[wire]
    family = "exo" if wire == "exo" else "hand"
    assert run(family, "stop", "-p", link, "--json").code == 0
    assert run(family, "raw", start.hex(" "), "-y", "-p", link, "--json").code == 0
    stopped = run(family, "stop", "-p", link, "--json")
    assert stopped.code == 6 and stopped.rows, stopped
    assert run(family, "get", "force_actual", "-p", link, "--json").code == 0
    assert run(family, "stop", "-p", link, "--json").code == 6, "what only reads ends nothing"


def test_a_calibration_is_no_failure_of_a_stop_of_another_device_on_the_line(locked: None) -> None:
    link, start = FAKES["exo"]
    assert run("exo", "raw", start.hex(" "), "-y", "-p", link, "--json").code == 0
    for number, code in ((2, 0), (1, 6)):
        assert run("exo", "stop", "--id", number, "-p", f"{link}&id={number}", "--json").code == code


def test_a_calibration_whose_end_was_seen_is_over(locked: None) -> None:
    assert run("exo", "calibrate", "-y", "-p", FAKES["exo"][0], "--json").code == 0
    assert run("exo", "stop", "-p", FAKES["exo"][0], "--json").code == 0


@each_row(("seconds", "later", "error"), [(30.0, 1.0, "DeviceRefused"), (30.0, 31.0, ""), (0.0, 0.0, "")])
def test_without_a_lock_the_same_command_knows_it(seconds: float, later: float, error: str) -> None:
    """Two lines of a batch on a simulated device; it is over when its time is."""
    hand = Hand()
    access = Asking(hand).access
    access.unstoppable(access._run, None, seconds)
    hand.link.sleep(later)
    assert access.stop("stopped")["error"] == error


@each_row(("silent", "error"), [(False, "DeviceRefused"), (True, "NoAnswer")])
def test_a_stop_says_that_the_calibration_goes_on(silent: bool, error: str) -> None:
    hand = Hand(silent=silent)
    prompts = Asking(hand)
    with pytest.raises(DeviceRefused) as caught:
        calibrate(hand_on(hand.link), prompts)
    assert caught.value.code == NOT_STOPPED
    stopped = prompts.access.stopped
    assert (prompts.told["error"], stopped is not None and stopped.code) == (error, NOT_STOPPED)
    for told in (prompts.told["text"], str(stopped), caught.value.text):
        assert "still calibrating" in told
    assert "switch its power off" in prompts.told["hint"] and RELEASE in hand.link.sent
    assert prompts.goes_on() is None, "only while it runs"


def test_what_was_not_begun_does_not_go_on() -> None:
    """Ctrl-C before the start went out has nothing to stop."""
    hand = Hand()
    hand.link.interrupt_at = 0.0
    with pytest.raises((HandctlError, KeyboardInterrupt)) as caught:
        calibrate(hand_on(hand.link), Prompts())
    assert getattr(caught.value, "exit_code", 130) == (6 if hand.begun else 130)
