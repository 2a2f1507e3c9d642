"""What the manual of the wrist module leaves open, as experiments (wrist §2; dossier 4, 6). See `model.proofs`."""

from __future__ import annotations

from handctl.devices.inspire import proofs
from handctl.devices.inspire.wrist.device import Wrist
from handctl.model.proofs import Observation, Proof

HAND = (1546, 2)
"""Angles of the hand that carries the wrist."""


def _carrier(wrist: Wrist) -> Observation:
    how, data = proofs.reply(wrist.bus.at("hand"), HAND)
    return Observation(how, f"{HAND[1]} bytes at {HAND[0]} with the hand's flag: {data.hex(' ').upper() or how}")


PROOFS = (
    proofs.across((1020, 24), "wrist §2.1"),
    proofs.in_gap((1034, 4), source="wrist §2.1"),
    proofs.reply_time("dossier 6"),
    proofs.signed("current_1024", "current_1026", says="not documented (wrist §2.1)"),
    Proof("carrier", "the hand that carries the wrist answers its own flag (wrist §2.3)", proofs.ANSWERED, "a read with the hand's flag and the same id", _carrier),
)  # fmt: skip
