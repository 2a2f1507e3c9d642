"""slcan adapters through python-can, with what its own interface is missing.

    asks V and N before anything else   a port that is not an adapter's gets no command that another device could take
    C, S, O, F in one go, their answers read    BEL for a bitrate or a channel is an error, not silence
    reads what waits, writes at once    python-can asks the system twice for each byte, sets up the port for each frame, and
                                        waits after each write until the adapter has the bytes
    takes lines apart strictly          damaged ones are dropped and counted
    BEL, F, and unasked reports         s… and e… as the slcan driver of Linux knows them

Status flags of F (Lawicel): 01 receive queue full, 02 transmit queue full, 04 error warning, 08 overrun, 20 error passive,
40 arbitration lost, 80 bus error. Reading clears them.
"""

from __future__ import annotations

import os
import re
import time
from collections import deque
from typing import Any

import can
from can.interfaces.slcan import slcanBus

from handctl.system import clock
from handctl.system.serial_ports import descriptor
from handctl.system.waits import ended, readable, writable

BEL = 7
ANSWER_SECONDS = 1.0
"""For the first answer: a network or Bluetooth may lie between."""
MORE_SECONDS = 0.25
"""For each further one, once an adapter has answered."""
WRITE_SECONDS = 1.0
"""For an adapter that takes no more bytes."""
AGAIN_SECONDS = 0.005
"""Between two readings of the flags: at 10 kbit/s one frame takes longer, at those of hands it is tried many times."""
LATE_SECONDS = 0.5
"""What was waiting has been read by then: a bus, or another device, that never pauses holds up no end."""
LONGEST = 4096
BARE = [b"\r"] * 4
"""Answers to two empty lines, V and N by an adapter that acknowledges what it does not know. Some acknowledge no empty line."""
QUEUE_FULL, WARNING, PASSIVE, BUS_ERROR = 0x02, 0x04, 0x20, 0x80
FLAGS = {
    0x01: "receive queue full", QUEUE_FULL: "transmit queue full", WARNING: "error warning", 0x08: "overrun",
    PASSIVE: "error passive", 0x40: "arbitration lost", BUS_ERROR: "bus error",
}  # fmt: skip
_END = re.compile(rb"[\r\a]")
_FRAME = re.compile(rb"(?:([Tx])([0-9A-Fa-f]{8})|(t)([0-9A-Fa-f]{3}))([0-8])((?:[0-9A-Fa-f]{2})*)")
_REMOTE = re.compile(rb"R[0-9A-Fa-f]{8}[0-8](?:[0-9A-Fa-f]{4})?|r[0-9A-Fa-f]{3}[0-8](?:[0-9A-Fa-f]{4})?")
_FLAGS_LINE = re.compile(rb"F([0-9A-Fa-f]{2})")
_REPORT = re.compile(rb"s([awpb])\d{6}|e(\d)([a-zA-Z]+)")


class NotAnAdapter(can.CanInitializationError):
    """Whatever has this port does not answer as an slcan adapter does."""


class BadBitrate(ValueError):
    """The adapter refuses this bitrate."""


