"""How handctl connects to a hand, as one table: state, received data, next state, what may be sent, meaning.

No I/O: `line` carries it out, the manual page prints it, the tests walk it. Passive first: listen, then a question that
no state of the hand takes for a command. Nothing that the boot monitor at 9600 could hear as FF, its trigger, is sent
at another speed: a wrong-speed byte may be one, and good firmware would be overwritten (dossier 1.5, 7.2).
"""

from __future__ import annotations

import re
from typing import NamedTuple

from handctl.devices.barrett.gcl.codec import ABORT, BANNER, CR, has_colon, has_prompt

MONITOR_SPEED = 9600
QUESTION = b"!\0" + CR
"""The empty line with a mark: a half-typed command becomes an unknown one (ERR 32) instead of being carried out. In a
control block of RealTime that was cut off no motor begins to move by it: 21h as a velocity has the gain 0 behind it, and
0Dh as a gain the velocity 0 before it."""
BLOCK_REST = 8
"""Bytes that a control block of RealTime can still want: velocity and gain, or a torque, of four motors (barrett §6.2.1)."""
FILL = bytes(BLOCK_REST) + QUESTION
"""Ends RealTime in the middle of a control block that somebody left half sent: what is missing of it becomes 0, by which no
motor moves, and the next 0 is no header: ERR 2048. The question behind it is for a hand at its prompt."""
SAFE_ABORT = b"\x00" + ABORT
"""^C at a speed above 9600: alone it is FF to a monitor; behind 00, which no motor moves by, it is the end of one byte."""


def abort_at(speed: int | None) -> bytes:
    """^C for a hand that may be a boot monitor at 9600 by now; `speed` of the port in bit/s, None where it has none."""
    return SAFE_ABORT if speed is not None and speed > MONITOR_SPEED else ABORT


