"""A simulated EksoNR behind its DataPort: messages in and out, settings, faults (manual §6).

Written from the manual and its dossier alone, by other means than the host: decimal numbers, `struct`, a bitwise CRC.
The manual is silent on much: length byte, status codes, states, and everything that goes wrong. What a guess fills is
marked so here; nothing seen here is evidence about a real device.
"""

from __future__ import annotations

import struct
from math import ceil, floor

from handctl.sim.ekso import tables, wire
from handctl.sim.ekso.body import LEFT, POSTURES, RIGHT, Body, hips
from handctl.sim.ekso.clock import FIRST_BOOT_MS, SIZES, WRAP, BootTime, Calendar, Unrest
from handctl.sim.ekso.options import FAULTS, OPTIONS
from handctl.sim.ekso.wire import BODY_SIZES, LENGTHS, crc, frame, seal, size
from handctl.sim.engine.model import NOTHING, Model, Options, Random, Reply

TYPE_CHECKING = False
if TYPE_CHECKING:
    pass

ACCEPTED, WRONG_STATE, NOT_ALLOWED = 0, 1, 3  # status codes of field clients; the manual has none
EVENT_EVERY = 0.35  # s between frames that nobody asked for
JUMP_MS = 5000
FOOT_STATE, MIN_STATE, HMI_DATA, VA_REF_TIME = 1028, 0, 1, 12  # constants of the log, but for the last (0 there)
STATE_WORD, TARGET_SOUNDS = 18, 12  # places in GetData and GetSettings
STUCK_COUNTS, OFFSET_TENTHS = 333, 30
CODES = range(10, 22)  # words of GetSettings that hold codes, the PilotID aside
PILOT_ID, STEP_LENGTH, SWING_TIME = 19, 2, 4


