"""Which generation of RH56 hand answers: DF, TP, F1 or DG2. Read-only (rh56 §1.1).

No register holds a model. Byte maps and word maps are told apart by what is plausible in both: where one is, the other's
addresses read as nonsense. Inside the byte map an IP address shows a TP, a supply voltage and current limits a DF.
What stays open is said, and the user's word decides (`--model`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from handctl.devices.inspire import eb90
from handctl.devices.inspire.canbus import CanBus
from handctl.devices.inspire.hand.map import DF, DG2, F1, MODELS, TP
from handctl.devices.inspire.identity import (
    BYTE_HAND,
    DG2_HAND,
    F1_HAND,
    STATES,
    TABLE,
    Kind,
    Look,
    is_f1,
    stranger,
    within,
)
from handctl.devices.inspire.modbusbus import BETWEEN_PROTOCOLS, ModbusBus
from handctl.devices.inspire.registers import RegisterBus
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError
from handctl.model.device import Gate

ANGLES = range(-20, 1021)
AT, IP, VOLTAGE, LIMITS = (1546, 12), (1700, 4), (1472, 2), (1020, 12)
VOLTS = range(500, 621)
"""A DF at 24 V reads 557 to 562 (rh56 §1.1)."""
F1_READS = next(sign.reads for sign in TABLE if sign.kind is F1_HAND)
KINDS = {DF: BYTE_HAND, TP: BYTE_HAND, F1: F1_HAND, DG2: DG2_HAND}
"""Generation -> who shows what it is."""
LABEL = "read the label on the hand and add --model df, tp, f1 or dg2"


class Found(NamedTuple):
    """What a look found: the device, its generation (None = open), and what shows it."""

    kind: Kind
    model: str | None
    evidence: str

    @property
    def words(self) -> str:
        """In words for people."""
        return MODELS[self.model] if self.model is not None else f"{self.kind.words}, generation unknown"


def look(bus: RegisterBus, other: RegisterBus | None = None) -> Found:
    """Who answers to the id of `bus`. Raises NoAnswer, ProtocolError where nobody answers as a hand does, LinkError.

    other  a second wire of the same line: who is silent here and answers there is not asked on, which takes 7 s
    """
    bus = bus.at("hand")
    bus.per = 1
    asked = Look(bus)
    if other is not None and asked.ask("hand", STATES) is None and asked.unheard is not None and _answers(other):
        raise asked.unheard
    kind = asked.who(BYTE_HAND)
    if kind is F1_HAND:
        return Found(kind, F1, asked.evidence)
    if kind is DG2_HAND:
        return Found(kind, DG2, asked.evidence)
    if kind is not BYTE_HAND:
        return Found(kind, None, asked.evidence)
    model, more = _of_bytes(bus, asked)
    return Found(kind, model, "; ".join(filter(None, (asked.evidence, more))))


def _answers(bus: RegisterBus) -> bool:
    """Whether a hand answers there what it would have answered on the first wire as well. One that refuses the address may be
    silent to it there, and speak all the same."""
    bus.pause(BETWEEN_PROTOCOLS)
    try:
        bus.at("hand").read(*STATES, retries=0)
    except (DeviceRefused, NoAnswer, ProtocolError):
        return False
    return True


def _of_bytes(bus: RegisterBus, asked: Look) -> tuple[str | None, str]:
    """DF or TP, and what shows it; None where a second question contradicts the first, or nothing tells the two apart."""
    angles = eb90.unpack_s16(asked.ask("hand", AT, due=True) or b"")
    if not angles or any(angle not in ANGLES for angle in angles):
        return None, f"but no angles of 0 to 1000 at {AT[0]}"
    # CAN 2.0 is spoken by DF and TP only (rh56 §2.4).
    words = [] if isinstance(bus, CanBus) else [(span[0], asked.ask("hand", span)) for span in F1_READS]
    if told := is_f1(within(words)):
        return None, f"but also {told}"
    if isinstance(bus, ModbusBus) and bus.tcp:
        return TP, "it uses Modbus TCP"
    model, shown = _df_or_tp(asked, due=False)
    return (model, shown) if model is not None else _df_or_tp(asked, due=True)


def _df_or_tp(asked: Look, *, due: bool) -> tuple[str | None, str]:
    """Which of the two shows itself; `due`: asked with patience, since silence may be a late answer."""
    address = asked.ask("hand", IP, due=due)
    if address is not None and _unicast(address):
        return TP, f"an IP address at {IP[0]} ({'.'.join(map(str, address))})"
    volts, limits = asked.ask("hand", VOLTAGE, due=due), eb90.unpack_s16(asked.ask("hand", LIMITS, due=due) or b"")
    counts = int.from_bytes(volts, "little") if volts is not None else 0
    if counts in VOLTS and any(limits) and all(0 <= limit <= 1500 for limit in limits):
        return DF, f"a supply of 24 V at {VOLTAGE[0]} ({counts}) and current limits at {LIMITS[0]}"
    return None, ""


def _unicast(address: bytes) -> bool:
    """Whether four bytes can be the address of one device."""
    return 1 <= address[0] <= 223 and address[0] != 127 and address[3] not in (0, 255)


class ModelGate(Gate):
    """Lets frames that are no reads pass after one look: a hand, of the generation that its writes are meant for.

    typed  the generation that the user named, None = none: then only a DF or TP that shows itself is written to
    """

    def __init__(self, typed: str | None, assumed: bool) -> None:
        super().__init__(assumed and typed is not None)  # what was neither looked at nor typed is not written to
        self.typed = typed
        self.unasked = assumed
        """Whether --assume-identity is given: whoever is there is read, by the map of bytes where none was typed."""
        self.found: Found | None = None

    def look(self, bus: RegisterBus) -> None:
        """Look once. Raises NotIdentified, Interrupted; nothing was written then."""
        self.check(bus.link, bus.journal, lambda: self._judge(bus))

    def seen(self, bus: RegisterBus, other: RegisterBus | None = None) -> Found:
        """Who answers, asked once a command. See `look`."""
        if self.found is None:
            self.found = look(bus, other)
        return self.found

    def read(self, bus: RegisterBus, blocks: Sequence[tuple[int, bytes]]) -> None:
        """Judge what was read where a generation was typed; else it has shown itself. Raises DeviceRefused for another device."""
        if self.typed is not None and self.found is None:
            self.check_read(bus.link, bus.journal, ("hand", bus.id), lambda: self._judge_read(bus, blocks))

    def unheard(self, bus: RegisterBus, error: HandctlError) -> None:
        """The hand that carries a wrist answers as any: nobody else is left to ask."""

    def _judge_read(self, bus: RegisterBus, blocks: Sequence[tuple[int, bytes]]) -> None:
        assert self.typed is not None
        own, there, held = KINDS[self.typed], bus.at("hand"), within(blocks)
        per, there.per = there.per, 1
        asked = Look(there, lambda address, count: held(per * address, count))
        kind = asked.contradiction(own)
        if kind is None:
            return
        if kind.family != "hand":
            raise stranger(bus, kind, BYTE_HAND, asked.evidence)
        contradiction(bus, Found(kind, None, asked.evidence), self.typed)

    def _judge(self, bus: RegisterBus) -> None:
        found, typed = self.seen(bus), self.typed
        if found.kind.family != "hand":
            raise stranger(bus, found.kind, BYTE_HAND, found.evidence)
        contradiction(bus, found, typed)
        if typed is None and found.model not in (DF, TP):
            raise DeviceRefused(
                f"{bus.where}: {found.words}: {found.evidence}. The same addresses do different things on another generation",
                hint=f"{LABEL}: the bytes that save on one generation reset another. Nothing was written.",
                code="model-open",
            )


def contradiction(bus: RegisterBus, found: Found, typed: str | None) -> None:
    """Raise DeviceRefused where the generation that was typed is not the one that answers."""
    if typed is None or typed == found.model or (found.model is None and KINDS[typed] is found.kind):
        return
    raise DeviceRefused(
        f"{bus.where}: --model {typed} was given, but this is {found.words}: {found.evidence}",
        hint="check the label on the hand: the same bytes do different things on another generation",
        code="other-model",
    )
