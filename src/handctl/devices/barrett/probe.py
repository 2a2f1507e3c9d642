"""Detect a BarrettHand: ask for its prompt, then read its serial number (barrett §5.1.1).

It moves nothing, ends no movement and is no command: an empty line with a mark. Other prompts look alike: only an answer
to PGET SN counts. A hand in its boot monitor is told and left alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl import connect_table
from handctl.devices.barrett.gcl.codec import has_prompt, values
from handctl.devices.barrett.gcl.connect_table import MONITOR_SPEED, MONITOR_TEXT, QUESTION, seen_in
from handctl.devices.barrett.gcl.line import GclLine
from handctl.devices.barrett.gcl.session_start import comes_back, without_echo
from handctl.devices.barrett.gcl.status_codes import UNKNOWN_NAME
from handctl.devices.barrett.parameter_map import SPEEDS as SPEEDS
from handctl.errors import NoAnswer, ProtocolError
from handctl.link import ByteLink, Deadline
from handctl.model.result import Journal, Row, hex_bytes
from handctl.wording import plural

WIRES = ("serial", "tcp")
PING = "PGET TEMP"
ECHOES = True
"""Every character comes back: its own echo is no sign of a loop in the cable."""
GUARD = (MONITOR_SPEED, connect_table.SECONDS[connect_table.SILENT], (115200, 57600))
"""Before other speeds than those in the brackets are tried, this one has been asked and the port was open for so many
seconds: at the others a probe of any family could be a trigger to the boot monitor (a test samples the bits)."""
PROMPT_WAIT = 0.3
READ_TIMEOUT = 0.5
MOST = 256
"""Bytes taken at the most while a prompt is waited for."""


def probe(
    link: ByteLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,), timeout: float | None = None
) -> list[Row]:
    """A row with the evidence. Raises NoAnswer, ProtocolError for other data."""
    waiting = _until_prompt(link, link.at_once)
    if seen_in(waiting, b"") == connect_table.COLON:
        raise _monitor(link, "a ':' arrived without a request")
    wire = 16 * 10 / link.baud if link.baud else 0.0
    link.write(QUESTION, link.deadline(1.0).earlier(deadline))
    journal.counters.sent += 1
    came = _until_prompt(link, link.deadline(max(PROMPT_WAIT, timeout or 0.0) + wire).earlier(deadline))
    if not came:
        raise NoAnswer(f"{link.name}: no prompt", hint="check the hand's power and the cable")
    seen = seen_in(came)
    if seen == connect_table.COLON:
        raise _monitor(link, "':' arrived")
    if seen == connect_table.ECHO and link.can_set_baud and link.baud == MONITOR_SPEED and not comes_back(link):
        raise _monitor(link, "the request came back, but no prompt")
    if not has_prompt(came):
        raise ProtocolError(
            f"{link.name}: no prompt, but {plural(len(came), 'byte')}: {hex_bytes(came[:24])}",
            hint="check the port and the baud rate: it may be another device, an echo or a wrong baud rate",
            code="echo" if seen == connect_table.ECHO else "garbage",
            came=came,
        )
    try:
        found = _identity(link, journal, deadline, timeout or READ_TIMEOUT)
    except ProtocolError as exc:
        unechoed = seen == connect_table.LATE and getattr(exc.__cause__, "code", "") == "echo-differs"
        if unechoed and b"ERR " in came:  # GCL's word: another device's prompt, such as a boot loader's, has none
            raise without_echo(link, came) from exc
        raise
    note = ", was in RealTime" if seen == connect_table.LOOP else ""
    return [{"evidence": found + note}]


def _monitor(link: ByteLink, evidence: str) -> ProtocolError:
    return ProtocolError(
        f"{link.name}: {evidence}: a BarrettHand in its {MONITOR_TEXT}",
        hint="scan again when its firmware is running. If it has none: `handctl barrett firmware download FILE`",
        code="boot-monitor",
    )


def _until_prompt(link: ByteLink, deadline: Deadline) -> bytes:
    came = b""
    while len(came) < MOST and not has_prompt(came):
        chunk = link.read(deadline)
        if not chunk:
            break
        came += chunk
    return came


def _identity(link: ByteLink, journal: Journal, deadline: Deadline, timeout: float) -> str:
    line = GclLine(link, journal, timeout=timeout, retries=1, bound=deadline, speed=link.baud)
    line.found()
    try:
        answer = line.read("PGET SN")
        if answer.status == UNKNOWN_NAME and not answer.lines:
            return "prompt, no serial number on this firmware (ERR 64)"
        if answer.status:
            raise ProtocolError(f"ERR {answer.status} in reply to PGET SN", hint="scan again")
        (numbers,) = values(answer, 1, 1)
    except (NoAnswer, ProtocolError) as exc:
        raise ProtocolError(
            f"{link.name}: a prompt arrived, but no serial number: {exc.text}",
            hint="check the port and the cable: it may be another device with a prompt, or a disturbed line",
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
