"""CAN through python-can: `can:INTERFACE:CHANNEL[?bitrate=…]`. The only user of python-can.

Extended data frames only; standard, remote and own frames are passed over, error frames and damaged lines counted.
What python-can's slcan interface leaves out is in slcan.py.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import struct
from typing import Any

import can

from handctl.errors import HandctlError, Hint, LinkError, NoAnswer, UsageError
from handctl.link.link_interface import BITRATE, CanFrame, Deadline, FrameLink, RawAccess, Trouble, options_in, unsent
from handctl.link.port_users import busy, refuse_held
from handctl.link.slcan import (
    AGAIN_SECONDS,
    BUS_ERROR,
    PASSIVE,
    QUEUE_FULL,
    WARNING,
    BadBitrate,
    NotAnAdapter,
    SlcanBus,
    said_flags,
)
from handctl.system import clock, serial_ports
from handctl.wording import plural

POLL_SECONDS = 0.05
"""Some back ends return early without a frame; the deadline decides, not they."""
IFF_UP = 1
"""linux/if.h."""
BUS_OFF, RESTARTED = 0x40, 0x100
"""Classes of Linux' error frames (linux/can/error.h)."""


def split_link(link: str) -> tuple[str, str, dict[str, Any]]:
    """``can:slcan:/dev/ttyACM0?bitrate=500000`` -> ("slcan", "/dev/ttyACM0", {"bitrate": 500000}). Raises UsageError."""
    body = link.removeprefix("can:").partition("?")[0]
    interface, colon, channel = body.partition(":")
    if not interface or not colon or not channel:
        raise UsageError(
            f"{link}: expected can:INTERFACE:CHANNEL",
            hint="write for example can:socketcan:can0, can:slcan:/dev/ttyACM0 or can:pcan:PCAN_USBBUS1",
        )
    options: dict[str, Any] = {"bitrate": BITRATE}
    for key, value in options_in(link, "write for example `?bitrate=1000000`").items():
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
        return Hint(f"check that {channel} is the adapter: {{}} lists the serial ports", "ports")
    return f"check the adapter, the driver of {interface}, and the channel {channel}"


NO_ACK_HINT = "check the hand's power, CAN high and low, the termination (120 ohm at both ends) and the bitrate"
ENOUGH = 20
"""Frames that show a bitrate to be right."""


