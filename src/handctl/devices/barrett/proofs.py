"""What the manual of the BarrettHand leaves open, as experiments (barrett §5; dossier 1, 15, 16). See `model.proofs`.

Reads are lines that the firmware answers at its prompt; a number that it prints is judged as printed, without our sign.
"""

from __future__ import annotations

import math
import re
from functools import partial

from handctl import interrupts
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import MAX_ARGUMENTS, MAX_LINE, PROMPT, Answer, encode, values
from handctl.devices.barrett.gcl.status_codes import UNKNOWN_NAME
from handctl.devices.barrett.parameter_map import BARRETT, NO_GAUGE, TRAVEL, gcl_name, standard
from handctl.devices.barrett.realtime.blocks import LoopError
from handctl.devices.barrett.realtime.control_values import Controls
from handctl.devices.barrett.realtime.enter_and_leave import Session
from handctl.devices.barrett.realtime.loop import RealtimeLoop
from handctl.devices.barrett.realtime.loop_flags import FlagRequest
from handctl.errors import Hint, Interrupted, NotPresent
from handctl.model.param import Step
from handctl.model.prompts import Prompts
from handctl.model.proofs import MOVE, NONE, WRITE_BACK, Disturbed, Observation, Proof, put_back

ENDS = {b"\n\r": "lfcr", b"\r\n": "crlf"}
BLANK = 0.1
"""Seconds in which the blank behind a prompt comes on a slow line."""
LENGTHS = (40, 50, 60, 70, 80, 96, 112, 128)
"""Characters of the lines that are tried. A longer one than any seen in public might overrun a buffer of the firmware."""
COUNTS = (8, 12, 16, 18, 20, 24)
SHORT = ("P", "S", "SG", "DP", "DS", "CT", "OT", "EN", "OD", "HSG", "LSG", "MOV", "MCV", "FDZ", "FIP", "FPG", "MPE", "LFV", "LFS", "LCV", "HOLD", "IHIT", "IOFF", "IVEL")  # fmt: skip
"""24 names in 96 characters, as the vendor's library sends them."""
AWAY = 200
"""Counts by which F1 closes first, so that a motor that does not move is told from a position that is printed as 0."""
TOO_LONG, TOO_MANY = 32, 1024
SPEEDS = (19200, 38400)


def _said(hand: BarrettHand, command: str) -> Answer:
    """The answer to a query that has data. Raises ProtocolError for one that has none, and DeviceRefused."""
    answer = hand.checked(hand.line.ask(command))
    if not answer.lines:
        raise Disturbed(f"{command}: the reply has no line")
    return _clean(answer)


def _clean(answer: Answer) -> Answer:
    """The same. Raises ProtocolError for bytes that no firmware prints: GCL has no checksum."""
    if not answer.raw.isascii():
        raise Disturbed(f"{answer.command}: the reply is damaged")
    return answer


def _numbers(hand: BarrettHand, name: str) -> tuple[int, ...]:
    """What the hand prints for all motors, as printed."""
    answer = hand.checked(hand.line.ask(f"FGET {name}"))
    return tuple(values(answer, 1, 4)[0])


def _prompt(hand: BarrettHand) -> Observation:
    raw, link = _said(hand, "PGET TEMP").raw, hand.line.link
    raw += b"" if raw.endswith(b" ") else link.read(link.deadline(BLANK), 1)  # on a slow line
    return Observation("space" if raw.endswith(PROMPT + b" ") else "bare", f"the reply ends with {raw[-3:]!r}")


def _line_end(hand: BarrettHand) -> Observation:
    raw = _said(hand, "PGET TEMP").raw
    found = [name for end, name in ENDS.items() if raw.removesuffix(b" ").endswith(end + PROMPT)]
    return Observation(found[0] if found else None, f"in front of the prompt: {raw[-5:]!r}")


def _version(hand: BarrettHand) -> Observation:
    text = " ".join(_said(hand, "VERS").lines)
    return Observation(re.sub(r"\d+(\.\d+)+", "N", text), f"VERS: {text}")


def _layout(command: str, word: str, hand: BarrettHand) -> Observation:
    """What stands between a name and what belongs to it, in the first line that begins with the name; "" = the name is not printed."""
    lines = _said(hand, command).lines
    for line in lines:
        if found := re.match(rf"{re.escape(word)}(\W+)(?=\w)", line):
            return Observation(f"name{found[1]}text", f"{command}: {line}")
    numbers = all(re.fullmatch(r"-?\d+( -?\d+)*", line) for line in lines)
    return Observation("values only" if numbers else None, f"{command}: {lines[0]}")


