"""The registers of one device id, over any wire: read, write, check the identity, deadlines.

`serial_bus.SerialBus` is the serial wire, `can_bus.CanBus` the CAN bus; what the bytes mean is not known here.

The first question to an id is a read upon whose bytes nobody else acts who may be there instead. Both addresses of a register
space are documented, and the sums of their requests differ: for any id one of the two is quiet, but for 3 and 13, which are
such bytes themselves. A BarrettHand that starts listens at 9600 whatever its speed, and FF opens its boot monitor: it hears
one where the line falls idle behind the beginning of a byte. At 115200 a read is shorter than one byte at 9600, which holds
all of it. At other speeds bytes ahead of the frame see to that. (A test samples the bits.)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from handctl.devices.inspire import eb90
from handctl.devices.inspire.eb90 import Frame
from handctl.errors import Aftermath, DeviceRefused, HandctlError, LinkError, NoAnswer, ProtocolError
from handctl.link import ByteLink, CanFrame, Link
from handctl.model.device import Line, harmless_to_others
from handctl.model.param import Step
from handctl.model.result import Journal
from handctl.model.stop_on_interrupt import on_early_end

if TYPE_CHECKING:
    from handctl.devices.inspire.identity import FamilyGate

Span = tuple[int, int]
"""Address and count of bytes."""

READS: dict[int, tuple[Span, ...]] = {eb90.READ: ((1472, 2), (1546, 2)), eb90.WRIST_READ: ((1024, 2), (1026, 2))}
"""Read flag -> system_voltage, position_actual (exo §2.3); the two currents (wrist §2.1).

Two bytes each: an answer is longer than its request, so an echo never passes for one.
"""


FRESH: dict[int, tuple[Span, ...]] = {
    eb90.READ: tuple((1546 + start, count) for start in (0, 2, 4, 6) for count in (4, 6, 8, 10) if start + count <= 12),
    eb90.WRIST_READ: ((1020, 6), (1020, 8), (1022, 4), (1022, 6), (1024, 4)),
}
"""Read flag -> parts of what is documented (position_actual, exo §2.3.9; wrist §2.1) that no first question asks for.

For an id that has answered: an answer to one of these is younger than that to any first question.
"""
FRESH_SHORT: dict[int, tuple[Span, ...]] = {
    eb90.READ: tuple((register + start, 2) for start in range(0, 10, 2) for register in (1582, 1594)),
    eb90.WRIST_READ: ((1022, 2), (1020, 2)),
}
"""Read flag -> the same of other registers, and no longer than a first question (force_actual and current, exo §2.3; angles, wrist §2.1).

