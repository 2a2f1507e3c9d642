"""The generations of RH56 hands, and their register maps: where each name lives (rh56 §1, §3). Knows no wire.

DF and TP count bytes and share a map; F1 and DG2 count words. A name means the same on all of them. Finger order
everywhere: little, ring, middle, index, thumb bend, thumb rotation; DG2 has the actuators m1 to m13.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from handctl.devices.inspire.register_map import Register
from handctl.fast_classes import fast_dataclass, replace
from handctl.model.param import COMMAND, MOVES, SETTING, TRIGGER, Number, ParamMap

DF, TP, F1, DG2 = "df", "tp", "f1", "dg2"
MODELS = {
    DF: "RH56DFX, DFQ or BFX (DF)",
    TP: "RH56DFTP or RH56E2 (TP)",
    F1: "RH56F1 (F1)",
    DG2: "RH5DG2 (DG2)",
}
"""Generation -> what is sold as it (rh56 §1)."""
LABELS = {
    "rh56dfx": DF, "rh56dfq": DF, "rh56bfx": DF, "rh56dftp": TP, "rh56e2": TP, "rh56e2-t1": TP, "rh56f1": F1, "rh56f1-e2": F1,
    "rh56f1-e4": F1, "rh56h1": F1, "rh5dg2": DG2,
}  # fmt: skip
"""The name on a label, in small letters -> generation (rh56 §1)."""

FORCE_MOST = {DF: 1000, TP: 3000}
"""Grams of a force threshold (rh56 §3.1)."""
THUMB_DEFAULT = 1500
"""Grams of the default of DF's thumb pair (rh56 §3.1)."""

FINGERS = ("little", "ring", "middle", "index", "thumb_bend", "thumb_rotation")
ACTUATORS = tuple(f"m{number}" for number in range(1, 14))
"""DG2."""

ERROR_BITS = ("locked_rotor", "over_temperature", "over_current", "motor", "communication")
"""rh56 §3.1, bit 0 first; bits 5 to 7 are undefined."""
STATUS = {
    0: "releasing", 1: "grasping", 2: "position reached", 3: "force reached", 5: "current protection", 6: "locked rotor",
    7: "fault", 8: "emergency stop", 255: "no command yet",
}  # fmt: skip
"""rh56 §3.1; 8 on F1 only (§3.2), 255 before the first command."""
NO_COMMAND = 255
"""The status code before the first command."""
RESTARTED = "it has restarted"
"""What is said of a finger that has this code behind another one."""
NO_MOVE_STATUS = frozenset({5, 6, 7, 8})
"""Status codes with which a hand is not moved (rh56 §9)."""
TOO_HOT_TO_MOVE = 70
"""°C from which on a hand is not moved: ours, no manual has a limit (rh56 §9)."""
NO_TEMPERATURE = 255
"""A temperature that is none (rh56 §1.1)."""


def too_hot(degrees: Number) -> bool:
    """Whether a hand with an actuator as warm as this is not moved."""
    return TOO_HOT_TO_MOVE <= degrees != NO_TEMPERATURE


HAND_BAUD_RATES = {0: 115200, 1: 57600, 2: 19200, 3: 921600}
"""Codes of a serial line in bit/s; 3 on TP, F1 and DG2 only (rh56 §2.1)."""
HAND_CAN_BITRATES = {0: 1_000_000, 1: 500_000}
"""The same codes on TP's CAN build (rh56 §2.1)."""
IP_ADDRESS = "ip_address"
OCTETS = ("a", "b", "c", "d")


@fast_dataclass(frozen=True, kw_only=True, eq=False)
class HandRegister(Register):
    """A register of some generations: `models` names them."""

    models: tuple[str, ...] = (DF, TP)

    @property
    def optional(self) -> bool:
        """Whether it stays out of a snapshot: a set-point, which no restore may write (rh56 §9), or not on every hand."""
        return self.kind == COMMAND or (self.models != (DF, TP) and self.per == 1)


def _row(address: int, name: str, doc: str, source: str, **more: Any) -> HandRegister:
    return HandRegister(address=address, name=name, doc=doc, source=source, **more)


