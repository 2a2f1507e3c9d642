"""Is there a BarrettHand? ^C and an empty line ask for its prompt, then its serial number is read (barrett §5.1.1).

^C is what the dossier begins every connection with: a bare CR would carry out a half-typed line. It ends a movement
that somebody left running, and moves nothing. Other prompts look alike: only an answer to PGET SN counts.
"""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.barrett.hand import BarrettHand
from handctl.devices.barrett.language import ABORT, CR, has_prompt, values
from handctl.devices.barrett.line import GclLine
from handctl.errors import NoAnswer, ProtocolError
from handctl.link import ByteLink, Deadline
from handctl.result import Journal, Row, hex_bytes

FAMILY = "barrett"
WIRES = ("serial", "tcp")
SPEEDS = (9600, 38400, 19200, 4800, 2400, 1200, 600)
PING = "PGET TEMP"
ECHOES = True
"""Every character comes back: its own echo is no sign of a loop in the cable."""
ABORT_WAIT = 0.15
PROMPT_WAIT = 0.3
READ_TIMEOUT = 0.5
MOST = 256
"""Bytes taken at the most while a prompt is waited for."""


def probe(
    link: ByteLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,), timeout: float | None = None
) -> list[Row]:
    """Rows family, link, baud, id (it has none), evidence. Raises NoAnswer, ProtocolError for what came instead."""
    waiting = _until_prompt(link, link.deadline(0))
    if b":" in waiting:
        raise ProtocolError(
            f"{link.name}: a ':' came by itself: a BarrettHand that has just been switched on sits in its boot monitor",
            hint="wait until its firmware runs, then scan again; without firmware: `handctl barrett firmware`",
            code="boot-monitor",
        )
    came = _knock(link, deadline, timeout or 0.0)
    journal.counters.sent += 1
    if not came:
        raise NoAnswer(f"{link.name}: no prompt", hint="check the hand's power and the cable")
    if not has_prompt(came):
        own = not came.replace(b"\n", b"").strip(ABORT + CR)
        raise ProtocolError(
            f"{link.name}: no prompt, but {len(came)} bytes: {hex_bytes(came[:24])}",
            hint="another device, an echo or a wrong speed",
            code="echo" if own else "garbage",
        )
    return [
        {
            "family": FAMILY,
            "link": link.name,
            "baud": link.baud,
            "id": None,
            "evidence": _identity(link, journal, deadline, timeout or READ_TIMEOUT),
        }
    ]


def _knock(link: ByteLink, deadline: Deadline, patience: float) -> bytes:
    """^C, then CR; what came up to the prompt. Waits `patience` seconds for each where that is longer than ours."""
    wire = 8 * 10 / link.baud if link.baud else 0.0
    link.write(ABORT, link.deadline(1.0).earlier(deadline))
    early = _until_prompt(link, link.deadline(max(ABORT_WAIT, patience) + wire).earlier(deadline))
    link.write(CR, link.deadline(1.0).earlier(deadline))
    return early + _until_prompt(link, link.deadline(max(PROMPT_WAIT, patience) + wire).earlier(deadline))


def _until_prompt(link: ByteLink, deadline: Deadline) -> bytes:
    came = b""
    while len(came) < MOST and not has_prompt(came):
        chunk = link.read(deadline)
        if not chunk:
            break
        came += chunk
    return came


def _identity(link: ByteLink, journal: Journal, deadline: Deadline, timeout: float) -> str:
    quiet = Journal()
    quiet.counters = journal.counters
    line = GclLine(link, quiet, timeout=timeout, retries=1, bound=deadline, speed=link.baud)
    try:
        answer = line.read("PGET SN")
        if answer.status:
            raise ProtocolError(f"ERR {answer.status} to PGET SN")
        (numbers,) = values(answer, 1, 1)
    except (NoAnswer, ProtocolError) as exc:
        raise ProtocolError(
            f"{link.name}: a prompt came, but no serial number: {exc.text}",
            hint="another device with a prompt, or a disturbed line",
            code="garbage",
        ) from exc
    return f"prompt, serial number {numbers[0]}"


def ping(device: BarrettHand) -> None:
    """PGET TEMP, asked once; after a failure the line is brought back to its prompt. Raises what the line raises."""
    try:
        device.checked(device.line.ask(PING))
    except (NoAnswer, ProtocolError):
        device.line.resynchronise()
        raise