def _unknown(hand: BarrettHand) -> Observation:
    answer = _clean(hand.line.ask("!"))
    text = answer.said or " ".join((*answer.lines, *([f"ERR {answer.status}"] if answer.status else ())))
    return Observation(text, f"'!' is answered with {text!r}")


def _lower_case(hand: BarrettHand) -> Observation:
    answer = _clean(hand.line.ask("pget temp"))
    return Observation("accepted" if answer.lines and not answer.status else f"ERR {answer.status}", "pget temp")


def _longest_line(hand: BarrettHand) -> Observation:
    longest = 0
    for length in LENGTHS:
        answer = hand.line.ask(f"FGET {'P'.rjust(length - 5)}")
        if answer.status == TOO_LONG or len(answer.lines) != 1:
            return Observation(longest, f"a line of {length} characters: ERR {answer.status}")
        longest = length
    return Observation(longest, f"{longest} characters and no limit met")


def _most_arguments(hand: BarrettHand) -> Observation:
    most = 0
    for count in COUNTS:
        answer = hand.line.ask(f"1FGET {' '.join(SHORT[:count])}")
        if answer.status == TOO_MANY:
            return Observation(most, f"{count} names: ERR {answer.status}")
        if answer.status or len(answer.lines) != count:
            return Observation(None, f"{count} names: ERR {answer.status}, which is not about their number")
        most = count
    return Observation(most, f"{most} names and no limit met")


def _absent(later: bool, hand: BarrettHand) -> Observation:
    """Of the parameters of every firmware, those that are missing; of the later ones, those that are there.

    A line that is refused is read again in halves: a name is missing that is refused alone.
    """
    found = []
    names = [param.mnemonic for param in ([one for one in BARRETT if one.optional] if later else standard())]
    for reading in hand.read(BARRETT.elements(*names, motors=[0])):
        if reading.error is not None and not isinstance(reading.error, NotPresent):
            raise reading.error
        if (reading.error is None) is later:
            found.append(gcl_name(reading.element))
    refused = f"ERR {UNKNOWN_NAME}"
    evidence = ("answered", f"{refused} for each") if later else (refused, "each has a value")
    return Observation(", ".join(found) or NONE, evidence[not found])


def sign_of(printed: tuple[int, ...]) -> str | None:
    """How positions below 0 are printed, None where none is."""
    below = [value for value in printed if value < 0 or 32767 < value < 65536]
    return None if not below else "signed" if below[0] < 0 else "unsigned"


def _sign(hand: BarrettHand) -> Observation:
    printed = _numbers(hand, "P")
    return Observation(sign_of(printed), f"FGET P: {' '.join(map(str, printed))}")


def _at_stop(hand: BarrettHand, prompts: Prompts) -> Observation:
    """How F1 prints its position at the open stop, IOFF counts below the origin. Raises what the movement ends with."""
    from handctl.devices.barrett.maintenance.signs_of_harm import driven

    driven(hand, "1", "IC", AWAY, prompts)
    away = _numbers(hand, "P")[0]
    driven(hand, "1", "TO", None, prompts)
    printed, offset = _numbers(hand, "P")[0], _numbers(hand, "IOFF")[0]
    if printed == away:
        return Observation(None, f"F1 does not move: P {printed}")
    clamped = "clamped" if printed == 0 < offset else None
    return Observation(sign_of((printed,)) or clamped, f"F1 at its open stop: P {printed}, IOFF {offset}")


def _gauges(hand: BarrettHand) -> Observation:
    printed = _numbers(hand, "SG")[:3]
    return Observation(sum(value != NO_GAUGE for value in printed), f"SG of the fingers: {' '.join(map(str, printed))}")


def _alias(hand: BarrettHand) -> Observation:
    high, alias = _numbers(hand, "HSG"), _numbers(hand, "MSG")
    return Observation("equal" if high == alias else "different", f"HSG {high}, MSG {alias}")