_U8: dict[str, Any] = {"size": 1, "signed": False}
_SIX: dict[str, Any] = {"elements": FINGERS}
_KEPT: dict[str, Any] = {"access": "rw", "kind": SETTING, "persistent": "yes"}
_SET: dict[str, Any] = {"access": "rw", "kind": COMMAND}
_DO: dict[str, Any] = {**_U8, "access": "w", "kind": TRIGGER, "low": 1, "high": 1}
_GO: dict[str, Any] = {"access": "rw", "kind": COMMAND, "acts": MOVES, "special": {-1: "left as it is"}}
_CODES = {code: f"{rate} baud" for code, rate in HAND_BAUD_RATES.items()}
_LEFT = {-1: "left as it is"}
_WARM = {NO_TEMPERATURE: "not measured"}

# fmt: off
BYTE_MAP: ParamMap[Any] = ParamMap("hand", [
    _row(1000, "id", "id of the hand on its line, unit on Modbus", "rh56 §3.1", low=1, high=254, strands=True, verb="id", **_U8, **_KEPT),
    _row(1002, "baud_code", "speed after save and power cycle", "rh56 §3.1, §6 Q1", choices=_CODES, strands=True, verb="baud", **_U8, **_KEPT),
    _row(1004, "clear_errors", "write 1: clear all errors but over-temperature", "rh56 §3.1", verb="clear-errors", **_DO),
    _row(1005, "save", "write 1: save the present parameters to flash", "rh56 §3.1", verb="save", strands=True, **_DO),
    _row(1006, "factory_reset", "write 1: restore the factory defaults", "rh56 §3.1", verb="factory-reset", strands=True, **_DO),
    _row(1009, "calibrate_force", "write 1: calibrate the force sensors, the hand moves", "rh56 §3.1, §6 Q8", verb="calibrate", acts=MOVES, **_DO),
    _row(1020, "current_limit", "current at which an actuator protects itself", "rh56 §3.1", unit="mA", low=0, high=1500, models=(DF,), **_SIX, **_KEPT),
    _row(1032, "default_speed", "speed after power-up", "rh56 §3.1", low=0, high=1000, **_SIX, **_KEPT),
    _row(1044, "default_force", "force threshold after power-up", "rh56 §3.1", unit="g", low=0, high=3000, **_SIX, **_KEPT),
    _row(1472, "system_voltage", "supply voltage as the hand counts it", "rh56 §3.1", note="raw, 557 to 562 at 24 V", models=(DF,)),
    _row(1474, "stroke_set", "commanded stroke, 0 open to 2000 closed, -1 leaves a finger as it is", "rh56 §3.1", low=0, high=2000, **_SIX, **_GO),
    _row(1486, "angle_set", "commanded angle, 0 closed to 1000 open, -1 leaves a finger as it is", "rh56 §3.1", low=0, high=1000, **_SIX, **_GO),
    _row(1498, "force_limit", "threshold in grams at which a closing finger stops, no force that it holds", "rh56 §3.1", unit="g", low=0, high=3000, special=_LEFT, **_SIX, **_SET),
    _row(1522, "speed_set", "speed of the next movement, 0 stops", "rh56 §3.1, §6", low=0, high=1000, special=_LEFT, **_SIX, **_SET),
    _row(1534, "stroke_actual", "measured stroke, 0 open to 2000 closed", "rh56 §3.1", low=0, high=2000, **_SIX),
    _row(1546, "angle_actual", "measured angle, 0 closed to 1000 open", "rh56 §3.1", low=0, high=1000, **_SIX),
    _row(1582, "force_actual", "measured force, negative values at rest are normal", "rh56 §3.1, §6 Q5", unit="g", low=-4000, high=4000, **_SIX),
    _row(1594, "current", "actuator current", "rh56 §3.1, §6 Q6", unit="mA", low=-2000, high=2000, **_SIX),
    _row(1606, "error", "error bits", "rh56 §3.1", bits=ERROR_BITS, **_SIX, **_U8),
    _row(1612, "status", "what the finger does", "rh56 §3.1", choices=STATUS, **_SIX, **_U8),
    _row(1618, "temperature", "actuator temperature", "rh56 §3.1", unit="°C", low=0, high=100, special=_WARM, **_SIX, **_U8),
    _row(1700, IP_ADDRESS, "address of the hand on its network, after save and power cycle", "rh56 §3.1, §6", low=0, high=255, strands=True, verb="network", models=(TP,), elements=OCTETS, **_U8, **_KEPT),
])
# fmt: on
"""DF and TP (rh56 §3.1)."""
OF_BYTES = tuple(one for one in BYTE_MAP if one.models == (DF, TP))
"""What a hand that counts bytes has, whichever of the two it is."""


