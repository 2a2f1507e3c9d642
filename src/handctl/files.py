"""Read and write files safely: only regular files of limited size are read, and a file is replaced only when complete.

`read`, `read_text` and `opened` raise UsageError with a sentence for the user. `atomic_write` raises OSError: what a write that
fails means is its callers' to say. `clash` tells two names of one file. Knows no device.
"""

from __future__ import annotations

import codecs
import contextlib
import errno
import io
import os
import stat
from collections.abc import Callable, Iterable, Iterator
from typing import IO, TYPE_CHECKING, Any, BinaryIO, TypeVar

from handctl.errors import OutputError, UsageError
from handctl.system import disk

T = TypeVar("T")
TURN_SECONDS = 10.0
"""How long a program waits for others that append to the same file."""

if TYPE_CHECKING:
    from pathlib import Path


class NoFile(UsageError):
    """There is no such file."""

    default_code = "no-file"


CHECK_NAME = "check the name of the file and its permissions"
NOT_FILES = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


def opened(path: str | os.PathLike[str], what: str, *, hint: str = CHECK_NAME, code: str = "") -> BinaryIO:
    """FILE for reading, where `what` names the kind of file, such as "a snapshot".

    Raises NoFile, or UsageError for what is not a regular file (it could be without end) or cannot be read, at once or later.
    """
    try:
        mode = os.stat(path).st_mode  # before it is opened: that alone can set a control line of a serial port
        if stat.S_ISREG(mode):
            descriptor = os.open(path, os.O_RDONLY | disk.AT_ONCE | disk.BINARY)
    except (FileNotFoundError, NotADirectoryError) as exc:
        raise NoFile(f"{path}: no such file", hint=hint, code=code) from exc
    except OSError as exc:
        kind = "it is a folder" if os.path.isdir(path) else exc.strerror or exc
        raise UsageError(f"{path}: cannot be read: {kind}", hint=hint, code=code) from exc
    if not stat.S_ISREG(mode):
        kind = next((text for fits, text in NOT_FILES if fits(mode)), "something else")
        raise UsageError(f"{path}: cannot be read: it is {kind}, not {what}", hint=hint, code=code)
    return io.BufferedReader(_Source(descriptor, str(path), hint, code))


class _Source(io.FileIO):
    """A file whose every read that fails is a UsageError: who reads line by line need not know."""

    def __init__(self, descriptor: int, path: str, hint: str, code: str) -> None:
        super().__init__(descriptor)
        self._said = (path, hint, code)

    def readinto(self, buffer: Any) -> int:
        return self._read(lambda: super(_Source, self).readinto(buffer))

    def readall(self) -> bytes:
        return self._read(super().readall)

    def _read(self, how: Callable[[], T]) -> T:
        try:
            return how()
        except OSError as exc:
            path, hint, code = self._said
            raise UsageError(f"{path}: cannot be read: {exc.strerror or exc}", hint=hint, code=code) from exc


def read(path: str | os.PathLike[str], what: str, most: int, *, hint: str = "", code: str = "") -> bytes:
    """All of FILE, `most` bytes at the most. Raises as `opened`, and UsageError for a larger file."""
    with opened(path, what, hint=hint, code=code) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise UsageError(f"{path}: larger than {most // 1_000_000} MB: not {what}", hint=hint, code=code)
    return content


def read_text(path: str | os.PathLike[str], what: str, most: int, *, hint: str = CHECK_NAME, code: str = "") -> str:
    """The same as text in UTF-8, without the byte order mark that some editors put in front."""
    try:
        return read(path, what, most, hint=hint, code=code).decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        hint = "save it as UTF-8" if hint == CHECK_NAME else hint
        raise UsageError(f"{path}: not a text in UTF-8: not {what}", hint=hint, code=code) from exc


BYTE_ORDER_MARK = "\ufeff"


def text_lines(text: str) -> list[str]:
    """The lines of a text. Only LF, CR LF and CR end one.

    `str.splitlines` ends one at ten more characters, such as a form feed or U+2028: what follows it in a comment would be a line.
    """
    return text.replace("\r\n", "\n").replace("\r", "\n").removesuffix("\n").split("\n") if text else []


def refuse_controls(text: str) -> None:
    """Raise UsageError for a line to send or run that has a control character or a line separator other than a tab.

    An editor may show one as the end of the line: then its author saw another line.
    """
    for one in "" if text.isprintable() else text:
        if one != "\t" and (one < " " or "\x7f" <= one < "\xa0" or one in "\u2028\u2029"):
            raise UsageError(
                f"the line contains the control character {one!a}",
                hint="remove it. If a new line was meant, end the line with a line feed. Nothing was sent.",
                code="control-character",
            )


SPELLED = "handctl-json"
"""The error handler of what may hold JSON: see `in_json`."""


