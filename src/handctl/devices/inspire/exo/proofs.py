"""What the manual of the EH55BF1 leaves open, as experiments (exo §2; dossier 4, 6, 7). See `model.proofs`."""

from __future__ import annotations

from handctl.devices.inspire import proofs
from handctl.devices.inspire.exo import calibration
from handctl.devices.inspire.exo.device import ExoHand
from handctl.devices.inspire.register_bus import POWER_OFF
from handctl.model.prompts import Prompts
from handctl.model.result import Table


def _calibrate(hand: ExoHand, prompts: Prompts) -> Table:
    calibration.say_steps(prompts)
    return calibration.calibrate(hand, prompts)


PROOFS = (
    proofs.across((1472, 151), "exo §2.2.3"),
    proofs.in_gap((1474, 2), (1558, 4), source="exo §2.3"),
    proofs.longest(1546, "exo §2.2.3"),
    proofs.reply_time("dossier 6"),
    proofs.speed_register(1001, "exo §2.3.2, RH56 §2.4"),
    proofs.set_points("position_set", "sibling, dossier 7"),
    proofs.supply("system_voltage", "exo §2.3"),
    proofs.ID_ACK,
    proofs.SAVE_FRAMES,
    proofs.calibration_frames(
        "calibrate", _calibrate, "no report in print (exo §2.3.6); a frame with address 2 on the RH56 (chapter 3, example 5)",
        f"{POWER_OFF} Someone has to wear the hand, and the calibration moves all fingers and replaces the present one",
    ),
)  # fmt: skip