class CanLink(FrameLink):
    """A bus of any python-can interface."""

    def __init__(self, link: str, *, exclusive: bool = True, listening: bool = False) -> None:
        """`listening`: an slcan adapter neither acknowledges nor sends, so that a wrong bitrate disturbs nobody."""
        self.name = link
        interface, channel, options = split_link(link)
        if listening and interface == "slcan":
            options["listen_only"] = True
        if interface == "slcan":
            # python-can waits 2 s for boards that restart when the port is opened; few do, `?sleep_after_open=2` is for those
            options.setdefault("sleep_after_open", 0.0 if "://" in channel or channel.startswith("/dev/pts/") else 0.1)
        logging.getLogger("can").setLevel(logging.CRITICAL)  # what it has to say comes back as exceptions
        if interface not in can.VALID_INTERFACES:
            raise UsageError(
                f"{link}: python-can has no interface {interface!r}",
                hint=f"use one of {', '.join(sorted(can.VALID_INTERFACES))}",
            )
        self._closed = self._gone = False
        self._interface, self._channel, self._options, self._exclusive = interface, channel, options, exclusive
        self.bitrate = options["bitrate"]
        self._open()
        self.adapter = self._slcan.adapter if self._slcan is not None else None

    def _open(self) -> None:
        """Lock the adapter, where that can be done, and open the bus. Raises UsageError, LinkError."""
        interface, channel = self._interface, self._channel
        slcan = interface == "slcan" and channel.startswith("/dev/")
        self._lock = _lock(self.name, channel) if slcan and self._exclusive else None
        try:
            self._bus = self._opened(interface, channel, self._options, meet=self._exclusive)
        except BaseException:
            self._unlock()
            raise
        self._slcan = self._bus if isinstance(self._bus, SlcanBus) else None
        self._raw_access: RawAccess | None = None
        self._counted = 0  # errors of an adapter that are in error_frames
        self._left = False  # a controller of another interface is bus off
        if self._lock is not None:
            self.held = (*self.held, self._lock)

    def reconnect(self, seconds: float) -> bool:
        """See Link. Only an adapter that is gone is looked for: one that takes no frame, or whose controller is bus off, is there,
        and so is what it has queued. Another program behind a URL stays lost, as with a serial port."""
        if "://" in self._channel or not (self._gone or self._is_gone()):
            return False
        return self.look_for(seconds, self._open_again)

    def _is_gone(self) -> bool:
        """Whether nothing can be received either."""
        try:
            self._next(0.0)
        except (can.CanError, OSError, ValueError, IndexError):
            return True
        return False

    def _open_again(self) -> bool:
        """Look once for the adapter that was lost. Raises LinkError while it is not there, or where another one is in its place."""
        self._let_go()
        try:
            self._open()
            if self._interface == "socketcan" and not _is_up(self._channel):
                raise self._down()
            if self._slcan is not None and self._slcan.adapter != self.adapter:
                raise LinkError(
                    f"{self.name}: another adapter is plugged in: {self._slcan.adapter or 'no version or serial number'}",
                    hint=f"plug in the one that was open ({self.adapter or 'no version or serial number'})",
                    code="other-adapter",
                )
        except HandctlError as exc:
            self._let_go()
            if isinstance(exc, LinkError):
                raise
            raise LinkError(exc.text, hint=exc.hint, code="cannot-open") from exc  # its options were right before
        self._gone = False
        return True

    def _opened(self, interface: str, channel: str, options: dict[str, Any], *, meet: bool) -> can.BusABC:
        """The bus of python-can. Raises UsageError, LinkError."""
        link = self.name
        try:
            return _open_bus(
                dict(interface=interface, channel=channel, receive_own_messages=False, **options), meet=meet
            )
        except BadBitrate as exc:
            raise UsageError(
                f"{link}: {exc}", hint="use a bitrate that this adapter has: add ?bitrate=N to the LINK"
            ) from exc
        except (TypeError, ValueError) as exc:
            raise UsageError(
                f"{link}: {exc}", hint="check the options after the question mark: they go to the python-can interface"
            ) from exc
        except NotAnAdapter as exc:
            raise LinkError(
                f"{link}: the port does not reply as an slcan adapter does: {exc}. Only version and serial number were asked for",
                hint=Hint(
                    "find the adapter with {}. A hand on a serial port has no can:slcan: before it. "
                    "A board that restarts when it is opened needs ?sleep_after_open=2",
                    "ports",
                ),
                code="not-slcan",
            ) from exc
        except (can.CanError, OSError, ImportError, NotImplementedError) as exc:
            if "invalid bitrate" in str(exc).lower():
                raise UsageError(f"{link}: {exc}", hint="use a bitrate that this adapter has") from exc
            raise LinkError(
                f"{link}: cannot open: {exc}",
                hint=_opening(interface, channel, options["bitrate"]),
                code="cannot-open",
            ) from exc

    def raw_access(self) -> RawAccess | None:
        """Of a Linux CAN socket, and of an slcan adapter; other back ends are inside a vendor's library."""
        codec = {"socketcan": (_socketcan_frame, _socketcan_frames), "slcan": (_slcan_frame, _slcan_frames)}
        if self._raw_access is None and self._interface in codec:
            with contextlib.suppress(can.CanError, OSError, NotImplementedError, ValueError):
                found = (
                    self._bus.fileno() if self._slcan is None else serial_ports.raw_access(self._slcan.serialPortOrig)
                )
                self._raw_access = None if found is None else RawAccess(found, *codec[self._interface])
        return self._raw_access

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        if self._raw_access is not None:
            self._raw_access.before()
        message = can.Message(arbitration_id=frame.can_id, data=frame.data, is_extended_id=True)
        try:
            self._bus.send(message, timeout=max(0.001, deadline.remaining))
        except (can.CanError, OSError, ValueError) as exc:
            raise unsent(self._not_sent(exc), self._takes_whole()) from exc

    def _takes_whole(self) -> bool:
        """Whether a frame that fails is certain not to have gone out: a socket takes it whole or not at all, and without its last byte no
        adapter sends it. What a vendor's library has done is not known."""
        return self._bus is _NO_BUS or self._interface == "socketcan" or (self._slcan is not None and self._slcan.whole)

    def _not_sent(self, exc: Exception) -> HandctlError:
        """Why a frame was not sent. Linux distinguishes a full queue from an interface that is down."""
        number = getattr(exc, "error_code", None) or getattr(exc, "errno", None)
        if number == errno.ENOBUFS:
            return NoAnswer(
                f"{self.name}: no device acknowledges, and the transmit queue is full", hint=NO_ACK_HINT, code="no-ack"
            )
        if number == errno.ENETDOWN:
            self._gone = True
            return self._down()
        return LinkError(
            f"{self.name}: the frame could not be sent: {exc}",
            hint="check the device's power, the termination (120 ohm at both ends) and the bitrate. No device acknowledged, or the adapter is gone",
            code="cannot-send",
        )

    def _down(self) -> LinkError:
        hint = _opening("socketcan", self._channel, self.bitrate or BITRATE)
        return LinkError(f"{self.name}: the CAN interface is down", hint=hint, code="down")

    def receive(self, deadline: Deadline) -> CanFrame | None:
        while True:
            try:
                message = self._next(min(POLL_SECONDS, deadline.remaining))
            except (can.CanError, OSError, ValueError, IndexError) as exc:
                raise self._lost(exc) from exc
            if self._slcan is not None:
                self._count(self._slcan)
            if message is not None and message.is_error_frame:
                self.error_frames += 1
                if self._interface == "socketcan":
                    self._left = bool(message.arbitration_id & BUS_OFF) or (
                        self._left and not message.arbitration_id & RESTARTED
                    )
            elif message is not None and not _possible(message):
                self.damaged += 1
                self.damage = "this is not a possible frame"
            elif message is not None and message.is_extended_id and not message.is_remote_frame and message.is_rx:
                return CanFrame(message.arbitration_id, bytes(message.data))
            elif message is not None and message.is_rx:
                self.passed_over += 1
            if deadline.expired:
                return None

    def _lost(self, exc: Exception) -> LinkError:
        self._gone = True
        return LinkError(
            f"{self.name}: the bus is lost: {exc}",
            hint="check the adapter's cable, then run the command again",
            code="lost",
        )

    def _next(self, seconds: float) -> can.Message | None:
        """The next frame. python-can's own `recv` uses the time of day, so it would wait longer if the clock is set back."""
        if self._slcan is not None:
            return self._slcan.recv(seconds)
        return self._bus._recv_internal(seconds)[0]  # there are no filters

    # -- what the controller reports -----------------------------------------------------------------------------

    def _count(self, bus: SlcanBus) -> None:
        """Take over what the adapter's lines came to."""
        self.damaged, self.damage = bus.damaged, bus.damage
        self.error_frames += bus.refused + bus.errors - self._counted
        self._counted = bus.refused + bus.errors

    def trouble(self, before: int = 0) -> Trouble | None:
        if self._slcan is not None:
            try:
                return self._asked(self._slcan, self.error_frames > before)
            except (can.CanError, OSError, ValueError) as exc:
                raise self._lost(exc) from exc
        with contextlib.suppress(can.CanError, OSError, ValueError, NotImplementedError):
            self._left = self._left or self._bus.state is can.BusState.ERROR
        return Trouble("bus-off", "The interface reports it") if self._left else super().trouble(before)

    def _asked(self, bus: SlcanBus, refused: bool) -> Trouble | None:
        """The adapter's status. Flags stay until they are read, so what happens now is in the second reading.

        A controller that no one answers repeats its frame: bus errors go on. One that is bus off does nothing more,
        and its queue stays full.
        """
        if bus.left:
            return Trouble("bus-off", "The adapter reports its state as bus off")
        flags = bus.flags()
        if flags is None:
            if bus.errors:
                return Trouble("no-ack", f"The adapter reports {plural(bus.errors, 'bus error')}")
            return Trouble("bel", "It does not report its status") if refused else None
        clock.sleep(AGAIN_SECONDS)
        now = bus.flags() or 0
        told = f"Its status flags are {said_flags(flags | now)}"
        if flags & BUS_ERROR and not refused and not (flags | now) & (WARNING | PASSIVE):
            return Trouble("bus-errors", told)
        if flags & (WARNING | PASSIVE | BUS_ERROR):
            if now & QUEUE_FULL and not now & BUS_ERROR:
                bus.left = True
                return Trouble("bus-off", f"{told}. Then they are {said_flags(now)}")
            return Trouble("no-ack", told)
        return Trouble("refused", told) if refused else Trouble("", told)

    def listen(self, bitrate: int, seconds: float) -> tuple[int, bool] | None:
        if not (able := self.only_listen(bitrate)):
            return None if able is None else (0, False)
        assert self._slcan is not None
        try:
            deadline, frames = self.deadline(seconds), 0
            while not deadline.expired and frames < ENOUGH:
                frames += self._slcan.recv(deadline.remaining) is not None
        except (can.CanError, OSError) as exc:
            raise self._lost(exc) from exc
        return frames, self.bus_errors()

    def only_listen(self, bitrate: int) -> bool | None:
        if self._slcan is None:
            return None
        try:
            self._slcan.tune(bitrate, listening=True)
        except ValueError:
            return False
        except (can.CanError, OSError) as exc:
            raise self._lost(exc) from exc
        return True

    def bus_errors(self) -> bool:
        try:
            flags = self._slcan.flags() if self._slcan is not None else None
        except (can.CanError, OSError, ValueError) as exc:
            raise self._lost(exc) from exc
        return bool((flags or 0) & (WARNING | PASSIVE | BUS_ERROR))

    def resume(self) -> None:
        if self._slcan is not None:
            with contextlib.suppress(can.CanError, OSError, ValueError):
                self._slcan.tune(self.bitrate or BITRATE)

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        self._shut()

    def _let_go(self) -> None:
        """Close the bus, so that nothing goes out until it is opened again."""
        self._shut()
        self._bus, self._slcan, self._raw_access = _NO_BUS, None, None

    def _shut(self) -> None:
        # An adapter that went away before us leaves nothing to release.
        with contextlib.suppress(can.CanError, OSError, ValueError):
            self._bus.shutdown()
        self._unlock()

    def _unlock(self) -> None:
        lock, self._lock = self._lock, None
        if lock is not None:
            self.held = tuple(one for one in self.held if one != lock)
            os.close(lock)


