"""One conversation with a BarrettHand: find its speed, send a command, wait for its prompt, stop what moves.

Follows the dossier's order at connect: ^C first (a bare CR would carry out a half-typed line), then CR, then the
prompt tells the speed. One command at a time; nothing but ^C is sent before the prompt.
"""

from __future__ import annotations

from collections.abc import Callable

from handctl.devices.barrett.commands import SECONDS, split
from handctl.devices.barrett.language import ABORT, CR, PROMPT, Answer, Decoder, encode, has_prompt
from handctl.devices.barrett.parameters import SPEEDS
from handctl.errors import HandctlError, LinkError, NoAnswer, ProtocolError
from handctl.link import ByteLink, Deadline
from handctl.result import Journal

ECHO_SECONDS = 1.0
POWER_ON_SECONDS = 2.0
ABORT_COLLECT = 0.15
PROMPT_WAIT = 0.5
LATE_PROMPT = 0.25
QUIET = 0.2
LOOP_EXITS = 9
LONGEST = 4
DEFAULT_RETRIES = 2


class GclLine:
    """The supervisory line of one hand.

    timeout   seconds for the prompt of a query, None = the command's own (dossier 1.3)
    speeds    speeds to try at connect; () where the link has none
    """

    def __init__(
        self,
        link: ByteLink,
        journal: Journal,
        *,
        timeout: float | None = None,
        retries: int = DEFAULT_RETRIES,
        bound: Deadline | None = None,
        speed: int | None = None,
    ) -> None:
        self.link = link
        self.journal = journal
        self.timeout = timeout
        self.retries = retries
        self.bound = bound
        self._only = speed
        self._connected = False

    # -- connect -------------------------------------------------------------------------------------------------

    def connect(self) -> None:
        """Find the hand's speed and its prompt. Raises NoAnswer, ProtocolError naming what was tried."""
        link = self.link
        if self._connected:
            return
        first = self._only or link.baud or SPEEDS[0]
        speeds = (
            [first] if self._only is not None or not link.can_set_baud else [first, *(s for s in SPEEDS if s != first)]
        )
        garbage = b""
        for speed in speeds:
            came = self._knock_at(speed)
            if came and not garbage and speed != first:
                # Silent at its speed, heard at another: a hand that was busy, saving say, has woken up meanwhile.
                came += self._knock_at(first)
            if self._connected:
                if link.can_set_baud and link.baud != first:
                    self.journal.info(
                        "speed", f"the hand answers at {link.baud} bit/s", hint=f"--baud {link.baud} finds it at once"
                    )
                return
            garbage += came
            if self.bound is not None and self.bound.expired:
                break
        tried = f"at {', '.join(map(str, speeds))} bit/s" if link.can_set_baud else "on this link"
        if garbage:
            error = ProtocolError(
                f"{link.name}: no prompt {tried}, but {len(garbage)} bytes came: {garbage[:24].hex(' ').upper()}",
                hint="another device, an echo or a disturbed line: check port and cable; power-cycle the hand",
                code="echo" if not garbage.strip(ABORT + CR) else "garbage",
            )
            error.came = garbage
            raise error
        raise NoAnswer(f"{link.name}: no answer {tried}", hint=SILENCE)

    def _knock_at(self, speed: int) -> bytes:
        if self.link.can_set_baud and self.link.baud != speed:
            self.link.set_baud(speed)
        return self._knock()

    def _knock(self) -> bytes:
        """^C, then CR; connected when the prompt comes. Returns bytes that were no prompt."""
        link = self.link
        if b":" in self.drain():
            # Just powered on: a byte now might be taken by the boot monitor (dossier 1.5, step 2).
            self.journal.info("powered-on", "the hand has just been switched on; waiting 2 s for its firmware")
            link.sleep(POWER_ON_SECONDS)
            self.drain()
        link.write(ABORT, link.deadline(1.0))
        slow = self.timeout or 0.0  # a line that is slower than ours
        early = self._until_prompt(max(ABORT_COLLECT, slow) + self.wire_seconds(8))
        link.write(CR, link.deadline(1.0))
        came = self._until_prompt(max(PROMPT_WAIT, slow) + self.wire_seconds(8))
        if has_prompt(came):
            if not has_prompt(early):
                # Perhaps it was the late answer to ^C: let the one to CR pass too, or it would pass for an answer.
                self._until_prompt(LATE_PROMPT + self.wire_seconds(8))
            self._connected = True
            return b""
        if came or early:
            rest = self.leave_loop()
            if rest is None:
                self._connected = True
                return b""
            came += rest
        return early + came

    def leave_loop(self) -> bytes | None:
        """Bytes but no prompt: the hand may sit in its RealTime loop and take ^C for data (dossier 1.5, step 4).

        None once the prompt has come, otherwise what came instead.
        """
        link = self.link
        came = b""
        for count in range(LOOP_EXITS):
            link.write(ABORT, link.deadline(1.0))
            came += self._until_prompt(0.02 + self.wire_seconds(8))
            if has_prompt(came):
                self.journal.warn(
                    "loop",
                    f"the prompt came after {count + 1} ^C: the hand was in its RealTime loop (each but the last then was a "
                    "small velocity), or the line is disturbed",
                )
                return None
        return came

    # -- commands ------------------------------------------------------------------------------------------------

    def ask(self, command: str, *, at_least: float = 0.0) -> Answer:
        """Send one command once; its answer, whatever its status. Raises NoAnswer, ProtocolError, LinkError.

        `at_least` seconds are allowed, for a movement that is known to be slow.
        """
        self.connect()
        if self.bound is not None and self.bound.expired:
            raise NoAnswer(
                f"{self.link.name}: --deadline is over; {command} was not sent",
                hint="a longer --deadline",
                code="deadline",
            )
        data = encode(command)
        _, known, _ = split(command)
        kind = known.kind if known is not None else "query"
        seconds = (
            self.timeout if self.timeout is not None and kind in ("query", "set") else max(SECONDS[kind], at_least)
        )
        self.drain()
        link = self.link
        answer = Patience(link, seconds + 2 * self.wire_seconds(len(data) + 512), self.bound)
        echo = Patience(link, (self.timeout or ECHO_SECONDS) + 2 * self.wire_seconds(len(data)), self.bound)
        link.write(data, answer.deadline)
        self.journal.counters.sent += 1
        try:
            return self._answer(command, answer, echo)
        except LinkError as exc:
            if kind in ("motion", "init"):
                exc.hint = f"{command} may go on to its end: switch the hand's power off if it must not; {exc.hint}"
            raise
        except (NoAnswer, ProtocolError) as exc:
            error: HandctlError = exc
            if self.bound is not None and self.bound.expired:
                error = NoAnswer(
                    f"{link.name}: --deadline is over, {command} was not answered by then",
                    hint="a longer --deadline",
                    code="deadline",
                )
            if kind in ("motion", "init"):  # whatever still moves must not go on
                self._stop_motors()
                error.hint = f"^C was sent, the motors should stand; {error.hint}"
            raise error from (exc if error is not exc else None)

    def _stop_motors(self) -> None:
        """^C and what belongs to it, whatever --deadline says."""
        bound, self.bound = self.bound, None
        try:
            self.resynchronise()
        finally:
            self.bound = bound

    def read(self, command: str, check: Callable[[Answer], object] = lambda answer: None) -> Answer:
        """A query, repeated after a resynchronisation when no valid answer came; anything else is `ask`ed once.

        `check` raises ProtocolError for an answer that has not the form it must have.
        """
        self.connect()  # a hand that is nowhere is looked for once, not once a repetition
        error: HandctlError | None = None
        for attempt in range(1 + self.retries):
            if attempt:
                self.journal.counters.retries += 1
                self.resynchronise()
            try:
                answer = self.ask(command)
                self._judge(answer, check)
                return answer
            except (NoAnswer, ProtocolError) as exc:
                error = exc
            if self.bound is not None and self.bound.expired:
                break
        assert error is not None
        raise error

    def _judge(self, answer: Answer, check: Callable[[Answer], object]) -> None:
        try:
            check(answer)
        except ProtocolError as exc:
            self.journal.counters.bad_frames += 1
            raise ProtocolError(f"{self.link.name}: {exc.text}", hint=DISTURBED, code=exc.code) from exc

    def _answer(self, command: str, whole: Patience, echo: Patience) -> Answer:
        """The answer within `whole`; without an echo within `echo` nobody is there, and waiting longer is useless."""
        decoder = Decoder(command)
        while True:
            answer = decoder.next()
            if answer is not None and not answer.lines and not answer.status and _must_have_lines(command):
                decoder.drop_prompt()  # a late prompt of something before: a get always has lines or an error
                answer = decoder.next()
            if answer is not None:
                self.journal.counters.received += 1
                self.journal.counters.stray_bytes += decoder.skipped
                if answer.raw.endswith(PROMPT):  # the space behind the prompt, if there is one, is part of it
                    self.link.read(self.link.deadline(0.005 + self.wire_seconds(2)), 1)
                return answer
            until = (whole if decoder.echoed else echo).deadline
            chunk = b"" if until.expired else self.link.read(until)
            if not chunk:
                raise self._failure(command, decoder)
            whole.renew()
            echo.renew()
            decoder.feed(chunk)

    def _failure(self, command: str, decoder: Decoder) -> HandctlError:
        received = decoder.received
        where = f"{self.link.name} at {self.link.baud} bit/s" if self.link.can_set_baud else self.link.name
        if not received:
            return NoAnswer(f"{where}: no answer to {command}", hint=SILENCE)
        self.journal.counters.bad_frames += 1
        shown = received[:48].hex(" ").upper()
        if decoder.echoed:
            code, text = "cut-short", "the answer has no prompt"
        else:
            code, text = "echo-differs", f"the echo differs from {encode(command).hex(' ').upper()}"
        return ProtocolError(
            f"{where}: {text}; came {shown}",
            hint="a disturbed line or a wrong speed: run it again, check the cable",
            code=code,
        )

    def abort(self) -> Answer | None:
        """^C: stop all motors (barrett §5.5 case 4). The answer of the command that ran, None when no prompt comes."""
        link = self.link
        link.write(ABORT, link.deadline(1.0))
        came = self._until_prompt(1.5 + self.wire_seconds(32))
        if not has_prompt(came):
            return None
        decoder = Decoder("")
        decoder.feed(b"\n" + came)
        return decoder.next()

    def resynchronise(self) -> None:
        """After a timeout: ^C, silence, CR (dossier 1.3). The next command finds a fresh prompt, or fails by itself."""
        link = self.link
        link.write(ABORT, link.deadline(1.0))
        quiet = link.deadline(QUIET)
        end = link.deadline(2.0)
        while not end.expired and link.read(quiet):
            quiet = link.deadline(QUIET)
        link.write(CR, link.deadline(1.0))
        self._until_prompt(PROMPT_WAIT + self.wire_seconds(8))

    def reconnect(self) -> None:
        """Look for the hand again, perhaps at another speed (after RESET, PDEF, PLOAD)."""
        self._connected = False
        self.connect()

    def prompt_comes(self) -> bool:
        """Whether a prompt comes within the usual time."""
        return has_prompt(self._until_prompt(PROMPT_WAIT + self.wire_seconds(8)))

    def collect(self, seconds: float) -> bytes:
        """What the hand says by itself within `seconds`, up to a prompt: a banner."""
        return self._until_prompt(seconds)

    # -- bytes ---------------------------------------------------------------------------------------------------

    def _until_prompt(self, seconds: float) -> bytes:
        deadline = self.link.deadline(seconds).earlier(self.bound)
        came = b""
        while not deadline.expired or not came:
            chunk = self.link.read(deadline)
            if not chunk:
                break
            came += chunk
            if has_prompt(came) and not came.endswith(b" "):
                came += self.link.read(self.link.deadline(0.005 + self.wire_seconds(2)), 1)
            if has_prompt(came) or len(came) > 65536:
                break
        return came

    def drain(self) -> bytes:
        """Drop what has arrived, counted as stray bytes; returns it."""
        now = self.link.deadline(0)
        stale = b""
        while len(stale) < 65536:
            chunk = self.link.read(now)
            if not chunk:
                break
            stale += chunk
        self.journal.counters.stray_bytes += len(stale)
        return stale

    def wire_seconds(self, count: int) -> float:
        """Transmission time of `count` bytes, 10 bits each; 0 where the link has no speed."""
        return count * 10 / self.link.baud if self.link.baud else 0.0


class Patience:
    """A wait that ends after `seconds` of silence: bytes renew it, up to LONGEST times as long and never beyond `bound`."""

    def __init__(self, link: ByteLink, seconds: float, bound: Deadline | None) -> None:
        self._link = link
        self._seconds = seconds
        self._last = link.deadline(LONGEST * seconds).earlier(bound)
        self.deadline = self._last
        self.renew()

    def renew(self) -> None:
        """Something came."""
        self.deadline = self._link.deadline(self._seconds).earlier(self._last)


DISTURBED = "a disturbed line: run it again, check the cable"
SILENCE = (
    "check in this order: the hand's power supply, the serial cable (straight-through, 9 pins), the port; a hand without "
    "firmware (off for more than a day or two) does not answer: load it again"
)


def _must_have_lines(command: str) -> bool:
    _, known, words = split(command)
    return known is not None and known.name in ("FGET", "PGET") and bool(words)
