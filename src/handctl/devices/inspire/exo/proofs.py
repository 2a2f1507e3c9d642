"""What the manual of the EH55BF1 leaves open, as experiments (exo §2; dossier 4, 6, 7). See `model.proofs`."""

from __future__ import annotations

from handctl.devices.inspire import proofs

PROOFS = (
    proofs.across((1472, 151), "exo §2.2.3"),
    proofs.in_gap((1474, 2), (1558, 4), source="exo §2.3"),
    proofs.longest(1546, "exo §2.2.3"),
    proofs.reply_time("dossier 6"),
    proofs.speed_register(1001, "exo §2.3.2, RH56 §2.4"),
    proofs.set_points("position_set", "sibling, dossier 7"),
    proofs.ID_ACK,
)
