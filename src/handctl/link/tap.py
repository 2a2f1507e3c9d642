"""Transcripts: the one text format of `--trace`, `-v`, `replay:` and the vectors in the tests.

    # what this shows, manual section
    0.000000 > EB 90 01 04 11 E8 03 01 02
    0.004120 < 90 EB 01 04 11 E8 03 01 02
    0.010000 > can 11000001 [1] 04
    0.020000 ! baud 57600
    0.031000 ! disconnect

`>` host, `<` device, `!` an event; time in seconds since the start, may be absent. A tap sits around a link and
writes such lines; `parse` reads them. Knows no protocol.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from typing import NamedTuple, Protocol

from handctl import ending
from handctl.ending import handing_over
from handctl.errors import LinkError, OutputError, UsageError
from handctl.files import at_once
from handctl.link.base import ByteLink, CanFrame, Deadline, FrameLink, Link, Outlet, Trouble


class Entry(NamedTuple):
    """One line of a transcript: `mark` is ">", "<" or "!"; `can_id` is None for serial bytes."""

    time: float | None
    mark: str
    data: bytes
    text: str = ""
    can_id: int | None = None
    line: int = 0


def parse(lines: Iterable[str], source: str = "transcript") -> list[Entry]:
    """Read a transcript. Comments and empty lines are left out. Raises UsageError with the line number."""
    entries = []
    for number, raw in enumerate(lines, 1):
        line = raw.strip()
        if not line or line.startswith("#"):
            continue
        try:
            entries.append(parse_line(line, number))
        except ValueError as exc:
            raise UsageError(f"{source}, line {number}: {exc}", hint="a line is: [SECONDS] > HEX BYTES") from exc
    return entries


def parse_line(line: str, number: int) -> Entry:
    """One line that is neither empty nor a comment. Raises ValueError."""
    words = line.split()
    time = None
    if words[0] not in (">", "<", "!"):
        try:
            time = float(words[0])
        except ValueError:
            raise ValueError(f"expected a time or one of > < !, found {words[0][:40]!r}") from None
        if not 0 <= time < float("inf"):
            raise ValueError(f"{words[0][:40]} is not a time in seconds since the start")
        words = words[1:]
    if not words or words[0] not in (">", "<", "!"):
        raise ValueError("expected > < or !")
    mark, rest = words[0], words[1:]
    if mark == "!":
        return Entry(time, mark, b"", " ".join(rest), None, number)
    can_id = None
    if rest and rest[0] == "can":
        if len(rest) < 3:
            raise ValueError("expected: can IDENTIFIER [DLC] HEX BYTES")
        can_id = int(rest[1], 16)
        if not 0 <= can_id < 1 << 29:
            raise ValueError(f"{rest[1]} is not a CAN identifier of 29 bits")
        dlc, rest = int(rest[2].strip("[]")), rest[3:]
        if dlc != len(rest):
            raise ValueError(f"{dlc} bytes announced, {len(rest)} given")
    elif not rest:
        raise ValueError("no bytes")
    if set(map(len, rest)) - {2}:
        odd = next(word for word in rest if len(word) != 2)
        raise ValueError(f"expected two hex digits, found {odd!r}")
    try:
        data = bytes.fromhex("".join(rest))
    except ValueError:
        raise ValueError("not hexadecimal") from None
    return Entry(time, mark, data, "", can_id, number)


class Observer(Protocol):
    """Who is told of everything that passes on a link, with its moment on the link's clock. Must not raise."""

    def opened(self, now: float) -> None:
        """A link is observed from now on."""
        ...

    def passed(self, now: float, mark: str, data: bytes, can_id: int | None) -> None:
        """Bytes, or a CAN frame: `mark` is ">" for the host's, "<" for the device's."""
        ...

    def event(self, now: float, text: str) -> None:
        """Something beside the bytes: a speed, a power cycle, the end of the link."""
        ...


def observed(link: Link, observer: Observer) -> Link:
    """The same link; `observer` is told of what passes."""
    observer.opened(link.now())
    if isinstance(link, FrameLink):
        return TappedFrames(link, observer)
    assert isinstance(link, ByteLink)
    return TappedLink(link, observer)