def _spelled(error: UnicodeError) -> tuple[str, int]:
    """Bytes as messages have them, ``\\xff``; the backslash is doubled, as JSON has it."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    halves = map(ord, error.object[error.start : error.end])
    return "".join(
        f"\\\\x{one - 0xDC00:02x}" if 0xDC80 <= one < 0xDD00 else f"\\\\u{one:04x}" for one in halves
    ), error.end


codecs.register_error(SPELLED, _spelled)


def in_json(text: str) -> str:
    """JSON without half a character: Python has one for each byte of an argument, a path or a variable that is no UTF-8.

    An escape of it would be no text for any reader: it is spelled out, as in a message.
    """
    return text if text.isascii() else text.encode("utf-8", SPELLED).decode()


def as_text(text: str) -> str:
    """The same as text that every file and stream can hold: what stands for a byte that is no UTF-8 becomes U+FFFD."""
    return text.encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def unmarked(lines: Iterable[str]) -> Iterator[str]:
    """The same lines, the first one without a byte order mark: stdin and pipes, where `read_text` doesn't read them."""
    rest = iter(lines)
    for line in rest:
        yield line.removeprefix(BYTE_ORDER_MARK)
        break
    yield from rest


PAGE = "<!DOCTYPE html>"
"""How a page of `report` or `service` begins."""
PAGE_DATA = 'script type="application/json" id="data"'
"""The element of a page that is for programs."""


def in_page(page: str, tag: str) -> str:
    """What the last element `tag` of a page of ours holds, as it was before it became HTML; "" where there is none."""
    from html import unescape

    _, found, rest = page.rpartition(f"<{tag}>")
    return unescape(rest.partition(f"</{tag.partition(' ')[0]}>")[0]) if found else ""


def transcript(path: str) -> BinaryIO:
    """A transcript for reading: FILE itself, or what the page of a report holds. Raises UsageError."""
    file = opened(path, "a transcript")
    if file.readline(len(PAGE)) != PAGE.encode():
        file.seek(0)
        return file
    with file:
        return io.BytesIO(in_page(b"".join(file).decode("utf-8", "replace"), "pre").encode())


def is_pipe(path: str) -> bool:
    """Whether `path` is a named pipe."""
    try:
        return stat.S_ISFIFO(os.stat(path).st_mode)
    except OSError:
        return False


def clash(one: str | os.PathLike[str], other: str | os.PathLike[str]) -> bool:
    """Whether two paths lead to one file, by whatever links; pipes, terminals and /dev/null never clash."""
    try:
        first, second = os.stat(one), os.stat(other)
    except OSError:
        if os.path.basename(one) != os.path.basename(other) and not (os.path.islink(one) or os.path.islink(other)):
            return False  # as nearly always; what follows looks at every folder of both
        return os.path.normcase(os.path.realpath(one)) == os.path.normcase(os.path.realpath(other))
    return stat.S_ISREG(first.st_mode) and os.path.samestat(first, second)


@contextlib.contextmanager
def atomic_write(path: str | os.PathLike[str], mode: str = "w") -> Iterator[IO[Any]]:
    """A file to write: a temporary one next to `path` that replaces it at the end, or is removed if the body raises.

    What is replaced keeps its permissions and its owner, and a symbolic link stays one. A device or a pipe is written to, never
    replaced. `mode` "w" is UTF-8 with line ends as they come, and what `in_json` makes of what is none, or "wb".
    Raises OSError.
    """
    text = {"encoding": "utf-8", "errors": SPELLED, "newline": ""}
    if os.path.exists(path) and not os.path.isfile(path):
        with open(path, mode, opener=at_once, **({} if "b" in mode else text)) as file:  # type: ignore[call-overload]
            yield file
        return
    target = os.path.realpath(path)
    part = f"{target}.{os.getpid()}.part"
    try:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(part)  # of a process of this number that was killed
        raw = _Part(part, "x")
        buffered = io.BufferedWriter(raw)
        with buffered if "b" in mode else io.TextIOWrapper(buffered, **text) as file:  # type: ignore[arg-type]
            with contextlib.suppress(FileNotFoundError):
                _inherit(os.stat(target), part)
            yield file
            file.flush()
            if raw.failure is not None:  # the body went on, or its buffer has been emptied
                raise raw.failure
            disk.sync(file.fileno())
        os.replace(part, target)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(part)
        raise


def has_content(descriptor: int) -> bool:
    """Whether an open file holds something. A file that others read while it grows takes its place: it is emptied when the first line is there, not before."""
    found = os.fstat(descriptor)
    return stat.S_ISREG(found.st_mode) and found.st_size > 0


def try_lock(descriptor: int) -> bool:
    """Lock a file that grows until it is closed. False if another program has locked it: lines of both would mix."""
    from handctl.system import file_locks

    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        try:
            file_locks.whole(descriptor)
            os.lseek(descriptor, 0, os.SEEK_SET)  # a lock moved it on Windows
        except BlockingIOError:
            return False
        except OSError:
            pass  # not every file system has locks
    return True


