"""The interface of every link: a clock with deadlines, and bytes or CAN frames. Opens none."""

from __future__ import annotations

from _thread import get_ident
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, TypeVar

from handctl.errors import HandctlError, LinkError, UsageError
from handctl.fast_classes import NamedTuple
from handctl.system import clock
from handctl.wording import frame_text, plural

BITRATE = 1_000_000
"""bit/s of a CAN bus, unless told otherwise (wrist §2.3)."""


class Deadline:
    """A moment on a monotonic clock. Handed down through every wait, so that waits do not add up."""

    __slots__ = ("_now", "at")

    def __init__(self, now: Callable[[], float], at: float) -> None:
        self._now = now
        self.at = at

    @property
    def remaining(self) -> float:
        """Seconds left, never negative."""
        left = self.at - self._now()
        return left if left > 0.0 else 0.0

    @property
    def expired(self) -> bool:
        """Whether the moment has passed."""
        return self._now() >= self.at

    def earlier(self, other: Deadline | None) -> Deadline:
        """The earlier of two deadlines on the same clock."""
        return self if other is None or self.at <= other.at else other


class CanFrame(NamedTuple):
    """One extended data frame: 29-bit identifier and up to 8 bytes."""

    can_id: int
    data: bytes

    def __str__(self) -> str:
        return frame_text(self.data, self.can_id)


E = TypeVar("E", bound=HandctlError)


def unsent(error: E, certain: bool = True) -> E:
    """The error of a frame that the link did not take: the record of writes then lists it as not sent."""
    error.unsent = certain
    return error


STALE_READS = 1000
"""A device that speaks unasked has filled the input meanwhile; more than this many pieces come from one that never pauses."""


def nothing(_rest: bytes = b"") -> None:
    """Nobody needs to know."""


def plain(data: bytes, _can_id: int | None) -> bytes:
    """Bytes as they are."""
    return data


class RawAccess:
    """Access to the descriptor of a link, for a process that outlives this one (deadman.py).

    descriptor  of the system; on Windows its handle
    encode      a frame (its data, and the identifier on a CAN bus) as this link writes it
    decode      on a CAN bus: what was read -> the frames in it, and the rest; None where bytes are bytes
    baud        speed of a port in bit/s, None where there is none
    elsewhere   as of its link
    before      called before anything is written; set by the guard
    owes        called with the rest of a frame that is half sent, and with b"" once it is out; set by the guard
    """

    def __init__(
        self,
        descriptor: int,
        encode: Callable[[bytes, int | None], bytes] | None = None,
        decode: Callable[[bytes], tuple[list[CanFrame], bytes]] | None = None,
        baud: int | None = None,
        elsewhere: bool = False,
    ) -> None:
        self.descriptor = descriptor
        self.elsewhere = elsewhere
        self.encode = encode or plain
        self.decode = decode
        self.baud = baud
        self.before: Callable[[], None] = nothing
        self.note_unfinished: Callable[[bytes], None] = nothing

    def __reduce__(self) -> tuple[Any, ...]:
        """For another process: `before` and `note_unfinished` stay in this one."""
        return RawAccess, (self.descriptor, self.encode, self.decode, self.baud, self.elsewhere)


LOOK_SECONDS = 0.05
"""Between two looks for a port that was lost."""