For one that answers none of `FRESH`: it lacks that register, or answers shorter reads only.
"""


@cache
def question(device_id: int, flag: int, *, other: bool = False) -> Span:
    """What to ask an id first; `other`: what to ask besides, since a firmware may lack a register."""
    spans = READS[flag]
    quiet = [span for span in spans if harmless_to_others(eb90.read_request(device_id, *span, flag), None)]
    return (quiet or spans[:1])[-1 if other else 0]


AHEAD: dict[int | None, bytes] = {19200: bytes(1), 57600: bytes(2), 921600: bytes(32)}
"""bit/s -> what is sent before a read as long as no device has replied: it ends within a byte that this has begun, and none begins at its end."""


# -- one device id ----------------------------------------------------------------------------------------------------

FEWER = "fewer-bytes"
"""Code of an answer to our read that has fewer bytes than were asked for."""
DEFAULT_TIMEOUT = 0.3
"""Seconds of silence allowed per reply beyond wire time: USB (4 ms), FTDI latency (16 ms) and Bluetooth with room."""


TWIN_ID = "twin-id"
"""Code of a write that is refused because two devices have one id."""
POWER_OFF = "Ctrl-C does not stop the hand. To stop it, switch its power off."
"""Safety words of a calibration: no command stops one (exo §2.3.6, rh56 §9)."""


@contextmanager
def may_still_move(what: str) -> Iterator[None]:
    """If watching a movement is cut short, the error also says that it may still move."""
    try:
        yield
    except (NoAnswer, ProtocolError, LinkError) as exc:
        if exc.code != "deadline" and not exc.left.moving:
            exc.add_aftermath(
                Aftermath(f"{what} may still move", "switch the power off if a movement would be dangerous", joint=". ")
            )
        raise


BETWEEN_PROTOCOLS = 0.005
"""Silence between EB 90 and RTU on one pair (rh56 §2.5)."""
FLOOD = 1024
"""Bytes: who sends more in place of an answer talks all the time, and no other question helps."""
PATIENCE = 4
"""An answer that has begun and keeps coming may take this many timeouts in all."""
MOST = 65536
"""Bytes that are listened to, where nothing answers."""


@contextmanager
def at_speed(link: ByteLink, speed: int | None) -> Iterator[None]:
    """The port at another speed, where it can have one; None = whatever is set meanwhile. Then it has its own again."""
    was = link.baud
    if speed is not None and link.can_set_baud and was is not None:
        link.set_baud(speed)
    try:
        yield
    finally:
        if was is not None and link.can_set_baud and (speed is not None or link.baud != was):
            link.set_baud(was)


def other_speed(speed: int | None) -> int:
    """One at which nobody hears what is said at this one."""
    return 57600 if speed == 115200 else 115200


T = TypeVar("T")
Own = TypeVar("Own", bound="RegisterBus")


class LastReply:
    """The reply to the last read on a wire, as that wire keeps it; every view of it (`RegisterBus.at`) has the same. None = it is no read, or was compared.

    two  whether any read on it got two different replies
    """

    reply: Any = None
    two = False


class RegisterBus(Line, ABC):
    """The wire to the registers of one device id: what the serial bus and the CAN bus have in common.

    timeout   seconds allowed for a reply, beyond the time its bits need on the wire
    max_count longest single read in bytes
    spaces    read and write flag of each register space; `read_flag` and `write_flag` are those of the `family`
    usual     the family, where none is named
    wire      what is spoken on it: eb90, can, rtu or tcp
    gate      looks who is there before the first frame that is no read, and at what was read; None = nobody looks
    asked_first  what is asked first where a map was found or typed, None = the usual question of the register space
    across_gaps  the device may answer reads that touch undocumented bytes
    reports   the device sends the end of a save or a calibration by itself
    fewer     code of an answer that has fewer bytes than were asked for
    per       bytes at one address of the wire: 2 where the device counts words; addresses here are bytes
    round_trip   seconds that the last answer took, its bytes included
    """

    max_count: int
    spaces: ClassVar[dict[str, tuple[int, int]]]
    usual: ClassVar[str]
    gate: FamilyGate | None = None
    round_trip: float | None = None
    asked_first: Span | None = None
    reports = False
    across_gaps = True
    fewer = FEWER
    per = 1
    wire = "eb90"

    timeout: float
    usual_timeout = DEFAULT_TIMEOUT

    def __init__(self, link: Link, device_id: int, journal: Journal, *, family: str = "", **limits: Any) -> None:
        self.check_id(device_id)
        super().__init__(link, journal, **limits)
        self.id = device_id
        self.family = family or self.usual
        self.read_flag, self.write_flag = self.spaces.get(self.family) or self.spaces["hand"]
        self._last = LastReply()
        self._met: set[int] = set()  # ids that have answered a read, also through `at`

    @staticmethod
    @abstractmethod
    def check_id(device_id: int, /) -> None:
        """Refuse an id that this wire does not have. Raises UsageError."""

    @property
    def first_questions(self) -> tuple[Span, ...]:
        """What nobody else acts on, and every device with this register space answers; a firmware may lack one."""
        if self.per != 1 and self.asked_first is not None:
            return (self.asked_first,)
        return READS[self.space]

    @property
    def space(self) -> int:
        """Its register space, by the read flag that this has on a serial line."""
        wrist, _ = self.spaces.get("wrist", (None, None))
        return eb90.WRIST_READ if self.read_flag == wrist else eb90.READ

    @property
    def presence(self) -> Span:
        """The span that tells whether anybody is there; its answer is longer than its question, so an echo never passes for it."""
        return self.asked_first or self.first_questions[0]

    @property
    def serial(self) -> bool:
        """Whether it is a line whose speed this end can set as well."""
        return self.wire in ("eb90", "rtu")

    @property
    def met(self) -> bool:
        """Whether a device of this maker has answered a read here."""
        return bool(self._met)

    def again(self, journal: Journal) -> bool:
        """See Device: whether nothing is left of what was asked before."""
        return False

    @abstractmethod
    def read(self, address: int, count: int, *, retries: int | None = None) -> bytes:
        """`count` bytes from `address`. Raises UsageError, NoAnswer, ProtocolError, LinkError."""

    def read_back(self, read: Callable[[], T], right: Callable[[T], bool]) -> T:
        """What `read` finds after a write. Where a request had to be repeated, what is not `right` may be a late reply to a
        read before that write: another question is asked, whose reply comes after all late ones, then it is read again.
        """
        found = read()
        if self.journal.counters.retries and not right(found) and not self.link.replayed:
            with suppress(NoAnswer, ProtocolError):
                self.read(*self.presence)
                found = read()
        return found

    def quiet(self, address: int, count: int) -> bool:
        """Whether this read may be sent now: a device has replied, or no other device on the line would act on it."""
        return True

    def pace(self, seconds: float) -> float | None:
        """Seconds until the answer to one question, None when none came within `seconds`."""
        there = self.at()
        there.timeout = seconds
        try:
            there.read(*self.presence, retries=0)
        except NoAnswer:
            return None
        except DeviceRefused:
            pass  # an answer as well
        self.round_trip = there.round_trip
        return self.round_trip

    def listen(self, prefixes: Sequence[bytes], seconds: float) -> Frame | None:
        """Wait for a frame that the device sends later by itself; None when it does not come, or this wire has none."""
        return None

    def behind(self, address: int, count: int, seconds: float) -> bytes | None:
        """A second reply to this read; None = none, or this wire cannot show it."""
        return None

    @abstractmethod
    def write(self, address: int, data: bytes, *, acknowledged_by: Sequence[int] = ()) -> None:
        """Write `data` once; `acknowledged_by` are further ids whose acknowledgement counts, where it names one. Raises DeviceRefused; NoAnswer, ProtocolError when it is unknown whether it arrived."""

    def try_write(self, address: int, data: bytes, what: str, then: str, **more: Sequence[int]) -> HandctlError | None:
        """Write once. Without an acknowledgement, warn and return the error; `then` says what decides instead.

        Raises what kept it from being sent.
        """
        before = self.journal.counters.writes
        try:
            self.write(address, data, **more)
        except (NoAnswer, ProtocolError) as exc:
            if self.journal.counters.writes == before:
                raise
            self.journal.warn("ack-lost", f"{what} was not acknowledged ({exc.text}). {then}")
            return exc
        return None

    @abstractmethod
    def write_step(self, address: int, data: bytes, meaning: str) -> Step:
        """The exact bytes of that write."""

    @abstractmethod
    def only_reads(self, request: Any, /) -> bool:
        """Whether `request` is nothing but reads, which change no device of this maker."""

    @abstractmethod
    def addressee(self, request: bytes | CanFrame) -> int:
        """The id that `request` is for, this bus's own where it has none."""

    def pass_gate(self, request: bytes | CanFrame) -> None:
        """Called with everything before it is sent. Raises NotIdentified before a first write to a stranger, UsageError for what none may get."""
        if not self.only_reads(request):
            if self.gate is not None and self.gate.assumed and isinstance(request, bytes):
                from handctl.model.other_family_bytes import refuse_for_strangers

                refuse_for_strangers(request)
            self.at(device_id=self.addressee(request)).identify()

    def count(self, request: bytes | CanFrame) -> None:
        """Before it is sent: a line that is lost meanwhile may have taken it. Raises DeviceRefused for a first write that two devices would obey."""
        writes = not self.only_reads(request)
        if writes:
            self._refuse_two()
        self.journal.counters.sent += 1
        self.journal.counters.writes += writes

    def two_replies(self, first: object, second: object) -> bool:
        claimed = super().two_replies(first, second)
        self._last.two = self._last.two or claimed
        return claimed

    def ready_to_ask(self) -> None:
        """Before a question about a write: raise DeviceRefused where two devices would obey it, as far as that has arrived. Sends nothing."""
        replied = self._last.reply
        self.drain()
        self._last.reply = replied  # its second reply may still come
        self._refuse_two()

    def _refuse_two(self) -> None:
        """A command that has begun to write goes on: what follows may be what puts the first write right."""
        if self._last.two and not self.journal.counters.writes:
            raise DeviceRefused(
                f"{self.where}: one request got two different replies, so two devices may have this id, and both would obey the command",
                hint="unplug one of them, or stop the other program that reads the same, then run the command again. Nothing was written.",
                code=TWIN_ID,
            )

    @abstractmethod
    def drain(self) -> object:
        """Discard unread input, such as late replies. A second reply to the last read with other data is told."""

    def identify(self) -> None:
        """Identify the device unless that is done; also called before starting a process that can write on its own."""
        if self.gate is not None:
            self.gate.look(self)

    def at(self: Own, space: str = "", device_id: int | None = None) -> Own:
        """The same wire to another register space ("hand", "wrist"), or to another id."""
        other = object.__new__(type(self))  # as `copy.copy`, which takes ten times as long
        vars(other).update(vars(self))
        other.read_flag, other.write_flag = self.spaces.get(space, (self.read_flag, self.write_flag))
        other.id = self.id if device_id is None else device_id
        return other

    @property
    def where(self) -> str:
        """Device, id and link for messages."""
        return f"id {self.id} on {self.link.name}"

    @contextmanager
    def waiting(self, seconds: float) -> Iterator[None]:
        """Meanwhile so long is allowed for a reply."""
        wanted, self.timeout = self.timeout, seconds
        try:
            yield
        finally:
            self.timeout = wanted

    def on_early_end(self, what: str, hint: str) -> AbstractContextManager[None]:
        """Around one write and its follow-up: after it was sent, Ctrl-C or a lost link reports `what` is left behind."""
        return on_early_end(Aftermath(what, hint, joint=". "), since=self.journal.counters)