def ends_alone(size: int, speed: int | None) -> bool:
    """Whether a monitor takes the last of so many bytes sent at `speed` for the beginning of a byte, the idle line for the
    rest: it may hear FF. 4 bytes at 38400 are as long as one of its own, 2 at 19200."""
    return speed is not None and speed > MONITOR_SPEED and size % (speed // MONITOR_SPEED) == 1


LOOPED = b"\x7f"
"""At LOOP_SPEED too short a pulse for any receiver at 9600: it comes back from a wire and from nothing else."""
LOOP_SPEED = 115200

NOTHING, PROMPT, LATE, LOOP = "nothing", "prompt", "late prompt", "ERR 2048"
OTHER = "other text"
RESTART, BANNER_ONLY, COLON, ECHO, BYTES = "banner and prompt", "banner", "':'", "echo", "other bytes"
SEEN = {
    NOTHING: "silence until the end of the wait",
    PROMPT: "a prompt in reply to the request, or one that was already there",
    OTHER: "a prompt in reply to the request, with other text than the manual has",
    LATE: "a prompt without an echo of the request: an earlier command has just ended, or the line swallows the echo",
    LOOP: "ERR 2048 and a prompt: RealTime rejected the request as a block header",
    RESTART: "the banner, then a prompt",
    BANNER_ONLY: "the banner, but no prompt yet",
    COLON: "the ':' of the boot monitor, and nothing after it",
    ECHO: "the request itself, including its CR, which a hand with firmware never echoes",
    BYTES: "anything else",
}

OPENED, REMEMBERED, ASKED, SILENT, BOOTING = "opened", "remembered", "asked", "silent", "booting"
RESTARTED, LEAVING, ECHOED, ELSEWHERE, AGAIN = "restarted", "leaving", "echoed", "elsewhere", "again"
CONFIRMED, FILLED_FIRST, FILLED = "confirmed", "filled first", "filled"
PROVED, CLEARED = "proved", "cleared"
STATES = {
    OPENED: "the port is open: read any bytes that have already arrived",
    REMEMBERED: "request sent at the last known baud rate, if that is not 9600",
    FILLED_FIRST: "no prompt at the last known baud rate: RealTime may be waiting for the rest of a control block",
    ASKED: "request sent at 9600, or at the only baud rate of the link",
    FILLED: "no reply there either: the same at 9600, or at the only baud rate",
    SILENT: "no reply at 9600 (off, no cable, busy, starting, or another baud rate): listen until the port has been open for 3 s",
    BOOTING: "boot window, or no firmware: send nothing for 6 s",
    CONFIRMED: "request sent once more at 9600, because the ':' may have been noise",
    RESTARTED: "the banner has arrived: wait for its prompt, or request it",
    LEAVING: "noise, a wrong baud rate, or RealTime in the middle of a control block",
    PROVED: "a prompt, but with other text than the manual has: request sent once more. Noise does not say the same twice",
    CLEARED: "a prompt without an echo: wait for the echo, then send the request once more. After an earlier command has ended, a hand echoes this one",
    ECHOED: "our own bytes came back: a short circuit also returns them at 115200, where the monitor does not",
    ELSEWHERE: "request sent at one of the other baud rates",
    AGAIN: "no reply at any baud rate, or a banner without a prompt: request sent once more, at the first baud rate or at that of the banner",
}
FILLING = (FILLED_FIRST, FILLED, LEAVING)
"""What is seen there was asked with FILL."""
SAME_SPEED = (*FILLING, SILENT, BOOTING, CONFIRMED, RESTARTED, PROVED, CLEARED)
"""The port keeps the speed of the state before."""
READY, MONITOR, WIRE, ECHOLESS, NOBODY, GARBAGE = "ready", "monitor", "wire", "echoless", "nobody", "garbage"
ENDS = {
    READY: "connected",
    MONITOR: "exit code 6: boot monitor (no firmware, or just switched on). If no ':' was received, another device that echoes at 9600 looks the same",
    WIRE: "exit code 5: TX and RX are connected to each other. On a link without a baud rate of its own, a boot monitor looks the same",
    ECHOLESS: "exit code 5: the hand replies, but the request is not echoed, so a reply cannot be matched with its request",
    NOBODY: "exit code 4: no reply",
    GARBAGE: "exit code 5: bytes arrived, but no prompt",
}
SECONDS = {OPENED: 0.0, REMEMBERED: 0.4, FILLED_FIRST: 0.1, ASKED: 0.4, FILLED: 0.1, SILENT: 3.0, BOOTING: 6.0, CONFIRMED: 0.5, RESTARTED: 5.0, LEAVING: 0.2,
           PROVED: 0.5, CLEARED: 0.5, ECHOED: 0.05, ELSEWHERE: 0.3, AGAIN: 0.5}  # fmt: skip
"""Longest wait in each state, beyond wire time; of SILENT the time since the port was opened."""

SEND_NOTHING, ASK, REST, ABORTS, LOOP_TEST = (
    "",
    "! 00 CR",
    f"{BLOCK_REST} x 00 ! 00 CR",
    f"{BLOCK_REST} x 00 ! 00 CR, or with --interrupt ^C, up to 9 times",
    "7F at 115200",
)


class Row(NamedTuple):
    """One line of the table."""

    state: str
    seen: str
    next: str
    send: str = SEND_NOTHING
    said: str = ""


BUSY = "the hand was still running an earlier command, which has ended"
IN_LOOP = "the hand was in RealTime and left it when handctl connected. The motors may still be running"
IN_BLOCK = "the hand was in RealTime, in a control block that was cut off. handctl sent 0 for the rest of it, and the hand left RealTime. The motors may still be running"
RESTARTED_TEXT = "the hand restarted because of a power or cable problem, and must be initialized (HI)"
SILENCE = "check the hand's power supply, then the serial cable (straight-through, 9 pins), then the port. A hand that was off for more than a day or two may have lost its firmware and does not reply: load it again"
MONITOR_TEXT = "boot monitor: no firmware, or just switched on"

SENDS = {
    **dict.fromkeys((ASKED, CONFIRMED, ELSEWHERE, AGAIN, PROVED, CLEARED), ASK),
    **dict.fromkeys((FILLED_FIRST, FILLED), REST),
    LEAVING: ABORTS,
    ECHOED: LOOP_TEST,
}
"""State -> what is sent on the way there."""
TELLS = {LATE: BUSY, LOOP: IN_LOOP, RESTART: RESTARTED_TEXT, BANNER_ONLY: RESTARTED_TEXT}
"""What is seen -> what that says of the hand, unless it has lain there since the port was opened."""


def _met(colon: str, echo: str, other: str, nothing: str) -> dict[str, str]:
    """The next states of one in which a prompt is an answer."""
    known = {**dict.fromkeys((PROMPT, LOOP, RESTART), READY), LATE: CLEARED, BANNER_ONLY: RESTARTED}
    return {**known, OTHER: PROVED, COLON: colon, ECHO: echo, BYTES: other, NOTHING: nothing}


NEXT: dict[str, dict[str, str]] = {
    OPENED: {
        **dict.fromkeys((NOTHING, PROMPT, OTHER, LATE, LOOP, RESTART), ASKED),
        BANNER_ONLY: RESTARTED,
        COLON: BOOTING,
        **dict.fromkeys((ECHO, BYTES), ASKED),
    },
    REMEMBERED: _met(ASKED, ASKED, FILLED_FIRST, FILLED_FIRST),
    FILLED_FIRST: _met(ASKED, ASKED, ASKED, ASKED),
    ASKED: _met(BOOTING, ECHOED, LEAVING, FILLED),
    FILLED: _met(BOOTING, ECHOED, LEAVING, SILENT),
    SILENT: _met(BOOTING, ECHOED, ELSEWHERE, ELSEWHERE),
    BOOTING: _met(CONFIRMED, MONITOR, ELSEWHERE, CONFIRMED),
    CONFIRMED: _met(MONITOR, MONITOR, GARBAGE, MONITOR),
    RESTARTED: _met(BOOTING, ASKED, ASKED, ASKED) | {BANNER_ONLY: AGAIN},
    LEAVING: _met(BOOTING, ECHOED, ELSEWHERE, ELSEWHERE),
    ECHOED: {ECHO: WIRE, NOTHING: MONITOR},
    ELSEWHERE: _met(ELSEWHERE, ELSEWHERE, ELSEWHERE, ELSEWHERE),
    AGAIN: _met(BOOTING, GARBAGE, ASKED, ASKED),
    PROVED: _met(BOOTING, ASKED, ASKED, ASKED) | {OTHER: READY},
    CLEARED: _met(BOOTING, ASKED, ASKED, READY) | {LATE: ECHOLESS},
}


def _said(state: str, seen: str) -> str:
    special = {(AGAIN, PROMPT): BUSY, (BOOTING, BYTES): "its firmware has started at another speed"}
    if NEXT[state][seen] == MONITOR:
        return MONITOR_TEXT
    if seen == LOOP and state in FILLING:
        return IN_BLOCK
    return special.get((state, seen), "" if state == OPENED and seen in (LATE, LOOP) else TELLS.get(seen, ""))


TABLE = tuple(
    Row(state, seen, after, SENDS.get(after, SEND_NOTHING), _said(state, seen))
    for state, row in NEXT.items()
    for seen, after in row.items()
)
"""Behind the last of the other speeds ELSEWHERE is AGAIN; NOBODY is GARBAGE when bytes came before. ASKED behind AGAIN is only for
a firmware that may have started meanwhile, once: 9600 was silent for 3 s and bytes came only then; else it is NOBODY. Any other
state that would be entered a third time is GARBAGE: every walk ends."""

ANSWER = re.compile(rb"\0*\s*(ERR \d+\s+)?=>\s*")
"""What stands behind the question's echo; anything more is noise, the answer to something before, or a firmware that answers
otherwise than the manual shows: then it says the same again."""
RULES = {(row.state, row.seen): row for row in TABLE}


PAGE = (
    "How handctl finds a hand on a link. Each line below shows the data received, the next state, and the bytes sent on the "
    "way there. The request is !, 00 and CR. It ends no movement. It turns a half-typed command into an unknown one, and "
    "in a RealTime control block that was cut off it starts no motor. If there is no reply, handctl sends 0 for the rest "
    "of such a block. Commands that move, write or stop send ^C first, and so does `--interrupt`.",
    "The boot monitor listens at 9600 and takes FF as its trigger, which would overwrite good firmware. So handctl sends "
    "nothing the monitor could read as FF until it has tried 9600 and the port has been open for 3 s. After that, "
    "`handctl scan` may send such a byte. A monitor that stays silent for longer looks like an unconnected port.",
    "If a port is silent for 3 s and then sends bytes, the firmware of the hand may have just started, so handctl tries "
    "all baud rates once more.",
    "A hand does not reply while it moves or saves. If it replies at no baud rate, it may be in the middle of a long "
    "movement. `handctl barrett stop` stops it.",
    "A banner, or a single : from the monitor, also ends every later wait for a reply: the hand has restarted because of "
    "its power or its cable, and needs `init`.",
)


def section() -> tuple[str, tuple[str, ...], list[tuple[str, str, list[str]]]]:
    """The section of the manual page: title, paragraphs, and for each state its text and its lines of the table."""
    items = []
    for state, text in STATES.items():
        lines = []
        for row in TABLE:
            if row.state == state:
                lines.append(f"{row.seen:<18}{row.next:<12}{f'sends {row.send}' if row.send else ''}".rstrip())
                lines += [f"    {row.said}"] if row.said else []
        items.append((state, f"{text}.", lines))
    seen: list[tuple[str, str, list[str]]] = [(name, f"{text}.", []) for name, text in SEEN.items()]
    return "CONNECTING", PAGE, [*items, *((end, f"{text}.", []) for end, text in ENDS.items()), *seen]


def is_answer(data: bytes) -> bool:
    """Whether a prompt came that answers the question: an unknown command, in words; numbers and bare prompts are of something before."""
    return has_prompt(data) and question_in(data) and any(chr(one).isalpha() for one in answer_in(data) if one < 128)


QUESTION_TEXT = "!"
MANUAL_ANSWER = "ERR 32 and a prompt"
"""The question, and what the manual has for its answer, as it is told."""


def answer_in(data: bytes) -> bytes:
    """What stands behind the question's echo."""
    return data.rpartition(QUESTION[:1])[2]


def question_in(data: bytes) -> bool:
    """Whether the question's echo is there."""
    return QUESTION[:1] in data


def seen_in(data: bytes, question: bytes = QUESTION) -> str:
    """Which of SEEN the bytes are; `question` is what was sent, b"" when nothing was."""
    prompt = has_prompt(data)
    if BANNER in data.upper():
        return RESTART if prompt else BANNER_ONLY
    if prompt:
        if b"ERR 2048" in data:
            return LOOP
        if question[:1] not in data:
            return LATE
        if not question or ANSWER.fullmatch(answer_in(data)):
            return PROMPT
        return OTHER if answer_in(data).isascii() else BYTES  # a bit was lost: no text of a firmware
    if question and data.strip(b"\0" + ABORT) == question:
        return ECHO
    if has_colon(data):
        return COLON
    return BYTES if data else NOTHING
