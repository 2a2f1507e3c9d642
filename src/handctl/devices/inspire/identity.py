"""Identify the device: an EH55BF1, a wrist module, or a hand of the same maker. Read-only (inspire §4.15, rh56 §1.1).

One frame is spoken by all of them, and the same bytes mean another thing to each: before the first frame of a command
that is no read, a gate asks. What is read is judged by itself where it can be, else by one question more, once a session.
Judged is what is answered; an echo, silence and zeros prove nothing. No register holds a model: where nothing speaks
against the family that was typed, it is the user's word.

Two devices with one id hear each question. Their answers come together and damage each other, but for what both hold alike:
then the id itself arrives whole and readings do not. Or they come one behind the other, and differ. Two that read the same at
each moment cannot be told from one (inspire §4.14).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from handctl.devices.inspire import eb90
from handctl.devices.inspire.register_bus import READS, RegisterBus, Span
from handctl.errors import OTHER_DEVICE, DeviceRefused, HandctlError, NoAnswer, ProtocolError
from handctl.fast_classes import NamedTuple
from handctl.model.device import Gate
from handctl.model.result import hex_bytes

At = Callable[[int, int], bytes | None]
"""(address, count) -> the bytes there, None where they were not read."""

FACTOR = 3.0
"""A sibling has so many round trips of this link to answer ..."""
LEAST = 0.010
"""... and so many seconds at least, for a host that is busy; never more than the silence allowed per reply."""

DAMAGED = ("bad-checksum", "cut-short")
"""What a valid answer turns into on a disturbed line."""
AT_WORK_TIMES, AT_WORK_SECONDS = 4, 0.1


def at_work(error: HandctlError) -> bool:
    """Whether a refusal passes, and says nothing about who refuses."""
    if not error.code.startswith("modbus-"):
        return False
    from handctl.devices.inspire.modbus_frames import PASSING

    return error.code in {f"modbus-{code}" for code in PASSING}


# -- what shows whom ----------------------------------------------------------------------------------------------

STATES = (1606, 18)
"""Errors, status codes, temperatures: six each on a hand; on the exo five errors and five temperatures are documented."""
STATUS, ROTATION = (1612, 6), (1623, 1)
SPEEDS, STROKES = (1522, 12), (1534, 12)
"""Six of each on a hand; the EH55BF1 documents none."""
SIXTH_ERROR = (1611, 1)
UNSET = 0xFF
"""In all of them: it proves no more than zeros do."""
STATUS_CODES = frozenset((0, 1, 2, 3, 5, 6, 7, 255))
"""RH56: 4 is undefined, 255 is what a hand shows before its first command (rh56 §3.1)."""
WARM = frozenset((*range(5, 111), 255))
"""Temperatures in °C that an actuator can have, and the mark of one that is not measured (rh56 §1.1)."""


ITS_CURRENT = READS[eb90.WRIST_READ][0]
"""A current of a wrist. Its angles lie at 1020: FC 03, and 03 ends a movement of a BarrettHand (`register_bus.question`)."""


def is_wrist(at: At) -> str:
    """Only a wrist module has registers behind flag 30 (wrist §2.2)."""
    replies = [span for span in READS[eb90.WRIST_READ] if at(*span) is not None]
    return "the wrist's flag (30, on CAN 4) gets a reply" if replies else ""


def is_six_wide(at: At) -> str:
    """A sixth finger where the EH55BF1 documents none: status codes, and the temperature of the thumb's rotation."""
    told = []
    codes, warm = at(*STATUS), at(*ROTATION)
    if set(at(*STATES) or b"") == {UNSET}:
        return ""  # a server that knows none of these addresses
    if codes and any(codes) and set(codes) <= STATUS_CODES:
        told.append(f"six status codes at {STATUS[0]} ({hex_bytes(codes)})")
    if warm and warm[0] in WARM:
        told.append(f"a temperature of the thumb rotation at {ROTATION[0]} ({warm[0]} °C)")
    speeds, strokes = eb90.unpack_s16(at(*SPEEDS)), eb90.unpack_s16(at(*STROKES))
    if any(speeds) and any(strokes) and max(map(abs, speeds)) <= 1000 and max(map(abs, strokes)) <= 2100:
        told.append(f"six speeds at {SPEEDS[0]} and six strokes at {STROKES[0]}")
    return " and ".join(told)


