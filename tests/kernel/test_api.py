"""handctl as a library: light, silent, closed when it is left, and a stop behind every Ctrl-C."""

from __future__ import annotations

import inspect
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

import handctl
from handctl import hands
from handctl.errors import STOPPED, Interrupted, LinkError, NoAnswer, NotConfirmed, UsageError
from handctl.families import FAMILIES
from handctl.link.fake import FakeLink
from handctl.model.device import Device
from tests.support.cli import spying
from tests.support.refused import refused

SET = {"position_set.index": 300}


@pytest.fixture
def exo() -> Iterator[hands.Exo]:
    with handctl.simulate("exo") as hand:
        yield hand


def loaded(code: str) -> set[str]:
    """What a program has imported in the end."""
    text = f"import sys; {code}; print(*sorted(sys.modules), sep='\\n')"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True, timeout=60)
    return set(done.stdout.split())


@pytest.mark.real
def test_importing_it_loads_nothing() -> None:
    found = loaded("import handctl; handctl.__version__")
    assert {name for name in found if name.startswith("handctl")} == {"handctl"}
    assert not found & {"click", "serial", "rich", "can", "typing"}
    assert handctl.HandctlError is handctl.errors.HandctlError
    assert not loaded("import handctl; handctl.errors.HandctlError") & {"click", "serial", "rich", "can"}


@pytest.mark.real
def test_a_simulated_device_needs_neither_a_terminal_nor_a_port() -> None:
    found = loaded("import handctl; handctl.simulate('exo').dump()")
    assert not found & {"serial", "rich", "can", "socket"}
    assert not any(name.startswith(("handctl.devices.barrett", "handctl.tools")) for name in found)


def test_what_is_not_there_is_an_attribute_error(exo: hands.Exo) -> None:
    assert not hasattr(handctl, "nonsense") and not hasattr(exo, "nonsense") and not hasattr(hands, "Nonsense")
    assert {"get", "factory_reset", "position"} <= set(dir(exo)) and "Write values" in exo.set.__doc__
    for kind in FAMILIES:
        assert issubclass(getattr(hands, kind.capitalize()), hands.Device)
    assert isinstance(exo, hands.Exo) and exo.kind == "exo"


def test_arguments_are_judged_as_python_does_and_values_as_the_command_does(exo: hands.Exo) -> None:
    with pytest.raises(TypeError, match="unexpected argument 'nonsense'"):
        exo.status(nonsense=True)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="1 arguments too many"):
        exo.status(True)  # type: ignore[misc]
    with pytest.raises(UsageError, match="out of range"):
        exo.set({"position_set.index": 2000}, confirm=True)
    with refused(UsageError, "unknown-name"):
        exo.get("nonsense")
    assert exo.position(ring=900, confirm=True) == exo.position({"ring": 900}, confirm=True)
    with pytest.raises(UsageError, match="no finger 'rnig'"):
        exo.position(rnig=900, confirm=True)
    with pytest.raises(UsageError) as error:
        exo.watch(rate=-1)
    assert error.value.exit_code == 2 and error.value.hint
    with pytest.raises(UsageError, match="no device family"):
        handctl.connect("nonsense", "/dev/ttyNOTHING0")
    with pytest.raises(UsageError, match="no such setting"):
        handctl.connect("exo", "/dev/ttyNOTHING0", nonsense=1)
    with refused(LinkError, "not-found"):
        handctl.connect("exo", "/dev/ttyNOTHING0")
    with pytest.raises(UsageError, match="ekso has no device ids"):
        handctl.connect("ekso", "fake://ekso", id=2)


def test_set_returns_what_was_read_back(exo: hands.Exo) -> None:
    rows = exo.set({"position_set.index": 300, "force_set": [1, 2, 3, 4, 5]}, confirm=True)
    assert [row["value"] for row in rows] == [300, 1, 2, 3, 4, 5]
    assert exo.get("position_set.index")[0]["value"] == 300
    assert exo.set("position_set.index=400", confirm=True)[0]["value"] == 400


def test_a_function_is_asked_with_the_steps(exo: hands.Exo) -> None:
    asked: list[Any] = []

    def answer(question: str, steps: list[hands.Row]) -> bool:
        asked.append((question, steps))
        return len(asked) > 1

    with pytest.raises(NotConfirmed, match="nothing was written"):
        exo.set(SET, confirm=answer)
    assert exo.envelope["counters"]["sent"] == 3  # its identity, and where it is
    assert exo.set(SET, confirm=answer)[0]["value"] == 300
    assert "position_set.index 440 to 300" in asked[0][0] and asked[0][1][0]["bytes"].startswith("EB 90")
    with pytest.raises(NotConfirmed) as error:
        exo.set(SET)
    assert error.value.exit_code == 8 and "confirm=True" in error.value.hint


def test_the_environment_plays_no_part(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"YES": "1", "PORT": "fake://wrist", "FORMAT": "csv", "ID": "7", "CONFIG": "/nowhere"}.items():
        monkeypatch.setenv(f"HANDCTL_{name}", value)
    with handctl.simulate("exo") as hand:
        with pytest.raises(NotConfirmed):
            hand.set(SET)
        assert hand.get("id")[0]["value"] == 1


