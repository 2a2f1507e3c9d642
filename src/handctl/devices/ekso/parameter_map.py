"""The words of the EksoNR messages: names, scales, signs, units, codes and ParameterIDs.

Names, scales and order are the manual's (ekso §6). Signs, units and codes are not in it; they are what clients in the
field and a log of one unit show, and stay empty where nobody knows. The limits for writing a setting are in `write_policy`.
Knows no wire.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal, InvalidOperation
from typing import Any

from handctl.devices.ekso import write_checks
from handctl.fast_classes import fast_dataclass
from handctl.model.param import MEASURED, SETTING, Element, Number, Param, ParamMap

WALK = {0: "First Step", 1: "ActiveStep", 2: "ProStep", 3: "ProStep+"}
STAND = {0: "Manual Lean", 1: "Auto Lean"}
SIT = {0: "Min Lean", 1: "Normal Lean"}
LEAN = {0: "Min", 1: "Max", 2: "Off"}
SOUNDS = {0: "Off", 1: "Forward", 2: "Lateral", 3: "Both"}
INJURY = {0: "Bilateral", 1: "Right Affected", 2: "Left Affected", 3: "2Free"}
ASSIST = {
    **{code: f"{code * 5} %" for code in range(21)},
    21: "Adapt",
    22: "Max",
    23: "High Resist",
    24: "Low Resist",
    25: "Neutral",
    26: "Low Assist",
    27: "High Assist",
}
STANCE = {0: "Low", 1: "Medium", 2: "High", 3: "Very High", 4: "Flex", 5: "Full"}
SWING_COMPLETE = {0: "2.5", 1: "2.0", 2: "1.5", 3: "1.0", 4: "0.5", 5: "0.3", 6: "0.1"}

SITTING, STANDING, CHANGING = 1, 2, 3
DRIVEN = 0x0400
"""State bit: the joints are being driven."""
POSTURES = {SITTING: "sitting", STANDING: "standing", CHANGING: "rising or sitting down"}
"""High digit of State. The code of walking was never seen: nobody may guess it."""
PERCENT_CODES = range(21)
NOTHING_SENT = "Nothing was sent."


@fast_dataclass(frozen=True, kw_only=True, eq=False)
class Word(Param):
    """A Param with its place in a message.

    message    "settings", "data" or "feedback": GetSettings, GetData, GetFeedback
    word       index in the body, from 0
    id         ParameterID of SetValue, None = cannot be written
    signed     two's complement
    hex        bits or a code whose meaning is unknown: shown in hex
    aliases    the manual's spellings and those of the field
    """

    message: str
    word: int
    id: int | None = None
    signed: bool = False
    hex: bool = False
    aliases: tuple[str, ...] = ()

    @property
    def path(self) -> str:
        """``data.boot_time_high``: where two messages have the same name, the message stands before it."""
        return f"{self.message}.{self.name}" if self.name in TWICE else self.name

    @property
    def type_name(self) -> str:
        """``s16/100``: the wire type and what it is divided by."""
        return f"{'s' if self.signed else 'u'}16" + (f"/{10**self.decimals}" if self.decimals else "")

    @property
    def range_text(self) -> str:
        """The codes with their labels, or the range of the wire type; percentages in one piece."""
        if self.choices is not ASSIST:
            return Param.range_text.fget(self)  # type: ignore[attr-defined,no-any-return]
        named = ", ".join(f"{code} = {label}" for code, label in ASSIST.items() if code not in PERCENT_CODES)
        return f"0..20 = 0 %..100 % in steps of 5 %, {named}"

    @property
    def limits_source(self) -> str:
        """The manual's codes; of a number it gives no range, so the ends are those of the 16-bit word."""
        return self.source if self.choices else f"the limits of its 16-bit word, the manual gives none: {self.source}"

    def raw_of(self, word: int) -> int:
        """The raw integer of a 16-bit word, given signed or unsigned, in this field's own sign."""
        word &= 0xFFFF
        return word - 0x10000 if self.signed and word & 0x8000 else word

    def value_of(self, word: int) -> Number:
        """The value in `unit` of a 16-bit word, given signed or unsigned."""
        return self.from_raw(self.raw_of(word))

    def label(self, value: Number) -> str | None:
        """A code in words, ``unknown (17)`` for an unknown one; bits in hex."""
        if self.name == "state":
            return state_text(int(value))
        if self.hex:
            return f"0x{int(value):04X}"
        if self.choices:
            return self.choices.get(value, f"unknown ({value})")
        return None

    def shown(self, value: Number) -> str:
        """A value for people in one piece: ``15.50 in``, ``50 %``."""
        if self.choices or self.hex:
            return str(self.label(value))
        return f"{self.text(value)} {self.unit}" if self.unit else self.text(value)

    def typed(self, value: Number) -> str:
        """A value as `set` takes it: ``15.50``, ``ProStep``."""
        return str(self.choices[value]) if value in self.choices else self.text(value)

    def check(self, value: Number, where: str = "") -> None:
        """Raise UsageError if `value` does not fit the wire type; an unknown code is allowed."""
        if not self.choices:
            Param.check(self, value, where)
        if self.from_raw(self.to_raw(value)) != value or (self.choices and not 0 <= value <= 0xFFFF):
            raise write_checks.refusal(
                write_checks.RANGE, f"{where or self.name} = {value} does not fit {self.type_name}", NOTHING_SENT
            )

    def parse(self, text: str, where: str = "") -> Number:
        """The value that a user typed: a label, a code (``2``, ``code:2``) or an exact decimal. Raises UsageError."""
        where = where or self.name
        if not self.choices:
            return self._exact(text.strip(), where)
        # In a number every sign counts: 7,5 % and -75 % are not 75 %.
        number, percent, rest = text.strip().partition("%")
        wanted = f"{number.rstrip()}%{rest}" if percent else plain(text)
        for code, label in self.choices.items():
            if wanted == plain(label):
                return code
        digits = text.strip().casefold().removeprefix("code:").strip()
        if not (digits.isascii() and digits.isdecimal()):
            raise write_checks.refusal(
                write_checks.NUMBER,
                f"{where}: {text.strip()!r} is neither a label nor a code",
                f"allowed: {self.range_text}. {NOTHING_SENT}",
            )
        if self.choices is ASSIST and digits == text.strip():
            raise write_checks.refusal(
                write_checks.AMBIGUOUS,
                f"{where}: {digits} could be percent or a code",
                f"write '{digits} %' (a multiple of 5), or code:N. {NOTHING_SENT}",
            )
        if int(digits) not in self.choices:
            raise write_checks.refusal(
                write_checks.RANGE,
                f"{where} = {digits}: this code is not documented",
                f"allowed: {self.range_text}. {NOTHING_SENT}",
            )
        return int(digits)

    def _exact(self, text: str, where: str) -> Number:
        try:
            if "_" in text or not text.isascii():
                raise InvalidOperation
            value = Decimal(text)
            if not value.is_finite() or abs(value) > 10**9:
                raise InvalidOperation
        except InvalidOperation as exc:
            raise write_checks.refusal(
                write_checks.NUMBER,
                f"{where}: {text!r} is not a number",
                f"a decimal number with at most {self.decimals} decimals. {NOTHING_SENT}",
            ) from exc
        step = Decimal(1).scaleb(-self.decimals)
        below, above = (value.quantize(step, mode) for mode in (ROUND_FLOOR, ROUND_CEILING))
        if below != above:
            raise write_checks.refusal(
                write_checks.EXACT,
                f"{where} = {text}: the device uses steps of {step}, and handctl does not round",
                f"{below} or {above}. {NOTHING_SENT}",
            )
        number = float(value)
        self.check(number, where)
        return number


