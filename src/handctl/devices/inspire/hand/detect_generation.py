"""Detect the generation of an RH56 hand: DF, TP, F1 or DG2. Read-only (rh56 §1.1).

No register holds a model. Byte maps and word maps are told apart by what is plausible in both: where one is, the other's
addresses read as nonsense. Inside the byte map an IP address shows a TP, a supply voltage and current limits a DF.
What stays open is said, and the user's word decides (`--model`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from handctl.devices.inspire import eb90
from handctl.devices.inspire.hand.register_map import DF, DG2, F1, MODELS, TP
from handctl.devices.inspire.identity import (
    BYTE_HAND,
    DG2_HAND,
    F1_HAND,
    STATES,
    TABLE,
    FamilyGate,
    IdentityCheck,
    Kind,
    is_f1,
    stranger,
    within,
)
from handctl.devices.inspire.register_bus import BETWEEN_PROTOCOLS, RegisterBus
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError

ANGLES = range(-20, 1021)
AT, IP, VOLTAGE, LIMITS = (1546, 12), (1700, 4), (1472, 2), (1020, 12)
VOLTS = range(500, 621)
"""A DF at 24 V reads 557 to 562 (rh56 §1.1)."""
F1_READS = next(sign.reads for sign in TABLE if sign.kind is F1_HAND)
KINDS = {DF: BYTE_HAND, TP: BYTE_HAND, F1: F1_HAND, DG2: DG2_HAND}
"""Generation -> who shows what it is."""
LABEL = "read the label on the hand and add --model df, tp, f1 or dg2"


class Found(NamedTuple):
    """What a look found: the device, its generation (None = open), and what shows it; `in_part`: enough to read only."""

    kind: Kind
    model: str | None
    evidence: str
    in_part: bool = False

    @property
    def words(self) -> str:
        """In words for people."""
        return MODELS[self.model] if self.model is not None else f"{self.kind.words}, generation unknown"


def detect(bus: RegisterBus, other: RegisterBus | None = None) -> Found:
    """Who answers to the id of `bus`. Raises NoAnswer, ProtocolError where nobody answers as a hand does, LinkError.

    other  a second wire of the same line: who is silent here and answers there is not asked on, which takes seconds
    """
    bus = bus.at("hand")
    bus.per = 1
    asked = IdentityCheck(bus)
    if other is not None and asked.ask("hand", STATES) is None and asked.unheard is not None and _answers(other):
        raise asked.unheard
    kind = asked.who(BYTE_HAND)
    if kind is not BYTE_HAND:
        return Found(kind, next((model for model, shown in KINDS.items() if shown is kind), None), asked.evidence)
    model, more = _of_bytes(bus, asked)
    return Found(kind, model, "; ".join(filter(None, (asked.evidence, more))), asked.in_part)


def _answers(bus: RegisterBus) -> bool:
    """Whether a hand answers there what it would have answered on the first wire as well. One that refuses the address may be
    silent to it there, and speak all the same."""
    bus.pause(BETWEEN_PROTOCOLS)
    try:
        bus.at("hand").read(*STATES, retries=0)
    except (DeviceRefused, NoAnswer, ProtocolError):
        return False
    return True


def _of_bytes(bus: RegisterBus, asked: IdentityCheck) -> tuple[str | None, str]:
    """DF or TP, and what shows it; None where a second question contradicts the first, or nothing tells the two apart."""
    angles = eb90.unpack_s16(asked.ask("hand", AT, due=True))
    if not angles or any(angle not in ANGLES for angle in angles):
        return None, f"but no angles of 0 to 1000 at {AT[0]}"
    # CAN 2.0 is spoken by DF and TP only (rh56 §2.4).
    words = [] if bus.wire == "can" else [(span[0], asked.ask("hand", span)) for span in F1_READS]
    if told := is_f1(within(words)):
        return None, f"but also {told}"
    if bus.wire == "tcp":
        return TP, "it uses Modbus TCP"
    model, shown = _df_or_tp(asked, due=False)
    return (model, shown) if model is not None else _df_or_tp(asked, due=True)


def _df_or_tp(asked: IdentityCheck, *, due: bool) -> tuple[str | None, str]:
    """Which of the two shows itself; `due`: asked with patience, since silence may be a late answer."""
    address = asked.ask("hand", IP, due=due)
    if address is not None and 1 <= address[0] <= 223 and address[0] != 127 and address[3] not in (0, 255):
        return TP, f"an IP address at {IP[0]} ({'.'.join(map(str, address))})"
    volts, limits = asked.ask("hand", VOLTAGE, due=due), eb90.unpack_s16(asked.ask("hand", LIMITS, due=due))
    counts = int.from_bytes(volts, "little") if volts is not None else 0
    if counts in VOLTS and any(limits) and all(0 <= limit <= 1500 for limit in limits):
        return DF, f"a supply of 24 V at {VOLTAGE[0]} ({counts}) and current limits at {LIMITS[0]}"
    return None, ""


class ModelGate(FamilyGate):
    """Lets frames that are no reads pass after one look: a hand, of the generation that its writes are meant for.

    typed  the generation that the user named, None = none: then only a DF or TP that shows itself is written to
    """

    def __init__(self, typed: str | None, assumed: bool) -> None:
        # what was neither looked at nor typed is not written to
        super().__init__(BYTE_HAND, assumed and typed is not None)
        self.typed = typed
        self._read_as = KINDS[typed] if typed is not None else BYTE_HAND
        self.unasked = assumed
        """Whether --assume-identity is given: whoever is there is read, by the map of bytes where none was typed."""
        self.found: Found | None = None

    def seen(self, bus: RegisterBus, other: RegisterBus | None = None) -> Found:
        """Who answers, asked once a command. See `detect`."""
        if self.found is None:
            self.found = detect(bus, other)
        return self.found

    def read(self, bus: RegisterBus, blocks: Sequence[tuple[int, bytes]]) -> None:
        """Judge what was read where a generation was typed; else it has shown itself. Raises DeviceRefused for another device."""
        if self.typed is not None and self.found is None:
            super().read(bus, blocks)

    def _refuse_read(self, bus: RegisterBus, kind: Kind, evidence: str) -> None:
        if kind.family != "hand":
            super()._refuse_read(bus, kind, evidence)
        refuse_other_generation(bus, Found(kind, None, evidence), self.typed)

    def _judge(self, bus: RegisterBus) -> None:
        found, typed = self.seen(bus), self.typed
        if found.kind.family != "hand":
            raise stranger(bus, found.kind, BYTE_HAND, found.evidence)
        refuse_other_generation(bus, found, typed)
        if found.in_part:
            raise DeviceRefused(
                f"{bus.where}: {found.words}: {found.evidence}, but no reply to the read of all its states ({STATES[0]})",
                hint="check the label on the hand. --assume-identity with --model skips this check. Nothing was written.",
                code="in-part",
            )
        if typed is None and found.model not in (DF, TP):
            raise DeviceRefused(
                f"{bus.where}: {found.words}: {found.evidence}. The same addresses do different things on another generation",
                hint=f"{LABEL}: the bytes that save on one generation reset another. Nothing was written.",
                code="model-open",
            )


def refuse_other_generation(bus: RegisterBus, found: Found, typed: str | None) -> None:
    """Raise DeviceRefused where the generation that was typed is not the one that answers."""
    if typed is None or typed == found.model or (found.model is None and KINDS[typed] is found.kind):
        return
    raise DeviceRefused(
        f"{bus.where}: --model {typed} was given, but this is {found.words}: {found.evidence}",
        hint="check the label on the hand: the same bytes do different things on another generation",
        code="other-model",
    )
