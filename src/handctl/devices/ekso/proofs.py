"""What the DataPort's manual leaves open, as experiments (ekso §6; dossier 1, 3, 10). See `model.proofs`.

A person may be standing in the device: only reads of the manual are sent, and with --level write-back one setting is written once
with the value that it has, through every check of `set` and while the wearer sits still.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.device import Ekso
from handctl.devices.ekso.frames import LENGTH_MODES, OVERHEAD, Command
from handctl.devices.ekso.parameter_map import DATA, SETTINGS, SITTING
from handctl.devices.ekso.stillness import STATE
from handctl.errors import DeviceRefused, ProtocolError
from handctl.model.prompts import Prompts
from handctl.model.proofs import NONE, WRITE_BACK, Disturbed, Observation, Proof, damage

if TYPE_CHECKING:
    from handctl.command.run import Run

GRIDS = (20, 10)
"""Periods in ms on which answers may leave, the longest first."""
ANSWERS = 16
STEP = 0.0037
"""Seconds by which the requests drift through any grid."""
JITTER = 1.2
"""ms by which an answer may be off its grid: a tenth of the time is so, whatever the device does, and never 16 times running."""
SILENT = 0.25
"""Seconds in which an answer to a damaged request would have come."""
REST = 0.5
WATCHED = 0.3
APART = 50
"""ms by which the two clocks may differ over that time."""
WRITTEN = "step_height"
"""A setting that shapes a step and nothing else: whoever sits does not feel it."""
BENT = 30.0
"""Degrees by which the knees of a seated person are bent at least."""


def prepare(device: Ekso) -> None:
    """Find the length convention first: nothing else is answered. Raises NoAnswer, ProtocolError."""
    device.port.detect_length_mode()


def writer_for(run: Run) -> Callable[[Ekso], None]:
    """Refuse --yes without an operator now; later give the device what writing needs, the audit log among it. Raises UsageError, OutputError."""
    from handctl.devices.ekso.cli import give_writer, need_operator

    need_operator(run)
    return lambda device: give_writer(run, device, None, override=False)


def _length(device: Ekso) -> Observation:
    port = device.port
    port.exchange(Command.GET_TIME)
    return Observation(port.mode, f"GetTime is answered with the length byte {LENGTH_MODES[port.mode]}")


def _answer_length(device: Ekso) -> Observation:
    frame = device.port.exchange(Command.GET_DATE)
    return Observation(frame.mode, f"{len(frame.body)} body bytes, length byte {frame.data[1]}")


def _time_body(device: Ekso) -> Observation:
    sizes = [len(device.port.exchange(command).body) for command in (Command.GET_TIME, Command.GET_DATE)]
    return Observation(
        sizes[0] if sizes[0] == sizes[1] else None, f"GetTime {sizes[0]} bytes, GetDate {sizes[1]} bytes"
    )


def _echoed(device: Ekso) -> Observation:
    """Both fields, or the exchange would not have been one: shown with a msgID whose two bytes differ."""
    frame = device.port.exchange(Command.GET_FEEDBACK)
    return Observation(
        "command, msgID", f"{frame.data[:4].hex(' ').upper()} answers command {frame.command}, msgID {frame.msg_id}"
    )


def _grid(device: Ekso) -> Observation:
    """Whether all answers leave at multiples of one period, although the requests do not."""
    port, moments = device.port, list[float]()
    for number in range(ANSWERS):
        port.exchange(Command.GET_TIME)
        moments.append(1000 * port.answered_at)
        port.pause(STEP * (1 + number % 5))
    for period in GRIDS:
        off = [(moment - moments[0] + period / 2) % period - period / 2 for moment in moments]
        if max(off) - min(off) <= JITTER:
            return Observation(
                period, f"{ANSWERS} answers lie within {max(off) - min(off):.1f} ms of a grid of {period} ms"
            )
    return Observation(0, f"{ANSWERS} answers lie on no grid of {' or '.join(map(str, GRIDS))} ms")


def _bad_crc(device: Ekso) -> Observation:
    port = device.port
    request = port.request(Command.GET_TIME)
    port.exchange(Command.GET_TIME)  # takes that msgID, so that no later request has it
    damaged = request[:-1] + bytes([request[-1] ^ 0x55])
    came = _raw(port, damaged)
    if not came:
        return Observation("silence", "GetTime with a wrong CRC: no reply")
    if came[:1] != request[:1] or damaged in came or came[2:4] != request[2:4]:
        raise Disturbed("the reply to a damaged request is itself damaged")
    return Observation(
        "acknowledged" if len(came) == OVERHEAD else "answered", f"GetTime with a wrong CRC: {came.hex(' ').upper()}"
    )


def _raw(port: DataPort, data: bytes) -> bytes:
    """What comes to these bytes, and quiet behind it: a device that wants more bytes must have forgotten them."""
    link, came = port.link, b""
    link.write(data, link.deadline(1.0))
    deadline = link.deadline(SILENT)
    while len(came) < 256 and (chunk := link.read(deadline)):
        came += chunk
    link.sleep(REST)
    port.resynchronise()
    return came


def _word_order(device: Ekso) -> Observation:
    """Which of the two words of BootTime counts the high part: only one reading of them goes as fast as our clock."""
    port = device.port
    pairs, times = list[tuple[int, int]](), list[float]()
    for _ in range(2):
        words = port.exchange(Command.GET_FEEDBACK).words
        pairs.append((words[15] & 0xFFFF, words[16] & 0xFFFF))
        times.append(1000 * port.answered_at)
        port.pause(WATCHED)
    passed = times[1] - times[0]
    high, low = ((pairs[1][a] - pairs[0][a]) * 65536 + pairs[1][b] - pairs[0][b] for a, b in ((0, 1), (1, 0)))
    told = f"{passed:.0f} ms passed here, BootTime {pairs[0]} became {pairs[1]}"
    if pairs[0] == pairs[1]:
        return Observation("stands still", told)
    fits = [name for name, way in (("high first", high), ("low first", low)) if abs(way - passed) <= APART]
    return Observation(fits[0] if len(fits) == 1 else None, told)


def _codes(device: Ekso) -> Observation:
    raw = device.port.settings_raw()
    found = [
        param.name for param, value in zip(SETTINGS, raw, strict=True) if param.choices and value not in param.choices
    ]
    return Observation(", ".join(found) or NONE, "GetSettings")


def _knees(device: Ekso) -> Observation:
    words = device.port.exchange(Command.GET_DATA).words
    index = {param.name: param.word for param in DATA}
    angles = [DATA[index[name]].from_raw(words[index[name]]) for name in ("left_knee_angle", "right_knee_angle")]
    told = f"state {words[index['state']] & 0xFFFF:04X}, knees {angles[0]} and {angles[1]} degrees"
    if (words[index["state"]] & 0xFFFF) >> 12 != SITTING or min(map(abs, angles)) < BENT or angles[0] * angles[1] < 0:
        return Observation(None, f"{told}: the wearer does not sit")
    return Observation("flexion positive" if angles[0] > 0 else "flexion negative", told)


def _write_back(device: Ekso, _prompts: Prompts) -> Observation:
    """One SetValue of the present value. Raises what a check of the writer refuses, and whatever reads back otherwise."""
    port, param, counters = device.port, device.map[WRITTEN], device.journal.counters
    state = port.exchange(Command.GET_DATA).words[STATE]
    if (state & 0xFFFF) >> 12 != SITTING:
        return Observation(None, f"state {state & 0xFFFF:04X}: the wearer does not sit, so nothing was written")
    shown, calm = port.settings_raw(), damage(counters)
    assert device.writer is not None
    value = "accepted"
    try:
        device.writer.write_back(param, shown)
    except DeviceRefused as exc:
        if not exc.code.startswith("status-"):
            raise
        value = exc.code.replace("-", " ")
    except ProtocolError as exc:
        if exc.code != "acknowledged":
            raise
        value = "acknowledged"
    if damage(counters) != calm and value != "acknowledged":
        raise Disturbed("the line was disturbed while a setting was written")
    told = param.shown(param.from_raw(shown[param.word]))
    return Observation(
        value, f"SetValue {param.name} = {told}, which it had: {value}, and every setting reads as before"
    )


PROOFS = (
    Proof("length-convention", "not documented what the length byte counts (dossier 1)", "body", "GetTime in each convention, until one is answered", _length),
    Proof("answer-length", "not documented for replies (dossier 1)", "body", "GetDate: length byte against CRC", _answer_length),
    Proof("time-body", "3 bytes in §6, 4 in the field (dossier 4, row 3)", 4, "GetTime and GetDate: size of the body", _time_body),
    Proof("echo-fields", "a reply repeats command and msgID (§6)", "command, msgID", "GetFeedback: which fields of the request its reply repeats", _echoed),
    Proof("service-grid", "not documented; 12 ms was the shortest interval in the field (dossier 10)", 0, f"{ANSWERS} requests at drifting times: do the answers keep to a grid of 20 or 10 ms?", _grid),
    Proof("bad-crc", "not documented; taken for silence (dossier 10)", "silence", "GetTime with a wrong CRC", _bad_crc),
    Proof("boot-time-words", "high word first (§6)", "high first", "GetFeedback twice: which reading goes as fast as this computer's clock", _word_order),
    Proof("unlisted-codes", "newer units return codes that no table has (dossier 3.1)", NONE, "GetSettings: codes that are in no table", _codes),
    Proof("knee-sign", "flexion is positive in the field (dossier 3.2); §6 gives no sign", "flexion positive", "GetData while the wearer sits: sign of both knees", _knees),
    Proof(
        "write-back", "a status, without its codes (§6); 0 is success in the field (dossier 2)", "accepted",
        f"while the wearer sits still, {WRITTEN} gets the value that it has: the status, and GetSettings before and after", _write_back, WRITE_BACK,
        question=f"{WRITTEN} will be written once, with the value that it has, to an exoskeleton that someone may be wearing. The wearer must sit still", alone=True,
    ),
)  # fmt: skip