class Device(Model):
    """The device without its wire.

    Of the faults of the line `wrong-id` is a wrong msgID, `refuse` a status other than 0 to SetValue and CancelAction.
    Every fault strikes request by request, so that after and every apply to the faults of the device too.
    """

    KIND = "ekso"
    USE = "handctl.sim.ekso.use"
    CONTROL = "handctl.sim.ekso.control"
    HEADER = bytes(range(150, 161))
    OPTIONS = OPTIONS
    FAULTS = FAULTS

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        self.preset = options.choice("preset", "clinic", tables.PRESETS)
        self.first_settings = _first_settings(self.preset)
        self.settings = list(self.first_settings)
        self.feedback = list(tables.VECTOR_FEEDBACK if self.preset == "vectors" else tables.FEEDBACK)
        self.body = Body(options.choice("sway", "1", ("0", "1")) == "1")
        self.body.pose(options.choice("posture", "standing", POSTURES))
        self.pinned: dict[int, int] = {}  # words of GetData that are not computed
        if self.preset == "vectors":
            self.pinned = {place: raw for place, raw in tables.VECTOR_DATA.items() if options.text("posture") is None}
            self.body.frozen = tables.VECTOR_ANGLES if self.pinned else None
        default = tables.VECTOR_BOOT if self.preset == "vectors" else 7654321
        size = options.choice("disagree", "", ("", *SIZES))
        self.unrest = Unrest.drawn(size, random) if size else Unrest(0)
        self.boot_time = BootTime(options.integer("boot", default, 0, WRAP - 1), self.unrest.drift)
        self.calendar = Calendar(options.text("rtc") or "2026-11-20T14:05:37")
        self._pad = bytes(int(options.choice("time-body", "4", ("3", "4"))) - 3)
        self.convention = options.choice("length", "body", tuple(LENGTHS))
        self.answer_convention = options.choice("answer-length", self.convention, tuple(LENGTHS))
        self._quantum = int(options.choice("quantum", "0", ("0", "10", "20"))) / 1000.0
        baud = int(options.choice("baud", "115200", ("115200", "57600", "9600")))
        self._on_usb = options.choice("usb", "0", ("0", "1")) == "1"
        self.speed = None if self._on_usb else baud
        self._gap = options.seconds("gap", 0.1, 3600.0)
        self._startup = options.seconds("startup", 1.0, 3600.0)
        self._persist = options.choice("persist", "1", ("0", "1")) == "1"
        self._refuse_status = options.integer("refuse-status", WRONG_STATE, 1, 255)
        self._bad_crc_answered = options.choice("bad-crc", "silence", ("silence", "acknowledge")) == "acknowledge"
        self._unknown_answered = options.choice("unknown", "acknowledge", ("silence", "acknowledge")) == "acknowledge"
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
        if now - self._heard > self._gap:
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
        soon = (self._event_at, back, None if unrest is None else self._grid + unrest)
        return min((when for when in soon if when is not None), default=None)

    @property
    def absent(self) -> bool:
        """On USB the port goes with a restart, and is listed again when that is over (ekso dossier §7)."""
        return self._on_usb and self.now < self._deaf_until

    def elapse(self, seconds: float) -> None:
        """The clocks go on as well."""
        self.advance(self.now + seconds)
        self.boot_time.restart(self.boot_ms(), self.now)
        self.calendar.set(self.calendar.text(self.now), self.now)

    def power(self, on: bool) -> None:
        """A second power-on starts BootTime and the counts of the session anew; the wearer stays where he is."""
        self.powered = on
        self._inbox.clear()
        self._replies.clear()
        self._lost = False
        if on and self._started:
            self.boot_time.restart(FIRST_BOOT_MS, self.now)
            self.feedback[:3] = [0, 0, 0]
            self.body.stop()
            if not self._persist:
                self.settings = list(self.first_settings)
            self.dirty = True
        self._started = True

    def reboot(self, seconds: float | None = None) -> None:
        """Off, on, and deaf for as long as that takes."""
        self.power(False)
        self.power(True)
        self._deaf_until = self.now + (self._startup if seconds is None else seconds)
        self.boot_time.since = self._deaf_until

    def thaw(self) -> None:
        """The body is computed again, after the fixed pose of a preset or of a control command."""
        self.body.frozen = None
        self.pinned.clear()

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
            if self._bad_crc_answered:
                self._reply(frame(command, ident, b"", self.answer_convention), NOTHING)
            return self._bad_crc_answered
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
        if answer is None or ("set-unanswered" in hits and command == wire.SET_VALUE):
            return True
        if "acknowledge" in hits or ("acknowledge-set" in hits and command == wire.SET_VALUE):
            answer = b""
        if "short-body" in hits:
            answer = answer[:-2]
        if "unsolicited" in hits:
            self.send_event(hits)
        if "wrong-command" in hits:
            command = command + 1 if command < wire.CANCEL else wire.TIME
        tail = b"\0" if "stray-zero" in hits else b""
        self._reply(frame(command, ident, answer, self.answer_convention) + tail, hits)
        return True

    def _reply(self, data: bytes, hits: frozenset[str]) -> None:
        due = self.now
        if self._quantum:
            due = self._grid + self._quantum * ceil((self.now - self._grid) / self._quantum - 0.000001)
        self._replies.append(Reply(due, data, hits))

    def send_event(self, hits: frozenset[str]) -> None:
        """A frame that nobody asked for; the manual says there are none, field clients know this one."""
        self._reply(frame(wire.EVENT, 0, b"\0\1", self.answer_convention), hits & {"silent"})

    def _answer(self, command: int, body: bytes, hits: frozenset[str]) -> bytes | None:
        """The body of the answer; None: silence."""
        if command in BODY_SIZES and len(body) != BODY_SIZES[command]:
            return b""  # "at least an acknowledge" (manual §6); a guess for a body of the wrong size
        year, month, day, hour, minute, second = self.calendar.read(self.now)
        match command:
            case wire.TIME:
                return bytes([hour, minute, second]) + self._pad
            case wire.DATE:
                return bytes([year - 2000, month, day]) + self._pad
            case wire.SETTINGS:
                return _pack(self._settings_words(hits))
            case wire.DATA:
                return _pack(self.data_words(hits))
            case wire.FEEDBACK:
                return _pack(self._feedback_words(hits))
            case wire.SET_VALUE:
                return _pack([self._set(int.from_bytes(body[:2], "big"), int.from_bytes(body[2:], "big"), hits)])
            case wire.CANCEL:
                return _pack([self._cancel(int.from_bytes(body, "big"), hits)])
            case wire.MOVE:
                self.violations += 1
                return _pack([NOT_ALLOWED])
            case wire.STATE_DATA:
                return _pack([self.data_words(hits)[STATE_WORD], MIN_STATE, 0])
            case wire.STEP_READY:
                return _pack([1 if self.body.posture == "standing" else 0])
        return b"" if self._unknown_answered else None

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
        if self.preset in ("order", "sign"):
            return tables.ladder(self.preset, tables.DATA_COUNT)
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

    def _feedback_words(self, hits: frozenset[str]) -> list[int]:
        if self.preset in ("order", "sign"):
            return tables.ladder(self.preset, tables.FEEDBACK_COUNT)
        return [*self.feedback, *self._boot_words(hits)]

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
            self.thaw()
            self.body.pose("rising")
        if "refuse" in hits:
            return self._status(self._refuse_status, hits)
        place = tables.PLACE.get(parameter)
        verdict = NOT_ALLOWED if place is None else tables.judge_value(place, raw)
        if place is None or verdict == NOT_ALLOWED:
            return NOT_ALLOWED
        if self.data_words(hits)[STATE_WORD] // 4096 not in (1, 2):
            return self._status(WRONG_STATE, hits)
        if verdict == ACCEPTED and "not-taken" not in hits:
            self.settings[place] = raw
            if "neighbour" in hits:
                other = (place + 1) % tables.SETTING_COUNT
                self.settings[other] = (self.settings[other] + 1) % 65536
            self.dirty = True
        return verdict

    def _cancel(self, word: int, hits: frozenset[str]) -> int:
        """The status word of CancelAction. That it ends a movement is a guess."""
        self.cancels += 1
        if word == 0:
            return NOT_ALLOWED
        if "refuse" in hits:
            return self._status(self._refuse_status, hits)
        self.body.stop()
        return ACCEPTED

    def _status(self, code: int, hits: frozenset[str]) -> int:
        """Only with code 1 the high byte says anything: that of State."""
        return code + (self.data_words(hits)[STATE_WORD] // 256 * 256 if code == WRONG_STATE else 0)

    # -- faults that know the message -----------------------------------------------------------------------------------

    def spoil(self, data: bytes) -> bytes:
        return data[:-1] + bytes([(data[-1] + 1) % 256])

    def readdress(self, data: bytes) -> bytes:
        ident = (data[2] * 256 + data[3] + 1) % 65536
        return seal(data[:2] + ident.to_bytes(2, "big") + data[4:-2])

    def twin(self, data: bytes) -> bytes:
        """The second device differs in the last byte of the body: BootTime, or the status; nothing in a bare acknowledge."""
        return data if len(data) < 7 else seal(data[:-3] + bytes([(data[-3] + 2) % 256]))


def _first_settings(preset: str) -> tuple[int, ...]:
    if preset in ("order", "sign"):
        return tuple(tables.ladder(preset, tables.SETTING_COUNT))
    return tables.VECTOR_SETTINGS if preset == "vectors" else tables.POWER_ON


def _raw(value: float, scale: int) -> int:
    """The nearest whole number of 1/scale as a word, negative ones as two's complement."""
    return floor(value * scale + 0.5) % 65536


def _pack(words: list[int]) -> bytes:
    return struct.pack(f">{len(words)}H", *words)
