"""What the registers of one device id are to everything above: read, write, who is there, and time; whichever wire.

`bus.Bus` is the serial wire, `canbus.CanBus` the CAN bus; what the bytes mean is not known here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from copy import copy
from typing import TYPE_CHECKING, ClassVar, TypeVar

from handctl.errors import HandctlError, Left, LinkError, NoAnswer, ProtocolError
from handctl.link import CanFrame, Deadline, Link
from handctl.model.device import Line
from handctl.model.moving import Clock
from handctl.model.param import Step
from handctl.model.result import Journal
from handctl.model.stopping import leaving

if TYPE_CHECKING:
    from handctl.devices.inspire.eb90 import Frame
    from handctl.devices.inspire.identity import FamilyGate

DEFAULT_TIMEOUT = 0.3
"""Seconds of silence allowed per reply beyond wire time: USB (4 ms), FTDI latency (16 ms) and Bluetooth with room."""


@contextmanager
def may_still_move(what: str) -> Iterator[None]:
    """Whatever keeps a movement from being watched to its end is told with: it may still move."""
    try:
        yield
    except (NoAnswer, ProtocolError, LinkError) as exc:
        if exc.code != "deadline":
            exc.leaves(
                Left(f"{what} may still move", "switch the power off if a movement would be dangerous", joint=". ")
            )
        raise


Own = TypeVar("Own", bound="RegisterBus")


class RegisterBus(Line, ABC):
    """The wire to the registers of one device id: what the serial bus and the CAN bus have in common.

    timeout   seconds allowed for a reply, beyond the time its bits need on the wire
    max_count longest single read in bytes
    spaces    read and write flag of each register space
    wire      what is spoken on it: eb90, can, rtu or tcp
    gate      looks who is there before the first frame that is no read, and at what was read; None = nobody looks
    presence  the span that tells whether anybody is there; its answer is longer than its question, so an echo never passes for it
    reports   the device sends the end of a save or a calibration by itself
    per       bytes at one address of the wire: 2 where the device counts words; addresses here are bytes
    round_trip   seconds that the last answer took, its bytes included
    """

    max_count: int
    spaces: ClassVar[dict[str, tuple[int, int]]]
    gate: FamilyGate | None = None
    round_trip: float | None = None
    presence: tuple[int, int] = (1472, 2)
    reports = False
    per = 1
    read_flag: int
    write_flag: int
    wire = "eb90"

    def __init__(
        self,
        link: Link,
        device_id: int,
        journal: Journal,
        *,
        timeout: float | None = None,
        retries: int | None = None,
        bound: Deadline | None = None,
    ) -> None:
        super().__init__(link, journal, retries=retries, bound=bound)
        self.id = device_id
        self.timeout = DEFAULT_TIMEOUT if timeout is None else timeout
        self._met: set[int] = set()  # ids that have answered a read, also through `at`

    @property
    def met(self) -> bool:
        """Whether a device of this maker has answered a read here."""
        return bool(self._met)

    @abstractmethod
    def read(self, address: int, count: int, *, retries: int | None = None) -> bytes:
        """`count` bytes from `address`. Raises UsageError, NoAnswer, ProtocolError, LinkError."""

    def quiet(self, address: int, count: int) -> bool:
        """Whether this read may be sent now: somebody has answered, or no stranger on the line would act upon it."""
        return True

    def pace(self, seconds: float) -> float | None:
        """Seconds until the answer to one question, None when none came within `seconds`."""
        there = self.at()
        there.timeout = seconds
        try:
            there.read(*self.presence, retries=0)
        except NoAnswer:
            return None
        self.round_trip = there.round_trip
        return self.round_trip

    def listen(self, prefixes: Sequence[bytes], seconds: float) -> Frame | None:
        """Wait for a frame that the device sends later by itself; None when it does not come, or this wire has none."""
        return None

    def behind(self, address: int, count: int, seconds: float) -> bytes | None:
        """What comes behind the answer to this read as another answer to it; None = nothing, or this wire cannot tell."""
        return None

    @abstractmethod
    def write(self, address: int, data: bytes, *, acknowledged_by: Sequence[int] = ()) -> None:
        """Write `data` once; `acknowledged_by` are further ids whose acknowledgement counts, where it names one. Raises DeviceRefused; NoAnswer, ProtocolError when it is unknown whether it arrived."""

    def try_write(self, address: int, data: bytes, what: str, then: str, **more: Sequence[int]) -> HandctlError | None:
        """Write once; where no acknowledgement came, that is told and returned: `then` says what decides instead.

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
    def only_reads(self, request: bytes | CanFrame) -> bool:
        """Whether `request` is nothing but reads, which change no device of this maker."""

    @abstractmethod
    def addressee(self, request: bytes | CanFrame) -> int:
        """The id that `request` is for, this bus's own where it has none."""

    def pass_gate(self, request: bytes | CanFrame) -> None:
        """Called with everything before it is sent. Raises NotIdentified before a first write to a stranger."""
        if not self.only_reads(request):
            self.at(device_id=self.addressee(request)).identify()

    def count(self, request: bytes | CanFrame) -> None:
        """Before it is sent: a line that is lost meanwhile may have taken it."""
        self.journal.counters.sent += 1
        self.journal.counters.writes += not self.only_reads(request)

    def identify(self) -> None:
        """Look who is there, unless that is done: also called before a process is made that will write by itself."""
        if self.gate is not None:
            self.gate.look(self)

    def at(self: Own, space: str = "", device_id: int | None = None) -> Own:
        """The same wire to another register space ("hand", "wrist"), or to another id."""
        other = copy(self)
        other.read_flag, other.write_flag = self.spaces.get(space, (self.read_flag, self.write_flag))
        other.id = self.id if device_id is None else device_id
        return other

    @property
    def where(self) -> str:
        """Device, id and link for messages."""
        return f"id {self.id} on {self.link.name}"

    def pause(self, seconds: float) -> None:
        """Let time pass, but not beyond the deadline of the command."""
        self.link.sleep(min(seconds, self.bound.remaining) if self.bound is not None else seconds)

    def clock(self, wait: float, refresh: float, what: str) -> Clock:
        """The time of a movement of `what` that is watched for `wait` seconds at most, every `refresh` seconds."""
        end = self.link.deadline(wait)

        def tick() -> None:
            self.pause(refresh)
            self.out_of_time(f"the arrival. {what} may still move")

        return Clock(self.link.now, lambda: end.expired, tick)

    def leaving(self, what: str, hint: str) -> AbstractContextManager[None]:
        """Around one write and what follows it: Ctrl-C, or a lost link, tells `what` that leaves behind once it was sent."""
        return leaving(Left(what, hint, joint=". "), since=self.journal.counters)

    def out_of_time(self, what: str) -> None:
        """Raise NoAnswer when --deadline, not the device, ended a wait for `what`."""
        if self.over:
            raise NoAnswer(
                f"{self.where}: --deadline ended the wait for {what}. The result is not known",
                hint="read the values before you repeat the command. A longer --deadline waits for the end",
                code="deadline",
            )
