"""Start a session: run the table of `connect_table` on one line. Send what a row allows, wait, and go to the next state."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from handctl.devices.barrett import state_files
from handctl.devices.barrett.gcl import connect_table as table
from handctl.devices.barrett.gcl.codec import ABORT, CR, MOTORS, has_prompt, values
from handctl.devices.barrett.parameter_map import SPEEDS, with_sign
from handctl.errors import HandctlError, Hint, LinkError, NoAnswer, NotRunning, ProtocolError, joined
from handctl.link import ByteLink
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.devices.barrett.gcl.line import GclLine

ABORT_COLLECT = 0.15
LATE_PROMPT = 0.25
PAUSE, MIDDLE = 0.1, 0.3
"""Seconds of silence that end a text, and the longest that is waited for it beyond the wire time of a banner."""
APART = 0.1
"""Seconds between two reads of P that show whether the hand moves."""
PROGRESS = {
    table.SILENT: "no reply yet. Listening in case the hand is starting or busy, then trying other baud rates",
    table.BOOTING: "the hand has just been switched on. Waiting for its firmware without sending anything",
    table.RESTARTED: "the firmware has started. Waiting for its prompt",
}
CUT_OFF = "a firmware download was cut off here, so the firmware in the hand is incomplete"
LOAD_AGAIN = "switch the hand off, do not move it, and load the whole file again: `handctl barrett firmware download FILE`. If another program has loaded it since, delete {}"
REMEDY = "run it again in a few seconds if the hand was just switched on. If it was off for more than a day or two, it may have lost its firmware: `handctl barrett firmware download FILE` (barrett §3.7, §8)"
TELL_APART = Hint(
    "Another device that echoes looks the same. To find out, run {} and switch the hand's power supply off and on: only a boot monitor sends ':'",
    "barrett listen --duration 30",
)
NO_ECHO = "a BarrettHand echoes every character. Check the adapter or the device server: turn off half duplex and echo suppression"
BUSY_HINT = Hint("A hand does not reply while it moves or saves: {} or --interrupt ends a movement", "barrett stop")

MOST = 2
"""A state is entered so often: a device that says what is never an answer must not lead round in a circle."""


class SessionStart:
    """One connect. `told`: the meanings of the rows taken."""

    def __init__(self, line: GclLine) -> None:
        self.line = line
        self.link = line.link
        self.told: list[str] = []
        self.tried: list[tuple[int | None, bytes]] = []
        known = state_files.recall(self.link) if line.only is None else None
        self._first = line.only or known or self.link.baud or SPEEDS[0]
        fixed = line.only is not None or not self.link.can_set_baud
        self._others = self._all_others = (
            () if fixed else tuple(speed for speed in SPEEDS if speed not in (self._first, SPEEDS[0]))
        )
        self._remembered = not fixed and self._first != table.MONITOR_SPEED
        self._garbage = b""
        self._woke = self._repeated = self._colon = False
        self._asked = b""
        self._echoed: list[float] = []
        self._other = b""
        self._entered: Counter[str] = Counter()

    def run(self) -> None:
        """Until READY; the line keeps what was tried. Raises DeviceRefused for a boot monitor, NoAnswer, ProtocolError."""
        self.line.tried = self.tried
        if state_files.is_half_loaded(self.link):
            # No banner and no prompt shows that it is whole: half an image may print them as well.
            hint = LOAD_AGAIN.format(state_files.downloads_path())
            raise NotRunning(f"{self.link.name}: {CUT_OFF}. Nothing was sent", hint=hint)
        state, came = table.OPENED, self.line.waiting()
        while True:
            seen = table.seen_in(came, self._asked)
            row = table.RULES[state, seen]
            if seen == table.OTHER:
                seen, row = self._judge_other(state, came, row)
            self._colon = self._colon or seen == table.COLON
            if row.said:
                self.told.append(row.said)
            if seen in (table.BYTES, table.ECHO):
                self._garbage += came
                self._woke = self._woke or bool(self._entered[table.SILENT] and state in (table.ELSEWHERE, table.AGAIN))
            state = self._next(state, row.next)
            if self._entered[state] == MOST:
                self._garbage, state = self._garbage or came, table.GARBAGE
            if state in table.ENDS:
                break
            if self.line.over:
                raise self._failure(table.GARBAGE if self._garbage else table.NOBODY)
            came = self._look(state, row.send, came)
        if state != table.READY:
            raise self._failure(state)
        self._ready(came)

    def _judge_other(self, state: str, came: bytes, row: table.Row) -> tuple[str, table.Row]:
        """Twice the same other text is this hand's way to answer; once it may be noise."""
        answer, before = table.answer_in(came).strip(), self._other
        self._other = answer
        if state != table.PROVED or answer == before:
            return table.OTHER, row
        return table.BYTES, table.RULES[state, table.BYTES]

    def _next(self, state: str, wanted: str) -> str:
        """The state that `wanted` means here: remembered baud rate, baud rates left, an undecidable echo."""
        if wanted == table.ASKED and state == table.AGAIN:
            if self._woke and not self._repeated:
                self._repeated, self._others = True, self._all_others
                return table.ASKED
            wanted = table.NOBODY
        if wanted == table.ASKED and state == table.OPENED and self._remembered:
            return table.REMEMBERED
        if wanted == table.ELSEWHERE and not self._others:
            return table.AGAIN
        if wanted == table.ECHOED and not self.link.can_set_baud:
            return table.WIRE
        if wanted == table.MONITOR and self.link.can_set_baud and self.line.only not in (None, table.MONITOR_SPEED):
            return table.GARBAGE
        return table.GARBAGE if wanted == table.NOBODY and self._garbage else wanted

    # -- one state ---------------------------------------------------------------------------------------------------

    def _look(self, state: str, send: str, came: bytes) -> bytes:
        """Send what the row allows, wait as long as the state says; all bytes since the last question."""
        line = self.line
        self._entered[state] += state != table.ELSEWHERE  # which is left when no speed is left
        if state in PROGRESS:
            line.journal.progress(f"{self.link.name}: {PROGRESS[state]}")
        self._set_speed(state)
        if send == table.SEND_NOTHING:
            return came + self._hear(self._seconds(state))
        if send == table.LOOP_TEST:
            self._asked = table.LOOPED
            return table.LOOPED if comes_back(self.link) else b""
        if send == table.ABORTS:
            return self._leave(state)
        if send == table.REST:
            return self._ask(b"", self._seconds(state), table.FILL)
        if state == table.CLEARED and table.question_in(late := self._hear(LATE_PROMPT + line.wire_seconds(8))):
            return late  # the hand had kept the request, and has carried it out now
        early = self._abort() if line.interrupt else b""
        return self._ask(early, self._seconds(state))

    def _set_speed(self, state: str) -> None:
        if not self.link.can_set_baud or state in table.SAME_SPEED:
            return
        if state == table.AGAIN and self._entered[table.RESTARTED]:
            return  # a banner could be read at this speed
        speed = {table.ASKED: self.line.only or SPEEDS[0], table.ELSEWHERE: (self._others or [0])[0]}.get(
            state, self._first
        )
        if state == table.ELSEWHERE:
            self._others = self._others[1:]
        if state != table.ECHOED and self.link.baud != speed:
            self._echoed.clear()
            self.link.set_baud(speed)

    def _seconds(self, state: str) -> float:
        line = self.line
        if state == table.SILENT:
            return max(0.0, table.SECONDS[state] - (self.link.now() - line.opened))
        slow = line.timeout or 0.0  # a line that is slower than ours
        return max(table.SECONDS[state], slow) + line.wire_seconds(16)

    def _ask(self, early: bytes, seconds: float, question: bytes = table.QUESTION) -> bytes:
        link = self.link
        self._asked = table.QUESTION
        try:
            link.write(question, link.deadline(1.0))
        except LinkError:
            if not link.replayed:
                raise
            if question != table.QUESTION:
                return b""  # of an older recording: it was not sent
            self._asked = b""  # an older recording: it was asked with an empty line
            link.write(CR, link.deadline(1.0))
        begun = link.now()
        came = self._hear(seconds)
        self.tried.append((link.baud, came))
        if table.question_in(came) and (has_prompt(came) or b"=>" not in came):  # else it was answered, and damaged
            self._echoed.append(begun)
        if early and has_prompt(early) and has_prompt(came) and table.LOOP not in came.decode("latin-1"):
            return came
        return early + came

    def _hear(self, seconds: float) -> bytes:
        """Data within `seconds`; if it has begun by then, also its rest: it may be the banner."""
        came = self.line.until_prompt(seconds)
        end = self.link.deadline(MIDDLE + self.line.wire_seconds(64))
        while came and not has_prompt(came) and not end.expired:
            more = self.line.until_prompt(PAUSE)
            if not more:
                break
            came += more
        return came

    def _abort(self) -> bytes:
        """^C first, for those who may end what runs; its prompt, when one comes."""
        link = self.link
        link.write(self.line.abort_bytes, link.deadline(1.0))
        early = self.line.until_prompt(max(ABORT_COLLECT, self.line.timeout or 0.0) + self.line.wire_seconds(32))
        if b"ERR 16384" in early:
            self.line.journal.info("stopped", "^C ended a movement of the hand")
        return early

    def _leave(self, state: str) -> bytes:
        """Bytes but no prompt: noise, or a control block of RealTime that wants its rest (dossier 1.5, step 4)."""
        if self.line.interrupt:
            self._asked = b""
            rest = self.line.leave_loop()
            return b"\n\r=> " if rest is None else rest
        return self._ask(b"", self._seconds(state), table.FILL)

    # -- the end -----------------------------------------------------------------------------------------------------

    def _ready(self, came: bytes) -> None:
        line, link = self.line, self.link
        line.found()
        if not table.is_answer(came):  # what it answers to the question may still come, and would pass for an answer
            line.until_prompt(LATE_PROMPT + line.wire_seconds(8))
        if self._echoed:
            slow = link.now() - self._echoed[0] + LATE_PROMPT + line.wire_seconds(8)
            for _ in self._echoed[1:]:  # the prompt that came answered the first; as late as that, the others' follow
                line.until_prompt(slow)
        if table.seen_in(came, self._asked) == table.OTHER:
            line.until_prompt(LATE_PROMPT + line.wire_seconds(8))  # a prompt more may belong to it
            line.odd(table.QUESTION_TEXT, table.answer_in(came), table.MANUAL_ANSWER)
        state_files.remember(link)
        if table.RESTARTED_TEXT in self.told:
            line.journal.warn("restarted", f"{link.name}: {table.RESTARTED_TEXT}", hint=Hint("{}", "barrett init"))
        elif table.BUSY in self.told:
            line.journal.info("busy", f"{link.name}: {table.BUSY}")
        if link.can_set_baud and link.baud != self._first:
            line.journal.info(
                "speed", f"the hand uses {link.baud} bit/s", hint=f"use --baud {link.baud} to find it immediately"
            )
        for text in (table.IN_LOOP, table.IN_BLOCK):
            if text in self.told:
                line.journal.warn("loop", f"{link.name}: {text}", hint=Hint("{} ends any movement", "barrett stop"))
                look_for_motion(line)

    def _failure(self, end: str) -> HandctlError:
        link, came = self.link, self._garbage
        speeds = ", ".join(str(speed) for speed in dict.fromkeys(speed for speed, _ in self.tried) if speed)
        tried = f"at {speeds} bit/s" if speeds and link.can_set_baud else "on this link"
        shown = came[:24].hex(" ").upper()
        if end == table.MONITOR:
            if self._colon:
                return NotRunning(f"{link.name}: {table.MONITOR_TEXT}. Nothing more was sent", hint=REMEDY)
            text = f"{link.name}: our own bytes come back at {table.MONITOR_SPEED} bit/s, but not at {table.LOOP_SPEED}: {table.MONITOR_TEXT}. Nothing more was sent"
            return NotRunning(text, hint=joined(REMEDY, TELL_APART))
        if end == table.ECHOLESS:
            return without_echo(link, self.tried[-1][1])
        if end in (table.WIRE, table.GARBAGE):
            echo = end == table.WIRE or not came.strip(ABORT + CR + b"!\0")
            if echo and not link.can_set_baud:
                text = f"{link.name}: only our own bytes come back: an echo (TX and RX connected), or the boot monitor of a hand without firmware: {shown}"
                return ProtocolError(text, hint=TELL_APART, code="echo-or-monitor", came=came)
            lacking = "no prompt" if b"=>" not in came else "no reply to the request"
            return ProtocolError(
                f"{link.name}: {lacking} {tried}, but {plural(len(came), 'byte')} arrived: {shown}",
                hint="check the wiring: this is an echo (TX and RX connected). If the bytes still come back with the hand unplugged, the wiring is at fault"
                if echo
                else "check the port and the cable, then power-cycle the hand: it may be another device, or a disturbed line",
                code="echo" if echo else "garbage",
                came=came,
            )
        return NoAnswer(f"{link.name}: no reply {tried}", hint=f"{table.SILENCE}. {BUSY_HINT}")


