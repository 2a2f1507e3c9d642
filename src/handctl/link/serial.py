"""Serial ports and pyserial URLs. The only user of pyserial.

Opens exclusively, names the cause when it cannot, and reads without pyserial's per-call timeouts: on POSIX it waits in
`select` for the exact deadline and takes whatever has arrived.
"""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from typing import Any

import serial

from handctl.errors import Hint, LinkError, UsageError
from handctl.link.link_interface import (
    SCHEMES,
    ByteLink,
    Deadline,
    RawAccess,
    options_in,
    path_in,
    scheme_of,
    unknown_scheme,
    unsent,
    usb_address,
)
from handctl.link.port_users import busy, group_of, group_remedy, holders, refuse_held
from handctl.system import clock, serial_ports
from handctl.system.waits import ended, readable, writable
from handctl.wording import plural

WRITE_SECONDS = 2.0
SLICE_SECONDS = 0.02
"""Where a port has no descriptor to wait on (Windows, socket://): it waits so long in itself, set once when it is opened. To
change that would set up the port anew, which on a USB adapter is control traffic in the middle of a reply."""
POLL_SECONDS = 0.001
"""Between two looks in the last of it: a deadline is kept to the millisecond."""
CLOSED = -1
"""The descriptor of a lost port that was not found again: its number may be another file's by now."""
REMOTE_SECONDS = 0.01
"""The same of rfc2217://, for good: it takes each new timeout for a new setting, negotiates with the server for a second and
drops what arrives meanwhile. It has no time limit for writing either."""


def open_serial(link: str, baud: int | None, *, exclusive: bool = True) -> ByteLink:
    """Open a port by name, `usb:VID:PID[:SERIAL]`, or pyserial URL. Raises UsageError, LinkError."""
    scheme = scheme_of(link)
    if scheme and scheme not in SCHEMES:
        raise unknown_scheme(link, scheme)
    if scheme == "cp2110" and not path_in(link):
        raise UsageError(f"{link}: this does not identify a port of this computer", hint="give cp2110:///dev/hidraw9")
    return SerialLink(link, baud or 115200, exclusive=exclusive)


def find(link: str) -> Any:
    """The one port of `usb:VID:PID[:SERIAL]` or `hwgrep://REGEXP`. Raises UsageError, LinkError."""
    return find_usb(link) if link.startswith("usb:") else _find_described(link)


def _find_described(link: str) -> Any:
    """The one port whose name, description or USB address fits, as pyserial matches them; never the first of several."""
    import re

    text = link.partition("://")[2]
    if "&" in text:
        raise UsageError(
            f"{link}: handctl does not support options of hwgrep://, and never chooses between ports",
            hint="give an expression that fits one port only, or the path",
        )
    try:
        wanted = re.compile(text, re.IGNORECASE)
    except re.error as exc:
        raise UsageError(f"{link}: not a regular expression: {exc}", hint="e.g. hwgrep://0403:6001") from exc
    found = [port for port in listed_ports() if any(map(wanted.search, (port.device, port.description, port.hwid)))]
    if len(found) != 1:
        names = ", ".join(str(port.device) for port in found)
        text = f"{len(found)} ports match: {names}" if found else "no port matches"
        hint = Hint("give an expression that fits one port only, or the path. {} lists the ports", "ports")
        raise LinkError(f"{link}: {text}", hint=hint, code="ambiguous" if found else "not-found")
    return found[0]


def find_usb(link: str) -> Any:
    """The one port of `usb:VID:PID[:SERIAL]` (hex). Exactly one must match; never another one."""
    vid, pid, wanted = usb_address(link)
    ports = [port for port in listed_ports() if (port.vid, port.pid) == (vid, pid)]
    if wanted:
        ports = [port for port in ports if (port.serial_number or "") == wanted]
    if not ports:
        present = ", ".join(
            f"{port.device} (usb:{port.vid:04X}:{port.pid:04X}:{port.serial_number or ''})"
            for port in listed_ports()
            if port.vid is not None
        )
        raise LinkError(
            f"{link}: no such USB serial port is plugged in",
            hint=f"present: {present}" if present else "no USB serial port is present at all: check the cable",
            code="not-found",
        )
    if len(ports) > 1:
        names = ", ".join(f"{port.device} (serial number {port.serial_number or 'none'})" for port in ports)
        raise LinkError(
            f"{link}: {plural(len(ports), 'port')} match: {names}",
            hint="add the serial number, or give the path",
            code="ambiguous",
        )
    return ports[0]


def _adapter(port: Any) -> str:
    """What distinguishes adapters of the same kind: the serial number, otherwise the USB socket."""
    if port.serial_number:
        return f"serial number {port.serial_number}"
    return f"USB socket {port.location}" if getattr(port, "location", None) else ""


def listed_ports() -> list[Any]:
    """The serial ports that pyserial knows of, on any system: its ListPortInfo objects. Opens none."""
    from serial.tools import list_ports

    return list(list_ports.comports())