def plain(text: str) -> str:
    """A name or label without case, spaces, hyphens and the like: ``Upper Leg Length`` is upper_leg_length."""
    return "".join(letter for letter in text.casefold() if letter.isalnum() or letter in "%+.")


def state_text(state: int) -> str:
    """``sitting (0x1040)``; ``unknown (0x4440)`` for a posture that was never seen."""
    posture = POSTURES.get(state >> 12)
    if posture is None:
        return f"unknown (0x{state:04X})"
    return f"{posture}{', moving' if state & DRIVEN else ''} (0x{state:04X})"


WORD_LIMITS = "the manual gives no range, so this is the range of the 16-bit word"


def _setting(word: int, number: int | None, name: str, doc: str, *aliases: str, **more: Any) -> Word:
    decimals = 2 if number is not None and number < 210 else 0
    high = 0x7FFF if more.get("signed") else 0xFFFF
    low = -327.68 if more.get("signed") else 0
    limits: dict[str, Any] = {} if more.get("choices") or number is None else {"low": low, "high": high / 100}
    source = "ekso §6, GetSettings" + ("" if number is None else f", ParameterID {number}")
    return Word(
        message="settings", word=word, id=number, name=name, doc=doc, aliases=aliases, decimals=decimals, source=source,
        access="r" if number is None else "rw", kind=MEASURED if number is None else SETTING, persistent="no" if number is None else "unknown", **limits, **{"note": WORD_LIMITS if limits else "", **more},
    )  # fmt: skip