class _NoBus:
    """In place of a bus whose adapter is gone, so that nothing reaches a descriptor that is another file's by now."""

    def _fail(self, *_: object, **__: object) -> Any:
        raise can.CanOperationError("the adapter is gone")

    send = _recv_internal = fileno = _fail
    state = property(_fail)

    def shutdown(self) -> None:
        """Nothing to release."""


_NO_BUS: Any = _NoBus()


def _is_up(channel: str) -> bool:
    """Whether Linux has this network interface up; it comes back down, until somebody or a rule of the system sets it up."""
    try:
        with open(f"/sys/class/net/{channel}/flags", encoding="ascii") as file:
            return bool(int(file.read(), 16) & IFF_UP)
    except (OSError, ValueError):
        return True  # sending will tell


def _open_bus(settings: dict[str, Any], *, meet: bool) -> can.BusABC:
    """python-can's bus; ours for slcan. A stop does not query the adapter, because the replies would go to the program using it."""
    config = _by_link_alone(settings)
    if config["interface"] != "slcan":
        return can.Bus(**config, ignore_config=True)
    del config["interface"]
    try:
        return SlcanBus(meet=meet, **config)
    except can.CanInitializationError as exc:
        if isinstance(exc.__cause__, NotAnAdapter | BadBitrate):
            raise exc.__cause__ from None  # python-can wraps what goes wrong while it opens
        raise


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