class SlcanBus(slcanBus):
    """An adapter whose lines are read as they are.

    adapter     who it says it is, "" when it does not
    refused     frames and commands that it answered with BEL
    acks        kinds of acknowledgement errors that it reported unasked
    left        whether it said that its controller left the bus (bus off)
    damaged     lines that are no line of an adapter; the last of them is `damage`
    whole       a line that could not be written is certain to lack its end
    """

    def __init__(self, channel: str, *, meet: bool = True, **options: Any) -> None:
        self.adapter = ""
        self.refused = self.errors = self.damaged = 0
        self.left = False
        self.damage = ""
        self._lines: deque[bytes] = deque()
        self._terminal: int | None = None
        self._looked = False
        self._meet = meet
        self._met = False
        options["timeout"] = 0  # select waits, where there is a descriptor; a read takes what is there
        super().__init__(channel, **options)

    # -- opening ------------------------------------------------------------------------------------------------------

    def set_bitrate(self, bitrate: int, data_bitrate: int | None = None) -> None:
        """Called by python-can once the port is open: identify the adapter before any setting."""
        if not self._meet or bitrate not in self._BITRATES:
            super().set_bitrate(bitrate, data_bitrate)
            return
        try:
            if not self._met:
                self._who()
            self.tune(bitrate, listening=self._listen_only)
        except (NotAnAdapter, BadBitrate):
            self.serialPortOrig.close()  # python-can leaves it open for as long as anybody keeps the error
            raise

    def open(self) -> None:
        if not self._met:  # `tune` has opened it
            super().open()

    def _who(self) -> None:
        """Ask for version and serial number. Raises NotAnAdapter."""
        self.serialPortOrig.reset_input_buffer()
        self._write("\r\rV\rN")
        version = serial_number = b""
        bells, came = 0, []
        end = clock.now() + ANSWER_SECONDS
        while (line := self._line(end - clock.now())) is not None:
            text = line[:-1]
            came.append(line)
            bells += line[-1] == BEL
            if line[-1] == BEL or _FRAME.fullmatch(text) or b"can" in text.lower():
                version = version or (text if b"can" in text.lower() else b"")
            elif len(text) > 1 and text[:1] == b"V" and text.isalnum():
                version = text[1:]
            elif len(text) > 1 and text[:1] == b"N" and text.isalnum():
                serial_number = text[1:]
            if bool(version) + bool(serial_number) + bells >= 2 or came == BARE:
                break
            if version or bells:
                end = min(end, clock.now() + MORE_SECONDS)
        bare = (
            len(came) > 1 and came == BARE[: len(came)] and not self._buffer
        )  # no shell answers with nothing but this
        self._met = bool(version or serial_number or bells or bare) or any(_FRAME.fullmatch(line[:-1]) for line in came)
        if not self._met:
            heard = b"".join(came) + bytes(self._buffer)
            if {b"V\r", b"N\r"} <= set(came):
                raise NotAnAdapter("only our own bytes came back")
            raise NotAnAdapter(f"{heard[:24].hex(' ').upper()} came" if heard.strip() else "it is silent")
        self.adapter = _named(version, serial_number)

    def tune(self, bitrate: int, *, listening: bool = False) -> None:
        """Close the channel, set the bitrate, open the channel: with L it neither sends nor acknowledges.

        Raises BadBitrate, or CanInitializationError when the channel does not open.
        """
        if bitrate not in self._BITRATES:
            raise BadBitrate(f"Invalid bitrate, choose one of {', '.join(map(str, self._BITRATES))}.")
        self._lines.clear()
        setting = self._BITRATES[bitrate]
        self._write(f"C\r{setting}\r{'L' if listening else 'O'}\rF")
        self._met, self.left = True, False
        answers: list[bytes] = []
        end = clock.now() + ANSWER_SECONDS
        while len(answers) < 4 and (line := self._line(end - clock.now())) is not None:
            if line in (b"\r", b"\a") or _FLAGS_LINE.fullmatch(line[:-1]):
                answers.append(line)
                end = clock.now() + MORE_SECONDS
            elif answers:
                self._lines.append(line)
        if answers[1:2] == [b"\a"]:
            raise BadBitrate(f"the adapter refuses the bitrate {bitrate} ({setting})")
        if answers[2:3] == [b"\a"]:
            raise can.CanInitializationError("the adapter does not open its channel (BEL)")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Like python-can's, with one timeout for all frames: a new one for each would reconfigure the port."""
        if self.serialPortOrig.write_timeout is None and self._terminal is None:
            self.serialPortOrig.write_timeout = WRITE_SECONDS
        super().send(msg, self.serialPortOrig.write_timeout)

    def _write(self, string: str) -> None:
        if not self._looked:
            self._looked, found = True, descriptor(self.serialPortOrig)
            self._terminal = found if found is not None and os.isatty(found) else None
        if self._terminal is None:
            super()._write(string)
            return
        data = string.encode() + self.LINE_TERMINATOR
        while data:
            try:
                data = data[os.write(self._terminal, data) :]
            except BlockingIOError:
                if not writable(self._terminal, WRITE_SECONDS):
                    raise can.CanTimeoutError("the adapter does not accept data") from None

    def shutdown(self) -> None:
        """Like python-can's, which leaves the port open where the adapter is gone and takes no C."""
        try:
            super().shutdown()
        finally:
            self.serialPortOrig.close()

    @property
    def whole(self) -> bool:
        """See the class. What pyserial has written before it failed is not known."""
        return self._terminal is not None

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame; None when there is none within `timeout`. There are no filters."""
        end = clock.now() + (timeout or 0.0)
        while True:
            line = self._lines.popleft() if self._lines else self._line(end - clock.now())
            if line is None:
                return None
            if (message := self._message(line)) is not None:
                return message

    # -- lines --------------------------------------------------------------------------------------------------------

    def _line(self, seconds: float) -> bytes | None:
        """The next line with the CR or BEL that ends it; None when there is none in time, or that has passed LATE_SECONDS ago."""
        end = clock.now() + seconds
        while clock.now() - end < LATE_SECONDS:
            if found := _END.search(self._buffer):
                place = found.end()
                line = bytes(self._buffer[:place])
                del self._buffer[:place]
                return line
            if len(self._buffer) > LONGEST:
                self._drop(bytes(self._buffer), "no end")
                self._buffer.clear()
            if not self._fill(end):
                return None
        return None

    def _fill(self, end: float) -> bool:
        """Take what waits, or wait for it until `end`; False when nothing came."""
        if self._terminal is not None:
            if not readable(self._terminal, max(0.0, end - clock.now())):
                return False
            try:
                data = os.read(self._terminal, LONGEST)
            except BlockingIOError:
                return True  # another reader was faster: a stop, while this has the port
            if not data and ended(self._terminal):
                raise can.CanOperationError("the adapter is gone")
            self._buffer.extend(data)
            return True
        port = self.serialPortOrig
        with can.exceptions.error_check("Could not read from serial device"):
            while True:
                left = max(0.0, end - clock.now())
                try:
                    readable(port.fileno(), left)
                    data = port.read(LONGEST)
                except (OSError, AttributeError, ValueError):  # a port without a descriptor, or one that has gone
                    data = port.read(LONGEST)
                    if not data:
                        clock.sleep(min(left, 0.001))
                if data or not left:
                    break
        self._buffer.extend(data)
        return bool(data)

    def _read(self, timeout: float | None) -> str | None:
        """python-can's own reader, for its get_version and get_serial_number."""
        line = self._line(timeout or 0.0)
        return None if line is None else line.decode("latin-1")

    def _message(self, line: bytes) -> can.Message | None:
        """What a line says: a frame, or None for what concerns the adapter, which is counted."""
        text = line[:-1].lstrip(b"\n")
        if line[-1] == BEL and not text:
            self.refused += 1
        elif found := _FRAME.fullmatch(text):
            size, body = int(found[5]), found[6]
            identifier = int(found[2] or found[4], 16)
            if len(body) in (2 * size, 2 * size + 4) and identifier < 1 << 29:  # with Z1 a time stands behind
                return can.Message(
                    arbitration_id=identifier, is_extended_id=found[1] is not None, timestamp=time.time(),
                    data=bytes.fromhex(body[: 2 * size].decode()),
                )  # fmt: skip
            self._drop(line, "this is not a possible frame")
        elif report := _REPORT.fullmatch(text):
            self._note(report)
        elif text not in (b"", b"z", b"Z") and not _FLAGS_LINE.fullmatch(text) and not _REMOTE.fullmatch(text):
            self._drop(line, "not a line of an adapter")
        return None

    def _note(self, report: re.Match[bytes]) -> None:
        """A change of state, or bus errors, reported without a request."""
        self.left = report[1] == b"b" or (self.left and report[1] is None)
        self.errors += report[1] in (b"b", b"p") or report[2] is not None

    def _drop(self, line: bytes, why: str) -> None:
        self.damaged += 1
        self.damage = f"{line[:40]!r} ({why})"

    # -- status -------------------------------------------------------------------------------------------------------

    def flags(self, seconds: float = MORE_SECONDS) -> int | None:
        """Read and clear the status flags; None if the adapter does not report them."""
        self._write("F")
        end = clock.now() + seconds
        while (line := self._line(end - clock.now())) is not None:
            if found := _FLAGS_LINE.fullmatch(line[:-1]):
                return int(found[1], 16)
            if line == b"\a":
                return None
            self._lines.append(line)
        return None


def said_flags(flags: int) -> str:
    """``A4: error warning, error passive, bus error``."""
    names = [name for bit, name in FLAGS.items() if flags & bit]
    return f"{flags:02X}: {', '.join(names) or 'no error'}"


def _named(version: bytes, serial_number: bytes) -> str:
    """``hardware 1.0, firmware 1.3, serial number SIM1``."""
    text = version.decode("ascii", "replace")
    parts = [f"hardware {text[0]}.{text[1]}, firmware {text[2]}.{text[3]}"] if re.fullmatch(r"\d{4}", text) else []
    parts += [] if parts or not text else [f"version {text[:40]}"]
    parts += [f"serial number {serial_number.decode('ascii', 'replace')[:16]}"] if serial_number else []
    return ", ".join(parts)