def _data(word: int, name: str, doc: str, alias: str, decimals: int = 0, unit: str | None = None, **more: Any) -> Word:
    return Word(
        message="data", word=word, name=name, doc=doc, aliases=(alias,), decimals=decimals, unit=unit,
        source="ekso §6, GetData", **more,
    )  # fmt: skip


def _feedback(
    word: int, name: str, doc: str, *aliases: str, decimals: int = 0, unit: str | None = None, signed: bool = False
) -> Word:
    return Word(
        message="feedback", word=word, name=name, doc=doc, aliases=aliases, decimals=decimals, unit=unit,
        signed=signed, source="ekso §6, GetFeedback",
    )  # fmt: skip


_NO_ID = "no ParameterID"

SETTINGS: tuple[Word, ...] = (
    _setting(0, 200, "upper_leg_length", "length of the thigh", "Upper Leg Length", "thigh_length", unit="in"),
    _setting(1, 201, "lower_leg_length", "length of the shank", "Lower Leg Length", "shank_length", unit="in"),
    _setting(2, 202, "step_length", "length of a step", unit="in"),
    _setting(3, 203, "step_height", "height of a step", unit="in"),
    _setting(4, 204, "swing_time", "duration of the swing", unit="s"),
    _setting(5, 205, "stand_time", "duration of the stance", unit="s"),
    _setting(6, 206, "knee_flexion", "flexion of the knee", "knee_flex", unit="deg"),
    _setting(7, 207, "hip_flexion", "flexion of the hip", "hip_flex", unit="deg"),
    _setting(8, 208, "forward_shift", "weight shift forward, unit unknown", signed=True),
    _setting(9, 209, "lateral_shift", "weight shift to the side, unit unknown", signed=True),
    _setting(10, 212, "walk_mode", "how steps are started", "Walk", choices=WALK),
    _setting(11, 210, "stand_mode", "how standing up is led", "Stand", choices=STAND),
    _setting(12, 213, "target_sounds", "which targets sound", choices=SOUNDS),
    _setting(13, 215, "injury_mode", "affected side", choices=INJURY),
    _setting(14, 216, "left_swing_assist", "help in the left swing", "Left Swing Assistance", choices=ASSIST),
    _setting(15, 218, "right_swing_assist", "help in the right swing", "Right Swing Assistance", choices=ASSIST),
    _setting(16, 217, "left_stance_support", "support of the left stance", choices=STANCE),
    _setting(17, 219, "right_stance_support", "support of the right stance", choices=STANCE),
    _setting(18, None, "swing_complete", "when a swing is complete, unit unknown", choices=SWING_COMPLETE, note=_NO_ID),
    _setting(19, None, "pilot_id", "number of the pilot, personal", "PilotID", private=True, note=_NO_ID),
    _setting(20, 211, "sit_mode", "how sitting down is led", "Sit", choices=SIT),
    _setting(21, 214, "lean_allowance", "how far leaning is allowed", choices=LEAN),
)
"""GetSettings in the order of its words, which is not the order of the ParameterIDs."""

_S: dict[str, Any] = {"signed": True}
_COUNTS: dict[str, Any] = {"unit": "raw counts"}
_HEX: dict[str, Any] = {"hex": True}