_WORDS = {
    "id": (1000, 1000), "baud_code": (1001, 1001), "clear_errors": (1003, 1003), "save": (1004, 1004),
    "factory_reset": (1005, 1005), "calibrate_force": (1007, 1007), "current_limit": (1016, 1024),
    "default_speed": (1022, 1038), "default_force": (1028, 1052), "stroke_set": (1034, 1066), "angle_set": (1040, 1080),
    "force_limit": (1046, 1094), "speed_set": (1052, 1108), "stroke_actual": (1058, 1122), "angle_actual": (1064, 1136),
    "force_actual": (1070, 1150), "current": (1076, 1164), "error": (1082, 1178), "status": (1088, 1192),
    "temperature": (1094, 1206), "mode": (1100, 1220),
}  # fmt: skip
"""Name -> address on F1, on DG2 (rh56 §3.2)."""
_WORD_FIELDS: dict[str, dict[str, Any]] = {
    "default_speed": {"low": 0, "high": 4000},
    "stroke_set": {"doc": "commanded stroke, -1 leaves an actuator as it is", "low": 0, "high": 2000},
    "angle_set": {"doc": "commanded angle, -1 leaves an actuator as it is", "unit": "0.1 °"},
    "speed_set": {"low": 0, "high": 4000},
    "stroke_actual": {"doc": "measured stroke"},
    "angle_actual": {"doc": "measured angle", "unit": "0.1 °"},
    "temperature": {"low": 0, "high": 100},
    "mode": {
        "doc": "0 speed and force, 1 force loop, 2 impedance",
        "access": "rw",
        "kind": SETTING,
        "acts": MOVES,
        "choices": {0: "speed and force", 1: "force loop", 2: "impedance"},
    },
}
"""What is not as on DF and TP; of what each finger has, no other limit is claimed."""


def _word_map(kind: str, which: int, elements: tuple[str, ...]) -> ParamMap[Any]:
    """The map of a generation that counts words: the same names, one word each (rh56 §3.2)."""
    rows = []
    for name, places in _WORDS.items():
        like = BYTE_MAP.get(name)
        each = like is None or bool(like.elements)
        fields: dict[str, Any] = {
            "address": 2 * places[which],
            "source": "rh56 §3.2",
            "size": 2,
            "per": 2,
            "models": (kind,),
        }
        fields |= {"elements": elements, "low": None, "high": None} if each else {}
        fields |= _WORD_FIELDS.get(name, {})
        rows.append(replace(like, **fields) if like is not None else HandRegister(name=name, **fields))
    return ParamMap("hand", rows)


F1_MAP = _word_map(F1, 0, FINGERS)
"""RH56F1 (rh56 §3.2). The limits of angles and forces differ between its three editions: none is claimed."""

DG2_MAP = _word_map(DG2, 1, ACTUATORS)
"""RH5DG2 (rh56 §3.2). Which way its angles grow is not known."""

MAPS = {DF: BYTE_MAP, TP: BYTE_MAP, F1: F1_MAP, DG2: DG2_MAP}
"""Generation -> its map."""


NEVER = {1: (range(1000, 1020), range(2000, 2326)), 2: (range(1000, 1016), range(1431, 1433), range(2160, 2163))}
"""Bytes at one address -> addresses that hold triggers, speed codes, gestures and sequences of one edition or another.
What of them is not documented is never written (rh56 §3.1, §3.3, §9)."""


def is_never_written(has: Sequence[HandRegister], unit: int, place: int) -> bool:
    """Whether this byte is not documented here, and starts something on some generation."""
    documented = any(place in register.span for register in has)
    return not documented and any(place // unit in span for span in NEVER[unit])


def model_of(text: str) -> str | None:
    """``tp``, ``RH56DFTP`` -> generation; None where the label is not known (rh56 §1)."""
    word = text.strip().casefold()
    return word if word in MODELS else LABELS.get(word)
