"""A simulated EksoNR behind its DataPort: messages in and out, settings, faults (manual §6).

Written from the manual and its dossier alone, by other means than the host: decimal numbers, `struct`, a bitwise CRC.

    command  length  msgID high  low  body ...  CRC high  low

The manual is silent on much: length byte, status codes, states, and everything that goes wrong. What a guess fills is
marked so here; nothing seen here is evidence about a real device. The settings, with their places, power-on values and presets,
are a transcription of its own, in raw numbers; their limits are invented, the codes are those that field clients know.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import lru_cache
from math import ceil, floor

from handctl.number_parsing import number_in
from handctl.sim.ekso.mechanics import (
    FIRST_BOOT_MS,
    LEFT,
    POSTURES,
    RIGHT,
    SIZES,
    WRAP,
    Body,
    BootTime,
    Calendar,
    Unrest,
    hips,
)
from handctl.sim.engine.simulated_device import NOTHING, Model, Options, Random, Reply, Rows, soonest

# Per word of GetSettings: (name, ParameterID or None, values that SetValue takes, power-on value). The order of the
# words is not that of the IDs. A range is a limit in hundredths (status 2 beyond it), a set is a list of codes (status
# 3 for others). The power-on codes differ as far as their short lists allow, and from their neighbours in either table.
SETTINGS: tuple[tuple[str, int | None, range | frozenset[int], int], ...] = (
    ("upper_leg_length", 200, range(1000, 2501), 1680),
    ("lower_leg_length", 201, range(1000, 2501), 1640),
    ("step_length", 202, range(400, 2401), 1475),
    ("step_height", 203, range(601), 175),
    ("swing_time", 204, range(40, 251), 110),
    ("stand_time", 205, range(501), 65),
    ("knee_flexion", 206, range(4001), 1250),
    ("hip_flexion", 207, range(4001), 820),
    ("forward_shift", 208, range(-500, 501), -150),
    ("lateral_shift", 209, range(-500, 501), 85),
    ("walk_mode", 212, frozenset(range(4)), 3),
    ("stand_mode", 210, frozenset(range(2)), 1),
    ("target_sounds", 213, frozenset(range(4)), 0),
    ("injury_mode", 215, frozenset(range(4)), 2),
    ("left_swing_assist", 216, frozenset(range(28)), 8),
    ("right_swing_assist", 218, frozenset(range(28)), 14),
    ("left_stance_support", 217, frozenset(range(6)), 4),
    ("right_stance_support", 219, frozenset(range(6)), 5),
    ("swing_complete", None, frozenset(), 6),
    ("pilot_id", None, frozenset(), 4711),
    ("sit_mode", 211, frozenset(range(2)), 0),
    ("lean_allowance", 214, frozenset(range(3)), 2),
)
PLACE = {row[1]: place for place, row in enumerate(SETTINGS) if row[1] is not None}
NAMES = tuple(row[0] for row in SETTINGS)
SETTING_COUNT, DATA_COUNT, FEEDBACK_COUNT = 22, 27, 17  # words
POWER_ON = tuple(row[3] % 65536 for row in SETTINGS)

# GetFeedback up to the two words of BootTime: steps, s upright, s walked, then what scales by 10.
FEEDBACK = (214, 1530, 417, 385, 270, 405, 295, 550, 640, 575, 665, 142, 147, 11, 13)

# Values of the synthetic transcripts.
VECTOR_SETTINGS = (1700, 1600, 1550, 200, 90, 50, 500, 300, 65461, 125, 2, 1, 3, 0, 10, 12, 2, 3, 4, 7, 1, 2)
VECTOR_FEEDBACK = (312, 1240, 655, 425, 300, 450, 315, 600, 700, 620, 710, 152, 156, 9, 9)
VECTOR_DATA = {2: 95, 3: 610, 4: 120, 5: 480, 10: 65351, 12: 65496, 14: 210, 16: 65481, 18: 8256, 21: 0, 22: 125}
VECTOR_ANGLES = (4.5, -0.75, 22.1, 8.4, -6.35, 3.2)
VECTOR_BOOT = 5000001

PRESETS = ("clinic", "vectors", "order", "sign")
LADDERS = {"order": (384, 257), "sign": (61440, 17)}  # words that all differ: the first, and the step to the next


def place_of(word: str) -> int:
    """The word of a setting by its name or its ParameterID; ValueError when there is none."""
    if word in NAMES:
        return NAMES.index(word)
    if (number := number_in(word)) in PLACE:
        return PLACE[number]
    raise ValueError(f"unknown setting {word!r}. Known: {', '.join(NAMES)}, or a ParameterID, 200 to 219")


def judge_value(place: int, raw: int) -> int:
    """Status code for a value, 0..65535: 0 good, 2 out of range, 3 not a listed code."""
    allowed = SETTINGS[place][2]
    if raw in allowed or (raw >= 32768 and raw - 65536 in allowed):  # only the shifts go below 0
        return 0
    return 2 if isinstance(allowed, range) else 3


# Commands; the last is met in the field, not in the manual.
TIME, DATE, SET_VALUE, CANCEL, EVENT = 150, 151, 155, 156, 160
BODY_SIZES = {150: 0, 151: 0, 152: 0, 153: 0, 154: 0, 155: 4, 156: 2, 157: 2}
LENGTHS = {"body": 0, "n-4": 2, "n-2": 4, "frame": 6}  # convention -> what the length byte counts beside the body
ACCEPTED, WRONG_STATE, NOT_ALLOWED = 0, 1, 3  # status codes of field clients; the manual has none
EVENT_EVERY = 0.35  # s between frames that nobody asked for
JUMP_MS = 5000
FOOT_STATE, MIN_STATE, HMI_DATA, VA_REF_TIME = 1028, 0, 1, 12  # constants of the log, but for the last (0 there)
STATE_WORD, TARGET_SOUNDS = 18, 12  # places in GetData and GetSettings
STUCK_COUNTS, OFFSET_TENTHS = 333, 30
CODES = range(10, 22)  # words of GetSettings that hold codes, the PilotID aside
PILOT_ID, STEP_LENGTH, SWING_TIME = 19, 2, 4

_OPTIONS = {
    "preset": (PRESETS, "values at the first start: clinic (default), vectors (the synthetic transcripts), order or sign (ladders)"),
    "posture": (("standing", POSTURES), f"at the first start: {', '.join(POSTURES)} (default standing)"),
    "boot": ((None, 0, WRAP - 1), "BootTime at the first start in ms, 0..4294967295, made odd (default 7654321, vectors: 5000001)"),
    "rtc": (None, "the device's date and time, YYYY-MM-DDTHH:MM:SS (default 2026-11-20T14:05:37)"),
    "time-body": (("4", ("3", "4")), "bytes in the body of time and date: 4 (default, as in the field) or 3 (as printed)"),
    "length": (tuple(LENGTHS), "what the length byte counts: body (default), n-4, n-2 or frame"),
    "answer-length": ((None, tuple(LENGTHS)), "what the length byte of answers counts (default: as for requests)"),
    "quantum": (("0", "10", "20"), "ms of the grid on which answers leave: 0 (default), 10 or 20"),
    "baud": (("115200", "57600", "9600"), "speed of the port: 115200 (default), 57600 or 9600"),
    "usb": (False, "1: on USB, where the speed means nothing, and a restart takes the port away"),
    "gap": ((0.1, 3600.0), "seconds of silence that end an unfinished or a bad request (default 0.1)"),
    "startup": ((1.0, 3600.0), "seconds that a reboot takes (default 1)"),
    "persist": (True, "1: accepted settings survive power-off (default), 0: they do not"),
    "refuse-status": ((WRONG_STATE, 1, 255), "status code under the fault refuse, 1..255 (default 1)"),
    "bad-crc": (("silence", "acknowledge"), "answer to a bad check value: silence (default) or acknowledge"),
    "unknown": (("acknowledge", "silence"), "answer to an unknown command: acknowledge (default) or silence"),
    "disagree": (("", ("", *SIZES)), "little, middling or much: BootTime drifts and jumps, the device restarts, as the seed draws it"),
    "sway": (True, "0: nothing moves at rest"),
}  # fmt: skip
_FAULTS = {
    "acknowledge": "every answer is an acknowledge without a body",
    "acknowledge-set": "SetValue is acknowledged without a status",
    "set-unanswered": "SetValue takes effect, its answer is lost",
    "not-taken": "SetValue is accepted without effect",
    "neighbour": "an accepted SetValue changes the next word as well",
    "pendant": "after each GetSettings someone changes Target Sounds at the pendant",
    "stands-up": "the wearer starts to stand up as SetValue arrives, which the device refuses",
    "fidget": "the hips move by more than 5 deg/s at rest",
    "unlisted-codes": "all codes of GetSettings are unlisted",
    "unknown-state": "State is 5040 hex",
    "stuck-sensor": "left toe pressure never changes",
    "hip-offset": "right hip X is 3 in too far forward",
    "frozen-clock": "BootTime stands still",
    "clock-jump": "BootTime jumps 5 s ahead at each request",
    "reboot": "the device restarts instead of answering",
    "unsolicited": "a frame with command 160 before each answer and every 0.35 s",
    "wrong-command": "answers carry the next command",
    "short-body": "the last word of an answer is missing, with a good check value",
    "stray-zero": "a byte 00 after each answer",
}


class Device(Model):
    """The device without its wire.

    Of the faults of the line `wrong-id` is a wrong msgID, `refuse` a status other than 0 to SetValue and CancelAction.
    Every fault strikes request by request, so that after and every apply to the faults of the device too.
    """

    KIND = "ekso"
    CONTROL = "handctl.sim.ekso.control_commands"
    HEADER = bytes(range(150, 161))
    OPTIONS = Rows(_OPTIONS)
    FAULTS = _FAULTS

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        given = self.given
        self.preset = given["preset"]
        vectors = self.preset == "vectors"
        found = VECTOR_SETTINGS if vectors else POWER_ON
        self.first_settings = self._ladder(SETTING_COUNT) or found
        self.settings = list(self.first_settings)
        self.feedback = list(VECTOR_FEEDBACK if vectors else FEEDBACK)
        self.body = Body(given["sway"])
        self.body.pose(given["posture"])
        self.pinned: dict[int, int] = {}  # words of GetData that are not computed
        if vectors and options.text("posture") is None:
            self.pinned = dict(VECTOR_DATA)
            self.body.frozen = VECTOR_ANGLES
        default = VECTOR_BOOT if vectors else 7654321
        self.unrest = Unrest.drawn(given["disagree"], random) if given["disagree"] else Unrest(0)
        self.boot_time = BootTime(default if given["boot"] is None else given["boot"], self.unrest.drift)
        self.calendar = Calendar(given["rtc"] or "2026-11-20T14:05:37")
        self.convention = given["length"]
        self.answer_convention = given["answer-length"] or self.convention
        self.speed = None if given["usb"] else int(given["baud"])
        self.sets = self.cancels = self.violations = 0  # SetValue, CancelAction, and command 157, which nobody may send
        self._started = False
        self._grid = 0.0
        self._deaf_until = 0.0
        self._event_at: float | None = None
        self._frozen_boot: int | None = None
        self._inbox = bytearray()
        self._lost = False  # after a bad request: everything is dropped until the line is quiet
        self._heard = 0.0

    # -- power, time ------------------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        super().boot(now)
        self.boot_time.since = self.calendar.since = self._grid = now

    def advance(self, now: float) -> None:
        self.body.advance(max(0.0, now - self.now), self.settings[SWING_TIME] / 100.0)
        for at, kind, ms in self.unrest.due(now - self._grid):
            self.now = self._grid + at
            if kind == "restart":
                self.reboot(ms / 1000.0)
            else:
                self.boot_time.start = (self.boot_time.start + ms) % WRAP
        self.now = now
        self._count()
        if now - self._heard > self.given["gap"]:
            self._inbox.clear()
            self._lost = False
        if "unsolicited" not in self.faults or not self.powered:
            self._event_at = None
        elif self._event_at is None:
            self._event_at = now + EVENT_EVERY
        elif now >= self._event_at:
            self._event_at = now + EVENT_EVERY
            self.send_event(NOTHING)

    def next_event(self) -> float | None:
        back = self._deaf_until if self.absent else None
        unrest = self.unrest.following()
        return soonest(self._event_at, back, None if unrest is None else self._grid + unrest)

    @property
    def absent(self) -> bool:  # type: ignore[override]
        """On USB the port goes with a restart, and is listed again when that is over (ekso dossier §7)."""
        return bool(self.given["usb"]) and self.now < self._deaf_until

    def elapse(self, seconds: float) -> None:
        """The clocks go on as well."""
        self.advance(self.now + seconds)
        self.boot_time.restart(self.boot_ms(), self.now)
        self.calendar.set(self.calendar.text(self.now), self.now)

    def power(self, on: bool) -> None:
        """A second power-on starts BootTime and the counts of the session anew; the wearer stays where he is."""
        super().power(on)
        self._inbox.clear()
        self._lost = False
        if on and self._started:
            self.boot_time.restart(FIRST_BOOT_MS, self.now)
            self.feedback[:3] = [0, 0, 0]
            self.body.stop()
            if not self.given["persist"]:
                self.settings = list(self.first_settings)
            self.dirty = True
        self._started = True

    def reboot(self, seconds: float | None = None) -> None:
        """Off, on, and deaf for as long as that takes."""
        self.power(False)
        self.power(True)
        self._deaf_until = self.now + (self.given["startup"] if seconds is None else seconds)
        self.boot_time.since = self._deaf_until

    def thaw(self) -> Body:
        """The body is computed again, after the fixed pose of a preset or of a control command."""
        self.body.frozen = None
        self.pinned.clear()
        return self.body

    def boot_ms(self) -> int:
        return self.boot_time.read(max(self.now, self.boot_time.since))

    def _count(self) -> None:
        """Steps and whole seconds since the last look go to the counters, which wrap; without power nothing counts."""
        steps = self.body.take_steps()
        if not self.powered or self.now < self._deaf_until:
            self.body.upright = self.body.walked = 0.0
            return
        upright, walked = floor(self.body.upright), floor(self.body.walked)
        self.body.upright -= upright
        self.body.walked -= walked
        for place, more in enumerate((steps, upright, walked)):
            self.feedback[place] = (self.feedback[place] + more) % 65536
        if steps:
            # The last steps, in tenths: the left one a little short, the right one a little slow.
            self.feedback[11:] = [
                max(0, self.settings[STEP_LENGTH] // 10 - 4),
                self.settings[STEP_LENGTH] // 10,
                self.settings[SWING_TIME] // 10,
                self.settings[SWING_TIME] // 10 + 1,
            ]

    # -- messages in --------------------------------------------------------------------------------------------------

    def due(self, pending: bytes) -> int | None:
        known = bytes(self._inbox) + pending
        whole = size(known[1], self.convention) if len(known) > 1 and not self._lost else None
        return None if whole is None or len(known) < whole else max(1, whole - len(self._inbox))

    def feed(self, data: bytes) -> None:
        if self.now < self._deaf_until:
            return
        self._heard = self.now
        self._inbox += data
        while len(self._inbox) > 1 and not self._lost:
            whole = size(self._inbox[1], self.convention)
            if whole is not None and len(self._inbox) < whole:
                return
            request = bytes(self._inbox[: whole or 0])
            del self._inbox[: len(request)]
            # There is no start byte: after a request that makes no sense only a pause can tell where the next starts.
            self._lost = not request or not self._take(request)
        if self._lost:
            self._inbox.clear()

    def _take(self, request: bytes) -> bool:
        """Acts on a whole request; False when its check value is bad and nothing is answered."""
        command, ident = request[0], request[2] * 256 + request[3]
        if crc(request):
            answered: bool = self.given["bad-crc"] == "acknowledge"
            if answered:
                self._reply(frame(command, ident, b"", self.answer_convention), NOTHING)
            return answered
        hits = self.judge()
        if "deaf" in hits:
            return True
        if "reboot" in hits:
            self.reboot()
            return True
        self.body.fidgets = "fidget" in hits
        if "clock-jump" in hits:
            self.boot_time.start = (self.boot_time.start + JUMP_MS) % WRAP
        answer = self._answer(command, request[4:-2], hits)
        if answer is None or ("set-unanswered" in hits and command == SET_VALUE):
            return True
        if "acknowledge" in hits or ("acknowledge-set" in hits and command == SET_VALUE):
            answer = b""
        if "short-body" in hits:
            answer = answer[:-2]
        if "unsolicited" in hits:
            self.send_event(hits)
        if "wrong-command" in hits:
            command = command + 1 if command < CANCEL else TIME
        tail = b"\0" if "stray-zero" in hits else b""
        self._reply(frame(command, ident, answer, self.answer_convention) + tail, hits)
        return True

    def _reply(self, data: bytes, hits: frozenset[str]) -> None:
        due = self.now
        if quantum := int(self.given["quantum"]) / 1000.0:
            due = self._grid + quantum * ceil((self.now - self._grid) / quantum - 0.000001)
        self.replies.append(Reply(due, data, hits))

    def send_event(self, hits: frozenset[str]) -> None:
        """A frame that nobody asked for; the manual says there are none, field clients know this one."""
        self._reply(frame(EVENT, 0, b"\0\1", self.answer_convention), hits & {"silent"})

    def _answer(self, command: int, body: bytes, hits: frozenset[str]) -> bytes | None:
        """The body of the answer; None: silence."""
        if command in BODY_SIZES and len(body) != BODY_SIZES[command]:
            return b""  # "at least an acknowledge" (manual §6); a guess for a body of the wrong size
        year, month, day, *time = self.calendar.read(self.now)
        if command in (TIME, DATE):
            return bytes(time if command == TIME else [year - 2000, month, day]) + bytes(
                int(self.given["time-body"]) - 3
            )
        numbers = [int.from_bytes(body[place : place + 2], "big") for place in range(0, len(body), 2)]
        words: dict[int, Callable[[], Sequence[int]]] = {
            152: lambda: self._settings_words(hits),
            153: lambda: self.data_words(hits),
            154: lambda: self._ladder(FEEDBACK_COUNT) or [*self.feedback, *self._boot_words(hits)],
            SET_VALUE: lambda: [self._set(numbers[0], numbers[1], hits)],
            CANCEL: lambda: [self._cancel(numbers[0], hits)],
            157: lambda: [self._refuse_movement()],  # met in the field, not in the manual, as the next two
            158: lambda: [self.data_words(hits)[STATE_WORD], MIN_STATE, 0],
            159: lambda: [1 if self.body.posture == "standing" else 0],
        }
        if command in words:
            found = words[command]()
            return struct.pack(f">{len(found)}H", *found)
        return b"" if self.given["unknown"] == "acknowledge" else None

    def _ladder(self, count: int) -> list[int]:
        """Words that all differ, of the presets that have such."""
        step = LADDERS.get(self.preset)
        return [step[0] + step[1] * place for place in range(count)] if step else []

    def _refuse_movement(self) -> int:
        self.violations += 1
        return NOT_ALLOWED

    # -- what they say ------------------------------------------------------------------------------------------------

    def _settings_words(self, hits: frozenset[str]) -> list[int]:
        words = list(self.settings)
        if "unlisted-codes" in hits:
            for place in CODES:
                words[place] = words[place] if place == PILOT_ID else 40 + place
        if "pendant" in hits:
            self.settings[TARGET_SOUNDS] = (self.settings[TARGET_SOUNDS] + 1) % 4
            self.dirty = True
        return words

    def data_words(self, hits: frozenset[str]) -> list[int]:
        """The 27 words of GetData at this moment."""
        if ladder := self._ladder(DATA_COUNT):
            return ladder
        pitch, roll, *joints = self.body.angles()
        words = [_raw(pitch, 100), _raw(roll, 100), *(_raw(value, 1) for value in self.body.pressures())]
        upper, lower = self.settings[0] / 100.0, self.settings[1] / 100.0
        for side in (RIGHT, LEFT):
            forward, height = hips(pitch, joints[2 * side], joints[2 * side + 1], upper, lower)
            words += [_raw(forward, 10), _raw(height, 100)]
        for current, angle in zip(self.body.currents(), joints, strict=True):
            words += [_raw(current, 100), _raw(angle, 100)]
        words += [self.body.state, FOOT_STATE, MIN_STATE, self.body.buttons(), _raw(self.body.weight_shift(), 1000)]
        words += [HMI_DATA, VA_REF_TIME, *self._boot_words(hits)]
        for place, raw in self.pinned.items():
            words[place] = raw
        if "unknown-state" in hits:
            words[STATE_WORD] = 20544
        if "stuck-sensor" in hits:
            words[4] = STUCK_COUNTS
        if "hip-offset" in hits:
            words[6] = (words[6] + OFFSET_TENTHS) % 65536
        return words

    def _boot_words(self, hits: frozenset[str]) -> tuple[int, int]:
        """High word first."""
        if "frozen-clock" not in hits:
            self._frozen_boot = None
        elif self._frozen_boot is None:
            self._frozen_boot = self.boot_ms()
        return divmod(self.boot_ms() if self._frozen_boot is None else self._frozen_boot, 65536)

    # -- what they do -------------------------------------------------------------------------------------------------

    def _set(self, parameter: int, raw: int, hits: frozenset[str]) -> int:
        """The status word of SetValue. The order of the checks is a guess, and so is the state byte."""
        self.sets += 1
        if "stands-up" in hits:
            self.thaw().pose("rising")
        if "refuse" in hits:
            return self._status(self.given["refuse-status"], hits)
        place = PLACE.get(parameter)
        verdict = NOT_ALLOWED if place is None else judge_value(place, raw)
        if place is None or verdict == NOT_ALLOWED:
            return NOT_ALLOWED
        if self.data_words(hits)[STATE_WORD] // 4096 not in (1, 2):
            return self._status(WRONG_STATE, hits)
        if verdict == ACCEPTED and "not-taken" not in hits:
            self.settings[place] = raw
            if "neighbour" in hits:
                other = (place + 1) % SETTING_COUNT
                self.settings[other] = (self.settings[other] + 1) % 65536
            self.dirty = True
        return verdict

    def _cancel(self, word: int, hits: frozenset[str]) -> int:
        """The status word of CancelAction. That it ends a movement is a guess."""
        self.cancels += 1
        if word == 0:
            return NOT_ALLOWED
        if "refuse" in hits:
            return self._status(self.given["refuse-status"], hits)
        self.body.stop()
        return ACCEPTED

    def _status(self, code: int, hits: frozenset[str]) -> int:
        """Only with code 1 the high byte says anything: that of State."""
        return code + (self.data_words(hits)[STATE_WORD] // 256 * 256 if code == WRONG_STATE else 0)

    # -- faults that know the message -----------------------------------------------------------------------------------

    def readdress(self, data: bytes) -> bytes:
        ident = (data[2] * 256 + data[3] + 1) % 65536
        return seal(data[:2] + ident.to_bytes(2, "big") + data[4:-2])

    def twin(self, data: bytes) -> bytes:
        """The second device differs in the last byte of the body: BootTime, or the status; nothing in a bare acknowledge."""
        return data if len(data) < 7 else seal(data[:-3] + bytes([(data[-3] + 2) % 256]))


def _raw(value: float, scale: int) -> int:
    """The nearest whole number of 1/scale as a word, negative ones as two's complement."""
    return floor(value * scale + 0.5) % 65536