class Tap:
    """Writes every byte that passes to `write` (one line, with newline), time counted from the first opening."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._start: float | None = None

    def around(self, link: Link) -> Link:
        """The same link, recorded."""
        return observed(link, self)

    def opened(self, now: float) -> None:
        """See Observer."""
        if self._start is None:
            self._start = now

    def passed(self, now: float, mark: str, data: bytes, can_id: int | None) -> None:
        """See Observer."""
        self._line(now, mark, data.hex(" ").upper() if can_id is None else f"can {CanFrame(can_id, data)}")

    def event(self, now: float, text: str) -> None:
        """See Observer."""
        self._line(now, "!", text)

    def _line(self, now: float, mark: str, text: str) -> None:
        """One line of the transcript. The writer must not raise: a stop must reach the wire whatever the disk does."""
        elapsed = max(0.0, now - (self._start if self._start is not None else now))
        self._write(f"{elapsed:.6f} {mark} {text}\n")


class _Tapped(Link):
    """What both kinds of tapped links have in common."""

    def __init__(self, link: Link, tap: Observer) -> None:
        self._inner = link
        self._tap = tap
        self._lost = False
        self.name = link.name
        self.fake = link.fake
        self.replayed = link.replayed
        self.held = link.held

    def now(self) -> float:
        return self._inner.now()

    def wall(self) -> float:
        return self._inner.wall()

    def sleep(self, seconds: float) -> None:
        self._inner.sleep(seconds)

    def event(self, text: str) -> None:
        self._tap.event(self.now(), text)

    def recorded_next(self, request: bytes) -> bool:
        return self._inner.recorded_next(request)

    def outlet(self) -> Outlet | None:
        return self._inner.outlet()

    def reconnect(self, seconds: float) -> bool:
        done = self._inner.reconnect(seconds)
        if done:
            self._lost = False
            self.event("reconnect")
        return done

    def reopen(self) -> bool:
        done = self._inner.reopen()
        if done:
            self._lost = False
            self.event("reconnect")
        return done

    def power_cycle(self) -> bool:
        done = self._inner.power_cycle()
        if done:
            self.event("power-cycle")
        return done

    def _whole(self) -> AbstractContextManager[None]:
        """Around what goes out and is noted: Ctrl-C waits for both, unless the line takes nothing just now."""
        outlet = self._inner.outlet()
        if outlet is None and not (self.fake or self.replayed):
            return nullcontext()
        return handing_over(outlet.descriptor if outlet is not None else -1)

    def _failed(self, exc: LinkError) -> LinkError:
        """That the link is lost is an event of the transcript, once."""
        if exc.code == "lost" and not self._lost:
            self._lost = True
            self.event("disconnect")
        return exc

    def close(self) -> None:
        self._inner.close()


class TappedFrames(_Tapped, FrameLink):
    """A CAN link with a tap on the bus."""

    def __init__(self, link: FrameLink, tap: Observer) -> None:
        super().__init__(link, tap)
        self._link = link
        self.adapter, self.bitrate = link.adapter, link.bitrate

    def trouble(self, before: int = 0) -> Trouble | None:
        return self._link.trouble(before)

    def listen(self, bitrate: int, seconds: float) -> tuple[int, bool] | None:
        return self._link.listen(bitrate, seconds)

    def resume(self) -> None:
        self._link.resume()

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        with self._whole():
            sent = self.now()
            try:
                try:
                    self._link.send(frame, deadline)
                finally:
                    self._tap.passed(sent, ">", frame.data, frame.can_id)
            except LinkError as exc:
                raise self._failed(exc) from exc.__cause__
        self._count()

    def receive(self, deadline: Deadline) -> CanFrame | None:
        try:
            frame = self._link.receive(deadline)
        except LinkError as exc:
            raise self._failed(exc) from exc.__cause__
        self._count()
        if frame is not None:
            with handing_over():
                self._tap.passed(self.now(), "<", frame.data, frame.can_id)
        return frame

    def _count(self) -> None:
        self.error_frames, self.damaged, self.damage = self._link.error_frames, self._link.damaged, self._link.damage


class TappedLink(_Tapped, ByteLink):
    """A byte link with a tap on the wire."""

    def __init__(self, link: ByteLink, tap: Observer) -> None:
        super().__init__(link, tap)
        self._link = link
        self.can_set_baud = link.can_set_baud
        self.baud = link.baud

    def write(self, data: bytes, deadline: Deadline) -> None:
        with self._whole():
            sent = self.now()
            try:
                try:
                    self._link.write(data, deadline)
                finally:
                    self._tap.passed(sent, ">", data, None)
            except LinkError as exc:
                raise self._failed(exc) from exc.__cause__

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        try:
            data = self._link.read(deadline, size)
        except LinkError as exc:
            raise self._failed(exc) from exc.__cause__
        if data:
            with handing_over():
                self._tap.passed(self.now(), "<", data, None)
        return data

    def set_baud(self, baud: int) -> None:
        self._link.set_baud(baud)
        self.baud = self._link.baud
        self.event(f"baud {baud}")


# -- where the lines go ---------------------------------------------------------------------------------------------


READER_SECONDS = 0.3
"""How long a line waits for who reads along. No longer: a motor may turn meanwhile."""


class TraceFile:
    """A transcript that is being written. `failure` says why it ends early; what is on the line goes on all the same."""

    def __init__(self, path: str | None, header: str, verbose: bool) -> None:
        """Begin with a line of comment. Raises OutputError: nothing has been sent yet."""
        self.failure: OutputError | None = None
        self._path = path
        self._verbose = verbose
        self._stderr = ending.waits(sys.stderr)
        self._file = None
        self._waits = -1
        if path:
            try:
                self._file = open(  # noqa: SIM115 - until close
                    path, "w", encoding="utf-8", newline="\n", buffering=1, opener=at_once
                )
            except OSError as exc:
                raise OutputError(
                    f"{path}: the trace cannot be written: {exc.strerror or exc}",
                    hint="give --trace another file. Nothing was sent.",
                ) from exc
            self._waits = ending.watch(self._file, result=False)
            try:
                self._file.write(f"# {header}\n")
            except OSError as exc:
                raise self._failed(exc) from exc

    def write(self, line: str) -> None:
        """One line. Never raises: what stops a device passes here too; the failure ends up in the exit code."""
        patience = 0.0 if ending.asked() else READER_SECONDS  # a stop waits for nobody
        if self._file is not None and self.failure is None:
            try:
                if not ending.has_room(self._waits, patience):
                    ending.make_room(self._waits)
                    raise TimeoutError("its reader does not accept data")
                self._file.write(line)
            except (OSError, ValueError) as exc:
                self.failure = self._failed(exc)
        self._verbose = self._verbose and ending.has_room(self._stderr, patience)
        if self._verbose:
            with contextlib.suppress(OSError, ValueError):
                sys.stderr.write(line)

    def close(self) -> None:
        """The end of the file. Never raises."""
        if self._file is not None:
            try:
                self._file.close()
            except OSError as exc:
                self.failure = self.failure or self._failed(exc)
            ending.forget(self._waits)

    def _failed(self, exc: Exception) -> OutputError:
        return OutputError(
            f"{self._path}: the trace cannot be written: {getattr(exc, 'strerror', None) or exc}",
            hint="make room or give --trace another file. The command continued, but the recording ends there",
        )
