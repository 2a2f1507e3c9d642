"""CAN through python-can: `can:INTERFACE:CHANNEL[?bitrate=…]`. The only user of python-can.

Extended data frames only; standard, remote and own frames are passed over, error frames and damaged lines counted.
"""

from __future__ import annotations

import contextlib
import logging
import os
import struct
from collections.abc import Callable
from typing import Any

import can

from handctl.errors import LinkError, UsageError
from handctl.link.base import CanFrame, Deadline, FrameLink, Outlet

BITRATE = 1_000_000
"""wrist §2.3."""
POLL_SECONDS = 0.05
"""Some back ends return early without a frame; the deadline decides, not they."""


def split_link(link: str) -> tuple[str, str, dict[str, Any]]:
    """``can:slcan:/dev/ttyACM0?bitrate=500000`` -> ("slcan", "/dev/ttyACM0", {"bitrate": 500000}). Raises UsageError."""
    body, _, query = link.removeprefix("can:").partition("?")
    interface, colon, channel = body.partition(":")
    if not interface or not colon or not channel:
        raise UsageError(
            f"{link}: expected can:INTERFACE:CHANNEL",
            hint="write for example can:socketcan:can0, can:slcan:/dev/ttyACM0 or can:pcan:PCAN_USBBUS1",
        )
    options: dict[str, Any] = {"bitrate": BITRATE}
    for item in filter(None, query.split("&")):
        key, equals, value = item.partition("=")
        if not equals:
            raise UsageError(f"{link}: {item!r} is not KEY=VALUE", hint="write for example `?bitrate=1000000`")
        try:
            options[key] = float(value) if "." in value else int(value)
        except ValueError:
            options[key] = value
    if not isinstance(options["bitrate"], int) or options["bitrate"] <= 0:
        raise UsageError(
            f"{link}: bitrate={options['bitrate']} is not a bitrate in bit/s",
            hint="write for example `?bitrate=1000000`",
        )
    return interface, channel, options


def _opening(interface: str, channel: str, bitrate: int) -> str:
    """What to do about an interface that cannot be opened."""
    if interface == "socketcan":
        return f"bring the interface up: `sudo ip link set {channel} up type can bitrate {bitrate}`"
    if interface == "slcan":
        return f"check that {channel} is the adapter: `handctl ports` lists the serial ports"
    return f"check the adapter, the driver of {interface}, and the channel {channel}"