def is_five_wide(at: At) -> str:
    """Temperatures of five fingers: an EH55BF1 for all that is known, where nothing speaks against it (exo §2.3.13)."""
    warm = at(1618, 5)
    return f"five temperatures ({', '.join(map(str, warm))} °C)" if warm and set(warm) - {0, UNSET} else ""


def is_f1(at: At) -> str:
    """RH56F1 counts words: angles of 50 to 180 degrees, status codes and temperatures, all three (rh56 §1.1)."""
    angles, states = eb90.unpack_s16(at(1064, 12)), eb90.unpack_s16(at(1088, 24))
    codes, warm = states[:6], states[6:]
    good = len(angles) == len(warm) == 6 and all(500 <= angle <= 1800 for angle in angles)
    good = good and all(0 <= code <= 8 for code in codes) and all(10 <= degrees <= 90 for degrees in warm)
    return (
        f"angles at 1064 ({', '.join(map(str, angles))}), status and temperatures behind them, as words" if good else ""
    )


def is_dg2(at: At) -> str:
    """RH5DG2 counts words and has 13 actuators: angles and temperatures (rh56 §1.1)."""
    angles, warm = eb90.unpack_s16(at(1136, 26)), eb90.unpack_s16(at(1206, 26))
    good = len(angles) == len(warm) == 13 and any(angles) and all(10 <= degrees <= 90 for degrees in warm)
    return f"13 temperatures at 1206 ({', '.join(map(str, warm))} °C) and 13 angles at 1136, as words" if good else ""


NOT_SHOWN = "not-shown"
"""Code of a device that answers, and does not show which one it is."""
UNHEARD = (NoAnswer.default_code, "echo")
"""Codes of a device that has not understood the question: silence, or only our own bytes."""


class Kind(NamedTuple):
    """What a device is: family of a scan's row, words for people, the command that fits, and the wires that carry it."""

    family: str
    words: str
    command: str
    wires: tuple[str, ...]


class Sign(NamedTuple):
    """One row of the table: what is read, in which register space, what it shows, and who that is."""

    space: str
    reads: tuple[Span, ...]
    shows: Callable[[At], str]
    kind: Kind


EXO = Kind("exo", "an EH55BF1 exoskeleton hand", "handctl exo", ("eb90",))
WRIST = Kind("wrist", "a wrist module with its hand", "handctl wrist", ("eb90", "can"))
BYTE_HAND = Kind("hand", "an RH56 hand (byte addresses)", "handctl hand", ("eb90", "can", "rtu", "tcp"))
F1_HAND = Kind("hand", "an RH56F1 hand (word addresses)", "handctl hand", ("eb90", "rtu"))
DG2_HAND = Kind("hand", "an RH5DG2 hand (word addresses)", "handctl hand", ("eb90", "rtu"))


TABLE = (
    Sign("wrist", (ITS_CURRENT,), is_wrist, WRIST),
    Sign("hand", (STATES,), is_six_wide, BYTE_HAND),
    Sign("hand", (STATES,), is_five_wide, EXO),
    Sign("hand", ((1618, 5),), is_five_wide, EXO),  # a device that is silent where a read touches undocumented bytes
    Sign("hand", ((1064, 12), (1088, 24)), is_f1, F1_HAND),
    Sign("hand", ((1136, 26), (1206, 26)), is_dg2, DG2_HAND),
)
"""In the order of their weight: a hand that carries a wrist shows both, an EH55BF1 only what every hand shows."""
MORE_WRIST = (Sign("wrist", READS[eb90.WRIST_READ][1:], is_wrist, WRIST),)
"""For one that does not have the first of them."""
PARTS = (
    Sign("hand", ((1618, 6),), is_six_wide, BYTE_HAND),
    Sign("hand", ((SPEEDS[0], SPEEDS[1] + STROKES[1]),), is_six_wide, BYTE_HAND),
)
"""Enough to read from a hand that does not answer the read of all its states; nothing is written to it."""


