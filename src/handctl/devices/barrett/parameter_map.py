"""The parameter map of the BarrettHand: mnemonic, name, range, defaults, precautions (barrett §5.3, §5.4).

Values are the hand's own integers; the unit says what one count is. And what else is so of every hand. Knows no wire.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property, partial
from operator import attrgetter
from typing import Any

from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.gcl.status_codes import STATUS_CODES
from handctl.errors import UsageError
from handctl.fast_classes import fast_dataclass
from handctl.model.param import SETTING, Element, Number, Param, ParamMap, scale_of

FINGERS = MOTORS[:3]
NO_GAUGE = 255
"""SG of a motor without a strain gauge: never a strain (§5.3.2)."""
OFF = 255
"""From here on a strain limit is off (§5.3.1)."""
STROKE = (17500, 3100)
"""Counts of one stroke of a finger and of the spread (barrett §7.3)."""
TRAVEL = (17800, 3150)
"""Counts between the joint stops of a finger and of the spread, approximately (§5.3.2 P)."""
SENSIBLE_LIMIT = 300
"""OTEMP in 0.1 °C below which it was most likely meant in °C: every movement fails (§5.4.1)."""
BEYOND = 500
"""Counts by which a position may lie outside the travel: fingers differ by tens, HI shifts the origin by IOFF <= 500."""
POSITIONS = ("P", "BP")
SPEEDS = (9600, 38400, 19200, 4800, 2400, 1200, 600)
"""Probing order: factory speed first, then the most likely."""
BAUD_CODES = {speed // 100: f"{speed} bit/s" for speed in sorted(SPEEDS)}


def quickest_opening(index: int, ivel: int | None) -> int:
    """The velocity, in 1/16 count per sample, above which a motor must not open: its IVEL, and never more than the factory's (§5.3.4)."""
    usual = BARRETT.by_mnemonic("IVEL").default_of(index) or 0
    return usual if ivel is None else min(ivel, usual)


@fast_dataclass(frozen=True, kw_only=True, eq=False)
class GclParam(Param):
    """A Param with its GCL mnemonic.

    default    factory value of fingers and spread (globals: twice the same), None for read-only
    advanced   shown only by FLISTA and its like (§5.3.4, §5.4.3)
    careful    (lowest, highest) beyond which --force is needed, for fingers and spread
    why        what happens beyond; `why_less` what happens below, where that is something else
    since      first firmware that has it
    """

    mnemonic: str
    default: tuple[int, int] | None = None
    advanced: bool = False
    careful: tuple[tuple[int, int], tuple[int, int]] | None = None
    why: str = ""
    why_less: str = ""
    since: str = ""

    @property
    def optional(self) -> bool:
        """Parameters of later firmware."""
        return bool(self.since)

    @property
    def is_global(self) -> bool:
        """A hand-wide parameter (PGET, PSET) rather than one per motor (FGET, FSET)."""
        return not self.elements

    @cached_property
    def alarms(self) -> Mapping[int, str]:
        """The codes of the status, whose sum it is (barrett §5.1.3, T3)."""
        return {code: f"{text} ({code})" for code, (text, _) in STATUS_CODES.items()} if self.mnemonic == "S" else {}

    def parse(self, text: str, where: str = "") -> Number:
        try:
            return super().parse(text, where)
        except UsageError as exc:
            # Whoever types 60.5 means degrees, not tenths: say what it would be, and do not guess.
            digits = text.strip().removeprefix("-")
            scale = scale_of(self.unit or "")
            if scale is not None and digits.count(".") == 1 and digits.replace(".", "").isdecimal():
                wanted = float(text) * scale.over / scale.times
                exc.text = f"{where or self.name} takes a whole number of {self.unit}, not {text}"
                if wanted == round(wanted):
                    exc.hint = f"{float(text):g} {scale.unit} is {self.name}={wanted:.0f}. {exc.hint}"
            raise

    def default_of(self, index: int) -> int | None:
        """Factory value for motor `index` (0..2 fingers, 3 spread)."""
        return None if self.default is None else self.default[1 if index == 3 else 0]

    def objection(self, index: int, value: Number) -> str | None:
        """Why this value needs --force, None if it does not."""
        if self.careful is None:
            return None
        low, high = self.careful[1 if index == 3 else 0]
        if low <= value <= high:
            return None
        shown = f"{value} ({value / 10:.1f} °C)" if self.unit == TENTHS else f"{value}"
        return f"{self.mnemonic} = {shown}: {self.why_less if value < low and self.why_less else self.why}"