def _slcan_frames(data: bytes) -> tuple[list[CanFrame], bytes]:
    """The extended data frames in lines of an adapter, and the line that has not ended; a damaged one is passed over."""
    *lines, rest = data.replace(b"\a", b"\r").split(b"\r")
    frames = []
    for line in lines:
        with contextlib.suppress(ValueError):
            if line.startswith(b"T") and len(line) >= 10:
                size = int(line[9:10], 16)
                frames.append(CanFrame(int(line[1:9], 16), bytes.fromhex(line[10 : 10 + 2 * size].decode("ascii"))))
    return frames, rest


def _socketcan_frames(data: bytes) -> tuple[list[CanFrame], bytes]:
    """The extended data frames among struct can_frame of Linux, and what is less than one."""
    frames = []
    for start in range(0, len(data) - len(data) % 16, 16):
        number, size, content = struct.unpack("=IB3x8s", data[start : start + 16])
        if number & 0xE000_0000 == 0x8000_0000:
            frames.append(CanFrame(number & 0x1FFF_FFFF, content[:size]))
    return frames, data[len(data) - len(data) % 16 :]


def _possible(message: can.Message) -> bool:
    """Whether a classic CAN frame can be like this; a damaged line of an slcan adapter may say otherwise."""
    whole = message.is_remote_frame or message.dlc == len(message.data) <= 8
    return whole and not message.is_fd and 0 <= message.arbitration_id < 1 << 29


def _lock(link: str, port: str) -> int | None:
    """Lock a serial adapter before python-can opens it, because opening it would close the channel of another program.

    Returns a descriptor to keep. Raises LinkError when another program has it open, or has locked it.
    """
    refuse_held(link, port)
    try:
        return serial_ports.lock(port)
    except OSError as exc:
        raise busy(link, []) from exc
