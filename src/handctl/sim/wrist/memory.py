"""The registers of a simulated wrist module, and the hand that carries it (wrist §2.1, RH56 §2.4).

The second book of registers: (address, bytes per element, elements, access, lowest, highest). Both spaces use the
addresses 1020 to 1043 for different things (wrist §2.1 against RH56 §2.4.7, §2.4.8); which one a request means is told
by its flag alone. The hand is one of `sim.hand`, with values of its own: nothing that could pass for one of the wrist.
"""

from __future__ import annotations

import struct

from handctl.sim.hand.books import Generation
from handctl.sim.hand.setup import Setup
from handctl.sim.inspire.space import Space

# wrist §2.1; angles in 0.01° with the ranges of wrist §1, currents in mA, time in ms.
WRIST = (
    (1020, 2, 1, "r", -2266, 2212),  # actual pitch
    (1022, 2, 1, "r", -2550, 2550),  # actual yaw
    (1024, 2, 1, "r", -32768, 32767),  # current of actuator #2
    (1026, 2, 1, "r", -32768, 32767),  # current of actuator #1
    (1028, 1, 1, "r", 0, 255),  # error of actuator #1
    (1030, 1, 1, "r", 0, 255),  # error of actuator #2
    (1032, 1, 1, "r", 0, 255),  # temperature of actuator #1
    (1033, 1, 1, "r", 0, 255),  # temperature of actuator #2
    (1038, 2, 1, "rw", -2550, 2550),  # yaw set value: yaw before pitch here
    (1040, 2, 1, "rw", -2266, 2212),  # pitch set value
    (1042, 2, 1, "rw", 0, 65535),  # time of a movement
)

# The hand behind the wrist, which the wrist's manual only mentions (wrist §2.3): that of RH56 §2.4, with ranges as wide as
# a register, so that a value meant for the wrist does its harm here.
_HAND = (
    (1000, 1, 1, "rw", 1, 254),  # id
    (1002, 1, 1, "rw", 0, 2),  # speed code: here at 1002
    (1004, 1, 1, "rw", 0, 1),  # clear errors
    (1005, 1, 1, "rw", 0, 1),  # save to flash
    (1006, 1, 1, "rw", 0, 1),  # factory defaults
    (1009, 1, 1, "rw", 0, 1),  # calibrate
    (1020, 2, 6, "rw", -32768, 32767),  # current limits, mA
    (1032, 2, 6, "rw", -32768, 32767),  # speeds after power-on
    (1044, 2, 6, "rw", -32768, 32767),  # forces after power-on
    (1472, 2, 1, "r", -32768, 32767),  # system voltage
    (1474, 2, 6, "rw", -32768, 32767),  # actuator strokes, set
    (1486, 2, 6, "rw", -32768, 32767),  # finger angles, set
    (1498, 2, 6, "rw", -32768, 32767),  # finger forces, set
    (1522, 2, 6, "rw", -32768, 32767),  # finger speeds, set
    (1534, 2, 6, "r", -32768, 32767),  # actuator strokes
    (1546, 2, 6, "r", -32768, 32767),  # finger angles
    (1582, 2, 6, "r", -32768, 32767),  # finger forces
    (1594, 2, 6, "r", -32768, 32767),  # actuator currents, mA
    (1606, 1, 6, "r", 0, 255),  # error bits
    (1612, 1, 6, "r", 0, 255),  # states
    (1618, 1, 6, "r", 0, 255),  # temperatures, °C
)
_PLACES = {
    "id": 1000, "speed": 1002, "clear": 1004, "save": 1005, "reset": 1006, "calibrate": 1009, "current-limit": 1020,
    "default-speed": 1032, "default-force": 1044, "voltage": 1472, "stroke-set": 1474, "angle-set": 1486, "force-set": 1498,
    "speed-set": 1522, "stroke": 1534, "angle": 1546, "force": 1582, "current": 1594, "error": 1606, "status": 1612,
    "temperature": 1618,
}  # fmt: skip
GENERATION = Generation("df", _HAND, _PLACES, full=0.8, speeds=(115200, 57600, 19200))
# What is in the hand's flash when it leaves the factory: current limits, speeds and forces after power-on.
_FACTORY: dict[str, tuple[int, ...]] = {
    "current-limit": (1501, 1502, 1503, 1504, 1505, 1506),
    "default-speed": (901, 902, 903, 904, 905, 906),
    "default-force": (401, 402, 403, 404, 405, 406),
}
KEPT = tuple(_FACTORY)
_SET = {
    "stroke-set": (1161, 1262, 1363, 1464, 1565, 1666),
    "angle-set": (161, 262, 363, 464, 565, 666),
    "force-set": (501, 502, 503, 504, 505, 506),
}
_READINGS = [  # of each finger: stroke, angle, force, current, state, temperature
    (1121, 921, -21, 41, 2, 36),
    (1133, 933, 22, 42, 1, 37),
    (1145, 945, -23, 43, 3, 38),
    (1169, 969, 24, 44, 2, 39),  # the angle as in a field capture of an RH56
    (1157, 957, -25, 45, 0, 40),
    (1181, 981, 26, 46, 5, 41),
]


def carrier() -> Setup:
    """The hand that carries the wrist: it moves at once and shows it at once, and begins as it was at every power-on."""
    return Setup(
        GENERATION,
        {**_FACTORY, **_SET},
        _READINGS,
        factory=_FACTORY,
        voltage=562,
        stays=True,
        refresh=0.0,
        dead_time=0.0,
        resets_flash=False,
        jitter=None,
    )


def power_on_wrist(space: Space) -> None:
    """Set values of the wrist after power-on; they move nothing until they are written."""
    space.memory = bytearray(len(space.memory))
    struct.pack_into("<hhH", space.memory, 1038, 1100, -300, 700)
