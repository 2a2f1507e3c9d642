"""The simulators: the second book must be right by itself, and where host and simulator agree on a mistake a third book speaks."""

from tests.mistakes.table import Patch, mistake

EB90 = "handctl.devices.inspire.eb90"
SIM_FRAMES = "handctl.sim.inspire.frames"
EXO = "handctl.sim.exo.device"

ROWS = (
    mistake(
        "both-sides-sum-over-the-header",
        "same mistake on both sides",
        EB90,
        "checksum",
        "return sum(body) & 0xFF",
        "return sum(body) + 1 & 0xFF",
        also=(Patch(SIM_FRAMES, "_sum", "return total % 256", "return (total + 1) % 256"),),
    ),
    mistake(
        "both-sides-crc-begins-with-zero",
        "same mistake on both sides",
        "handctl.devices.ekso.frames",
        "_crc_function",
        'function: Callable[[bytes], int] = crcmod.predefined.mkPredefinedCrcFun("crc-ccitt-false")',
        'function: Callable[[bytes], int] = crcmod.predefined.mkPredefinedCrcFun("xmodem")',
        "tests/ekso/test_frames.py::test_the_check_value_of_the_manual",
        also=(Patch("handctl.sim.ekso.wire", "crc", "register = 65535", "register = 0"),),
    ),
    mistake(
        "both-sides-force-one-register-higher",
        "same mistake on both sides",
        "handctl.devices.inspire.map",
        "",
        '_s16(1582, "force_actual", "measured force, positive when the user closes the hand, negative when opening it", "exo §2.3.10", low=-1000, high=1000, **_FIVE),',
        '_s16(1584, "force_actual", "measured force, positive when the user closes the hand, negative when opening it", "exo §2.3.10", low=-1000, high=1000, **_FIVE),',
        also=(
            Patch(EXO, "", '(1582, 2, 5, "r", -1000, 1000),  # forces', '(1584, 2, 5, "r", -1000, 1000),  # forces'),
        ),
    ),
    mistake(
        "both-sides-wrist-angles-swapped",
        "same mistake on both sides",
        "handctl.devices.inspire.map",
        "",
        '_angle(1038, "yaw_set", "commanded yaw", _RANGE, YAW_RANGE, **_GO),\n_angle(1040, "pitch_set", "commanded pitch", _RANGE, PITCH_RANGE, **_GO),',
        '_angle(1038, "pitch_set", "commanded pitch", _RANGE, PITCH_RANGE, **_GO),\n_angle(1040, "yaw_set", "commanded yaw", _RANGE, YAW_RANGE, **_GO),',
    ),
    mistake(
        "map-address-off-by-one",
        "address off by one",
        "handctl.devices.inspire.map",
        "Register.address_of",
        "return self.address + self.size * index",
        "return self.address + self.size * index + 1",
    ),
    mistake(
        "map-register-off-by-one",
        "address off by one",
        "handctl.devices.inspire.map",
        "",
        '_u8(1606, "error", "actuator error bits", "exo §2.3.12", bits=ERROR_BITS, **_FIVE),',
        '_u8(1607, "error", "actuator error bits", "exo §2.3.12", bits=ERROR_BITS, **_FIVE),',
    ),
    mistake(
        "map-error-bits-in-another-order",
        "same fact twice",
        "handctl.devices.inspire.map",
        "",
        'ERROR_BITS = ("locked_rotor", "over_temperature", "over_current", "motor_abnormal", "communication")',
        'ERROR_BITS = ("locked_rotor", "over_current", "over_temperature", "motor_abnormal", "communication")',
    ),
    mistake(
        "sim-exo-finger-off-by-one",
        "address off by one",
        EXO,
        "Device._store",
        "self.hand.fingers[(place - 1486) // 2].target = None if value == -1 else value",
        "self.hand.fingers[(place - 1488) // 2].target = None if value == -1 else value",
    ),
    mistake(
        "sim-exo-writes-what-is-out-of-range",
        "out of range clamped",
        EXO,
        "Device._write",
        "if low <= value <= high:",
        "if value <= 2 * high:",
    ),
    mistake(
        "sim-exo-answers-any-id",
        "wrong id accepted",
        SIM_FRAMES,
        "find",
        "if head[0:1] and head[0] != device_id:",
        "if head[0:1] and head[0] == 255:",
    ),
    mistake(
        "sim-exo-takes-a-damaged-request",
        "checksum not checked",
        SIM_FRAMES,
        "find",
        "if buffer[start + size - 1] == _sum(buffer[start + 2 : start + size - 1]):",
        "if size:",
    ),
    mistake(
        "sim-gcl-wrong-pair-takes-the-rest-along",
        "swallowed error",
        "handctl.sim.barrett.gcl",
        "_pairs",
        "if code:",
        "if code and at:",
        "tests/barrett/test_hand.py::test_a_line_refused_in_its_middle_may_be_half_set",
    ),
    mistake(
        "sim-line-late-answer-in-time",
        "deadline ignored",
        "handctl.sim.engine.line",
        "Line._transmit",
        "due += self._late",
        "due += 0.0",
    ),
    mistake(
        "sim-line-answers-before-the-last-bit",
        "deadline ignored",
        "handctl.sim.engine.line",
        "Line._hearing",
        "return count, first.end_of(first.sent + count)",
        "return count, first.start",
    ),
)
