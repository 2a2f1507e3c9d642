"""What is pulled out of a simulated bus and plugged in again, and the faults of its CAN adapters, from the FILE and by hand."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from handctl.errors import LinkError
from handctl.link import CanFrame, open_link
from handctl.sim import create
from tests.support.bus_file import text
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.virtual import Loop

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


@each_row(("wire", "devices"), [("rs485", HANDS), ("can", WRISTS)])
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


@pytest.mark.parametrize(("wire", "place"), [("rs485", "pty"), ("can", "slcan-pty")])
def test_the_adapters_go_and_come_back_under_their_names(tmp_path: Path, wire: str, place: str) -> None:
    name, tcp = tmp_path / "usb-if00", "slcan-tcp" if wire == "can" else "tcp"
    file = file_of(tmp_path, HANDS if wire == "rs485" else WRISTS, wire=wire)
    request, answers = (ASK_3, ID_IS_3) if wire == "rs485" else (b"C\rS8\rO\rT11000001104\r", b"T110000014")
    words = ("bus", file, f"--{place}", "--by-id", name, f"--{tcp}", "127.0.0.1:0", "--control", "control")
    with Loop(*words) as loop:

        def answered() -> list[bool]:
            found = []
            for link in loop.links:
                with loop.open(link=link) as client:
                    client.reset_input_buffer()
                    found.append(answers in client.ask(request, 100, 0.1))
            return found

        one, two = loop.links
        assert one.endswith(str(name)) and answered() == [True, True]
        first, client = os.readlink(name), loop.open(link=two)
        assert loop.tell("unplug") == "ok unplug"
        loop.sleep(0.0)
        assert not name.is_symlink()
        assert client.hangs_up()
        with loop.open(link=two) as early:
            assert early.ask(b"V\r" if wire == "can" else request, 100, 1.0) == b"", "nobody comes in now"
        assert loop.tell("replug") == "ok replug"
        loop.sleep(0.0)
        assert name.is_symlink() and os.readlink(name) != first
        assert answered() == [True, True]
        assert loop.tell("unplug 0.2") == "ok unplug 0.2"
        loop.sleep(0.19)
        assert not name.is_symlink()
        loop.sleep(0.02)
        assert name.is_symlink() and answered()[0]
        assert "unplug [SECONDS] | replug" in loop.tell("help")


FAULTS = {
    "no-ack": (4, "no-ack"), "queue,no-ack": (4, "no-ack"), "bus-off": (3, "bus-off"), "bel": (3, "refused"),
    "bus-errors": (4, "bus-errors"), "damaged-lines": (5, "damaged"), "no-adapter": (3, "not-slcan"),
}  # fmt: skip
"""Of [line]: what a client is told, by the exit code and the code of its message."""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_adapters_from_the_file_and_by_hand(tmp_path: Path, fault: str) -> None:
    file = file_of(tmp_path, WRISTS, wire="can", fault=fault)
    with Loop("bus", file, "--slcan-tcp", "127.0.0.1:0", "--control", "control") as loop:
        words = ["wrist", "get", "pitch_actual", "--json", "--timeout", "0.2", "-p", loop.link]
        told = run(*words)
        assert (told.code, told.error["code"]) == FAULTS[fault], told
        assert loop.tell("fault none").startswith("ok ")
        assert run(*words).code == 0
        assert loop.tell(f"fault {fault}") == f"ok fault {fault}"
        told = run(*words)
        assert (told.code, told.error["code"]) == FAULTS[fault], told


def test_faults_of_the_bus_show_in_this_process_and_those_of_an_adapter_do_not(tmp_path: Path) -> None:
    path = file_of(tmp_path, WRISTS, wire="can", fault=["no-ack"])
    done = run("wrist", "get", "pitch_actual", "--json", "-p", f"fake://bus?file={path}&clock=virtual")
    assert (done.code, done.error["code"]) == (4, "no-ack")
    path = file_of(tmp_path, WRISTS, wire="can", fault=["no-ack", "bel"])
    done = run("wrist", "get", "pitch_actual", "--json", "-p", f"fake://bus?file={path}&clock=virtual")
    assert done.code == 2 and "--slcan-pty" in done.error["text"]


@each_row(
    ("line", "device", "told"),
    [({"wire": "can", "fault": "bell"}, {}, "some of no-ack"), ({"wire": "rs485", "fault": "bel"}, {}, 'wire = "can"'),
     ({"wire": "can", "unplug": "2"}, {}, "AT:SECONDS"), ({"wire": "can", "unplug": 2}, {}, "AT:SECONDS"),
     ({"wire": "can"}, {"unplug": "x:1"}, r"\[\[device\]\] 1 unplug=x:1")],
)  # fmt: skip
def test_what_the_file_may_not_say(tmp_path: Path, line: dict[str, Any], device: dict[str, Any], told: str) -> None:
    path = file_of(tmp_path, [{**WRISTS[0], **device}], **line)
    with pytest.raises(ValueError, match=told):
        create("bus", {"file": str(path)})
