"""The plug of a simulated port: its plan, by hand, a restart on USB, and the name that stays on a real terminal."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from handctl.sim import create
from handctl.sim.engine.line_and_faults import Plug
from handctl.sim.engine.serve import send_control
from tests.support.cli import Simulator, run, wait_until
from tests.support.each_row import each_row
from tests.support.virtual import Loop

GET_ID, ID_IS_1 = bytes.fromhex("EB 90 01 04 11 E8 03 01 02"), bytes.fromhex("90 EB 01 04 11 E8 03 01 02")
# ekso dossier 8.1, GetTime
GET_TIME = bytes.fromhex("96 00 00 C8 3D 82")


def test_a_plan_counts_from_the_start() -> None:
    plug = Plug("2.5:1,0.5:0.25")
    plug.begin(100.0)
    moments = (100.0, 100.5, 100.74, 100.75, 102.4, 102.5, 103.4, 103.5)
    assert [plug.out(moment) for moment in moments] == [False, True, True, False, False, True, True, False]
    assert [plug.next_event(moment) for moment in (100.0, 100.5, 101.0, 103.5)] == [100.5, 100.75, 102.5, None]


def test_by_hand_for_a_while_or_until_it_is_pushed() -> None:
    plug = Plug(None)
    plug.command(["unplug", "7"], 0.0)
    assert (plug.out(6.9), plug.out(7.0), plug.next_event(5.0)) == (True, False, 7.0)
    plug.command(["unplug"], 0.0)
    assert (plug.out(1e9), plug.next_event(5.0)) == (True, None)
    plug.command(["replug"], 0.0)
    assert not plug.out(5.0)


@each_row("plan", ["2", "2:", "x:1", "2:0", "-1:1", "2:nan", "inf:1"])
def test_a_plan_that_is_none(plan: str) -> None:
    with pytest.raises(ValueError, match="AT:SECONDS"):
        create("exo", {"unplug": plan})


def test_what_was_on_the_wire_goes_with_the_port_and_the_device_goes_on() -> None:
    line = create("ekso", {"unplug": "1:2", "turnaround": "0.5"})
    line.advance(10.0)
    line.advance(10.9)
    line.feed(GET_TIME)
    assert line.next_event() == 11.0
    line.advance(11.0)
    assert (line.away, line.hung_up, line.pulled) == (True, True, True)
    line.advance(13.0)
    assert (line.away, line.hung_up, line.pulled) == (False, True, True), "a client has to open it"
    line.reconnect()
    assert (line.hung_up, line.pulled, line.take()) == (False, False, b"")
    boot = int(line.command("boot").split()[1])
    line.feed(GET_TIME)
    line.advance(13.5)
    assert line.take()[:1] == GET_TIME[:1]
    assert boot == pytest.approx(7654321 + 3000, abs=2)


def test_a_restart_takes_the_port_away_on_usb_only() -> None:
    for usb in ("0", "1"):
        line = create("ekso", {"usb": usb, "startup": "1.5"})
        line.advance(0.0)
        line.command("reboot")
        assert (line.away, line.pulled) == (usb == "1",) * 2
        line.advance(1.5)
        assert (line.away, line.pulled) == (False, usb == "1")


def taking(place: str) -> list[int]:
    """Terminals until this one is among them, or is another program's: the next one has another number."""
    taken: list[int] = []
    for _ in range(64):
        taken += os.openpty()
        if os.ttyname(taken[-1]) == place:
            break
    return taken


@pytest.mark.real
def test_the_name_stays_and_the_terminal_is_another(tmp_path: Path) -> None:
    name, control = tmp_path / "usb-if00", str(tmp_path / "control")
    name.symlink_to(tmp_path / "of one that was killed")
    with Simulator("--pty", "--by-id", name, "--control", control, kind="exo") as simulator:
        assert simulator.link == str(name)
        first = os.readlink(name)
        assert run("exo", "get", "id", "-p", name).code == 0
        assert send_control(control, "unplug") == "ok unplug"
        wait_until(lambda: not name.is_symlink())
        assert run("exo", "get", "id", "-p", name).code == 3
        taken = taking(first)
        assert send_control(control, "replug") == "ok replug"
        wait_until(name.exists)
        assert os.readlink(name) != first
        assert run("exo", "get", "id", "-p", name).code == 0
        assert "unplug [SECONDS] | replug" in send_control(control, "help")
        assert send_control(control, "unplug soon").startswith("error ")
        for descriptor in taken:
            os.close(descriptor)
    assert not name.is_symlink()


def test_a_file_is_never_taken_for_a_name(tmp_path: Path) -> None:
    name = tmp_path / "mine"
    name.write_text("kept")
    with pytest.raises(AssertionError, match="File exists"), Loop("exo", "--pty", "--by-id", name):
        pass
    assert name.read_text() == "kept"
    assert run("sim", "exo", "--tcp", "127.0.0.1:0", "--by-id", "x").code == 2


def test_the_name_stays_and_the_terminal_is_another_in_this_process(tmp_path: Path) -> None:
    """A single port, as tests/sim/test_bus_plug.py has those of a bus."""
    name = tmp_path / "usb-if00"
    with Loop("exo", "--pty", "--by-id", name, "--control", "control") as loop:
        first = os.readlink(name)
        client = loop.open()
        assert loop.tell("unplug 0.2") == "ok unplug 0.2"
        loop.sleep(0.19)
        assert not name.is_symlink()
        with pytest.raises(EOFError):
            client.read()
        loop.sleep(0.02)
        assert os.readlink(name) != first
        assert loop.open().ask(GET_ID, 9) == ID_IS_1
    assert not name.is_symlink()
