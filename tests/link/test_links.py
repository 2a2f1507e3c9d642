"""Links: what opens, what the errors say, and that bytes pass unchanged. Real ports only where a real one is the point."""

from __future__ import annotations

import errno
import os
import pty
import socket
import subprocess
import sys
import termios
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import SimpleNamespace
from typing import Any

import pytest
import serial
from serial.rfc2217 import PortManager

from handctl.errors import HandctlError, LinkError
from handctl.link import ByteLink, Deadline, NoLink, RawAccess, open_link, port_users
from handctl.link import serial as serial_module
from handctl.link.port_users import Process
from handctl.link.tcp import TcpLink
from handctl.system import descriptors, waits
from tests.support.cli import PATIENCE, run
from tests.support.each_row import each_row
from tests.support.scripted import unhex

READ_ID, ID_IS_1 = unhex("EB 90 01 04 11 E8 03 01 02"), unhex("90 EB 01 04 11 E8 03 01 02")


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """A pty: our end, and the name of the other one."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    name = os.ttyname(theirs)
    os.close(theirs)
    yield ours, name
    os.close(ours)


class Port:
    """A port of pyserial's with a descriptor: one end of a pair, of which `peer` is the other."""

    def __init__(self, *_: object, baudrate: int, **options: object) -> None:
        self._end, self.peer = socket.socketpair()
        self._end.setblocking(False)
        self.baudrate, self.options = baudrate, options

    def fileno(self) -> int:
        return self._end.fileno()

    def close(self) -> None:
        self._end.close()


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Port]:
    """Every port that is opened, as this process's own."""
    ports: list[Port] = []

    def open_one(name: str, **options: Any) -> Port:
        ports.append(Port(name, **options))
        return ports[-1]

    monkeypatch.setattr(serial, "serial_for_url", open_one)
    return ports


def opening(link: str, **options: object) -> HandctlError:
    """The error of a link that cannot be opened."""
    with pytest.raises(HandctlError) as caught:
        open_link(link, **options)  # type: ignore[arg-type]
    return caught.value


def all_of(link: ByteLink, count: int) -> bytes:
    deadline = link.deadline(PATIENCE)
    data = b""
    while len(data) < count and (chunk := link.read(deadline)):
        data += chunk
    return data


# -- deadlines --------------------------------------------------------------------------------------------------------


def test_deadline() -> None:
    clock = [10.0]
    deadline = Deadline(lambda: clock[0], 12.5)
    assert (deadline.remaining, deadline.expired) == (2.5, False)
    clock[0] = 12.5
    assert (deadline.remaining, deadline.expired) == (0.0, True)
    clock[0] = 99.0
    assert (deadline.remaining, deadline.expired) == (0.0, True)


def test_earlier_deadline() -> None:
    soon, later = Deadline(lambda: 0.0, 1.0), Deadline(lambda: 0.0, 2.0)
    assert soon.earlier(later) is soon
    assert later.earlier(soon) is soon
    assert soon.earlier(None) is soon
    assert Deadline(lambda: 0.0, float("inf")).earlier(soon) is soon


def test_a_link_makes_deadlines_on_its_own_clock() -> None:
    link = open_link("fake://exo?clock=virtual")
    deadline = link.deadline(3.0)
    link.sleep(2.0)
    assert deadline.remaining == pytest.approx(1.0)
    link.sleep(-5.0)
    assert link.now() == pytest.approx(2.0)


# -- what is no link --------------------------------------------------------------------------------------------------


def test_empty_link() -> None:
    assert opening("").exit_code == 2


@each_row(
    "link",
    [
        "fake://wrist?seed=1&seed=2",
        "fake://wrist?seed=1&clock=virtual&seed=1",
        "fake://wrist?bus=serial&bus=can",
        "can:virtual:x?bitrate=500000&bitrate=1000000",
        "socket://127.0.0.1:9?logging=debug&logging=info",
        "spy:///dev/null?color&color",
    ],
)
def test_an_option_that_is_given_twice_is_refused(link: str) -> None:
    """In every scheme that has options, of which either might be meant; a LINK that is kept for later is refused as well."""
    assert opening(link).exit_code == 2
    for words in (("wrist", "status"), ("wrist", "stop"), ("doctor",), ("stop",), ("devices", "add", "left", "wrist")):
        assert run(*words, "-p", link).code == 2, words


