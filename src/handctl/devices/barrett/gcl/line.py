"""One connection to a BarrettHand: find its baud rate, send a command, wait for its prompt, stop a movement.

The table of `connect_table` says how the hand is met. One command at a time; nothing but ^C is sent before the prompt.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from handctl.devices.barrett.gcl.codec import (
    BANNER,
    CR,
    DISTURBED,
    KINDS,
    PROMPT,
    Answer,
    Decoder,
    encode,
    error_form,
    has_colon,
    has_prompt,
    kind_of,
    split,
    whole,
)
from handctl.devices.barrett.gcl.connect_table import (
    MONITOR_SPEED,
    QUESTION,
    RESTARTED_TEXT,
    SILENCE,
    abort_at,
    is_answer,
    question_in,
)
from handctl.errors import Aftermath, DeviceRefused, HandctlError, Hint, LinkError, NoAnswer, ProtocolError
from handctl.link import ByteLink, Deadline
from handctl.model.device import Line
from handctl.model.param import Step
from handctl.model.result import Journal

ECHO_SECONDS = 1.0
SETTLE_SECONDS = 1.0
"""The vendor's pause after a speed change."""
BANNER_SECONDS = 5.0
BANNER_TEXT = "BarrettHand Firmware"
LATEST = 3.0
"""Seconds after the question within which answers to what was before it are waited for."""
PROMPT_WAIT = 0.5
QUIET = 0.2
LOOP_EXITS = 9
LONGEST = 4
SLOW_ADAPTER = Hint("{} shows whether it is the latency timer of the adapter, and how to set it", "doctor")