def _global(
    mnemonic: str, name: str, doc: str, source: str, low: int | None, high: int | None, **more: Any
) -> GclParam:
    return GclParam(mnemonic=mnemonic, name=name, doc=doc, source=f"barrett §{source}", low=low, high=high, **more)


_motor = partial(_global, elements=MOTORS)


TENTHS = "0.1 °C"
_USEFUL: dict[str, Any] = {
    "careful": ((0, 18000), (0, 3150)),
    "why": "beyond the joint's travel, about 18,000 counts and 3150 for the spread",
}
"""§5.3.1, §5.3.4: "its true range of useful values is bounded by the joint limits"."""
_RW: dict[str, Any] = {"access": "rw", "kind": SETTING, "persistent": "yes"}
_OFF = {255: "off", 256: "off"}
_ADV: dict[str, Any] = {**_RW, "advanced": True}


class GclMap(ParamMap[GclParam]):
    """Finds by readable name or mnemonic in any case, elements by F1, 1, S …; one value may set all motors."""

    def __init__(self, kind: str, params: Sequence[GclParam], texts: Sequence[GclParam]) -> None:
        super().__init__(kind, params, texts)
        self._by_mnemonic = {param.mnemonic: param for param in self.every}

    def by_mnemonic(self, mnemonic: str) -> GclParam:
        """The parameter with this mnemonic."""
        return self._by_mnemonic[mnemonic]

    def elements(self, *names: str, motors: Collection[int] = range(4)) -> list[Element]:
        """What is read of these mnemonics, of some motors only."""
        every = [element for name in names for element in self._by_mnemonic[name].each]
        return [one for one in every if not one.param.elements or one.index in motors]

    def find(self, name: str) -> tuple[GclParam, Sequence[Element]]:
        base, dot, part = name.partition(".")
        param = self._by_mnemonic.get(base.upper())
        if param is not None:
            base = param.name
        element = {"1": "F1", "2": "F2", "3": "F3", "4": "SPREAD", "S": "SPREAD"}.get(part.upper(), part.upper())
        return super().find(f"{base}.{element}" if dot else base)

    def assignments_on(self, texts: Sequence[str], motors: Sequence[str]) -> list[tuple[Element, Number]]:
        """Like `assignments`; one value without a motor goes to all of `motors`, as GCL has it (§5.2.2)."""
        spread_out = []
        for text in texts:
            name, equals, value = text.partition("=")
            if equals and "." not in name and "," not in value:
                param, elements = self.find(name)
                if not param.is_global:
                    spread_out += [f"{name}.{e.part}={value}" for e in elements if e.part in motors]
                    continue
            spread_out.append(text)
        return self.assignments(spread_out)


_KNOWN_FLAG: dict[str, Any] = {**_RW, "choices": {0: "no", 1: "yes"}}