class SerialLink(ByteLink):
    """A serial port, 8N1, no flow control."""

    can_set_baud = True

    def __init__(self, link: str, baud: int, *, exclusive: bool = True) -> None:
        self.name = link
        self.baud = baud
        self._exclusive = exclusive
        self._adapter: str | None = None
        self._open(self._path())

    def _path(self) -> str:
        """The path of the port now, or a URL. Where `usb:` or hwgrep:// says no more than the kind, the one that was opened first or none."""
        scheme, _, rest = self.name.partition("://")
        if rest and scheme.lower() != "hwgrep":
            return f"{scheme.lower()}://{rest}"
        if not self.name.startswith("usb:") and not rest:
            return self.name
        port = find(self.name)
        if self._adapter is None:
            self._adapter = _adapter(port)
        elif self._adapter != _adapter(port) or not self._adapter:
            raise LinkError(
                f"{self.name}: another adapter of this kind is plugged in: {port.device} ({_adapter(port) or 'no serial number'})",
                hint=f"plug in the one that was open ({self._adapter})" if self._adapter else "run the command again",
                code="other-adapter",
            )
        return str(port.device)

    def _open(self, device: str) -> None:
        link, baud, exclusive = self.name, self.baud, self._exclusive
        self._device = device
        is_url = "://" in device
        if is_url:
            options_in(link, flags=True)  # pyserial takes the first of two
        path = "" if device.startswith("cp2110:") else path_in(device)
        if path and exclusive:
            refuse_held(link, path)
        try:
            waits = 0.0 if serial_ports.WAITED_FOR and not is_url else SLICE_SECONDS
            options: dict[str, Any] = {"baudrate": baud, "timeout": waits, "write_timeout": WRITE_SECONDS}
            if device.startswith("rfc2217://"):
                options = {"baudrate": baud, "timeout": REMOTE_SECONDS}
            elif path and serial_ports.SHARED:
                options["exclusive"] = exclusive
            self._port = serial.serial_for_url(device, **options)
        except (serial.SerialException, OSError) as exc:
            raise _cannot_open(link, device, exc) from exc
        except ValueError as exc:
            raise UsageError(f"{link}: {exc}", hint="give a port, tcp://HOST:PORT or a URL of pyserial") from exc
        self.can_set_baud = not device.startswith("socket://")
        self._fd = self._descriptor()
        self._raw_access = raw_access_of(self._port, device)
        if self._raw_access is not None and self.can_set_baud:
            self._raw_access.baud = baud
        if self._fd is not None and not device.startswith("/dev/pts/"):
            # An FTDI chip then waits 1 ms instead of 16 for more bytes.
            port: Any = self._port
            with contextlib.suppress(OSError, ValueError, NotImplementedError, AttributeError):
                port.set_low_latency_mode(True)

    def _descriptor(self) -> int | None:
        return None if "://" in self._device else serial_ports.descriptor(self._port)

    def reopen(self) -> bool:
        """See Link."""
        return self._open_again()

    def _open_again(self) -> bool:
        """A URL leads to another program: what is lost there stays lost."""
        if "://" in self._device:
            return False
        self.close()
        if self._fd is not None:
            self._fd, self._raw_access = CLOSED, None
        self._open(self._path())
        return True

    def reconnect(self, seconds: float) -> bool:
        """See Link. A contact that bounces brings the adapter back under its name within a second."""
        return self.look_for(seconds, self._open_again)

    def write(self, data: bytes, deadline: Deadline) -> None:
        if self._fd == CLOSED:
            raise unsent(self._lost(None))
        try:
            if self._raw_access is not None:
                self._raw_access.before()
            if self._fd is None:
                self._port.write(data)
            else:
                self._write_fd(data, deadline)
        except serial.SerialTimeoutException as exc:
            raise self._stuck() from exc
        except (serial.SerialException, OSError) as exc:
            raise self._lost(exc) from exc

    def _write_fd(self, data: bytes, deadline: Deadline) -> None:
        assert self._fd is not None and self._raw_access is not None
        rest = data
        while rest:
            try:
                rest = rest[os.write(self._fd, rest) :]
            except BlockingIOError as exc:
                self._raw_access.note_unfinished(rest if len(rest) < len(data) else b"")
                if not writable(self._fd, deadline.remaining):
                    raise unsent(self._stuck(), rest == data) from exc
            except OSError as exc:
                raise unsent(self._lost(exc), rest == data) from exc
        self._raw_access.note_unfinished(b"")

    def framing_errors(self) -> int | None:
        return None if self._fd is None else serial_ports.framing_errors(self._fd)

    def raw_access(self) -> RawAccess | None:
        return self._raw_access

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        if self._fd == CLOSED:
            raise self._lost(None)
        try:
            if self._fd is None:
                return self._read_slices(deadline, size)
            if deadline is not self.at_once and not readable(self._fd, deadline.remaining):
                return b""
            data = os.read(self._fd, size)
        except BlockingIOError:
            return b""
        except (serial.SerialException, OSError, TypeError) as exc:
            # TypeError: what pyserial raises when the port is torn down in the middle of a read.
            raise self._lost(exc) from exc
        if not data and ended(self._fd):
            raise self._lost(None)
        return data  # b"" where another reader was faster: a stop, while this has the port

    def _read_slices(self, deadline: Deadline, size: int) -> bytes:
        """What has arrived: the port is asked for no more than it has, but where it may wait for itself."""
        while True:
            left = deadline.remaining
            if left < SLICE_SECONDS and not self._port.in_waiting:
                if not left:
                    return b""
                clock.sleep(min(left, POLL_SECONDS))
            elif data := bytes(self._port.read(1)):
                waiting = min(int(self._port.in_waiting), size - 1)
                return data + bytes(self._port.read(waiting)) if waiting > 0 else data

    def set_baud(self, baud: int) -> None:
        try:
            self._port.baudrate = baud
        except (serial.SerialException, OSError, ValueError) as exc:
            raise LinkError(
                f"{self.name}: the port cannot be set to {baud} bit/s: {exc}",
                hint="use --baud with a baud rate that this adapter supports",
                code="baud",
            ) from exc
        self.baud = baud
        if self._raw_access is not None:
            self._raw_access.baud = baud

    def _stuck(self) -> LinkError:
        return LinkError(
            f"{self.name}: the port does not accept data",
            hint="unplug the adapter and plug it in again. Flow control, a stopped terminal or a hung adapter may be blocking the data",
            code="write-timeout",
        )

    def _lost(self, exc: Exception | None) -> LinkError:
        why = f": {getattr(exc, 'strerror', None) or exc}" if exc is not None else ""
        return LinkError(
            f"{self.name}: the port is gone{why}",
            hint=Hint(
                "check the cable: the adapter was unplugged, or the other end closed. {} lists the ports that are left",
                "ports",
            ),
            code="lost",
        )

    def close(self) -> None:
        with contextlib.suppress(serial.SerialException, OSError):  # it went away before us: nothing is left to release
            self._port.close()