def without_echo(link: ByteLink, came: bytes) -> ProtocolError:
    """The error of a hand that replies at the present baud rate, and does not echo: `came` is its reply."""
    at = f"at {link.baud} bit/s" if link.can_set_baud else "on this link"
    text = f"{link.name}: a prompt arrives {at}, but no echo of the request, so a reply cannot be matched with its request: {came[:24].hex(' ').upper()}"
    return ProtocolError(text, hint=NO_ECHO, code="no-echo", came=came)


def comes_back(link: ByteLink) -> bool:
    """Whether a byte comes back that only a wire can give back; the port's speed is as before then."""
    speed = link.baud
    link.set_baud(table.LOOP_SPEED)
    try:
        link.write(table.LOOPED, link.deadline(1.0))
        return link.read(link.deadline(table.SECONDS[table.ECHOED])) == table.LOOPED
    finally:
        link.set_baud(speed or SPEEDS[0])


def look_for_motion(line: GclLine) -> list[str]:
    """Read P twice and warn about the motors whose position differs; [] if none moves or P cannot be read."""
    try:
        first, second = _places(line), _places(line, APART)
    except HandctlError:
        return []
    moving = [
        f"{motor} {before} to {after}"
        for motor, before, after in zip(MOTORS, first, second, strict=True)
        if before != after
    ]
    if moving:
        line.journal.warn(
            "moving",
            f"{line.link.name}: the hand is moving: {', '.join(moving)} counts in {APART:g} s",
            hint=Hint("{} stops it", "barrett stop"),
        )
    return moving


def _places(line: GclLine, after: float = 0.0) -> list[int]:
    line.link.sleep(after)
    answer = line.ask("FGET P")
    if answer.status:
        raise ProtocolError(
            f"{line.link.name}: cannot read the positions: ERR {answer.status}",
            hint=Hint("{} shows each motor", "barrett status"),
        )
    (places,) = values(answer, 1, 4)
    return [with_sign(index, place, line.sign) for index, place in enumerate(places)]