DATA: tuple[Word, ...] = (
    _data(0, "torso_pitch", "trunk, leaning forward is positive", "Torso Pitch Angle", 2, "deg", **_S),
    _data(1, "torso_roll", "trunk to the side, sign unknown", "Torso Roll Angle", 2, "deg", **_S),
    _data(2, "right_toe_pressure", "sole sensor, unit unknown", "Right Toe Pressure", **_COUNTS),
    _data(3, "right_heel_pressure", "sole sensor, unit unknown", "Right Heel Pressure", **_COUNTS),
    _data(4, "left_toe_pressure", "sole sensor, unit unknown", "Left Toe Pressure", **_COUNTS),
    _data(5, "left_heel_pressure", "sole sensor, unit unknown", "Left Heel Pressure", **_COUNTS),
    _data(6, "right_hip_x", "hip before the foot", "Right Hip X Position", 1, "in", **_S),
    _data(7, "right_hip_y", "hip above the sole", "Right Hip Y Position", 2, "in", **_S),
    _data(8, "left_hip_x", "hip before the foot", "Left Hip X Position", 1, "in", **_S),
    _data(9, "left_hip_y", "hip above the sole", "Left Hip Y Position", 2, "in", **_S),
    _data(10, "right_hip_current", "motor current", "Right Hip Current", 2, "A", **_S),
    _data(11, "right_hip_angle", "flexion is positive", "Right Hip Angle", 2, "deg", **_S),
    _data(12, "right_knee_current", "motor current", "Right Knee Current", 2, "A", **_S),
    _data(13, "right_knee_angle", "flexion is positive", "Right Knee Angle", 2, "deg", **_S),
    _data(14, "left_hip_current", "motor current", "Left Hip Current", 2, "A", **_S),
    _data(15, "left_hip_angle", "flexion is positive", "Left Hip Angle", 2, "deg", **_S),
    _data(16, "left_knee_current", "motor current", "Left Knee Current", 2, "A", **_S),
    _data(17, "left_knee_angle", "flexion is positive", "Left Knee Angle", 2, "deg", **_S),
    _data(18, "state", "high digit posture, bit 0x0400 joints driven, other bits unknown", "State", **_HEX),
    _data(19, "foot_state", "one byte a foot, meaning unknown", "Foot State", **_HEX),
    _data(20, "min_state", "meaning unknown", "Min State"),
    _data(21, "lcd_button_state", "meaning unknown", "LCD Button State", **_HEX),
    _data(22, "weight_shift", "weight shift", "Weight Shift", 3, **_S),
    _data(23, "hmi_data", "meaning unknown", "HMI Data", **_HEX),
    _data(24, "va_ref_time", "unit unknown", "VA Ref Time", 1),
    _data(25, "boot_time_high", "milliseconds since power-on, high word", "BootTime (high bytes)"),
    _data(26, "boot_time_low", "milliseconds since power-on, low word", "BootTime (low bytes)"),
)
"""GetData in the order of its words: right before left."""

_UNKNOWN: dict[str, Any] = {"decimals": 1, "signed": True}

FEEDBACK: tuple[Word, ...] = (
    _feedback(0, "steps_taken", "steps, wraps at 65536", "StepsTaken", unit="steps"),
    _feedback(1, "upright_time", "time upright, wraps at 65536", "UprightTime", unit="s"),
    _feedback(2, "walk_time", "time walking, wraps at 65536", "WalkTime", unit="s"),
    _feedback(3, "left_max_forward_assist", "unit unknown", "Max Fwd Assist, left", "MinGain, left", **_UNKNOWN),
    _feedback(4, "left_assist_gain", "unit unknown", "Assist Gain, left", "FwdGain, left", **_UNKNOWN),
    _feedback(5, "right_max_forward_assist", "unit unknown", "Max Fwd Assist, right", "MinGain, right", **_UNKNOWN),
    _feedback(6, "right_assist_gain", "unit unknown", "Assist Gain, right", "FwdGain, right", **_UNKNOWN),
    _feedback(7, "left_hip_stance_support", "unit unknown", "Hip stance support, left", **_UNKNOWN),
    _feedback(8, "left_knee_stance_support", "unit unknown", "Knee stance support, left", **_UNKNOWN),
    _feedback(9, "right_hip_stance_support", "unit unknown", "Hip stance support, right", **_UNKNOWN),
    _feedback(10, "right_knee_stance_support", "unit unknown", "Knee stance support, right", **_UNKNOWN),
    _feedback(11, "left_step_length", "as reported", "StepLength, left", unit="in", **_UNKNOWN),
    _feedback(12, "right_step_length", "as reported", "StepLength, right", unit="in", **_UNKNOWN),
    _feedback(13, "left_swing_time", "as reported", "SwingTime, left", unit="s", **_UNKNOWN),
    _feedback(14, "right_swing_time", "as reported", "SwingTime, right", unit="s", **_UNKNOWN),
    _feedback(15, "boot_time_high", "milliseconds since power-on, high word", "BootTime (high bytes)"),
    _feedback(16, "boot_time_low", "milliseconds since power-on, low word", "BootTime (low bytes)"),
)
"""GetFeedback in the order of its words: left before right."""

