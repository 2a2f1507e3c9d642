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
import os
import sys
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from math import inf
from typing import Any, NamedTuple, Protocol, TypeVar

from handctl import interrupts
from handctl.errors import HandctlError, LinkError, OutputError, UsageError
from handctl.files import SPELLED, at_once, has_content, try_lock, writing
from handctl.interrupts import handing_over
from handctl.link.link_interface import CanFrame, Deadline, FrameLink, Link

L = TypeVar("L", bound=Link)
DIRECTIONS = {">": "host", "<": "device"}
"""Mark of a line -> who sent it, as explainers call them."""


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


def as_written(line: str, number: int) -> Entry | None:
    """A line of serial bytes as `TraceWriter` writes it, with its end or without: a recording has millions. None for any other."""
    try:
        time, mark, text = line.split(" ", 2)
        moment, data = float(time), bytes.fromhex(text)
    except ValueError:
        return None
    between = len(text) - 3 * len(data)
    if (between and between != -1) or not text[2::3].isspace() or mark not in DIRECTIONS or not 0 <= moment < inf:
        return None
    return Entry(moment, mark, data, "", None, number)


def parse_line(line: str, number: int) -> Entry:
    """One line that is neither empty nor a comment. Raises ValueError."""
    if (entry := as_written(line, number)) is not None:
        return entry
    words = line.split()
    time = None
    if words[0] not in (">", "<", "!"):
        try:
            time = float(words[0])
        except ValueError:
            raise ValueError(f"expected a time or one of > < !, found {words[0][:40]!r}") from None
        if not 0 <= time < inf:
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
    """Observes all traffic of a link, with times of the link's clock. Must not raise."""

    def opened(self, now: float) -> None:
        """A link is observed from now on."""
        ...

    def passed(self, now: float, mark: str, data: bytes, can_id: int | None) -> None:
        """Bytes, or a CAN frame: `mark` is ">" for the host's, "<" for the device's."""
        ...

    def event(self, now: float, text: str) -> None:
        """An event: a baud rate, a power-cycle, the end of the link."""
        ...


def observed(link: L, observer: Observer) -> L:
    """Send all traffic of this link to `observer` from now on; returns the link."""
    observer.opened(link.now())
    if not link.overheard:  # once: between two commands of a session there may be no observer
        link.overheard = True
        _overheard(link)
    link.observers = (*link.observers, observer)
    return link


def _overheard(link: Any) -> None:
    """Replace the methods that send and receive by ones that also call the observers. A check in those would cost every frame."""
    frames = isinstance(link, FrameLink)
    speak, hear = (link.send, link.receive) if frames else (link.write, link.read)
    lost = False

    def tell(moment: float, mark: str, what: Any) -> None:
        data, can_id = (what.data, what.can_id) if frames else (what, None)
        for observer in link.observers:
            observer.passed(moment, mark, data, can_id)

    def event(text: str) -> None:
        for observer in link.observers:
            observer.event(link.now(), text)

    def failed(exc: LinkError) -> None:
        """That the link is lost is an event of the transcript, once."""
        nonlocal lost
        if exc.code == "lost" and not lost:
            lost = True
            event("disconnect")

    def spoken(what: Any, deadline: Deadline) -> None:
        with _whole(link):
            if link.silenced:
                raise KeyboardInterrupt
            sent, unsent = link.now(), False
            try:
                try:
                    speak(what, deadline)
                except HandctlError as exc:
                    unsent = exc.unsent
                    raise
                finally:
                    if not unsent:  # else it may have reached the device
                        tell(sent, ">", what)
            except LinkError as exc:
                failed(exc)
                raise

    def heard(deadline: Deadline, *size: int, **named: int) -> Any:
        try:
            found = hear(deadline, *size, **named)
        except LinkError as exc:
            failed(exc)
            raise
        if found:
            with handing_over():
                tell(link.now(), "<", found)
        return found

    def followed(do: Callable[..., Any], text: str) -> Callable[..., Any]:
        def done(*args: Any) -> Any:
            nonlocal lost
            found = do(*args)
            if found is not False:
                lost = lost and text != "reconnect"
                event(" ".join([text, *map(str, args)]) if text == "baud" else text)
            return found

        return done

    methods = {"send": spoken, "receive": heard} if frames else {"write": spoken, "read": heard}
    methods["event"] = event
    for name, text in (
        ("reconnect", "reconnect"),
        ("reopen", "reconnect"),
        ("power_cycle", "power-cycle"),
        *(() if frames else (("set_baud", "baud"),)),
    ):
        methods[name] = followed(getattr(link, name), text)
    vars(link).update(methods)