def _speed(hand: BarrettHand) -> Observation:
    """The highest speed that works both ways; the speed of before is set again and answered at, whatever came in between."""
    line = hand.line
    was, best = line.link.baud or 9600, 0
    if not line.link.can_set_baud:
        return Observation(None, "this link has no baud rate of its own")
    for speed in SPEEDS:
        try:
            line.change_speed(speed // 100)
            _said(hand, "PGET TEMP")
            best = speed
        except BaseException as exc:  # Ctrl-C among them: the speed is put back first
            refused = getattr(exc, "code", "") == "baud"
            put_back(partial(_put_back, hand, was))
            if not refused:
                raise
            return Observation(best or was, f"PSET BAUD {speed // 100} leaves it at {was} bit/s")
        put_back(partial(_put_back, hand, was))
    return Observation(best, f"replies at {best} bit/s, and at {was} bit/s again")


def _put_back(hand: BarrettHand, speed: int) -> None:
    """Set the speed of before and read it back there. Raises what kept it from being confirmed."""
    if hand.line.link.baud != speed:
        hand.line.change_speed(speed // 100)
    (reading,) = hand.read(BARRETT.elements("BAUD"))
    hand.check_read_back(
        [(reading.element, speed // 100)], [reading], Hint("run {}, which tries all baud rates", "barrett baud")
    )


def _speed_steps(hand: BarrettHand) -> list[Step]:
    return [
        Step(text, encode(text)) for code in (*(speed // 100 for speed in SPEEDS), 96) for text in [f"PSET BAUD {code}"]
    ]


def _idle_abort(hand: BarrettHand) -> Observation:
    """What ^C comes to at the prompt. It would end a movement, so it is no read."""
    answer = hand.line.abort()
    if answer is None:
        return Observation("silence", "no prompt within 1.5 s")
    return Observation(f"ERR {answer.status}" if answer.status else "prompt", f"^C at the prompt: {answer.raw!r}")


def _stop_steps(_: BarrettHand) -> list[Step]:
    return [Step(text, encode(text), moves=True) for text in (f"1IC {AWAY}", "1TO")]


def _after_loop_steps(_: BarrettHand) -> list[Step]:
    return [
        Step("1LOOP", encode("1LOOP")),
        Step("control block: velocity 2, or -2", b"C\x02", moves=True),
        Step("^C", b"\3"),
        Step("1T", encode("1T")),
    ]


# -- what the motors do once RealTime is left by ^C alone: the one session that is left with a velocity on purpose ------------
#    (dossier 6.6, 16). It is short and slow, the second process guards it like any other, a Ctrl-C ends it at once, and T
#    follows whatever happens.


F1 = 0
VELOCITY = 2
"""1/8 count a sample: 2 units are 488 counts/s at the factory settings, four degrees of the inner link."""
DRIVEN, WATCHED = 0.2, 1.0
"""Seconds in the loop, and behind it until T."""
READS = 10
LEAST = 30
"""Counts that a motor gains at least that goes on: it would gain over 400."""


class _LeftRunning(Session):
    """Leaves by ^C without a velocity of 0, and reads where the motor is until T takes its power."""

    places: tuple[int, ...] = ()
    usual = False
    """It could not be left like that: velocity 0 first, as ever."""

    def stand(self, most: float = math.inf) -> bool:
        return super().stand(most) if self.usual else self._answered()

    def _answered(self) -> bool:
        """Whether the block before has been answered: only then is ^C a header. Raises ProtocolError."""
        link, decoder = self.hand.line.link, self.decoder
        while decoder.outstanding:
            if isinstance(answer := decoder.next(), LoopError):
                return False
            if answer is None and decoder.outstanding:
                if not (chunk := link.read(self.hand.link.deadline(self.patience))):
                    return False
                decoder.feed(chunk)
        return True

    def _go_out(self, moved: bool) -> bool:
        hand = self.hand
        if not (self.inside and self.last and self._answered() and hand.line.abort() is not None):
            self.usual = True
            return super()._go_out(moved)
        self.inside = False
        hand.journal.ledger.confirm("each block was acknowledged", since=self.mark)
        for _ in range(READS):
            if interrupts.was_interrupted():
                break
            self.places += tuple(hand.numbers(BARRETT.elements("P", motors=[F1])))
            hand.link.sleep(WATCHED / READS)
        return False


def _after_loop(hand: BarrettHand, prompts: Prompts) -> Observation:
    """Drive F1 slowly away from the nearer end of its travel, leave by ^C, and watch it. Raises what the loop or its end raises."""
    hand.line.connect()
    if hand.line.risky:
        return Observation(None, "above 9600 bit/s a 00 is sent ahead of ^C, which ends RealTime by itself: use 9600")
    (place,) = hand.numbers(BARRETT.elements("P", motors=[F1]))
    velocity = VELOCITY if place < TRAVEL[0] / 2 else -VELOCITY
    request = FlagRequest((F1,), {F1: ("position",)})
    loop = RealtimeLoop(
        hand, prompts, request, Controls({F1: ("velocity",)}, {(F1, "velocity"): velocity}), sequential=True
    )
    loop.session = session = _LeftRunning(hand, request, drives=True)
    for _ in loop.run(rate=0.0, count=None, duration=DRIVEN):
        pass
    if loop.failure is not None:
        raise loop.failure
    if interrupts.was_interrupted():
        raise Interrupted("interrupted: the motor's power is off")
    told = f"P behind ^C: {' '.join(map(str, session.places))}"
    if len(session.places) < READS:
        return Observation(None, f"{told}: the loop was not left by ^C alone")
    gained = (session.places[-1] - session.places[0]) * (1 if velocity > 0 else -1)
    return Observation("run on" if gained >= LEAST else "stop", f"{told}, at velocity {velocity}")


LAYOUTS = ("name text", "name - text", "name: text")
PROOFS = (
    Proof("prompt", "§5.1.1 prints '=>'; other drivers expect a blank behind it (dossier 1.1)", "space", "PGET TEMP: how its reply ends", _prompt),
    Proof("line-end", "'<CRLF>' in §5.1.1, LF CR on the wire of other drivers (dossier 1.1)", "lfcr", "PGET TEMP: what is in front of the prompt", _line_end),
    Proof("version-text", "the format of VERS is not documented (§5.2.4)", (), "VERS, its number as N", _version),
    Proof("parameter-list", "the format of FLIST is not documented (§5.2.2)", LAYOUTS, "FLIST: what is between DP and its description", partial(_layout, "FLIST", "DP")),
    Proof("value-list", "FLISTV: whether it prints names is not documented (§5.2.2)", ("values only", *LAYOUTS), "FLISTV: the line of DP", partial(_layout, "FLISTV", "DP")),
    Proof("help-text", "the format of ? is not documented (§5.2.4)", LAYOUTS, "?HI: what is between HI and its description", partial(_layout, "?HI", "HI")),
    Proof("unknown-command", "ERR 32, as T3 has it; no capture shows what stands behind the number (dossier 15)", "ERR 32", "'!': its whole reply", _unknown),
    Proof("lower-case", "§7.3 prints `fget od` (dossier 1.1)", "accepted", "pget temp", _lower_case),
    Proof("longest-line", "not documented; lines of 96 characters were seen (dossier 1.4)", MAX_LINE, "FGET P padded with blanks, 40 to 128 characters, up to the first refusal", _longest_line, limit="least"),
    Proof("most-arguments", "not documented; 24 were seen (dossier 1.4)", MAX_ARGUMENTS, "1FGET with 8 to 24 names, up to ERR 1024", _most_arguments, limit="least"),
    Proof("absent-parameters", "§5.3.4: SGFLIP may go in later firmware (dossier 15)", NONE, "each parameter of §5.3 and §5.4: a value, or ERR 64 alone?", partial(_absent, False)),
    Proof("later-parameters", "firmware 4.34 and 4.4 have more (dossier 3)", (), "each later parameter: a value, or ERR 64 alone?", partial(_absent, True)),
    Proof("position-sign", "not documented whether a position below 0 has a sign (dossier 15)", "signed", "FGET P, where a joint is below 0", _sign),
    Proof("strain-gauges", "255 = no gauge (§5.3.2)", 3, "FGET SG: fingers that do not show 255", _gauges),
    Proof("strain-alias", "MSG is an alias of HSG (§5.3.1)", "equal", "FGET HSG and FGET MSG", _alias),
    Proof("idle-abort", "not documented; drivers send it at connect and ignore what comes (dossier 1.2)", "prompt", "^C at the prompt", _idle_abort, WRITE_BACK, steps=lambda hand: [Step("^C", hand.line.abort_bytes)], question="^C ends a movement, if there is one"),
    Proof(
        "highest-speed", "not every hand can do the higher speeds (vendor source, dossier 1.1)", 38400,
        "PSET BAUD 192 and 384, each put back to the present speed and read back there", _speed, WRITE_BACK,
        steps=_speed_steps, question="The hand changes its baud rate for some seconds, and back",
    ),
    Proof(
        "position-at-stop", "not documented whether a position below 0 has a sign (dossier 15)", "signed",
        f"1IC {AWAY} and 1TO, then FGET P: F1 is IOFF counts below its origin. It stays there", _at_stop, MOVE,
        steps=_stop_steps, question="F1 will CLOSE a little, then OPEN to its stop and drop any held object. Keep clear",
    ),
    Proof(
        "motors-after-loop", "no watchdog is described, nor what ^C does to a velocity (§6.1; dossier 6.6)", "run on",
        "F1 driven by velocity 2 for 0.2 s, RealTime left by ^C alone, P ten times in 1 s, then T", _after_loop, MOVE,
        steps=_after_loop_steps, question="F1 moves by up to 700 counts, and may go on moving for a second after the loop. Keep clear",
    ),
)  # fmt: skip