# -- messages ----------------------------------------------------------------------------------------------------------


def _shifted(byte: int) -> int:
    """What a byte at the top of the register comes to when it has been shifted out."""
    register = byte * 256
    for _ in range(8):
        register = register * 2 % 65536 ^ (4129 if register >= 32768 else 0)
    return register


SHIFTED = [_shifted(byte) for byte in range(256)]


@lru_cache(1024)
def crc(data: bytes) -> int:
    """CRC-CCITT: polynomial x^16 + x^12 + x^5 + 1, start FFFF, not reflected, no final XOR (manual §6, CRC table)."""
    register = 65535
    for byte in data:
        register = register % 256 * 256 ^ SHIFTED[register // 256 ^ byte]
    return register


def frame(command: int, ident: int, body: bytes, convention: str = "body") -> bytes:
    """A message in either direction; the length byte counts by this convention (the manual does not say by which)."""
    head = bytes([command, (len(body) + LENGTHS[convention]) % 256, ident // 256, ident % 256])
    return seal(head + body)


def seal(data: bytes) -> bytes:
    """The bytes with their check value, high byte first."""
    return data + crc(data).to_bytes(2, "big")


def size(length: int, convention: str) -> int | None:
    """Bytes of the whole message by its length byte; None when no message can be that short."""
    count = length - LENGTHS[convention]
    return None if count < 0 else count + 6