BARRETT = GclMap(
    "barrett",
    [
        # -- movement, §5.3.1
        _motor("DP", "default_position", "target of M without an argument, useful to 17,800 (spread 3150)", "5.3.1", 0, 65535, unit="cts", default=(8500, 1575), **_USEFUL, **_RW),
        _motor("DS", "default_step", "step of IC and IO without an argument", "5.3.1", 0, 65535, unit="cts", default=(1700, 315), **_USEFUL, **_RW),
        _motor("HSG", "strain_limit_high", "a movement ends above this strain (255 and 256 = off)", "5.3.1", 0, 256, special=_OFF, default=(256, 256), **_RW),
        _motor("LSG", "strain_limit_low", "a movement ends below this strain (255 and 256 = off)", "5.3.1", 0, 256, special=_OFF, default=(256, 256), **_RW),
        _motor("MOV", "max_open_velocity", "opening velocity, below 40 the motor may not move (§8)", "5.3.1", 16, 4080, unit="1/16 cts/sample", default=(100, 60), careful=((40, 300), (40, 150)), why="faster than IVEL allows, which deforms the clutch permanently, so it loses its breakaway (§5.3.4)", why_less="below 40 the motor may not move (§8)", **_RW),
        _motor("MCV", "max_close_velocity", "closing velocity, sets the tip force of TC", "5.3.1", 16, 4080, unit="1/16 cts/sample", default=(100, 60), careful=((40, 2032), (40, 2032)), why="beyond 127 counts a sample the motor controller has no profile", why_less="below 40 the motor may not move (§8)", **_RW),
        _motor("MSG", "strain_limit_high_alias", "the same value as HSG", "5.3.1", 0, 256, special=_OFF, default=(256, 256), **_RW),
        # -- status, §5.3.2
        _motor("OD", "odometer", "total distance the motor has moved", "5.3.2", 0, 2**32, unit="1000 cts"),
        _motor("P", "position", "position, about 0 to 17,800 (spread 3150)", "5.3.2", None, None, unit="cts"),
        _motor("S", "status", "sum of status codes, 0 = ready", "5.3.2", 0, 65535),
        _motor("SG", "strain", "strain gauge, 100 to 140 without load (§7.4), 255 = no gauge", "5.3.2", 0, 255, special={255: "no gauge"}),
        # -- realtime, §5.3.3
        _motor("LCV", "loop_control_velocity", "control block has a velocity", "5.3.3", 0, 1, default=(1, 1), **_KNOWN_FLAG),
        _motor("LCVC", "loop_control_velocity_coefficient", "factor of the control velocity, 0 would always stop", "5.3.3", 1, 255, default=(1, 1), careful=((1, 2), (1, 1)), why="with it, a velocity of -127 opens faster than IVEL allows and deforms the clutch permanently (§5.3.4)", **_RW),
        _motor("LCPG", "loop_control_proportional_gain", "control block has a gain", "5.3.3", 0, 1, default=(1, 1), **_KNOWN_FLAG),
        _motor("LFV", "loop_feedback_velocity", "feedback has the velocity", "5.3.3", 0, 1, default=(1, 1), **_KNOWN_FLAG),
        _motor("LFVC", "loop_feedback_velocity_coefficient", "divisor of the velocity in feedback", "5.3.3", 1, 255, default=(1, 1), **_RW),
        _motor("LFS", "loop_feedback_strain", "feedback has the strain", "5.3.3", 0, 1, default=(1, 1), **_KNOWN_FLAG),
        _motor("LFAP", "loop_feedback_absolute_position", "feedback has the position", "5.3.3", 0, 1, default=(1, 1), **_KNOWN_FLAG),
        _motor("LFDP", "loop_feedback_delta_position", "feedback has the change of position", "5.3.3", 0, 1, default=(1, 1), **_KNOWN_FLAG),
        _motor("LFDPC", "loop_feedback_delta_position_coefficient", "divisor of the change in feedback", "5.3.3", 1, 255, default=(1, 1), **_RW),
        # -- advanced, §5.3.4
        _motor("ACCEL", "acceleration", "acceleration, with 0 the motor would never move", "5.3.4", 1, 65535, unit="1/256 cts/sample²", default=(4, 2), **_ADV),
        _motor("CT", "close_target", "target of C", "5.3.4", 0, 65535, unit="cts", default=(17000, 3150), careful=((51, 18000), (51, 3150)), why="beyond the joint's travel: C drives into the stop", why_less="C has nowhere to go from the open target", **_ADV),
        _motor("EN", "enabled", "1: also moves without being named; 0: a finger seems dead", "5.3.4", 0, 1, choices={0: "no", 1: "yes"}, default=(1, 1), **_ADV),
        _motor("FDZ", "filter_derivative_zero", "filter zero, noisy unless 0", "5.3.4", 0, 255, default=(0, 0), **_ADV),
        _motor("FIP", "filter_integral_pole", "filter pole, may be unstable unless 0", "5.3.4", 0, 255, default=(0, 0), careful=((0, 0), (0, 0)), why="may become unstable", **_ADV),
        _motor("FPG", "filter_proportional_gain", "filter gain, sets the spread's pinch torque", "5.3.4", 0, 255, default=(10, 10), **_ADV),
        _motor("HOLD", "hold", "servo after a movement, which only heats a finger", "5.3.4", 0, 1, choices={0: "no", 1: "yes"}, default=(0, 1), **_ADV),
        _motor("IHIT", "init_hit_count", "hits of the open stop during HI", "5.3.4", 0, 65535, default=(2, 0), careful=((0, 5), (0, 5)), why="more than 5 hits is beyond the vendor's limit", **_ADV),
        _motor("IOFF", "init_offset", "distance back from the stop after HI, a larger one lowers the breakaway force", "5.3.4", 0, 65535, unit="cts", default=(50, 0), careful=((0, 500), (0, 500)), why="useful values are 0 to 500", **_ADV),
        _motor("IVEL", "init_velocity", "velocity of HI", "5.3.4", 16, 4080, unit="1/16 cts/sample", default=(300, 150), careful=((16, 300), (16, 150)), why="a value above the default deforms the clutch permanently, so it loses its breakaway", **_ADV),
        _motor("MPE", "max_position_error", "how close counts as reached", "5.3.4", 0, 65535, unit="cts", default=(50, 50), **_USEFUL, **_ADV),
        _motor("OT", "open_target", "target of O, also sets the breakaway force", "5.3.4", 0, 65535, unit="cts", default=(0, 0), careful=((0, 17800), (0, 3150)), why="beyond the joint's travel: O closes instead", **_ADV),
        _motor("SAMPLE", "sample_time", "sample time of the motor controller, not to be changed", "5.3.4", 15, 255, default=(31, 31), careful=((31, 31), (31, 31)), why="the manual says not to change it", **_ADV),
        _motor("SGFLIP", "strain_flip", "strain readings are inverted (legacy)", "5.3.4", 0, 1, choices={0: "no", 1: "yes"}, default=(0, 0), careful=((0, 0), (0, 0)), why="legacy, inverts every strain reading", **_ADV),
        _motor("TSTOP", "stop_time", "time a stalled motor is still driven", "5.3.4", 0, 65535, unit="ms", default=(30, 30), careful=((0, 30), (0, 30)), why="above 30 ms the motors heat up very fast", **_ADV),
        # -- global, §5.4
        _global("BAUD", "baud_rate", "baud rate of the serial line, changes immediately", "5.4.1", 6, 384, unit="100 bit/s", choices=BAUD_CODES, default=(96, 96), strands=True, **_RW),
        _global("LFT", "loop_feedback_temperature", "feedback has the temperature", "5.4.1", 0, 1, default=(0, 0), **_KNOWN_FLAG),
        _global("OTEMP", "over_temperature_limit", "motor commands fail above it (0 = off, 600 to 650 advised)", "5.4.1", 0, 1250, unit=TENTHS, special={0: "off"}, default=(0, 0), careful=((SENSIBLE_LIMIT, 1250),) * 2, why="the unit is 0.1 °C: below 30 °C every movement fails", **_RW),
        _global("TEMP", "temperature", "temperature of the CPU board, normal 400 to 600, limit 650 (§2)", "5.4.2", -550, 1250, unit=TENTHS),
        _global("PTEMP", "peak_temperature", "highest temperature ever", "5.4.2", 0, 1250, unit=TENTHS),
        _global("UPSECS", "uptime_seconds", "total operating time", "5.4.2", 0, 2**32, unit="s"),
        _global("SN", "serial_number", "serial number (0 on upgraded hands)", "5.4.2", 0, None, private=True, tells="serial"),
        _global("LFDPD", "loop_feedback_delta_discard", "drop a change that is too large for a byte", "5.4.3", 0, 1, default=(0, 0), advanced=True, **_KNOWN_FLAG),
        # -- later firmware: ERR 64 where absent
        _motor("BD", "breakaway_detected", "the clutch has broken away", "later firmware", 0, 1, since="4.34"),
        _motor("BP", "breakaway_position", "position at breakaway", "later firmware", None, None, unit="cts", since="4.34"),
        _motor("BS", "breakaway_stop", "stop at breakaway", "later firmware", 0, 1, default=(0, 0), since="4.34", **_RW),
        _motor("BDAT", "breakaway_acceleration_threshold", "detection threshold", "later firmware", 0, 20000, default=(1500, 1500), since="4.34", **_RW),
        _motor("LCT", "loop_control_torque", "control block has a torque, excludes velocity and gain", "later firmware", 0, 1, since="4.4", **_KNOWN_FLAG),
        _motor("LFBP", "loop_feedback_breakaway_position", "feedback block has the breakaway position", "later firmware", 0, 1, since="4.4", **_KNOWN_FLAG),
        _motor("LFAIN", "loop_feedback_analog_input", "feedback block has the analog input", "later firmware", 0, 1, since="4.4", **_KNOWN_FLAG),
    ],
    [_global("VERS", "firmware", "firmware version, as the hand reports it", "5.2.4", None, None)],
)  # fmt: skip


