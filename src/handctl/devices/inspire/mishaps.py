"""What came instead of an answer on the serial wire, in words with the next step. Knows bytes, no link."""

from __future__ import annotations

from collections.abc import Callable

from handctl.devices.inspire import eb90
from handctl.devices.inspire.eb90 import Decoder, Frame
from handctl.errors import ProtocolError
from handctl.model.frames import frames_in
from handctl.model.result import hex_bytes
from handctl.sentence import plural

SILENCE_HINT = (
    "check these in order: --id 1 at 115200 bit/s, `handctl exo scan`, power (7 to 9 V), TX/RX and RS-232 wiring. "
    "A wrong id, a wrong baud rate, no power and no cable all look the same: the device never answers. Unplug power and data, and plug them in again"
)
SILENCE_HINTS = {
    "hand": "check these in order: --id 1 at 115200 bit/s, `handctl hand scan`, power (24 V), A and B of RS-485. "
    "An RH56DFTP may answer only on its network: `handctl hand status -p tcp://192.168.11.210`. "
    "At baud rates other than 115200 bit/s handctl tries Modbus RTU only with --protocol modbus",
}
"""Of families that are not as the EH55BF1 is (rh56 §1, §2.5)."""
HINTS = {
    "echo": "check the wiring: an echo or a TX-RX short returns our own bytes, and no device answers",
    "wrong-id": "use the --id it shows, or find the hand with `handctl exo scan`: a different id answers",
    "bad-checksum": "check the cable, the ground and the baud rate, and that only one device has this id: bytes were damaged on the line",
    "cut-short": "check the cable and the adapter, and that no other program reads the port: the answer was cut off",
    "stale": "check for another program or a second master on this line: the frame is valid, but answers a different request",
    "first-byte-lost": "use another RS-485 adapter, or make this one switch its direction sooner: it swallows the first byte of each answer",
    "garbage": "try --baud 115200, 57600 and 19200: the baud rate is probably wrong, or this is another kind of device",
}


OWN_HINTS = {
    (
        "hand",
        "garbage",
    ): "try --baud 115200, 921600, 57600 and 19200: the baud rate is probably wrong, or this is another kind of device",
    (
        "hand",
        "bad-checksum",
    ): "check the cable, the ground and the baud rate. Two hands with the same id also cause this: `handctl hand doctor -p LINK` detects that",
}
"""(family, code) -> the next step where it is another one."""


def hint_for(code: str, family: str) -> str:
    """The next step for a code of `mishap`, with this family's own command names."""
    return OWN_HINTS.get((family, code), HINTS[code]).replace("handctl exo", f"handctl {family}")


def silence_hint_for(family: str) -> str:
    """The next step where nothing came."""
    return SILENCE_HINTS.get(family, SILENCE_HINT)


def mishap(request: bytes, received: bytes) -> tuple[str, str]:
    """Name what came instead of the answer: (code, text). Codes are the keys of HINTS."""
    rest = received
    if request in rest:
        rest = rest.replace(request, b"", 1)
        if not rest:
            return "echo", "only our own bytes came back"
    wanted_id = request[2] if len(request) > 2 else None
    if any(frame.id == wanted_id for frame in beheaded(rest)):
        return "first-byte-lost", "the answer arrived without its first byte"
    if others_speak(request, rest) and not _damaged(rest, wanted_id):
        return (
            "stale",
            "received a valid frame, but it does not answer this request: another program or device is using this line",
        )
    sniffer = Decoder()
    sniffer.feed(rest)
    bad_sums: list[ProtocolError] = []
    frames = list(frames_in(sniffer, bad_sums.append))
    pending = sniffer.pending
    frames += sniffer.finish()
    replies = [frame for frame in frames if frame.from_device]
    for frame in replies:
        if frame.id != wanted_id:
            return "wrong-id", f"id {frame.id} answered instead"
    if bad_sums:
        return "bad-checksum", "the answer's checksum is wrong"
    if frames:
        return "stale", "received a valid frame, but it does not answer this request"
    # At a wrong speed 90 EB may come by chance: with the id behind it, or nothing, it is the beginning of an answer.
    if pending >= 2 and (rest.endswith(eb90.DEVICE) or eb90.DEVICE + request[2:3] in rest):
        return "cut-short", f"the answer was cut off after {plural(len(rest), 'byte')}"
    return "garbage", f"received {plural(len(rest), 'byte')} instead of a valid frame"


def others_speak(request: bytes, received: bytes) -> bool:
    """Whether there is a request in it that is not ours, or an answer of another id to something else than ours."""

    def aside(frame: Frame) -> bool:
        if not frame.from_device:
            return True
        same = bytes([frame.flag]) + frame.payload[:2] == request[4:7]
        if same and frame.flag in (eb90.READ, eb90.WRIST_READ):
            same = len(frame.data) == request[7]
        return frame.id != request[2] and not same

    return any(map(aside, foreign_in(received, request, lambda frame: False)))


def _damaged(received: bytes, device_id: int | None) -> bool:
    """Whether a frame with this id and a wrong sum is in it."""
    sniffer, named = Decoder([eb90.DEVICE]), list[int]()
    sniffer.feed(received)
    list(frames_in(sniffer, lambda _error: named.append(sniffer.rejected[2])))
    return device_id in named


def shorten(data: bytes, limit: int = 40) -> str:
    """Bytes in hex, not more of them than a message can hold."""
    text = hex_bytes(data[:limit])
    return text if len(data) <= limit else f"{text} … ({len(data)} bytes)"


def beheaded(data: bytes) -> list[Frame]:
    """Answers to reads in `data` that are whole but for their first byte."""
    found = []
    place = data.find(eb90.DEVICE[1:])
    while place >= 0:
        one = eb90.DEVICE[:1] + data[place:]
        whole = Decoder([eb90.DEVICE])
        whole.feed(one[: one[3] + eb90.OVERHEAD] if len(one) > 3 else b"")
        if data[:place][-1:] != eb90.DEVICE[:1]:
            found += [frame for frame in frames_in(whole) if frame.flag in (eb90.READ, eb90.WRIST_READ)]
        place = data.find(eb90.DEVICE[1:], place + 1)
    return found


def foreign_in(data: bytes, sent: bytes, ours: Callable[[Frame], bool]) -> list[Frame]:
    """Whole frames in `data` that were not `sent` by us, and answer nothing of `ours`: the conversation of others."""
    sniffer = Decoder()
    sniffer.feed(data)
    frames = [*frames_in(sniffer), *sniffer.finish()]
    return [frame for frame in frames if frame.encode() not in sent and not (frame.from_device and ours(frame))]