class GclLine(Line):
    """The supervisory line of one hand.

    timeout   seconds for the prompt of a query, None = the command's own (dossier 1.3)
    speed     the only speed to try at connect, None = find it
    sign      how this hand prints a position below 0, "" = not known
    interrupt whether a movement that is met may be ended by ^C: for what stops, moves or writes
    """

    link: ByteLink

    def __init__(
        self,
        link: ByteLink,
        journal: Journal,
        *,
        speed: int | None = None,
        sign: str = "",
        interrupt: bool = False,
        **limits: Any,
    ) -> None:
        super().__init__(link, journal, **limits)
        self.only = speed
        self.sign = sign
        self.interrupt = interrupt
        self.opened = link.now()
        self._connected = False
        self._unread = self._behind = b""
        self._bare = False
        """The last prompt came without its blank, which a slow adapter hands on later."""
        self._told_odd = False
        self._form: re.Pattern[str] | None = None
        """How this hand spells its errors, where the manual has another form."""
        self._said: Answer | None = None
        """The answer to the last get; `_behind` is what came behind it with the same bytes."""
        self.tried: list[tuple[int | None, bytes]] = []
        """Of the last connect: the speeds at which it was asked, and what came."""

    # -- connect -------------------------------------------------------------------------------------------------

    def connect(self) -> None:
        """Meet the hand: its speed and its prompt. Raises DeviceRefused (boot monitor), NoAnswer, ProtocolError."""
        if not self._connected:
            from handctl.devices.barrett.gcl.session_start import SessionStart

            SessionStart(self).run()

    def reopened(self) -> None:
        self._unread, self._connected = b"", False

    def odd(self, request: str, came: bytes, usual: str) -> None:
        """Tell once what this hand answers where the manual has something else; the text is kept as it came."""
        if not self._told_odd:
            self._told_odd = True
            self._form = error_form(came.decode("ascii", "replace"))
            text = (
                " ".join(came.decode("ascii", "backslashreplace").replace("\0", "").split()).removesuffix("=>").strip()
            )
            self.journal.info(
                "other-text",
                f"{self.link.name}: this hand replies to {request!r} with {text!r} where the manual has {usual} ({came[:48].hex(' ').upper()})",
            )

    def overheard(self, data: bytes) -> None:
        self._unread += data

    def found(self) -> None:
        """The hand is at its prompt."""
        self._connected = True

    def waiting(self) -> bytes:
        """Received data that was no reply: the next connect learns the state of the hand from it."""
        came, self._unread = self._unread + self.drain(), b""
        return came

    @property
    def abort_bytes(self) -> bytes:
        """^C for a hand that may be a boot monitor at 9600 by now."""
        return abort_at(self.link.baud if self.link.can_set_baud else None)

    @property
    def risky(self) -> bool:
        """Whether bytes of ours could be a trigger to a boot monitor, which hears at 9600."""
        return self.link.can_set_baud and (self.link.baud or 0) > MONITOR_SPEED

    def leave_loop(self) -> bytes | None:
        """Bytes but no prompt: the hand may sit in its RealTime loop and take ^C for data (dossier 1.5, step 4).

        None once the prompt has come, otherwise what came instead.
        """
        link = self.link
        came = b""
        for count in range(LOOP_EXITS):
            link.write(self.abort_bytes, link.deadline(1.0))
            came += self.until_prompt(0.02 + self.wire_seconds(8))
            if has_prompt(came):
                self.journal.warn(
                    "loop",
                    f"the prompt arrived after {count + 1} ^C. Either the hand was in its RealTime loop, where each ^C except the last was a small velocity, or data was corrupted on the line",
                )
                return None
        return came

    # -- commands ------------------------------------------------------------------------------------------------

    def ask(self, command: str, *, at_least: float = 0.0) -> Answer:
        """Send one command once; its answer, whatever its status. Raises NoAnswer, ProtocolError, LinkError.

        `at_least` seconds are allowed, for a movement that is known to be slow.
        """
        self.connect()
        self.check_bound(command)
        data = encode(command)
        name = kind_of(command, "query")
        kind = KINDS[name]
        short = self.timeout is not None and name in ("query", "set")
        seconds = self.timeout if self.timeout is not None and short else max(kind.seconds, at_least)
        self._judge_stale(command, name)
        link = self.link
        answer = IdleTimeout(link, seconds + 2 * self.wire_seconds(len(data) + 512), self.bound)
        echo = IdleTimeout(link, (self.timeout or ECHO_SECONDS) + 2 * self.wire_seconds(len(data)), self.bound)
        self.journal.counters.sent += 1
        link.write(data, answer.deadline)
        try:
            return self._answer(command, answer, echo)
        except LinkError as exc:
            if kind.moves:
                hint = f"{command} may continue to its end. To prevent that, switch the hand's power off"
                exc.add_aftermath(Aftermath(hint=hint, moving=True))
                self.journal.counters.writes += 1  # as below: the port may come back, and the stop reach the hand
            raise
        except Restarted:
            raise
        except (NoAnswer, ProtocolError) as exc:
            error: HandctlError = exc
            if not self.over:
                self.journal.blame(exc)
            else:  # an answer that the deadline cut short is not to blame
                text = f"{link.name}: --deadline passed before the hand replied to {command}"
                error = NoAnswer(text, hint="use a longer --deadline", code="deadline")
                if exc.code == "echo-differs":
                    error = ProtocolError(f"{text}: {exc.text}", hint=exc.hint, code=exc.code)
            if kind.moves:  # whatever still moves must not go on
                stands = self._stop_motors()
                told = (
                    "^C was sent, so the motors should have stopped"
                    if stands
                    else f"^C was sent, but the hand did not reply: {OFF}"
                )
                error.add_aftermath(Aftermath(hint=told, moving=True))
                self.journal.counters.writes += 1  # set going, its end not seen: who drives it stops it, and looks
            raise error from (exc if error is not exc else None)

    def _stop_motors(self) -> bool:
        """^C and what belongs to it, whatever --deadline says; whether the prompt came."""
        bound, self.bound = self.bound, None
        try:
            return self.resynchronise(stop=True)
        finally:
            self.bound = bound

    def check_ended(self, command: str) -> None:
        """Raise ProtocolError if the hand does not reply after the prompt of a movement: then the movement may still be running."""
        # As in `ask`: until it was seen standing still, whoever drives it stops it after an error.
        self.journal.counters.writes += 1
        if self.over or question_in(came := self._question()) or _speaks_of_restart(came, ""):
            return
        self.journal.ledger.doubt("a prompt came, but no reply after it", Step(command, encode(command)))
        raise ProtocolError(
            f"{self.where}: the prompt of {command} came, but the hand does not reply after it, so the movement may not have ended",
            hint="check the cable and run the command again: data may have been corrupted on the line",
            code="false-prompt",
        )

    def read(self, command: str, check: Callable[[Answer], object] = lambda answer: None) -> Answer:
        """A query, repeated after a resynchronisation when no valid answer came; anything else is `ask`ed once.

        `check` raises ProtocolError for an answer that has not the form it must have.
        """
        self.connect()  # a hand that is nowhere is looked for once, not once a repetition
        error: HandctlError | None = None
        for attempt in range(1 + self.retries):
            if attempt:
                self.journal.counters.retries += 1
                if not isinstance(error, Restarted) and not self.resynchronise() and self.risky:
                    self._connected = False  # it may have restarted at 9600, where our bytes could be a trigger
            try:
                answer = self.ask(command)
                self._judge(answer, check)
                return answer
            except (NoAnswer, ProtocolError) as exc:
                error = exc
            if self.over:
                break
        assert error is not None
        raise error

    def _judge_stale(self, command: str, kind: str) -> None:
        """What lies waiting before a command: a sign of a restart is followed up first, and ends what is no question."""
        stale = self.drain()
        said, self._said = self._said, None
        if said is not None and (again := self._behind + stale):
            decoder = Decoder(said.command)
            decoder.feed(again)
            second = decoder.next()
            if second is not None and second.lines != said.lines and _has_form_of(said, second):
                self.two_replies(" | ".join(said.lines), " | ".join(second.lines))
        if not (_speaks_of_restart(stale, command) or (stale and self.risky)):
            return
        self._unread, self._connected = stale, False
        self.connect()
        if restarted_in(stale, command) and kind != "query":
            raise Restarted(f"{self.link.name}: {RESTARTED_TEXT}. {command} was not sent", hint=RESTART_HINT)

    def _judge(self, answer: Answer, check: Callable[[Answer], object]) -> None:
        try:
            check(answer)
            whole(answer)
        except ProtocolError as exc:
            self.journal.counters.bad_frames += 1
            raise ProtocolError(f"{self.link.name}: {exc.text}", hint=DISTURBED, code=exc.code) from exc

    def _answer(self, command: str, whole: IdleTimeout, echo: IdleTimeout) -> Answer:
        """The reply within `whole`; without an echo within `echo` there is no hand, and waiting longer is useless."""
        decoder, since = Decoder(command, self._form), self.link.now()
        while True:
            answer = decoder.next()
            if answer is not None and not answer.lines and not answer.status and _must_have_lines(command):
                decoder.drop_prompt()  # a late prompt of something before: a get always has lines or an error
                answer = decoder.next()
            if answer is not None:
                self.journal.counters.received += 1
                late = self._bare and decoder.received.startswith(b" ")
                self.journal.counters.stray_bytes += decoder.skipped - late
                if answer.said:
                    usual = f"ERR {answer.status}"
                    self.odd(command, f"{answer.said}".encode(), usual)
                answer = answer._replace(raw=answer.raw + self._blank(answer.raw.endswith(PROMPT)))
                self._behind = decoder.received[len(answer.raw) :]
                self._said = answer if answer.lines and _must_have_lines(command) else None
                return answer
            until = (whole if decoder.echoed else echo).deadline
            chunk = b"" if until.expired else self.link.read(until)
            if not chunk:
                raise self._failure(command, decoder, since)
            whole.renew()
            if not decoder.echoed:
                echo.renew()
            decoder.feed(chunk)
            self._judge_restart(command, decoder, chunk, whole)

    def _judge_restart(self, command: str, decoder: Decoder, chunk: bytes, whole: IdleTimeout) -> None:
        """Raise Restarted at the banner, or at a single ':' of the boot monitor. `chunk` arrived last."""
        size, more = len(chunk), True
        while chunk.endswith(b":") and more:  # a help text goes on behind it
            chunk = self.link.read(self.link.deadline(COLON_ALONE + self.wire_seconds(2)))
            decoder.feed(chunk)
            size += len(chunk)
            if not chunk:
                raise self.restarted(decoder.received, f"{command} has no reply")
            more = not whole.deadline.expired
        banner = BANNER in decoder.last(size + len(BANNER)).upper()
        if banner and restarted_in(decoder.received, command):
            raise self.restarted(decoder.received, f"{command} has no reply")

    def restarted(self, received: bytes, what: str) -> Restarted:
        """The error of a restart that shows in `received`; the next connect goes on from there."""
        place = received.upper().find(BANNER)
        self._unread, self._connected = received[place:] if place >= 0 else b":", False
        self.journal.counters.bad_frames += 1
        return Restarted(f"{self.link.name}: {RESTARTED_TEXT}. {what}", hint=RESTART_HINT)

    def _failure(self, command: str, decoder: Decoder, since: float) -> HandctlError:
        received = decoder.received
        speed = f" at {self.link.baud} bit/s" if self.link.can_set_baud else ""
        if not received:
            return self.unanswered(f"{command}{speed}", self.timeout or ECHO_SECONDS, since, SILENCE)
        self.journal.counters.bad_frames += 1
        hint = "check the cable and run the command again: data was corrupted on the line, or the baud rate is wrong"
        if decoder.echoed:
            code, text = "cut-short", "the reply has no prompt"
            hint = "check that the hand has power: it took the command, and its reply did not end"
        else:
            code, text = "echo-differs", f"the echo differs from {encode(command).hex(' ').upper()}"
        return ProtocolError(
            f"{self.where}{speed}: {text}, received {received[:48].hex(' ').upper()}", hint=hint, code=code
        )

    def abort(self) -> Answer | None:
        """^C: stop all motors (barrett §5.5 case 4). The answer of the command that ran, None when no prompt comes."""
        link = self.link
        link.write(self.abort_bytes, link.deadline(1.0))
        came = self.until_prompt(1.5 + self.wire_seconds(32))
        if not has_prompt(came):
            return None
        decoder = Decoder("")
        decoder.feed(b"\n" + came)
        return decoder.next()

    def resynchronise(self, *, stop: bool = False) -> bool:
        """After a timeout: silence, then the question; whether the prompt came. ^C before it only where it is to `stop`."""
        link = self.link
        if stop:
            link.write(self.abort_bytes, link.deadline(1.0))
        quiet = link.deadline(QUIET)
        end = link.deadline(2.0)
        stale = b""
        while not end.expired and (chunk := link.read(quiet)):
            stale = (stale + chunk)[-256:]
            quiet = link.deadline(QUIET)
        if _speaks_of_restart(stale, ""):
            self._unread, self._connected = stale, False
            return False
        return has_prompt(self._question())

    def _question(self) -> bytes:
        """Send the question; what came until its answer. One that is not waited for would be taken for that of the next command."""
        link = self.link
        link.write(QUESTION, link.deadline(1.0))
        came, end = b"", link.deadline(max(PROMPT_WAIT, self.timeout or 0.0) + self.wire_seconds(16))
        last = link.deadline(LATEST)
        while not end.expired and not is_answer(came):
            chunk = self.until_prompt(end.remaining)
            if not chunk:
                break
            came += chunk
            # The prompt of something before, or its own echo: its answer is to come.
            if has_prompt(chunk) or chunk.endswith(QUESTION[:-1]):
                end = last
        if _speaks_of_restart(came, ""):
            self._unread, self._connected = came, False
        return came

    def reconnect(self) -> None:
        """Find the hand again, perhaps at another baud rate (after RESET, PDEF, PLOAD)."""
        self._connected = False
        self.connect()

    # -- speed, restart (barrett §5.2, §5.4.1) -----------------------------------------------------------------------

    def change_speed(self, code: int) -> None:
        """`PSET BAUD code`, then the port (dossier 1.2): the echo comes at the old speed, the rest is unusable.

        Raises NoAnswer when the hand answers at neither speed afterwards; CheckFailed is left to the read-back.
        """
        self.connect()
        link, ledger = self.link, self.journal.ledger
        command = f"PSET BAUD {code}"
        old, new = link.baud, code * 100
        data = encode(command)
        self.journal.counters.sent += 1
        link.write(data, link.deadline(2.0))
        echo = b""
        deadline = self.deadline(1.0 + (2 * len(data) * 10 / old if old else 0))
        while data[:-1] not in echo.upper() and not deadline.expired:
            # Never beyond the echo: what follows comes at the new speed.
            chunk = link.read(deadline, max(1, len(data) - 1 - len(echo)))
            if not chunk:
                break
            echo += chunk
        if data[:-1] not in echo.upper():
            self.resynchronise()
            raise ProtocolError(
                f"{link.name}: the echo of {command} differs: {echo.hex(' ').upper()}",
                hint=Hint("run {}, which tries all baud rates: this one may or may not have changed", "barrett status"),
                code="echo-differs",
            )
        if link.can_set_baud:
            link.set_baud(new)
        link.sleep(SETTLE_SECONDS)
        self.until_prompt(0.05)
        link.write(CR, link.deadline(2.0))
        answers = f"the hand replies at {new} bit/s"
        if has_prompt(self.until_prompt(PROMPT_WAIT + self.wire_seconds(8))):
            if link.can_set_baud:
                ledger.confirm(answers, Step(command, data))
            return
        if link.can_set_baud and old is not None:
            try:
                self.reconnect()
            except (NoAnswer, ProtocolError) as exc:
                text = f"{link.name}: no prompt after {command}, at {new} bit/s or any other baud rate. {exc.text}"
                raise exc.reworded(text, code="lost-speed") from exc
            if link.baud == new:
                ledger.confirm(answers, Step(command, data))
                return
            ledger.doubt(f"replies at {link.baud} bit/s", Step(command, data))
            raise DeviceRefused(
                f"{link.name}: the hand did not change to {new} bit/s. It replies at {link.baud} bit/s",
                hint="use a lower baud rate: some hands do not support the higher ones",
                code="baud",
            )
        raise NoAnswer(f"{link.name}: no prompt after {command}", hint="check the baud rate of the device server")

    def restart(self) -> str:
        """RESET: restart the firmware; its banner. Motors are uninitialised afterwards (barrett §5.2.4)."""
        self.connect()
        link = self.link
        before = link.baud
        self.journal.counters.sent += 1
        link.write(encode("RESET"), link.deadline(2.0))
        came = self.until_prompt(BANNER_SECONDS)
        if came.upper().strip(b"\r\n :") in (b"", b"RESET"):  # nothing but the echo: it is still starting
            came += self.until_prompt(KINDS["reset"].seconds - BANNER_SECONDS)
        text = came.decode("ascii", "replace")
        banner = "\n".join(part.strip() for part in text.replace("\r", "\n").split("\n") if part.strip(" =>:\0"))
        banner = banner.removeprefix("RESET").strip(" :\n")  # a hand that has just started may print ":" first
        self.reconnect()
        if BANNER_TEXT in banner or link.baud != before:  # a banner at another speed is unreadable
            self.journal.ledger.confirm("its banner arrived, and it replies", Step("RESET", encode("RESET")))
        else:
            raise ProtocolError(
                f"{link.name}: the banner does not say {BANNER_TEXT!r}: {banner!r}. The hand may or may not have restarted",
                hint=Hint("check with {}: after a restart the motors are not initialized", "barrett status"),
                code="banner",
            )
        self.journal.info("uninitialized", "the motors are no longer initialized", hint=Hint("{}", "barrett init"))
        return banner

    # -- bytes ---------------------------------------------------------------------------------------------------

    def until_prompt(self, seconds: float) -> bytes:
        """What comes within `seconds`, up to a prompt."""
        deadline = self.deadline(seconds)
        came = bytearray()
        while not deadline.expired or not came:
            chunk = self.link.read(deadline)
            if not chunk:
                break
            came += chunk
            ended = has_prompt(came)
            if ended:
                came += self._blank(not came.endswith(b" "))
                ended = has_prompt(came)
            if ended or len(came) > 65536:
                break
        return bytes(came)

    def _blank(self, due: bool) -> bytes:
        """The blank behind a prompt where it is still `due`: it is part of it, and no stray byte when it comes later."""
        blank = self.link.read(self.link.deadline(0.005 + self.wire_seconds(2)), 1) if due else b""
        self._bare = due and not blank
        return blank

    def drain(self) -> bytes:
        """Drop what has arrived, counted as stray bytes; returns it. The late blank of a prompt is none."""
        stale = b""
        while len(stale) < 65536:
            chunk = self.link.read(self.link.at_once)
            if not chunk:
                break
            stale += chunk
        if self._bare and stale:
            self._bare = False
            stale = stale.removeprefix(b" ")
        self.journal.counters.stray_bytes += len(stale)
        return stale