def standard() -> list[GclParam]:
    """Everything of §5.3 and §5.4, without what only later firmware has."""
    return [param for param in BARRETT if not param.since]


gcl_name: Callable[[Element], str] = attrgetter("param.mnemonic")
"""The GCL name of an element's parameter; asked for with every value."""


def sample_seconds(sample: int) -> float:
    """How long a sample of the motor controllers lasts, by SAMPLE: so many ticks of 2 MHz (§5.3.4; dossier 13)."""
    return 16 * (sample + 1) / 2e6


def travel_seconds(index: int, velocity: int, sample: int) -> float:
    """How long motor `index` takes for its whole travel at MOV or MCV `velocity`, in 1/16 count a sample, without its ramps (dossier 13)."""
    return TRAVEL[index == 3] * 16 / max(1, velocity) * sample_seconds(sample)


def implausible(index: int, position: int) -> bool:
    """Whether motor `index` cannot be there: beyond its travel by more than fingers differ."""
    return not -BEYOND <= position <= TRAVEL[index == 3] + BEYOND


def unmeasured(tenths: int) -> bool:
    """Whether TEMP cannot be the board's temperature: at an end of its scale or below that of PTEMP, where no hand that answers is (§5.4.2)."""
    peak = BARRETT.by_mnemonic("PTEMP")
    assert peak.low is not None and peak.high is not None
    return not peak.low < tenths < peak.high