MESSAGES: dict[str, tuple[Word, ...]] = {"settings": SETTINGS, "data": DATA, "feedback": FEEDBACK}
SIGNS = {name: "".join("h" if word.signed else "H" for word in words) for name, words in MESSAGES.items()}
"""Message -> its words' signs, for `frames.unpack`: all words are read at once, for the line waits meanwhile."""


@fast_dataclass(frozen=True, kw_only=True, eq=False)
class Clock(Word):
    """GetTime or GetDate: a message of its own, whose bytes (`parts`, with their ranges) are told in words (`form`)."""

    parts: tuple[tuple[str, int, int], ...]
    form: str

    @property
    def type_name(self) -> str:
        return "3 bytes"


_CLOCK: dict[str, Any] = {"source": "ekso §6", "word": 0}
_YEAR, _HOUR = (("year", 0, 99), ("month", 1, 12), ("day", 1, 31)), (("hour", 0, 23), ("minute", 0, 59), ("second", 0, 59))  # fmt: skip
CLOCKS = (
    Clock(name="date", message="date", doc="the device's date", form="20{:02d}-{:02d}-{:02d}", parts=_YEAR, **_CLOCK),
    Clock(name="time", message="time", doc="the device's time", form="{:02d}:{:02d}:{:02d}", parts=_HOUR, **_CLOCK),
)


def days_of(year: int, month: int) -> int:
    """How many days a month of the years 2000 to 2099 has."""
    return 30 + (month in (1, 3, 5, 7, 8, 10, 12)) - (month == 2) * (1 if year % 4 == 0 else 2)


TWICE = {word.name for word in DATA} & {word.name for word in FEEDBACK}
"""Names that stand in two messages."""


class EksoMap(ParamMap[Word]):
    """Finds by name, by any alias without regard to case, spaces and hyphens, by ParameterID, and by message.name."""

    def __init__(self, kind: str, params: Sequence[Word], texts: Sequence[Word]) -> None:
        super().__init__(kind, params, texts)
        self._by_alias: dict[str, str] = {}
        for param in params:
            for alias in (param.name, *param.aliases, *([str(param.id)] if param.id is not None else [])):
                if self._by_alias.setdefault(plain(alias), param.name) != param.name:
                    raise ValueError(f"{kind}: {alias} means two quantities")

    def find(self, name: str) -> tuple[Word, Sequence[Element]]:
        """``step_length``, ``Step Length``, ``202`` -> that quantity. Raises UsageError with near names."""
        key = plain(name)
        known = self._by_alias.get(key)
        if known is not None and (not key.isdecimal() or key == name.strip()):  # -202 is no ParameterID
            return self[known], self[known].each
        if name.strip().isdecimal():
            raise write_checks.refusal(
                write_checks.UNKNOWN,
                f"{self.kind} has no ParameterID {name.strip()}",
                f"they are 200 to 219 (ekso §6). {NOTHING_SENT}",
            )
        message, _, rest = name.strip().partition(".")
        for word in MESSAGES.get(message.casefold(), ()):
            if rest.casefold() == word.name:
                return word, word.each
        return super().find(name.strip().casefold() if key in self.texts else name)

    def _refuse_unsettable(self, param: Param) -> None:
        if not param.writable:
            why = param.note or "it is measured"
            raise write_checks.refusal(
                write_checks.READ_ONLY, f"{param.name} is read-only: {why} ({param.source})", NOTHING_SENT
            )


EKSO = EksoMap("ekso", (*SETTINGS, *DATA, *FEEDBACK[:15]), CLOCKS)
"""Everything with a name of its own. BootTime of GetFeedback is found as `feedback.boot_time_high`."""
LEGS = (SETTINGS[0], SETTINGS[1])
NAMED = {word.name: word for word in (*FEEDBACK, *DATA, *SETTINGS)}
"""Each word by its name; BootTime is that of GetData."""


def boot_ms(words: Sequence[int]) -> int:
    """Milliseconds since power-on from the last two words of GetData or GetFeedback; wraps after 49.7 days."""
    return (words[-2] & 0xFFFF) << 16 | words[-1] & 0xFFFF


def boot_text(milliseconds: int) -> str:
    """``1 h 23 m 20.001 s``."""
    minutes, rest = divmod(milliseconds, 60_000)
    return f"{minutes // 60} h {minutes % 60} m {rest // 1000}.{rest % 1000:03d} s"