def raw_access_of(port: Any, device: str) -> RawAccess | None:
    """Where a second process can write to an open port of pyserial; None where the system gives it no descriptor."""
    telnet = device.startswith("rfc2217://")
    found = serial_ports.raw_access(getattr(port, "_socket", None) if telnet else port)
    return None if found is None else RawAccess(found, _telnet if telnet else None)


def _telnet(data: bytes, _can_id: int | None) -> bytes:
    """A byte FF is doubled, as pyserial does."""
    return data.replace(b"\xff", b"\xff\xff")


def _cannot_open(link: str, device: str, exc: Exception) -> LinkError | UsageError:
    number = serial_ports.trouble(exc)
    if number == errno.EACCES:
        return LinkError(f"{link}: not permitted", hint=_permission_hint(device), code="not-permitted")
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return LinkError(f"{link}: no such port", hint=_ports_hint(link), code="not-found")
    if number in (errno.EAGAIN, errno.EBUSY):
        return busy(link, holders(device) if "://" not in device else [])
    if number == errno.ETIMEDOUT:
        return LinkError(
            f"{link}: the device on the port does not reply",
            hint="switch on the Bluetooth device and bring it near. Then run the command again",
            code="cannot-open",
        )
    if number == errno.EIO and not serial_ports.WAITED_FOR:
        return LinkError(
            f"{link}: the driver of the port fails",
            hint=Hint(
                "unplug the adapter and plug it in again. If that does not help, look at its driver with {}", "doctor"
            ),
            code="cannot-open",
        )
    if number in (errno.ENOTTY, errno.EINVAL, errno.EISDIR):
        return LinkError(f"{link}: this is not a serial port", hint=_ports_hint(link), code="not-a-port")
    return LinkError(
        f"{link}: cannot open: {exc}",
        hint=Hint("check the port with {} and {}", "ports", "doctor"),
        code="cannot-open",
    )


def _permission_hint(device: str) -> str:
    group = group_of(Path(device))
    if group is None:
        return "ask the administrator for access to the port"
    hint = group_remedy(group[1], device)
    return f"{hint}. `handctl ports` shows a rule that lasts, if there is one" if group[0] == 0 else hint


def _ports_hint(link: str) -> str:
    scheme, _, rest = link.partition(":")
    if scheme.lower() in ("tcp", "socket") and rest and "://" not in link:
        return f"write {scheme.lower()}://HOST:PORT, such as tcp://{rest.lstrip('/') if ':' in rest else '192.168.1.20:8000'}"
    present = serial_ports.present(listed_ports)
    if serial_ports.foreign_name(link):
        return f"{link} is a name from another system. `handctl ports` lists the serial ports of this computer"
    return (
        f"use one of {', '.join(present)}"
        if present
        else Hint("plug in the adapter, then look for its port with {}. `--fake` needs none", "ports")
    )