def test_errors_are_the_tree_with_what_was_read() -> None:
    with handctl.simulate("exo", fault="silent", timeout=0.1) as hand, pytest.raises(NoAnswer) as error:
        hand.dump()
    assert (error.value.exit_code, error.value.code, bool(error.value.hint)) == (4, "no-answer", True)
    with handctl.simulate("exo", fault="over-temperature") as hand, pytest.raises(handctl.errors.CheckFailed) as found:
        hand.status(check=True)
    assert found.value.rows and hand.messages


def test_a_stream_ends_with_its_loop(exo: hands.Exo) -> None:
    samples = list(exo.watch("id", rate=50, count=3))
    assert [sample[0]["t"] for sample in samples] == [0.0, 0.02, 0.04]
    assert exo.envelope["stream"]["samples"] == 3
    stream = exo.watch("temperature.index", rate=50)
    assert next(stream)[0]["value"] == 34
    with pytest.raises(UsageError, match="a stream is running"):
        exo.get("id")
    stream.close()  # type: ignore[attr-defined]
    assert exo.get("id")
    next(exo.watch("id"))
    assert exo.stop() and exo.get("id")


def test_a_lost_link_is_an_error_and_is_opened_again() -> None:
    with spying() as spy, handctl.simulate("exo", fault="disconnect", after=2) as hand:
        assert hand.get("id")
        with pytest.raises(LinkError):
            hand.get("id")
        assert hand.get("id")
    assert len(spy.lines) == 2


def pressing() -> Any:
    """`FakeLink.read` with Ctrl-C while the device is waited for, once something was written."""
    left = [1]

    def reading(link: FakeLink, deadline: Any, size: int = 4096) -> bytes:
        if left and getattr(link, "driven", False):
            left.clear()
            signal.raise_signal(signal.SIGINT)
        return READ(link, deadline, size)

    return reading


READ, WRITE = FakeLink.read, FakeLink.write


def written(link: FakeLink, data: bytes, deadline: Any) -> None:
    if data[4:5] == b"\x32":
        link.driven = True  # type: ignore[attr-defined]
    WRITE(link, data, deadline)


def test_ctrl_c_stops_what_is_driven_and_is_raised_again(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a command run in this process may have left another
    with (
        mock.patch.object(FakeLink, "read", pressing()),
        mock.patch.object(FakeLink, "write", written),
        handctl.simulate("exo", trace=str(trace)) as hand,
    ):
        with pytest.raises(KeyboardInterrupt):
            hand.position(100, 200, 300, 400, 500, wait=2, confirm=True)
        assert hand.envelope["exit_code"] == 130
        _, release, hold = [(row["bytes"][12:14], row["state"]) for row in hand.envelope["writes"]]
        assert (release, hold) == (("31", "confirmed"), ("32", "confirmed"))
        assert hand.get("id")
    assert trace.read_text(encoding="utf-8").count(" > EB 90 01 0B 32") == 2


def test_no_signal_is_taken(exo: hands.Exo) -> None:
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGTSTP", "SIGIO", "SIGALRM", "SIGUSR1", "SIGQUIT")
    before = [signal.getsignal(getattr(signal, name)) for name in names]
    exo.set(SET, confirm=True)
    list(exo.watch("id", rate=50, count=2))
    exo.stop()
    assert [signal.getsignal(getattr(signal, name)) for name in names] == before


def test_it_works_in_any_thread_and_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    found: list[Any] = []

    def work(seed: int) -> None:
        with handctl.simulate("exo", seed=seed) as hand:
            found.append(len(hand.dump()) + len(hand.set(SET, confirm=True)))

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    assert found == [43] * 4
    assert capfd.readouterr() == ("", "")


def test_a_device_may_be_left_without_with() -> None:
    hand = handctl.simulate("exo", deadline=5)
    assert hand.get("id")
    hand.disconnect()
    hand.disconnect()
    with refused(UsageError, "closed"):
        hand.get("id")


def test_a_stop_behind_the_last_reply_of_a_reading_that_is_asked_again_ends_it(
    exo: hands.Exo, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = Device.table

    def stopped(device: Device, *given: Any) -> Any:
        call = exo._line.last
        assert call is not None and call.connection.device_access is not None
        call.connection.device_access.stop_from_outside("stopped by a test")
        return table(device, *given)

    for _ in range(3):
        assert exo.get("id")
    monkeypatch.setattr(Device, "table", stopped)
    with refused(Interrupted, STOPPED):
        exo.get("id")
    monkeypatch.undo()
    assert exo.get("id")  # on a link that was opened again


def test_the_signature_of_connect_is_documented() -> None:
    from handctl import api

    for function in (api.connect, api.simulate):
        assert inspect.getdoc(function)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_log_is_exported_to_the_file_that_is_named(family: str, tmp_path: Path) -> None:
    log, out = tmp_path / "log.csv", tmp_path / "out.xdf"
    with handctl.simulate(family) as device:
        device.log(str(log), count=5)
        (row,) = device.export(str(log), to="xdf", output=out)
        assert row["rows"] == 5 and out.read_bytes()[:4] == b"XDF:"
        with pytest.raises(UsageError, match="makes a file"):
            device.export(str(log), to="xdf")


def test_a_log_is_exported_as_the_text_that_the_command_writes(tmp_path: Path) -> None:
    log, out = tmp_path / "log.csv", tmp_path / "out.csv"
    with handctl.simulate("ekso") as device:
        device.log(str(log), count=5)
        assert device.export(str(log), to="csv", output=str(out)) == []
    assert out.read_bytes() == log.read_bytes()