def _whole(link: Link) -> AbstractContextManager[None]:
    """Around what goes out and is noted: Ctrl-C and a stop wait for both, unless the line takes nothing just now."""
    raw_access = link.raw_access()
    if raw_access is None and not (link.fake or link.replayed):
        return nullcontext()
    return handing_over(raw_access.descriptor if raw_access is not None else -1, frame=True)


class TraceWriter:
    """Writes every byte that passes to `write` (one line, with newline), time counted from the first opening."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._start: float | None = None

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


# -- where the lines go ---------------------------------------------------------------------------------------------


READER_SECONDS = 0.3
"""How long a line waits for who reads along. No longer: a motor may turn meanwhile."""


CONTINUED = "The command continued, but the recording ends there."


class TraceFile(TraceWriter):
    """A transcript that is being written. `failure`: why it ended early; the traffic itself goes on.

    One that was there before is kept until something passes.
    """

    def __init__(self, path: str | None, header: str, verbose: bool) -> None:
        """Begin with a line of comment. Raises OutputError: nothing has been sent yet."""
        super().__init__(self.write)
        self.failure: OutputError | None = None
        self._path = path
        self._verbose = verbose
        self._stderr = interrupts.waits(sys.stderr)
        self._file = None
        self._waits = -1
        self._header = f"# {header}\n"
        self._replaces = False
        if path:
            with writing(path, "the trace ", hint="give --trace another file. Nothing was sent."):
                self._file = open(  # noqa: SIM115 - until close
                    path, "w", encoding="utf-8", errors=SPELLED, newline="\n", buffering=1,
                    opener=lambda path, flags: at_once(path, flags & ~os.O_TRUNC),
                )  # fmt: skip
            if not try_lock(self._file.fileno()):
                self._file.close()
                raise self._failed(BlockingIOError(0, "another handctl is writing it"), "Nothing was sent.")
            self._waits = interrupts.watch(self._file, result=False)
            self._replaces = has_content(self._file.fileno())
            try:
                if not self._replaces:
                    self._file.write(self._header)
            except OSError as exc:
                raise self._failed(exc, "Nothing was sent.") from exc

    def write(self, line: str) -> None:
        """One line. Never raises: what stops a device passes here too; the failure ends up in the exit code."""
        patience = 0.0 if interrupts.was_interrupted() else READER_SECONDS  # a stop waits for nobody
        if self._file is not None and self.failure is None:
            try:
                if not interrupts.has_room(self._waits, patience):
                    interrupts.make_room(self._waits)
                    raise TimeoutError("its reader does not accept data")
                if self._replaces:
                    self._replaces = False
                    self._file.truncate(0)
                    self._file.write(self._header)
                self._file.write(line)
            except (OSError, ValueError) as exc:
                self.failure = self._failed(exc, CONTINUED)
        self._verbose = self._verbose and interrupts.has_room(self._stderr, patience)
        if self._verbose:
            with contextlib.suppress(OSError, ValueError):
                sys.stderr.write(line)

    def close(self) -> None:
        """The end of the file. Never raises."""
        if self._file is not None:
            try:
                self._file.close()
            except OSError as exc:
                self.failure = self.failure or self._failed(exc, CONTINUED)
            interrupts.forget(self._waits)

    def _failed(self, exc: Exception, consequence: str) -> OutputError:
        return OutputError(
            f"{self._path}: the trace cannot be written: {getattr(exc, 'strerror', None) or exc}",
            hint=f"make room or give --trace another file. {consequence}",
        )