class CanLink(FrameLink):
    """A bus of any python-can interface."""

    def __init__(self, link: str, *, exclusive: bool = True) -> None:
        self.name = link
        interface, channel, options = split_link(link)
        if interface == "slcan":
            # python-can waits 2 s for boards that restart when the port is opened; few do, `?sleep_after_open=2` is for those
            options.setdefault("sleep_after_open", 0.0 if "://" in channel or channel.startswith("/dev/pts/") else 0.1)
        logging.getLogger("can").setLevel(logging.CRITICAL)  # what it has to say comes back as exceptions
        if interface not in can.VALID_INTERFACES:
            raise UsageError(
                f"{link}: python-can has no interface {interface!r}",
                hint=f"use one of {', '.join(sorted(can.VALID_INTERFACES))}",
            )
        slcan = interface == "slcan" and channel.startswith("/dev/")
        self._lock = _lock(link, channel) if slcan and exclusive else None
        try:
            settings = dict(interface=interface, channel=channel, receive_own_messages=False, **options)
            self._bus = can.Bus(**_by_link_alone(settings), ignore_config=True)
        except (TypeError, ValueError) as exc:
            raise UsageError(
                f"{link}: {exc}", hint="check the options behind the question mark: python-can's interface takes them"
            ) from exc
        except (can.CanError, OSError, ImportError, NotImplementedError) as exc:
            if "invalid bitrate" in str(exc).lower():
                raise UsageError(f"{link}: {exc}", hint="use a bitrate that this adapter has") from exc
            raise LinkError(
                f"{link}: cannot open: {exc}",
                hint=_opening(interface, channel, options["bitrate"]),
                code="cannot-open",
            ) from exc
        self._closed = False
        self._line = b""
        if interface == "slcan" and hasattr(self._bus, "_read"):
            self._bus._read = self._noting(self._bus._read)
        self._interface = interface
        self.held = (self._lock,) if self._lock is not None else ()

    def outlet(self) -> Outlet | None:
        """Of a Linux CAN socket, and of an slcan adapter; other back ends are inside a vendor's library."""
        try:
            if self._interface == "socketcan":
                return Outlet(int(self._bus.fileno()), _socketcan_frame)
            if self._interface == "slcan":
                return Outlet(int(self._bus.fileno()), _slcan_frame)
        except (can.CanError, OSError, NotImplementedError, ValueError):
            pass
        return None

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        message = can.Message(arbitration_id=frame.can_id, data=frame.data, is_extended_id=True)
        try:
            self._bus.send(message, timeout=max(0.001, deadline.remaining))
        except (can.CanError, OSError, ValueError) as exc:
            raise LinkError(
                f"{self.name}: the frame could not be sent: {exc}",
                hint="check the device's power, the termination (120 ohm at both ends) and the bitrate. No device acknowledged, or the adapter is gone",
                code="cannot-send",
            ) from exc

    def receive(self, deadline: Deadline) -> CanFrame | None:
        while True:
            try:
                message = self._bus.recv(min(POLL_SECONDS, deadline.remaining))
            except (can.CanError, OSError, ValueError, IndexError) as exc:
                if self._interface == "slcan" and isinstance(exc.__cause__ or exc, (ValueError, IndexError)):
                    self._drop_line(str(exc))
                    if deadline.expired:
                        return None
                    continue
                raise LinkError(
                    f"{self.name}: the bus is lost: {exc}",
                    hint="check the adapter's cable, then run the command again",
                    code="lost",
                ) from exc
            if message is not None and message.is_error_frame:
                self.error_frames += 1
            elif message is not None and not _possible(message):
                self._drop_line("no frame can be like this")
            elif message is not None and message.is_extended_id and not message.is_remote_frame and message.is_rx:
                return CanFrame(message.arbitration_id, bytes(message.data))
            if deadline.expired:
                return None

    def _drop_line(self, why: str) -> None:
        """python-can takes an adapter's lines apart unchecked: a damaged one is passed over, as a damaged frame is."""
        self.damaged += 1
        kept = getattr(self._bus, "_buffer", None)
        if isinstance(kept, bytearray) and kept:
            self._line = bytes(kept)
            kept.clear()  # bytes that are no text stay in there, and every line behind them would fail
        self.damage = f"{self._line[:40]!r} ({why})" if self._line else why

    def _noting(self, read: Callable[[float | None], str | None]) -> Callable[[float | None], str | None]:
        """python-can's reader of an adapter's lines, with the last one kept: its errors do not tell it."""

        def reading(timeout: float | None) -> str | None:
            self._line = b""
            line = read(timeout)
            self._line = (line or "").encode()
            return line

        return reading

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        # An adapter that went away before us leaves nothing to release.
        with contextlib.suppress(can.CanError, OSError, ValueError):
            self._bus.shutdown()
        if self._lock is not None:
            os.close(self._lock)


def _by_link_alone(settings: dict[str, Any]) -> dict[str, Any]:
    """The options as python-can wants them, from the LINK only.

    Its own files (~/.canrc, ~/can.conf, /etc/can.conf) and variables (CAN_BITRATE, CAN_CONFIG) would add to them, with
    another bitrate or timing, and nobody would be told.
    """
    hidden = {name: os.environ.pop(name) for name in list(os.environ) if name.startswith("CAN_")}
    try:
        return dict(can.util.load_config(path=os.devnull, config=settings))
    finally:
        os.environ.update(hidden)


def _slcan_frame(data: bytes, can_id: int | None) -> bytes:
    """A frame for the adapter: T, identifier, length, data in hex, CR; the CR before it ends a line that is half sent."""
    return f"\rT{can_id or 0:08X}{len(data)}{data.hex().upper()}\r".encode()


def _socketcan_frame(data: bytes, can_id: int | None) -> bytes:
    """struct can_frame of Linux: identifier with the flag of 29 bits, length, padding, 8 bytes of data."""
    return struct.pack("=IB3x8s", (can_id or 0) | 0x8000_0000, len(data), data)


def _possible(message: can.Message) -> bool:
    """Whether a classic CAN frame can be like this; a damaged line of an slcan adapter may say otherwise."""
    whole = message.is_remote_frame or message.dlc == len(message.data) <= 8
    return whole and not message.is_fd and 0 <= message.arbitration_id < 1 << 29


def _lock(link: str, port: str) -> int | None:
    """Lock a serial adapter before python-can opens it: its opening alone would end the channel of who has it open.

    Returns a descriptor to keep. Raises LinkError when another program has locked it.
    """
    try:
        import fcntl
    except ImportError:
        return None  # no such locks on this system
    try:
        descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return None  # python-can will say what is wrong with it
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as exc:
        os.close(descriptor)
        raise LinkError(
            f"{link}: the port is in use by another program",
            hint="close that program, then run the command again",
            code="busy",
        ) from exc
    return descriptor