class Link(ABC):
    """What every link has: a name, a clock, an end.

    name      as the user gave it (for messages and the JSON envelope)
    fake      True when a simulator in this process answers
    replayed  True when a transcript plays the device
    held      descriptors that keep others off the device (locks)
    observers who is told of what passes, see `transcript.observed`
    overheard whether what passes is told at all
    silenced  nothing is sent any more, see `block_sending`
    over      nothing can come any more: a transcript that has been played to its end
    guard     the child that stops the device if this process dies (`deadman`), None = none
    elsewhere it was lost and opened again for a stop: its name may lead to another device by now
    """

    name: str = ""
    fake: bool = False
    replayed: bool = False
    over: bool = False
    held: tuple[int, ...] = ()
    observers: tuple[Any, ...] = ()
    overheard: bool = False
    silenced: bool = False
    guard: Any = None
    elsewhere: bool = False

    at_once = Deadline(float, float("-inf"))
    """Over on any clock: for what has arrived, without a wait."""
    now = staticmethod(clock.now)
    """Seconds on the link's monotonic clock."""

    def wall(self) -> float:
        """The time of day now: seconds since 1970, UTC. Of a simulator on virtual time it goes with that."""
        return clock.wall()

    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass on the link's clock."""
        if seconds > 0:
            clock.sleep(seconds)

    def deadline(self, seconds: float) -> Deadline:
        """The deadline `seconds` from now."""
        return Deadline(self.now, self.now() + seconds)

    def event(self, text: str) -> None:  # noqa: B027 - only a tap records events
        """Note an event (change of baud rate, power-cycle) in the transcript, if one is recorded."""

    def raw_access(self) -> RawAccess | None:
        """Access for a second process; None where there is none: inside this process, or inside a library."""
        return None

    def discard(self) -> None:
        """Drop unread input: late replies and unsolicited messages. Raises LinkError."""
        take = getattr(self, self._comes_in)
        for _ in range(STALE_READS):
            if not take(self.at_once):
                return

    def reconnect(self, seconds: float) -> bool:
        """Open a connection that was lost again, once; what it had not delivered is dropped. False where there is none.

        Raises LinkError where it cannot be opened within `seconds`.
        """
        return False

    def reopen(self) -> bool:
        """Look once for the port that was lost, and open it as at first. False where a lost link of this kind stays lost.

        Raises LinkError while it is not there.
        """
        return False

    def look_for(self, seconds: float, reopen: Callable[[], bool]) -> bool:
        """`reopen` a port that may come back within `seconds`, as a stop needs it. Raises LinkError where it does not."""
        bound = self.deadline(seconds)
        while True:
            try:
                return reopen()
            except LinkError:
                if bound.expired:
                    raise
                self.sleep(LOOK_SECONDS)

    def power_cycle(self) -> bool:
        """Switch the device off and on. Only simulators can: False means the operator must."""
        return False

    def is_next_recorded(self, request: bytes) -> bool:
        """Whether the transcript that plays the device has this request next: a caller with a choice then sends the recorded one."""
        return False

    def block_sending(self) -> None:
        """From now on nothing is sent: a thread that tries is interrupted. The device was stopped, and must stay stopped."""
        self.silenced = True  # for what had begun to send
        setattr(self, self._goes_out, _interrupt)  # in place of the method: a check in it would cost every write

    def only_this_thread(self) -> None:
        """From now on only this thread sends and receives; any other that tries is interrupted."""
        mine = get_ident()

        def only(method: Callable[..., Any]) -> Callable[..., Any]:
            def checked(*given: Any) -> Any:
                return method(*given) if get_ident() == mine else _interrupt()

            return checked

        for name in (self._goes_out, self._comes_in):
            setattr(self, name, only(getattr(self, name)))

    _goes_out = ""
    """Name of the method that sends."""
    _comes_in = ""
    """Name of the method that receives."""

    @abstractmethod
    def close(self) -> None:
        """Release the link. May be called twice."""


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


class Trouble(NamedTuple):
    """What a CAN controller reports about the bus.

    code       "no-ack" (no device acknowledges), "bus-off" (it has left the bus), "refused" (the adapter takes no frame), "bel" (the same, and it has no status to ask for),
               "bus-errors" (frames were destroyed on the bus), "" (it was asked and reports no error)
    evidence   how that is known, for people
    """

    code: str
    evidence: str


class FrameLink(Link):
    """A CAN bus with a device on it.

    error_frames   what the controller reported: nobody acknowledges, bus off, a frame that the adapter refused
    damaged        what came from the adapter and is no frame; the last of it is `damage`, for people
    adapter        who the adapter says it is; "" where it does not, None where there is no adapter to ask
    bitrate        bit/s of this end, None where it is not known
    passed_over    whole frames of a kind that this bus does not hand over: they too show that the bitrate is right
    """

    _goes_out = "send"
    _comes_in = "receive"
    error_frames: int = 0
    damaged: int = 0
    damage: str = ""
    adapter: str | None = None
    bitrate: int | None = None
    passed_over: int = 0

    def trouble(self, before: int = 0) -> Trouble | None:
        """What the controller reports now, asked for where it can be asked; None where nothing is known.

        `before` is what `error_frames` was when the frame in question was sent.
        """
        errors = self.error_frames - before
        return Trouble("no-ack", f"The controller reports {plural(errors, 'error frame')}") if errors > 0 else None

    def listen(self, bitrate: int, seconds: float) -> tuple[int, bool] | None:
        """Only listen at this bitrate, without acknowledging: frames of others, and whether errors were seen.

        None where this interface cannot. The channel is closed then, until `resume`.
        """
        return None

    def only_listen(self, bitrate: int) -> bool | None:
        """From now on receive at this bitrate without acknowledging, until `resume`.

        False where the adapter does not have that bitrate, None where this interface cannot only listen. Raises LinkError.
        """
        return None

    def bus_errors(self) -> bool:
        """Whether the controller saw errors on the bus since this was last asked; False where it cannot be asked."""
        return False

    def resume(self) -> None:
        """Back to the bitrate of the LINK, sending and acknowledging, after `listen` or `only_listen`."""

    @abstractmethod
    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        """Queue one frame. Raises LinkError."""

    @abstractmethod
    def receive(self, deadline: Deadline) -> CanFrame | None:
        """The next extended data frame of any identifier; None on silence until `deadline`. Raises LinkError."""