def test_no_link_refuses_bytes() -> None:
    link = NoLink()
    with pytest.raises(LinkError):
        link.write(b"x", link.deadline(PATIENCE))
    with pytest.raises(LinkError):
        link.read(link.deadline(PATIENCE))
    link.set_baud(9600)
    assert (link.baud, link.can_set_baud, link.fake, link.power_cycle()) == (9600, False, False, False)
    link.close()


# -- serial ports -----------------------------------------------------------------------------------------------------


def test_missing_port() -> None:
    error = opening("/dev/ttyNOTHING0")
    assert isinstance(error, LinkError)
    assert (error.exit_code, error.code) == (3, "not-found")
    assert "/dev/ttyNOTHING0" in error.text
    assert "--fake" in error.hint or "present" in error.hint


def test_a_file_is_not_a_port(tmp_path: object) -> None:
    path = os.path.join(str(tmp_path), "file")
    with open(path, "wb"):
        pass
    error = opening(path)
    assert (error.exit_code, error.code) == (3, "not-a-port")


@each_row("path", ["/dev/null", "/"])
def test_devices_and_directories_are_not_ports(path: str) -> None:
    error = opening(path)
    assert (error.exit_code, error.code) == (3, "not-a-port")


@pytest.mark.real
def test_a_port_of_the_system(terminal: tuple[int, str]) -> None:
    """Every byte passes unchanged: XON, XOFF, CR, LF, ^C, ^D and FF too. A second opening is busy."""
    ours, name = terminal
    link = open_link(name, baud=57600)
    try:
        assert (link.name, link.baud, link.can_set_baud, link.fake) == (name, 57600, True, False)
        assert termios.tcgetattr(ours)[4] == termios.B57600
        data = bytes(range(256))
        link.write(data, link.deadline(PATIENCE))
        assert os.read(ours, 4096) == data
        os.write(ours, data)
        assert all_of(link, 256) == data
        link.set_baud(19200)
        assert (termios.tcgetattr(ours)[4], link.baud) == (termios.B19200, 19200)
        error = opening(name)
        assert (error.exit_code, error.code) == (3, "busy")
        assert "close" in error.hint
    finally:
        link.close()
        link.close()
    open_link(name).close()