class _Part(io.FileIO):
    """A file that remembers that it could not be written: what comes in its place must have all of it.

    A buffer may drop what it could not write, and who writes may go on: then a shorter file would look complete.
    """

    failure: OSError | None = None

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as exc:
            self.failure = exc
            raise


@contextlib.contextmanager
def writing(path: object, what: str = "", *, hint: str = "", code: str = "") -> Iterator[None]:
    """What goes wrong with a file that is written in here is an OutputError, about `what` it is, such as "the report "."""
    try:
        yield
    except OSError as exc:
        raise OutputError(f"{path}: {what}cannot be written: {exc.strerror or exc}", hint=hint, code=code) from exc


@contextlib.contextmanager
def appended(path: str | os.PathLike[str]) -> Iterator[IO[str]]:
    """A text that is added to FILE, all of it in one write or nothing; gone when the body raises.

    Its first line is a header, which only a new file gets. Raises OSError, and OutputError for a file with another one.
    """
    text = io.StringIO(newline="")
    yield text
    header, _, rest = text.getvalue().encode("utf-8", SPELLED).partition(b"\n")
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | disk.AT_ONCE | disk.BINARY, 0o666)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OutputError(f"{path}: not a file, so nothing can be appended")
        with in_turn(descriptor, TURN_SECONDS):
            size = os.fstat(descriptor).st_size
            there = disk.read_at(descriptor, len(header) + 3, 0).removeprefix(b"\xef\xbb\xbf")
            if size and there.split(b"\n")[0].rstrip(b"\r") != header.rstrip(b"\r"):
                raise OutputError(
                    f"{path}: nothing was appended: its columns are not {header.decode().strip()}",
                    hint="append the same quantities in the same format, or choose another file",
                    code="columns",
                )
            data = rest if size else header + b"\n" + rest
            if disk.torn(descriptor):
                data = b"\r\n" + data
            try:
                if os.write(descriptor, data) < len(data):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                disk.sync(descriptor)
            except OSError:
                os.ftruncate(descriptor, size)
                raise
    finally:
        os.close(descriptor)


def at_once(path: str, flags: int) -> int:
    """An opener for `open`: a pipe without a reader is an error at once, instead of an endless wait."""
    return disk.waiting(os.open(path, flags | disk.AT_ONCE, 0o666))


def _inherit(old: os.stat_result, path: str) -> None:
    """Permissions and, where root edits another user's file, owner."""
    os.chmod(path, old.st_mode & 0o7777)
    disk.inherit_owner(old, path)


@contextlib.contextmanager
def in_turn(descriptor: int, seconds: float) -> Iterator[None]:
    """While it lasts no other program is in its own turn with this file; who takes longer than `seconds` is not waited for.

    A lock beside that of the whole file, which it does not touch.
    """
    from handctl.system import clock, file_locks

    end = clock.now() + seconds
    while True:
        with contextlib.suppress(OSError):
            file_locks.turn(descriptor)
            break
        if clock.now() >= end:
            break
        clock.sleep(0.001)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            file_locks.end_turn(descriptor)


def why_unwritable(path: str) -> str:
    """Why no file can be written there, as far as that is known without trying; "" if there is no reason."""
    folder = os.path.dirname(path) or "."
    if os.path.isdir(path):
        return "it is a folder"
    if os.path.exists(path) and not os.path.isfile(path):  # a terminal, a pipe: written to as it is
        return ""
    if not os.path.isdir(folder) or not os.access(folder, os.W_OK):
        return f"{folder} is not a folder that you can write to"
    return ""


def state_path(name: str) -> Path:
    """handctl/NAME in the user's folder of state: what this machine keeps for this user."""
    from pathlib import Path

    from handctl.system.user_folders import STATE, user_folder

    return Path(user_folder(STATE), "handctl", name)


# -- text that may be longer than memory ------------------------------------------------------------------------------


BLOCK = 1 << 16
"""Characters that are written, and bytes that are read, at once."""


class Spool:
    """Takes lines one by one, gives them back in order. Raises OutputError where the disk has no room."""

    def __init__(self) -> None:
        import tempfile

        self.folder = tempfile.gettempdir()
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - as long as it is used

    def take(self, lines: Iterable[str]) -> None:
        """Append them; what came before an error stays."""
        with writing(self.folder, hint="make room there, or choose --format ndjson, which needs none"):
            some, size = [], 0
            try:
                for line in lines:
                    some.append(line)
                    size += len(line)
                    if size >= BLOCK:
                        self._write(some)
                        some, size = [], 0
            finally:
                self._write(some)

    def _write(self, lines: list[str]) -> None:
        if lines:
            self._file.write("\n".join([*lines, ""]).encode("utf-8", "surrogatepass"))

    def blocks(self) -> Iterator[str]:
        """All of them, some at once, each with its line end."""
        self._file.seek(0)
        while block := self._file.read(BLOCK) + self._file.readline():
            yield block.decode("utf-8", "surrogatepass")