SIX_FINGERS = "this is not an EH55BF1 but a hand with six actuators (an RH56, or the hand of a wrist module)"
SIX_HINT = "use `handctl hand` for the hand itself, `handctl wrist` for a wrist on it"
"""For commands that read and ask nothing more: the bytes of a hand do not tell whether it carries a wrist."""

# -- looking ------------------------------------------------------------------------------------------------------


class IdentityCheck:
    """One identity check of the id of `bus`: the family's own request first, then requests that could contradict it.

    held  what was read there already, in its own space: that is not asked for again; None = nothing
    """

    def __init__(self, bus: RegisterBus, held: At | None = None) -> None:
        self._bus = bus
        self._held = held
        self._memory: dict[tuple[str, Span], bytes | None] = {}
        self._failure: HandctlError | None = None
        self._heard = False
        self._patiently: set[tuple[str, Span]] = set()
        self.evidence = ""
        self.in_part = False
        """Whether only a part shows who it is: enough to read."""

    def proves(self, kind: Kind) -> bool:
        """Whether what was read shows this kind, and not the silence to what would have shown another one."""
        assert self._held is not None
        return kind is not EXO or self._held(*STATES) is not None or self._memory.get(("hand", STATES)) is not None

    def hand(self, unheard: HandctlError) -> Kind | None:
        """Whose hand answers its own flag where the wrist's was `unheard`, twice; None = nobody's, or that of a wrist."""
        self._failure = unheard
        try:
            kind = self.shown_by(TABLE[1:3])
            if kind is None and any(self._memory.values()):
                kind = self.shown_by(TABLE[3:])
            return None if kind is None or self.shown_by(TABLE[:1]) is not None else kind
        except (NoAnswer, ProtocolError):
            return None

    def who(self, own: Kind) -> Kind:
        """The kind of device. Raises NoAnswer, ProtocolError without a valid reply of one of these, LinkError."""
        self.evidence = ""
        wrist, states, more = TABLE[:1], TABLE[1:3], TABLE[3:]
        if own in (F1_HAND, DG2_HAND) and (kind := self.shown_by([sign for sign in TABLE if sign.kind is own])):
            return kind
        if (
            own.family == BYTE_HAND.family
        ):  # with a wrist on it or not: it is the hand's own flag that is asked and written
            kind = self.shown_by(states)
            if self._nobody():
                assert self._failure is not None
                raise self._failure
        elif own is WRIST:  # flag 30 is nobody else's: its answer is enough
            kind = self.shown_by(wrist) or (self.shown_by(MORE_WRIST) if self._silent else None)
            if kind is None and self._silent:
                self.evidence = "there is no reply to the wrist's flag (30, on CAN 4)"
                kind = self.shown_by(states)
        else:
            kind = self.shown_by(states)
            if kind is not None or self._silent:
                kind = self.shown_by(wrist) or kind
        if kind is None and self._silent and own.family == BYTE_HAND.family:
            kind = self.shown_by(PARTS)
            self.in_part = kind is not None
        if kind is None and self._silent:
            kind = self.shown_by(more)
            if kind is None and own.family == BYTE_HAND.family:
                kind = self.shown_by(more, due=True)
        if kind is None:
            raise self._not_shown() or self._failure or self._unknown()
        return kind

    def _not_shown(self) -> ProtocolError | None:
        """The error of a device that answers a first question, and not those that show which one it is; None where nobody does."""
        if (
            self._failure is None
            or self._failure.code not in (NoAnswer.default_code, self._bus.fewer)
            or self._bus.over
        ):
            return None
        spans = self._bus.at("hand").first_questions
        came = [f"{span[0]}: {hex_bytes(data)}" for span in spans if (data := self.ask("hand", span)) is not None]
        if not came:
            return None
        return ProtocolError(
            f"{self._bus.where}: a device replies ({'; '.join(came)}), but not to the reads that show which one it is",
            hint="check the label on the device, then add --model to read a hand. --assume-identity skips this check",
            code=NOT_SHOWN,
        )

    @property
    def _silent(self) -> bool:
        """Whether asking on makes sense: zeros, silence, a refused address, our own bytes. What else came is a stranger's, or destroyed."""
        failure = self._failure
        return failure is None or isinstance(failure, DeviceRefused) or failure.code in (*UNHEARD, self._bus.fewer)

    def _nobody(self) -> bool:
        """Whether no byte comes at all: neither for a first question to a map of bytes nor for that to each map of words.

        What is then asked of a hand that lacks one register or another has no reply either.
        """
        if self._failure is None or self._failure.code != NoAnswer.default_code or self._heard:
            return False
        for span in self._bus.first_questions:
            self.ask("hand", span)
        for sign in TABLE[4:]:
            if self._bus.wire in sign.kind.wires and not self._heard:
                self.ask(sign.space, sign.reads[0], due=True)
        return not self._heard

    @property
    def unheard(self) -> HandctlError | None:
        """Why the first question was not understood by anybody: silence, or only our own bytes."""
        failure = self._failure
        return failure if failure is not None and failure.code in UNHEARD else None

    def shown_by(self, signs: Collection[Sign], *, due: bool = False) -> Kind | None:
        """Whom the first of `signs` shows that shows anything. `due`: see `ask`."""
        for sign in signs:
            if self._bus.wire not in sign.kind.wires:
                continue
            blocks: list[tuple[int, bytes | None]] = []
            for span in sign.reads:
                blocks += [(span[0], self.ask(sign.space, span, due=due))]
            shown = sign.shows(within(blocks))
            if shown:
                self.evidence = "; ".join(filter(None, (shown, self.evidence)))
                return sign.kind
        return None

    def ask(self, space: str, span: Span, *, due: bool = False) -> bytes | None:
        """One question, asked once in a look; the first as often as any read. None where no valid answer came.

        due  it gets the patience of any read, and is asked again where it was silent: a busy computer hears late
        """
        known = self._memory.get((space, span))
        if known is not None or ((space, span) in self._memory and (not due or (space, span) in self._patiently)):
            return known
        bus = self._bus.at(space)
        if self._held is not None and bus.read_flag == self._bus.read_flag and (data := self._held(*span)) is not None:
            return data
        first = not self._memory and self._held is None and self._failure is None
        if not (first or due) and self._bus.round_trip is not None:
            bus.timeout = min(bus.timeout, max(LEAST, FACTOR * self._bus.round_trip))
        data, started = None, bus.link.now()
        try:
            retries = None if first or due else int(self._held is not None)
            for left in reversed(range(AT_WORK_TIMES)):  # who is at work is asked again
                try:
                    data = bus.read(*span, retries=retries)
                    break
                except DeviceRefused as exc:
                    if not at_work(exc) or not left:
                        raise
                    bus.pause(AT_WORK_SECONDS)
            self._heard = True
            if first and bus.link.now() - started > bus.timeout:
                self._confirm(bus)
        except (NoAnswer, ProtocolError, DeviceRefused) as exc:
            self._heard = self._heard or exc.code != NoAnswer.default_code
            if exc.code == "late" or at_work(exc) or self._bus.over:
                raise  # --deadline has passed: nothing that was not answered shows anything
            if first:
                self._failure = exc
            elif exc.code in DAMAGED:
                data = self._again(space, span)
        if first:
            self._bus.round_trip = bus.round_trip
        self._memory[space, span] = data
        self._patiently |= {(space, span)} if first or due else set()
        return data

    def _again(self, space: str, span: Span) -> bytes | None:
        """Try again with the timeout and retries of any read: a device may have replied to a request that only a sibling answers."""
        try:
            return self._bus.at(space).read(*span)
        except (NoAnswer, ProtocolError, DeviceRefused) as exc:
            if exc.code in DAMAGED and exc.code != self._bus.fewer:
                raise
            return None  # fewer bytes each time are what it has, as its silence is

    def _confirm(self, bus: RegisterBus) -> None:
        """An answer after silence may be a late one to the first question: then what is written is not seen in time."""
        wrist, _ = bus.spaces.get("wrist", (None, None))
        span = (1022, 2) if bus.read_flag == wrist else (1618, 5)
        try:
            bus.read(*span, retries=0)
        except NoAnswer as exc:
            raise NoAnswer(
                f"{bus.where}: replies take longer than {bus.timeout:g} s, or are sometimes missing",
                hint=f"run the command again with --timeout {max(1.0, 4 * bus.timeout):g}",
                code="late",
            ) from exc

    def _unknown(self) -> ProtocolError:
        came = "; ".join(f"{span[0]}: {hex_bytes(data)}" for (_, span), data in self._memory.items() if data)
        return ProtocolError(
            f"{self._bus.where}: the device replies, but not like a known Inspire device ({came})",
            hint="check the label on the device. --assume-identity skips this check",
            code="unknown-device",
        )