class IdleTimeout:
    """A wait that ends after `seconds` of silence: bytes renew it, up to LONGEST times as long and never beyond `bound`."""

    def __init__(self, link: ByteLink, seconds: float, bound: Deadline | None) -> None:
        self._link = link
        self._seconds = seconds
        self._last = link.deadline(LONGEST * seconds).earlier(bound).at
        self.renew()

    def renew(self) -> None:
        """Something came."""
        now = self._link.now
        self.deadline = Deadline(now, min(now() + self._seconds, self._last))


class Restarted(ProtocolError):
    """The hand restarted while something was asked of it."""

    default_code = "restarted"


def restarted_in(data: bytes, command: str) -> bool:
    """Whether the data contains a banner; in the reply to VERS the same words may be the version, after its echo."""
    before, banner, _ = data.upper().partition(BANNER)
    return bool(banner) and not (command.upper().startswith("VERS") and b"VERS" in before)


def _speaks_of_restart(data: bytes, command: str) -> bool:
    """A banner, or the boot monitor's ':' as the last thing said."""
    return restarted_in(data, command) or has_colon(data)


RESTART_HINT = Hint("run {} before any movement. Values that were not saved are lost", "barrett init")
COLON_ALONE = 0.05
OFF = "switch the power supply off if anything is still moving"


def _has_form_of(answer: Answer, second: Answer) -> bool:
    """Whether it has as many lines and numbers, and nothing else: no bit of it was lost."""
    numbers = [[len(line.split()) for line in one.lines] for one in (answer, second)]
    return numbers[0] == numbers[1] and all(set(line) <= set("-0123456789 ") for line in second.lines)


def _must_have_lines(command: str) -> bool:
    _, known, words = split(command)
    return known is not None and known.name in ("FGET", "PGET") and bool(words)
