"""Where a LINK leads and what may be on its way: one name a place, the owner of a port, python-can's own files, damaged lines."""

from __future__ import annotations

import pkgutil
from pathlib import Path
from typing import Any, NamedTuple

import can as python_can
import pytest
import serial as pyserial
import serial.urlhandler as pyserial_urls

from handctl.errors import HandctlError, LinkError, UsageError
from handctl.link import open_link, serial
from handctl.link.device_lock import canonical, hold
from handctl.link.link_interface import SCHEMES
from handctl.link.port_users import group_remedy
from tests.support.cli import PATIENCE, run
from tests.support.each_row import each_row
from tests.support.virtual import Answering, virtual_time

HERE = [
    *("127.0.0.1", "127.1", "0x7f.1", "2130706433", "0", "0.0.0.0", "localhost", "LOCALHOST", "LocalHost."),  # noqa: S104
    *("[::1]", "::1", "::ffff:127.0.0.1", "[::FFFF:127.0.0.1]", "::ffff:7f00:1", "[::]", "ip6-localhost"),
]


@each_row("scheme", ["tcp", "socket", "rfc2217"])
def test_all_names_of_this_machine_are_one_place(scheme: str) -> None:
    assert {canonical(f"{scheme}://{host}:8000") for host in HERE} == {"tcp 127.0.0.1:8000"}
    assert {canonical(f"{scheme}://{host}:08000/") for host in HERE} == {"tcp 127.0.0.1:8000"}
    assert {canonical(f"tcp://{host}", 8000) for host in HERE if ":" not in host} == {"tcp 127.0.0.1:8000"}


def test_other_machines_are_other_places() -> None:
    names = ["10.0.0.1", "10.1", "10.0.0.2", "hand", "HAND.", "fe80::1", "[FE80:0::1]", "127.0.0.2", "1.2.3.4.5", ""]
    places = [canonical(f"tcp://{name}:8000") for name in names]
    assert places == [f"tcp {host}:8000" for host in ("10.0.0.1", "10.0.0.1", "10.0.0.2", "hand", "hand", "fe80::1", "fe80::1", "127.0.0.2", "1.2.3.4.5", "")]  # fmt: skip


PORT = "/dev/null"
"""A character device, as a port is."""
ADDRESSES = {"socket": "{}://127.1:08000/x?logging=info#y", "rfc2217": "{}://user@LOCALHOST:8000/?timeout=3"}
OPTIONS = {"spy": "?file=/nowhere&all=1#x", "alt": "?class=PosixPollSerial", "cp2110": ""}


class Listed(NamedTuple):
    """A port of pyserial's list."""

    device: str
    description: str = "USB Serial"
    hwid: str = "USB VID:PID=0403:6001 SER=A1"
    vid: int = 0x0403
    pid: int = 0x6001
    serial_number: str = "A1"


def places_of(scheme: str) -> set[str]:
    """Where the URLs of a handler of pyserial lead, in its several spellings; a new handler is refused, or must be added."""
    if scheme == "loop":
        assert hold(f"{scheme.upper()}://", "x") is None
        return {"nobody else"}
    if scheme in ADDRESSES:
        return {canonical(ADDRESSES[scheme].format(one)) for one in (scheme, scheme.upper())}
    links = [f"{one}://{PORT}{OPTIONS.get(scheme, '')}" for one in (scheme, scheme.upper(), scheme.capitalize())]
    if scheme == "hwgrep":
        links = [
            f"{one}://{text}" for one in (scheme, scheme.upper()) for text in ("0403:6001", "usb serial", "SER=A1$")
        ]
    return {canonical(link) for link in [*links, *(f"can:slcan:{link.partition('?')[0]}@9600" for link in links)]}