class ByteBus(RegisterBus):
    """A wire of bytes: what the serial line and a connection have in common."""

    link: ByteLink
    check_id = staticmethod(eb90.check_id)
    _rest = b""
    """What came behind the last accepted frame: perhaps a frame that the device sends by itself."""
    _empty = False
    """Whether unread input was discarded a moment ago."""

    @staticmethod
    def differs_again(ask: Callable[[], object], differs: Callable[[bytes], Sequence[str]]) -> Sequence[str]:
        """How what comes in place of the reply to another question differs from that; () where it is one, or nothing comes."""
        try:
            ask()
        except ProtocolError as exc:
            return differs(exc.came)
        except (NoAnswer, DeviceRefused):
            pass
        return ()

    def drain(self) -> bytes:
        """Discard unread input, such as late replies. Returns and counts it. A second reply to the last read with other data is told."""
        if self._empty:
            self._empty, self._last.reply = False, None
            return b""
        stale, self._rest = self._rest, b""
        while len(stale) <= MOST and (chunk := self.link.read(self.link.at_once)):
            stale += chunk
        self.journal.counters.stray_bytes += len(stale)
        replied, self._last.reply = self._last.reply, None
        if stale and replied is not None:
            self._look_for_second(replied, stale)
        return stale

    @abstractmethod
    def _look_for_second(self, replied: Any, data: bytes) -> None:
        """Tell where `data` has another reply to a read than `replied`, which was taken, with other values."""