@pytest.mark.real
def test_the_holder_is_named(terminal: tuple[int, str]) -> None:
    _, name = terminal
    holder = (
        "import serial,sys; p = serial.Serial(sys.argv[1], exclusive=True); print('open', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", holder, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == "open\n"
        error = opening(name)
        assert (error.exit_code, error.code) == (3, "busy")
        assert f"pid {process.pid}" in error.text
        process.stdin.close()


@pytest.mark.real
def test_a_port_that_goes_away_is_lost() -> None:
    ours, theirs = pty.openpty()
    link = open_link(os.ttyname(theirs))
    os.close(theirs)
    os.close(ours)
    for attempt in (lambda: link.write(READ_ID, link.deadline(PATIENCE)), lambda: link.read(link.deadline(1.0))):
        with pytest.raises(LinkError) as caught:
            attempt()
        assert (caught.value.exit_code, caught.value.code) == (3, "lost")
    link.close()


@pytest.mark.real
def test_a_port_is_not_lost_where_another_reader_was_faster(
    terminal: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stop reads beside the command that has the port: what made it readable is gone then, and the port is not."""
    ours, name = terminal
    link = open_link(name)
    raw_access = link.raw_access()
    assert raw_access is not None

    def faster(port: int, seconds: float) -> bool:
        return waits.readable(port, seconds) and bool(os.read(raw_access.descriptor, 4096))

    monkeypatch.setattr(serial_module, "readable", faster)
    monkeypatch.setattr(descriptors, "readable", faster)
    os.write(ours, READ_ID)
    assert link.read(link.deadline(PATIENCE)) == b""
    os.write(ours, READ_ID)
    with pytest.raises(BlockingIOError):
        descriptors.read(raw_access.descriptor, 4096, PATIENCE)
    monkeypatch.undo()
    os.write(ours, READ_ID)
    assert all_of(link, len(READ_ID)) == READ_ID
    link.close()


def test_a_port_is_read_in_pieces_until_the_deadline(opened: list[Port], monkeypatch: pytest.MonkeyPatch) -> None:
    link = open_link("/dev/ttyUSB7", baud=57600)
    assert opened[0].baudrate == 57600 and opened[0].options["timeout"] == 0.0
    opened[0].peer.sendall(b"abcdef")
    assert link.read(link.deadline(PATIENCE), 2) == b"ab"
    assert all_of(link, 4) == b"cdef"
    waits: list[float] = []
    monkeypatch.setattr(serial_module, "readable", lambda _port, seconds: bool(waits.append(seconds)))
    assert link.read(Deadline(lambda: 10.0, 12.5)) == b""
    assert waits == [2.5]
    link.close()


def test_an_adapter_that_was_unplugged_reads_as_nothing_and_is_lost(opened: list[Port]) -> None:
    """Ready, and no byte: that is the end of a hung-up line, never silence that could be waited for again."""
    link = open_link("/dev/ttyUSB7")
    opened[0].peer.close()
    with pytest.raises(LinkError) as caught:
        link.read(link.deadline(PATIENCE))
    assert caught.value.code == "lost"
    link.close()


@each_row(("first", "unsent"), [(0, True), (3, False)])
def test_a_frame_of_which_a_lost_link_took_nothing_is_known_not_to_be_sent(
    first: int, unsent: bool, opened: list[Port], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of one that it took a part of, the record of writes says what is known: it may have arrived."""
    port, tcp = open_link("/dev/ttyUSB7"), TcpLink.__new__(TcpLink)
    assert isinstance(port, ByteLink)
    tcp.name, tcp._raw_access = "tcp://192.0.2.7:1", RawAccess(-1)
    for link in (port, tcp):
        taken = iter([first] * (first > 0))

        def write(*_: Any, taken: Iterator[int] = taken) -> int:
            for count in taken:
                return count
            raise OSError(errno.EIO, "gone")

        tcp._socket = SimpleNamespace(send=write)  # type: ignore[assignment]
        with monkeypatch.context() as patched, pytest.raises(LinkError) as caught:
            patched.setattr(os, "write", write)
            link.write(b"whole", link.deadline(PATIENCE))
        assert (caught.value.code, caught.value.unsent) == ("lost", unsent), link.name


def test_a_port_that_another_program_has_open_is_refused(opened: list[Port], monkeypatch: pytest.MonkeyPatch) -> None:
    """Two readers would each get half of the bytes; the exclusive opening does not see one that opened it before."""
    name = "/dev/ttyUSB7"
    holding = [Process(4711, "minicom")]
    monkeypatch.setattr(port_users, "holders", lambda device: holding if device == name else [])
    with pytest.raises(LinkError, match=r"in use by minicom \(pid 4711\)") as caught:
        open_link(name)
    assert caught.value.code == "busy" and not opened
    holding.clear()
    open_link(name).close()
    assert len(opened) == 1


def test_a_port_that_takes_nothing_ends_at_the_deadline(opened: list[Port], monkeypatch: pytest.MonkeyPatch) -> None:
    link = open_link("/dev/ttyUSB7")
    waits: list[float] = []
    monkeypatch.setattr(serial_module, "writable", lambda _port, seconds: bool(waits.append(seconds)))
    owed: list[bytes] = []
    assert isinstance(link, ByteLink)
    link.raw_access().note_unfinished = owed.append  # type: ignore[union-attr]
    link.write(b"whole", link.deadline(PATIENCE))
    assert owed == [b""]
    frame = bytes(range(251)) * 40000
    with pytest.raises(LinkError) as caught:
        link.write(frame, Deadline(lambda: 10.0, 12.5))
    assert caught.value.code == "write-timeout" and waits == [2.5]
    assert owed[-1] and frame.endswith(owed[-1]) and owed[-1] != frame, "the rest of a frame that is half sent"
    link.close()


@pytest.mark.parametrize(
    ("number", "code"),
    [
        ("EACCES", "not-permitted"),
        ("ENOENT", "not-found"),
        ("EBUSY", "busy"),
        ("EAGAIN", "busy"),
        ("EIO", "cannot-open"),
    ],
)
def test_causes_of_a_failed_opening(monkeypatch: pytest.MonkeyPatch, number: str, code: str) -> None:
    def refuse(*args: object, **more: object) -> None:
        raise serial.SerialException(getattr(errno, number), "could not open port")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    error = opening("/dev/ttyUSB77")
    assert (error.exit_code, error.code) == (3, code)


def test_permission_names_the_group(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*args: object, **more: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    monkeypatch.setattr(serial_module, "group_of", lambda _path: (20, "dialout"))  # a port of root: test_places
    assert "usermod -aG dialout" in opening("/dev/ttyUSB7").hint


# -- usb: -------------------------------------------------------------------------------------------------------------


def port(device: str, vid: int | None, pid: int | None, serial_number: str | None) -> SimpleNamespace:
    return SimpleNamespace(device=device, vid=vid, pid=pid, serial_number=serial_number)


FTDI_A = port("/dev/ttyUSB0", 0x0403, 0x6001, "A1")
FTDI_B = port("/dev/ttyUSB1", 0x0403, 0x6001, "B2")
CH340 = port("/dev/ttyUSB2", 0x1A86, 0x7523, None)
BOARD = port("/dev/ttyS0", None, None, None)


def plug(monkeypatch: pytest.MonkeyPatch, *ports: SimpleNamespace) -> None:
    from serial.tools import list_ports

    monkeypatch.setattr(list_ports, "comports", lambda *args, **more: list(ports))


@each_row(
    ("link", "device"),
    [
        ("usb:1A86:7523", "/dev/ttyUSB2"), ("usb:1a86:7523", "/dev/ttyUSB2"), ("usb:0403:6001:A1", "/dev/ttyUSB0"),
        ("usb:0403:6001:B2", "/dev/ttyUSB1"), ("usb:403:6001:B2", "/dev/ttyUSB1"),
    ],
)  # fmt: skip
def test_usb_port_is_found(monkeypatch: pytest.MonkeyPatch, link: str, device: str) -> None:
    plug(monkeypatch, BOARD, FTDI_A, FTDI_B, CH340)
    assert serial_module.find_usb(link).device == device


def test_usb_port_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    plug(monkeypatch, BOARD, FTDI_A)
    for link in ("usb:1A86:7523", "usb:0403:6001:B2", "usb:0403:6001:a1"):
        error = opening(link)
        assert (error.exit_code, error.code) == (3, "not-found")
        assert "/dev/ttyUSB0" in error.hint
        assert "0403:6001:A1" in error.hint
    plug(monkeypatch)
    assert "no USB serial port" in opening("usb:1A86:7523").hint


@each_row("number", ["A", "1", "a1", "A12"])
def test_a_serial_number_must_be_the_whole_one(monkeypatch: pytest.MonkeyPatch, number: str) -> None:
    """The port of another device must not be opened for it."""
    plug(monkeypatch, FTDI_A, CH340)
    error = opening(f"usb:0403:6001:{number}")
    assert error.code == "not-found" and "no such USB serial port" in error.text


def test_usb_port_that_is_not_the_only_one(monkeypatch: pytest.MonkeyPatch) -> None:
    plug(monkeypatch, FTDI_A, FTDI_B)
    error = opening("usb:0403:6001")
    assert (error.exit_code, error.code) == (3, "ambiguous")
    for part in ("/dev/ttyUSB0", "A1", "/dev/ttyUSB1", "B2"):
        assert part in error.text


@each_row("link", ["usb:", "usb:0403", "usb:xyz:6001", "usb:0403:", "usb::6001"])
def test_usb_link_that_is_none(monkeypatch: pytest.MonkeyPatch, link: str) -> None:
    plug(monkeypatch, FTDI_A)
    assert opening(link).exit_code == 2


def test_usb_link_opens_the_port_it_found(monkeypatch: pytest.MonkeyPatch, opened: list[Port]) -> None:
    plug(monkeypatch, FTDI_A)
    link = open_link("usb:0403:6001:A1")
    assert link.name == "usb:0403:6001:A1"
    link.write(READ_ID, link.deadline(PATIENCE))
    assert opened[0].peer.recv(100) == READ_ID
    link.close()


def socketed(device: str, location: str | None) -> SimpleNamespace:
    return SimpleNamespace(device=device, vid=0x1A86, pid=0x7523, serial_number=None, location=location)


def test_a_lost_usb_port_comes_back_as_itself_only(monkeypatch: pytest.MonkeyPatch, opened: list[Port]) -> None:
    """A kind without a serial number: not the port of another adapter of that kind, whatever its path is by then."""
    name = "/dev/ttyUSB7"
    for own, other in (
        (port(name, 0x1A86, 0x7523, "A1"), port(name, 0x1A86, 0x7523, "B2")),
        (socketed(name, "1-2"), socketed(name, "1-3")),
        (socketed(name, None), socketed(name, None)),
    ):
        plug(monkeypatch, own)
        link = open_link("usb:1A86:7523")
        plug(monkeypatch, other)
        with pytest.raises(LinkError, match="another adapter of this kind") as caught:
            link.reopen()
        assert caught.value.hint
        plug(monkeypatch, own, other)
        with pytest.raises(LinkError, match="2 ports match"):
            link.reopen()
        plug(monkeypatch, own)
        if getattr(own, "location", "") is not None:
            assert link.reopen()
        link.close()


# -- pyserial URLs ----------------------------------------------------------------------------------------------------


def test_loop_url_echoes() -> None:
    link = open_link("loop://", baud=115200)
    link.write(READ_ID, link.deadline(PATIENCE))
    assert all_of(link, 9) == READ_ID
    assert link.read(link.deadline(0.0)) == b""
    link.close()


@pytest.mark.real
def test_urls_that_lead_to_a_listener_or_to_nothing() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        link = open_link(f"socket://127.0.0.1:{listener.getsockname()[1]}")
        peer, _ = listener.accept()
        with peer:
            assert link.can_set_baud is False
            link.write(READ_ID, link.deadline(PATIENCE))
            assert peer.recv(100) == READ_ID
            peer.sendall(ID_IS_1)
            assert all_of(link, 9) == ID_IS_1
            assert link.read(link.deadline(0.02)) == b""
        with pytest.raises(LinkError) as caught:
            link.read(link.deadline(PATIENCE))
        assert caught.value.code == "lost"
        link.close()
    for name in ("nothing://x", "socket://", "socket://127.0.0.1:0", "socket://127.0.0.1:1"):
        assert opening(name).exit_code in (2, 3), name


@contextmanager
def device_server(baud: int = 115200) -> Iterator[tuple[str, serial.Serial, bytearray]]:
    """An RFC 2217 server (pyserial's own) whose port echoes what it gets: its LINK, the port, and what it heard."""
    heard = bytearray()
    port = serial.serial_for_url("loop://", baudrate=baud)
    port.timeout = 0.02
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            client, _ = listener.accept()
            with client, suppress(OSError):
                client.settimeout(0.01)
                manager = PortManager(port, SimpleNamespace(write=client.sendall))
                while port.is_open:
                    with suppress(TimeoutError):
                        data = client.recv(1024)
                        if not data:
                            return
                        heard.extend(data)
                        port.write(b"".join(manager.filter(data)))
                    if port.in_waiting:
                        client.sendall(b"".join(manager.escape(port.read(port.in_waiting))))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"rfc2217://127.0.0.1:{listener.getsockname()[1]}", port, heard
        finally:
            port.close()
            thread.join(PATIENCE)


@pytest.mark.real
def test_an_rfc2217_server_carries_bytes_and_sets_the_speed() -> None:
    with device_server() as (name, port, heard):
        link = open_link(name, baud=57600)
        assert port.baudrate == 57600
        heard.clear()
        for _ in range(5):
            link.write(READ_ID + b"\xff", link.deadline(PATIENCE))
            assert all_of(link, 10) == READ_ID + b"\xff"
        assert link.read(link.deadline(0.03)) == b""
        assert heard == (READ_ID + b"\xff\xff") * 5, "a wait negotiates nothing"
        link.set_baud(19200)
        assert port.baudrate == 19200
        port.close()
        with pytest.raises(LinkError) as caught:
            for _ in range(3):
                link.write(READ_ID, link.deadline(PATIENCE))
                link.read(link.deadline(PATIENCE))
        assert caught.value.code == "lost"
        link.close()
    with device_server() as (name, _, _):
        result = run("exo", "get", "id", "-p", name, "--timeout", "0.2", "--json")
        assert (result.code, result.error["code"]) == (5, "echo")