class ByteLink(Link):
    """A stream of bytes to one device. Base of all byte links; also states what each must do.

    baud   current speed in bit/s, None where the link has none (TCP)
    can_set_baud   whether `set_baud` reaches the device's line
    answered   when the last answer ended, or was given up: for a protocol that needs a silence behind it, whoever asked
    """

    answered: float = float("-inf")
    _goes_out = "write"
    _comes_in = "read"
    baud: int | None = None
    can_set_baud: bool = False

    @abstractmethod
    def write(self, data: bytes, deadline: Deadline) -> None:
        """Hand all of `data` to the line before `deadline`. Raises LinkError."""

    def framing_errors(self) -> int | None:
        """Bytes without a stop bit where it should be, and breaks, that this end has counted so far: a wrong baud rate has many.

        None where they cannot be counted: on a pty, over a network, by some drivers and systems.
        """
        return None

    @abstractmethod
    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        """What has arrived, at most `size` bytes, waiting until `deadline` for the first; b"" on silence.

        Raises LinkError when the link is lost.
        """

    def set_baud(self, baud: int) -> None:
        """Change this end's speed. Raises LinkError where there is none."""
        raise LinkError(
            f"{self.name}: the baud rate of this link cannot be set",
            hint="set the baud rate on the computer that has the serial port, and run the command without --baud",
            code="baud",
        )


WITHOUT = "run the command without -n"


class NoLink(ByteLink):
    """No device: for plans that are only printed. Refuses every byte."""

    name = "(dry run)"

    def write(self, data: bytes, deadline: Deadline) -> None:
        raise LinkError("a dry run sends nothing", hint=WITHOUT)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        raise LinkError("a dry run reads nothing", hint=WITHOUT)

    def set_baud(self, baud: int) -> None:
        self.baud = baud

    def close(self) -> None:
        """Nothing to release."""


class NoFrames(FrameLink):
    """The same for CAN."""

    name = "(dry run)"

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        raise LinkError("a dry run sends nothing", hint=WITHOUT)

    def receive(self, deadline: Deadline) -> CanFrame | None:
        raise LinkError("a dry run reads nothing", hint=WITHOUT)

    def close(self) -> None:
        """Nothing to release."""


# -- URLs of pyserial, taken apart exactly as that does -----------------------------------------------------------------------------------------------


SCHEMES = ("socket", "rfc2217", "spy", "loop", "hwgrep", "alt", "cp2110")
"""Any other is refused: nobody could tell to which device it leads."""
OF_A_PORT = ("spy", "alt", "cp2110")
"""They name a port of this computer by its path."""
OF_A_HOST = ("socket", "rfc2217")


def scheme_of(link: str) -> str:
    """The scheme of a URL in small letters, "" for a LINK that is none."""
    scheme, separator, _ = link.partition("://")
    return scheme.lower() if separator else ""


def unknown_scheme(link: str, scheme: str) -> UsageError:
    """The error of a LINK whose scheme is none of SCHEMES."""
    hint = f"use tcp://, fake:// or a URL of pyserial: {', '.join(SCHEMES)}"
    return UsageError(f"{link}: {scheme}:// is not a known kind of link", hint=hint)


def usb_address(link: str) -> tuple[int, int, str]:
    """Vendor, product and serial number, "" = any, of a `usb:VID:PID[:SERIAL]`. Raises UsageError."""
    import re

    if found := re.fullmatch(r"usb:([0-9a-fA-F]{1,4}):([0-9a-fA-F]{1,4})(?::(.*))?", link, re.DOTALL):
        return int(found[1], 16), int(found[2], 16), found[3] or ""
    text = f"{link}: expected usb:VID:PID or usb:VID:PID:SERIAL, hexadecimal"
    raise UsageError(text, hint="e.g. usb:0403:6001")


def path_in(link: str) -> str:
    """The path, or COM name, of the port that a LINK names; "" where it names none, or finds one by other marks."""
    scheme = scheme_of(link)
    if not scheme:
        return "" if link.startswith(("usb:", "can:", "replay:")) else link
    if scheme not in OF_A_PORT:
        return ""
    from urllib.parse import urlsplit

    try:
        parts = urlsplit(link)
    except ValueError:
        return ""
    if scheme == "cp2110":
        return "" if parts.netloc else parts.path
    return f"{parts.netloc}{parts.path}"


def options_in(link: str, hint: str = "", *, flags: bool = False) -> dict[str, str]:
    """The options behind the ``?`` of a LINK; with `flags` a key without a value is one, too.

    Raises UsageError, with `hint`, for what is not KEY=VALUE, and for a key that is given twice: nobody knows which is meant.
    """
    options: dict[str, str] = {}
    for item in filter(None, link.partition("?")[2].split("&")):
        key, equals, value = item.partition("=")
        if not (equals or flags):
            raise UsageError(f"{link}: {item!r} is not KEY=VALUE", hint=hint)
        if key in options:
            raise UsageError(f"{link}: {key} is given twice", hint=f"give {key} once. Nothing was sent.")
        options[key] = value
    return options


def host_in(link: str) -> tuple[str, str] | None:
    """Host and port of a URL that leads to a host; None where it leads elsewhere, or says no port."""
    if scheme_of(link) not in OF_A_HOST:
        return None
    from urllib.parse import urlsplit

    try:
        parts = urlsplit(link)
        host, port = parts.hostname, parts.port
    except ValueError:
        return None
    return (host, str(port)) if host and port is not None else None