def with_sign(index: int, position: int, known: str = "") -> int:
    """A position of motor `index` that may have been sent as a word without a sign (§5.3.2, §5.3.4 IOFF).

    `known`: how this hand prints one below 0, "" = not known.

    The origin is IOFF counts from the open stop, so a finger at that stop is below 0. The manual does not say how that is
    printed. Where only the number with a sign lies within the joint's travel, it is that.
    """
    below = position - 65536
    if known:
        return below if known == "unsigned" and 32767 < position < 65536 else position
    return below if position <= 65535 and -TRAVEL[index == 3] <= below else position


def careful(element: Element, value: Number) -> str | None:
    """What speaks against a value that the manual allows and warns of; 0 switches OTEMP off, as the factory has it."""
    assert isinstance(element.param, GclParam)
    return element.param.objection(element.index, value) if value or element.param.mnemonic != "OTEMP" else None


def check_careful(changes: Sequence[tuple[Element, Number]], force: bool) -> list[str]:
    """Objections to values that the manual allows and warns of. Raises UsageError unless `force`."""
    objections = [careful(element, value) for element, value in changes]
    found = list(dict.fromkeys(objection for objection in objections if objection is not None))
    if found and not force:
        raise UsageError(". ".join(found), hint="use --force to write it anyway. Nothing was sent.", code="careful")
    return found