def test_each_url_of_pyserial_leads_to_one_place_or_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else two programs would have one device, each with a lock of its own."""
    monkeypatch.setattr(serial, "listed_ports", lambda: [Listed(PORT), Listed("/dev/zero", "n/a", "n/a", 1, 2, "")])
    handlers = [info.name.removeprefix("protocol_") for info in pkgutil.iter_modules(pyserial_urls.__path__)]
    assert {"alt", "spy", "hwgrep", "loop", "socket", "rfc2217", "cp2110"} <= set(handlers)
    port, host = {canonical(PORT)}, {canonical("tcp://127.0.0.1:8000")}
    for scheme in handlers:
        if scheme in SCHEMES:
            wanted = {"nobody else"} if scheme == "loop" else host if scheme in ADDRESSES else port
            assert places_of(scheme) == wanted, scheme
        else:
            with pytest.raises(UsageError, match="not a known kind of link"):
                open_link(f"{scheme}://{PORT}")
    assert port == {canonical("usb:0403:6001:A1"), canonical(f"can:robotell:{PORT}@9600?bitrate=500000")}


@each_row(
    "link, code, text",
    [
        ("cp2110://0001:0023:00", 2, "a port of this computer"),
        ("hwgrep://0403:6001&n=2", 2, "options of hwgrep"),
        ("hwgrep://x&skip_busy", 2, "options of hwgrep"),
        ("hwgrep://(", 2, "regular expression"),
        ("hwgrep://.", 3, "2 ports match: /dev/null, /dev/zero"),
        ("hwgrep://nothing", 3, "no port matches"),
        ("other:///dev/null", 2, "not a known kind of link"),
        ("fake:exo", 2, "// is missing"),
        ("tcp:/127.0.0.1", 2, "// is missing"),
        ("alt:///dev/null?class=Nothing", 2, "unknown class"),
        ("spy://[x", 2, "IPv6"),
        ("socket://127.0.0.1", 3, "cannot open"),
        ("rfc2217://127.0.0.1", 3, "cannot open"),
    ],
)
def test_a_url_that_leads_nowhere_for_sure_is_refused(
    link: str, code: int, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial, "listed_ports", lambda: [Listed(PORT), Listed("/dev/zero")])
    canonical(link)
    with pytest.raises(HandctlError) as caught:
        open_link(link)
    assert caught.value.exit_code == code and text in caught.value.text and caught.value.hint, caught.value.text


def test_a_port_of_root_is_no_matter_of_a_group(monkeypatch: pytest.MonkeyPatch) -> None:
    """To join the group root would give far more than the port."""
    assert "usermod" not in group_remedy("root", "/dev/ttyS9") and "chmod a+rw /dev/ttyS9" in group_remedy(
        "root", "/dev/ttyS9"
    )
    assert "usermod -aG dialout" in group_remedy("dialout", "/dev/ttyUSB0")
    assert "log out and in" in group_remedy("dialout", "/dev/ttyUSB0", member=True)
    monkeypatch.setattr(serial, "group_of", lambda _path: (0, "root"))
    error = serial._cannot_open("/dev/ttyS9", "/dev/ttyS9", PermissionError(13, "Permission denied"))
    assert error.code == "not-permitted" and "usermod" not in error.hint and "root" in error.hint


CONFIGS = {
    "broken": "[default\ninterface = {{", "no section": "interface = pcan\n", "twice": "[default]\na = 1\n[default]\na = 2\n",
    "timing": "[default]\nf_clock = 8000000\nbrp = 1\ntseg1 = 10\ntseg2 = 5\nsjw = 1\nbtr = 001C\ndata_bitrate = 5\n",
    "bytes": "[default]\nchannel = \xff\n", "percent": "[default]\nbitrate = %(nothing)s\n",
}  # fmt: skip


@each_row("name", CONFIGS)
@each_row("place", [".canrc", "can.conf", ".can", "CAN_CONFIG"])
def test_the_link_alone_says_how_a_bus_is_opened(
    name: str, place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """python-can's own files and variables may be broken, or give another bitrate, of which nobody would know."""
    monkeypatch.setenv("HOME", str(tmp_path))
    if place == "CAN_CONFIG":
        monkeypatch.setenv("CAN_CONFIG", '{"btr": "001C"}' if name == "timing" else "{")
        monkeypatch.setenv("CAN_BITRATE", "125000")
    else:
        (tmp_path / place).write_bytes(CONFIGS[name].encode("latin-1"))
    asked: list[dict[str, Any]] = []
    made = python_can.Bus

    def note(**options: Any) -> Any:
        asked.append(options)
        return made(**options)

    monkeypatch.setattr(python_can, "Bus", note)
    open_link("can:virtual:here?bitrate=500000").close()
    (options,) = asked
    assert {key: value for key, value in options.items() if value is not None} == {
        "interface": "virtual", "channel": "here", "bitrate": 500000, "receive_own_messages": False, "ignore_config": True,
    }  # fmt: skip
    done = run(
        "wrist", "get", "pitch_actual", "-p", "can:virtual:here", "--timeout", "0.01", "--retries", "0", "--json"
    )
    assert done.code == 4 and "internal" not in done.codes(), done


DAMAGED = [b"T\r", b"T1\r", b"TZZZZZZZZ2AABB\r", b"T000000012A\r", b"T00000001\xff1AA\r", b"t12\r", b"x1234567890\r", b"T000000019AA\r", b"R0000\r", b"B000000011\r"]  # fmt: skip


def test_a_damaged_line_of_an_adapter_is_dropped_and_counted() -> None:
    """What follows it is read."""
    with virtual_time():
        link: Any = open_link("can:slcan:loop://", exclusive=False)  # it does not say who it is
        port = link._bus.serialPortOrig
        port.reset_input_buffer()
        for number, line in enumerate(DAMAGED, 1):
            port.write(line + b"T10FF000120102\r")
            frame = link.receive(link.deadline(PATIENCE))
            assert frame is not None and (frame.can_id, frame.data) == (0x10FF0001, b"\1\2"), line
            assert (link.damaged, link.error_frames) == (number, 0), line
        link.close()
        with pytest.raises(LinkError):
            open_link("can:slcan:/dev/nothing-there")


@each_row(
    ("answer", "code", "words"),
    [
        (b"T?2A7\r", 5, "the adapter sent 1 corrupted line (the last one: b'T1"),
        (b"\xff\r", 5, "the adapter sent 1 corrupted line (the last one: b'\\xff\\r'"),
        (b"T?2A7\rT?2A7FE\r", 0, ""),
    ],
)
def test_damaged_lines_stand_in_the_counters_and_in_the_cause(
    monkeypatch: pytest.MonkeyPatch, answer: bytes, code: int, words: str
) -> None:
    """Silence is not blamed on the bus where the adapter's own cable is damaged."""

    def answering(came: bytes) -> bytes:
        told = [line + b"1013\r" for line in came.split(b"\r") if line in (b"V", b"N")]
        return b"".join([*told, *(answer.replace(b"?", line[1:9]) for line in came.split(b"\r") if line[:1] == b"T")])

    monkeypatch.setattr(pyserial, "serial_for_url", lambda *_, **__: Answering(answering))
    words_of = (
        "wrist",
        "get",
        "pitch_actual",
        "-p",
        "can:slcan:socket://192.0.2.7:1",
        "--timeout",
        "0.2",
        "--retries",
        "1",
    )
    with virtual_time():
        done = run(*words_of, "--json")
    assert done.code == code, done
    if code:
        assert done.error["code"] == "damaged" and words in done.error["text"], done.error
        assert done.json["counters"]["bad_frames"] == 2
    else:
        assert done.json["counters"]["bad_frames"] == 1 and done.rows[0]["value"] == -3.45