def within(blocks: Collection[tuple[int, bytes | None]]) -> At:
    """What lies in blocks that were read: (address, bytes) each."""

    def at(address: int, count: int) -> bytes | None:
        for start, data in blocks:
            if data is not None and start <= address and address + count <= start + len(data):
                return data[address - start : address - start + count]
        return None

    return at


class FamilyGate(Gate):
    """The gate before frames that are not reads: one identity check. `own` is the family that was typed."""

    def __init__(self, own: Kind, assumed: bool) -> None:
        super().__init__(assumed)
        self._own = self._read_as = own
        self._sought = False  # a hand without a wrist: once a command

    def look(self, bus: RegisterBus) -> None:
        """Look once. Raises NotIdentified, Interrupted; nothing was written then."""
        self.check(bus.link, bus.journal, lambda: self._judge(bus))

    def read(self, bus: RegisterBus, blocks: Sequence[tuple[int, bytes]]) -> None:
        """Judge what was read in the space of `bus`. Raises DeviceRefused where it proves another device."""
        who, met = (self._own.family, bus.id), bus.journal.line.met
        if self.passed or who in met:
            return
        if self.assumed:
            self.tell(bus.journal)
        elif self._own is not WRIST:  # nobody else has answered to its flag
            own, there, known = self._read_as, bus.at("hand"), within(blocks)
            per, there.per = there.per, 1
            held: At = known if per == 1 else lambda address, count: known(per * address, count)
            if own is EXO:  # five fingers, and what would have shown a sixth was read
                sixth = held(*STATUS) and (held(*ROTATION) or (held(*SPEEDS) and held(*STROKES)))
                fits = bool(sixth and is_five_wide(held) and not is_six_wide(held))
            else:
                fits = any(one.kind is own and one.shows(held) for one in TABLE)
            if not fits:
                look, kind = IdentityCheck(there, held), own
                try:
                    if own is not EXO or look.shown_by(TABLE[1:3]) is not EXO:  # enough for what only reads
                        kind = look.who(own)
                except (NoAnswer, ProtocolError):
                    pass  # nobody else is proved
                except HandctlError as exc:
                    if not bus.link.replayed or exc.code != "replay-miss":
                        raise
                if kind is not own and look.proves(kind):
                    self._refuse_read(bus, kind, look.evidence)
        met.add(who)

    def _refuse_read(self, bus: RegisterBus, kind: Kind, evidence: str) -> None:
        """Raise DeviceRefused: what was read proves this kind."""
        raise stranger(bus, kind, self._own, evidence)

    def unheard(self, bus: RegisterBus, error: HandctlError) -> None:
        """After an `error` of a read: raise DeviceRefused where a hand without a wrist answers what it hears."""
        if self._own is not WRIST or error.code not in UNHEARD or self._sought or self.passed or self.assumed:
            return
        if (self._own.family, bus.id) in bus.journal.line.met or bus.link.replayed or bus.over:
            return
        self._sought = True
        look = IdentityCheck(bus)
        if (kind := look.hand(error)) is not None:
            look.evidence = f"{look.evidence}, and there is no reply to the wrist's flag (30, on CAN 4)"
            raise stranger(bus, kind, self._own, look.evidence) from error

    def _judge(self, bus: RegisterBus) -> None:
        look = IdentityCheck(bus)
        kind = look.who(self._own)
        if kind.family != self._own.family:
            raise stranger(bus, kind, self._own, look.evidence)


def stranger(bus: RegisterBus, kind: Kind, own: Kind, evidence: str) -> DeviceRefused:
    """The error of a device of another kind, with the command that fits."""
    return DeviceRefused(
        f"{bus.where}: this is {kind.words}, not {own.words}: {evidence}",
        hint=f"use `{kind.command}`, the command for it. --assume-identity skips this check, if you are sure which device it is",
        code=OTHER_DEVICE,
    )
