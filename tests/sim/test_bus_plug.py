"""What is pulled out of a simulated bus and plugged in again, and the faults of its CAN adapters, from the FILE and by hand."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from handctl.errors import LinkError
from handctl.link import CanFrame, open_link
from handctl.sim import create
from handctl.sim.bus.models import text
from handctl.sim.engine.serve import send_control
from tests.support.cli import Simulator, run, wait_until

ASK_3 = bytes.fromhex("EB 90 03 04 11 E8 03 01 04")
ID_IS_3 = bytes.fromhex("90 EB 03 04 11 E8 03 03 06")
ASK_5 = bytes.fromhex("EB 90 05 04 11 E8 03 01 06")
ID_IS_5 = bytes.fromhex("90 EB 05 04 11 E8 03 05 0A")
HANDS: list[dict[str, Any]] = [{"kind": "exo", "id": 3}, {"kind": "exo", "id": 5}]
WRISTS: list[dict[str, Any]] = [{"kind": "wrist", "id": 1}, {"kind": "wrist", "id": 2}]


def file_of(folder: Path, devices: list[dict[str, Any]], **line: Any) -> Path:
    path = folder / "bus.toml"
    path.write_text(text("clean", devices, **line), encoding="utf-8")
    return path


def answer(line: Any, request: bytes, now: float) -> bytes:
    """What comes back within 20 ms."""
    line.advance(now)
    line.feed(request)
    came = b""
    for step in range(1, 21):
        line.advance(now + step / 1000)
        came += line.take()
    return came


# -- devices ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wire", ["rs485", "rs232"])
def test_a_device_is_pulled_by_plan_and_by_hand(tmp_path: Path, wire: str) -> None:
    hands = [{**HANDS[0], "unplug": "1:2"}, HANDS[1]]
    line = create("bus", {"file": str(file_of(tmp_path, hands, wire=wire))})
    line.advance(0.0)
    assert answer(line, ASK_3, 0.5)[-9:] == ID_IS_3
    assert answer(line, ASK_3, 1.5) == b""
    assert answer(line, ASK_5, 2.5)[-9:] == ID_IS_5, "the others are still there"
    assert answer(line, ASK_3, 3.5)[-9:] == ID_IS_3
    assert line.command("device 2 unplug") == "unplug"
    assert (answer(line, ASK_5, 4.0), answer(line, ASK_3, 4.1)[-9:]) == (b"", ID_IS_3)
    assert line.command("device 2 replug") == "replug"
    assert answer(line, ASK_5, 5.0)[-9:] == ID_IS_5
    assert line.command("device 1 unplug 0.5") == "unplug 0.5"
    assert (answer(line, ASK_3, 5.3), answer(line, ASK_3, 5.7)[-9:]) == (b"", ID_IS_3)


def test_what_a_device_was_saying_ends_with_its_plug(tmp_path: Path) -> None:
    line = create("bus", {"file": str(file_of(tmp_path, HANDS, wire="rs485", baud=19200))})
    line.advance(0.0)
    line.client_baud = 19200
    line.feed(ASK_3)
    line.advance(0.0069)  # 9 bytes forth in 4.7 ms, 4 of 9 back
    line.command("device 1 unplug")
    line.advance(0.1)
    assert line.take() in (ID_IS_3[:3], ID_IS_3[:4])


def test_a_device_is_pulled_off_a_can_bus(tmp_path: Path) -> None:
    path = file_of(tmp_path, [{**WRISTS[0], "unplug": "1:2"}], wire="can")
    line = create("bus", {"file": str(path)})
    line.advance(0.0)

    def heard(now: float) -> tuple[bool, int]:
        line.advance(now)
        line.feed_frame(0x11000001, bytes([4]))
        acknowledged = line.acknowledged
        line.advance(now + 0.05)
        return acknowledged, len(line.take_frames())

    assert [heard(now) for now in (0.5, 1.5, 3.5)] == [(True, 1), (False, 0), (True, 1)]
    line.command("device 1 unplug")
    assert heard(4.0) == (False, 0)
    line.command("device 1 replug")
    assert heard(5.0) == (True, 1)


# -- adapters ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("wire", "devices"), [("rs485", HANDS), ("can", WRISTS)])
def test_the_port_in_this_process_goes_and_comes_back(tmp_path: Path, wire: str, devices: list[dict[str, Any]]) -> None:
    path = file_of(tmp_path, devices, wire=wire, unplug="1:2")
    link: Any = open_link(f"fake://bus?file={path}&clock=virtual", baud=115200)

    def ask() -> Any:
        if wire == "can":
            link.send(CanFrame(0x11000001, bytes([4])), link.deadline(1.0))
            return link.receive(link.deadline(0.1))
        link.write(ASK_3, link.deadline(1.0))
        return link.read(link.deadline(0.1))

    assert ask()
    link.sleep(1.5)
    with pytest.raises(LinkError, match="the simulated port is gone"):
        ask()
    if wire == "rs485":
        with pytest.raises(LinkError, match="no such port"):
            link.reopen()
        link.sleep(2.0)
        assert link.reopen() and ask()
    link.close()


Start = Callable[..., tuple[Simulator, str]]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    served: list[Simulator] = []

    def starter(devices: list[dict[str, Any]], *args: Any, **line: Any) -> tuple[Simulator, str]:
        control = str(tmp_path / "control")
        served.append(Simulator(file_of(tmp_path, devices, **line), *args, "--control", control, kind="bus"))
        return served[-1], control

    yield starter
    for one in served:
        one.stop()


@pytest.mark.real
@pytest.mark.parametrize(
    ("wire", "place", "devices", "words"),
    [("rs485", "--pty", HANDS, ["exo", "get", "id", "--id", "3"]),
     ("can", "--slcan-pty", WRISTS, ["wrist", "get", "pitch_actual"])],
)  # fmt: skip
def test_the_adapters_go_and_come_back_under_their_names(
    tmp_path: Path, start: Start, wire: str, place: str, devices: list[dict[str, Any]], words: list[str]
) -> None:
    name = tmp_path / "usb-if00"
    tcp = ["--slcan-tcp" if wire == "can" else "--tcp", "127.0.0.1:0"]
    simulator, control = start(devices, place, "--by-id", name, *tcp, wire=wire)
    one, two = simulator.links
    assert one.endswith(str(name))
    assert [run(*words, "-p", link).code for link in (one, two)] == [0, 0]
    assert send_control(control, "unplug") == "ok unplug"
    wait_until(lambda: not name.is_symlink())
    assert run(*words, "-p", one).code == 3
    taken = os.openpty()
    assert send_control(control, "replug") == "ok replug"
    wait_until(name.exists)
    assert [run(*words, "-p", link).code for link in (one, two)] == [0, 0]
    assert send_control(control, "unplug 0.2") == "ok unplug 0.2"
    wait_until(lambda: not name.is_symlink())
    wait_until(name.exists)
    assert run(*words, "-p", one).code == 0
    assert "unplug [SECONDS] | replug" in send_control(control, "help")
    for descriptor in taken:
        os.close(descriptor)


FAULTS = {
    "no-ack": (4, "no-ack"), "queue,no-ack": (4, "no-ack"), "bus-off": (3, "bus-off"), "bel": (3, "refused"),
    "bus-errors": (4, "bus-errors"), "damaged-lines": (5, "damaged"), "no-adapter": (3, "not-slcan"),
}  # fmt: skip
"""Of [line]: what a client is told, by the exit code and the code of its message."""


@pytest.mark.real
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_adapters_from_the_file_and_by_hand(start: Start, fault: str) -> None:
    simulator, control = start(WRISTS, "--slcan-pty", wire="can", fault=fault)
    words = ["wrist", "get", "pitch_actual", "--json", "--timeout", "0.2", "-p", simulator.link]
    told = run(*words)
    assert (told.code, told.error["code"]) == FAULTS[fault], told
    assert send_control(control, "fault none").startswith("ok ")
    assert run(*words).code == 0
    assert send_control(control, f"fault {fault}") == f"ok fault {fault}"
    if FAULTS[fault][0] == 3:  # those that end at once
        told = run(*words)
        assert (told.code, told.error["code"]) == FAULTS[fault], told


def test_faults_of_the_bus_show_in_this_process_and_those_of_an_adapter_do_not(tmp_path: Path) -> None:
    path = file_of(tmp_path, WRISTS, wire="can", fault=["no-ack"])
    done = run("wrist", "get", "pitch_actual", "--json", "-p", f"fake://bus?file={path}&clock=virtual")
    assert (done.code, done.error["code"]) == (4, "no-ack")
    path = file_of(tmp_path, WRISTS, wire="can", fault=["no-ack", "bel"])
    done = run("wrist", "get", "pitch_actual", "--json", "-p", f"fake://bus?file={path}&clock=virtual")
    assert done.code == 2 and "--slcan-pty" in done.error["text"]


@pytest.mark.parametrize(
    ("line", "device", "told"),
    [({"wire": "can", "fault": "bell"}, {}, "some of no-ack"), ({"wire": "rs485", "fault": "bel"}, {}, 'wire = "can"'),
     ({"wire": "can", "unplug": "2"}, {}, "AT:SECONDS"), ({"wire": "can", "unplug": 2}, {}, "AT:SECONDS"),
     ({"wire": "can"}, {"unplug": "x:1"}, r"\[\[device\]\] 1 unplug=x:1")],
)  # fmt: skip
def test_what_the_file_may_not_say(tmp_path: Path, line: dict[str, Any], device: dict[str, Any], told: str) -> None:
    path = file_of(tmp_path, [{**WRISTS[0], **device}], **line)
    with pytest.raises(ValueError, match=told):
        create("bus", {"file": str(path)})
