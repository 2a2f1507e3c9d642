"""One command line whose file is no such file, or one that means no good."""

from __future__ import annotations

import os
import socket
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import click

from handctl.command.options import InFile, OutFile
from handctl.families import FAMILIES
from tests.harm import lines
from tests.hostile.cell import DOCUMENTED, FORMATS, Folder, Tried, attempt
from tests.hostile.devices import KINDS, RAW, READY
from tests.support.leaves import LEAVES, Leaf, command_line, own


class Place(NamedTuple):
    """Where a name of a file stands in a command line; {} is the name, {folder} and {link} are put in."""

    name: str
    family: str
    words: tuple[str, ...]
    reads: bool
    env: dict[str, str]


def _places() -> Iterator[Place]:
    for leaf in LEAVES:
        for param in own(leaf, InFile) + own(leaf, OutFile):
            reads = isinstance(param.type, InFile)
            bounds = {name for one in leaf.command.params for name in one.opts} & {"--count", "--duration"}
            words = (
                *command_line(leaf, {param.name or "": "{}", "other": "{folder}/other.json"}), *_link(leaf),
                *(word for name in sorted(bounds) for word in (name, "2")),
            )  # fmt: skip
            yield Place(f"{' '.join(leaf.words)} {_label(param)}", leaf.words[0], words, reads, {})
    for family in FAMILIES:
        for verb in ("dump", "stop"):
            for option in ("-o", "--trace"):
                yield Place(
                    f"{family} {verb} {option}", family, (family, verb, option, "{}", "-p", "{link}"), False, {}
                )
        yield Place(f"{family} status -p replay:", family, (family, "status", "-p", "replay:{}"), True, {})
    for words in (
        ("devices", "list"),
        ("devices", "add", "left", "exo", "-p", "/dev/ttyUSB7"),
        ("exo", "dump", "-p", "{link}"),
    ):
        yield Place(
            f"{' '.join(words[:2])}, configuration", words[0], words, "add" not in words, {"HANDCTL_CONFIG": "{}"}
        )
    for kind in FAMILIES:
        words = ("sim", kind, "--tcp", "127.0.0.1:0", "--duration", "0", "--state", "{}")
        yield Place(f"sim {kind} --state", "sim", words, True, {})


def _label(param: click.Parameter) -> str:
    return param.opts[0] if isinstance(param, click.Option) else (param.name or "").upper()


def _link(leaf: Leaf) -> tuple[str, ...]:
    return ("-p", "{link}") if leaf.words[0] in FAMILIES else ()


PLACES = list(_places())


def _made(make: Callable[[Path], object]) -> Callable[[Path], str]:
    def there(path: Path) -> str:
        make(path)
        return str(path)

    return there


def _holding(content: bytes) -> Callable[[Path], str]:
    return _made(lambda path: path.write_bytes(content))


def _odd(path: Path) -> str:
    name = os.fsencode(path) + b"\xff\x1b]0;x\x07"
    with open(name, "wb") as file:
        file.write(b"{}")
    return os.fsdecode(name)


def _socket(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)  # a name of a socket is short
    try:
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(path.name)
    finally:
        os.chdir(here)


def _unreadable(path: Path) -> str:
    if not os.geteuid():
        return "/proc/self/mem"  # a regular file, and reading its first byte fails, also for root
    path.write_bytes(b"{}")
    path.chmod(0)
    return str(path)


def _sparse(path: Path) -> None:
    with open(path, "wb") as file:
        file.truncate(70_000_000)


DEEP = 100_000
THERE: dict[str, Callable[[Path], str]] = {
    "/dev/zero": lambda _: "/dev/zero",
    "a pipe": _made(os.mkfifo),
    "a folder": _made(os.mkdir),
    "a socket": _made(_socket),
    "no file": str,
    "no folder": lambda path: f"{path}/none/at/all",
    "a file for a folder": lambda path: f"{_holding(b'')(path)}/x",
    "a link to nothing": _made(lambda path: path.symlink_to(path.with_name("none"))),
    "a link to itself": _made(lambda path: path.symlink_to(path)),
    "a long name": lambda path: f"{path}{'x' * 300}",
    "escapes in the name": lambda path: f"{path}\x1b]0;x\x07\u202e\n",
    "not UTF-8 in the name": _odd,
    "unreadable": _unreadable,
}
"""What is tried for inputs and outputs."""
FOR_OUTPUTS: dict[str, Callable[[Path], str]] = {
    "a full disk": lambda _: "/dev/full",
    "a place of the system": lambda _: "/proc/version",
    "a link to an input": _made(lambda path: path.symlink_to(path.with_name("other.json"))),
}
FOR_INPUTS: dict[str, Callable[[Path], str]] = {
    "empty": _holding(b""),
    "bytes": _holding(bytes(range(256)) * 40),
    "nothing but NUL": _holding(bytes(50_000)),
    "70 MB": _made(_sparse),
    "one endless line": _holding(b"7" * 4_000_000),
    "a million lines": _holding(b"\n" * 1_000_000),
    "nesting": _holding(b"[" * DEEP),
    "objects in objects": _holding(b'{"a":' * DEEP),
    "nesting in TOML": _holding(b"a = " + b"[" * DEEP),
    "tables in TOML": _holding(b"[" + b"a." * 20_000 + b"a]\n"),
    "digits": _holding(b'{"schema": ' + b"9" * DEEP + b"}"),
    "no object": _holding(b'[null, true, 1e999, "\\ud800"]'),
    "UTF-16": _holding('{"schema": "handctl-snapshot/1"}'.encode("utf-16")),
    "escapes": _holding("\x1b]52;c;cm0=\x07 > EB 90\n< \x9b31m\n\u202e,\x00,1\n".encode()),
    "bytes in hex": _holding(b"> EB 90\n< 90 EB\n" * 20_000),
}


def kinds(place: Place) -> dict[str, Callable[[Path], str]]:
    kinds = {**THERE, **(FOR_INPUTS if place.reads else FOR_OUTPUTS)}
    if "--control" in place.words:
        del kinds["a pipe"]  # it takes one, and waits for what is to come
    if not any("other.json" in word for word in place.words):
        kinds.pop("a link to an input", None)
    return kinds


def _short(place: Place, kind: str, code: int | None) -> str:
    """What else must hold."""
    stops = "stop" in place.words or "cancel" in place.words  # which a disk does not hold up; they warn
    if kind == "a full disk" and code == 0 and not stops:
        return "exit 0 on a full disk"
    if (
        place.reads
        and not place.env
        and kind
        in (*(("no file",) if place.family != "sim" else ()), "/dev/zero", "a folder", "unreadable", "a link to itself")
        and code != 2
    ):
        return f"exit {code}, not 2"
    return ""


HOWS = ("json", "table", "csv", "plain", "always")


def how_of(place: Place, kind: str) -> str:
    """The format of a cell."""
    return HOWS[zlib.crc32(f"{place.name}{kind}".encode()) % len(HOWS)]


def try_cell(place: Place, kind: str, make: Callable[[Path], str], how: str, folder: Folder) -> Tried:
    """One command with one such file in one place."""
    with folder.scratch() as path:
        (path / "other.json").write_text("{}", encoding="utf-8")
        if not place.reads:
            folder.keep()  # what an output names may be replaced
        named = make(path / "file")
        if place.reads:
            folder.keep()
        link = f"fake://{place.family}?clock=virtual" + "".join(
            f"&{k}={v}" for k, v in READY.get(place.family, {}).items()
        )

        def put(word: str) -> str:
            return word.replace("{}", named).replace("{folder}", str(path)).replace("{link}", link)

        env = {name: put(text) for name, text in place.env.items()}
        words = [*map(put, place.words)]
        if place.family == "sim":
            how = "plain"  # it has one format, and asks nothing
        else:
            words += ["--yes", *FORMATS[how]]
        codes = DOCUMENTED if place.reads else (*DOCUMENTED, 1)  # "or the output could not be written"
        done = attempt(words, how, folder, env, codes=codes)
        return done._replace(failure=done.failure or _short(place, kind, done.code))


# -- what a command reads, spoiled as an answer is ----------------------------------------------------------------

READING = [
    line
    for listed in lines.examples().values()
    for line in listed
    if any(word.startswith("{dir}/") for word in line.words)
]


def try_content(line: lines.Line, kind: str, how: str, folder: Folder) -> Tried | None:
    """Snapshots, logs and images that were good, with escapes, bombs and other encodings in them; None without such a file."""
    with folder.scratch() as path:
        words, spoiled = [], False
        for said in line.words:
            word, good = said, folder.path / line.family / said.removeprefix("{dir}/")
            if said.startswith("{dir}/") and good.is_file():
                bad = path / good.name
                bad.write_bytes(b"".join(piece for _, piece in KINDS[kind](b"").answer(good.read_bytes())))
                word, spoiled = str(bad), True
            words.append(word.replace("{dir}", str(path)))
        if not spoiled:
            return None
        folder.keep()
        asked = ("--yes",) if line.asks else ()
        return attempt([*words, "-p", f"fake://{line.family}?clock=virtual", *asked, *FORMATS[how]], how, folder)


# -- a pipe with somebody at its other end ------------------------------------------------------------------------

ROW = b"t,velocity.F1,gain.F1\n0,0,0\n"
LIVE = b"velocity.F1,gain.F1\n0,0\n"
WRITERS: dict[str, tuple[bytes, bytes]] = {
    "escapes": (RAW + b"\n", b""),
    "escapes behind a header": (LIVE + RAW + b"\n", b""),
    "one endless line": (b"", b"7" * 60_000),
    "an endless line behind a header": (LIVE, b"7" * 60_000),
    "NUL without end": (b"", bytes(60_000)),
    "times without end": (ROW, b"1,0,0\n" * 10_000),
    "rows without end": (LIVE, b"0,0\n" * 10_000),
    "nesting": (b'{"velocity.F1": 0, "gain.F1": 0}\n{"velocity.F1": ' + b"[" * 50_000 + b"\n", b""),
    "digits": (b'{"velocity.F1": ' + b"9" * 50_000 + b"}\n", b""),
    "no number": (b'{"t": NaN, "velocity.F1": 0, "gain.F1": 0}\n', b""),
    "past all bounds": (b"velocity.F1,gain.F1\n1e999,0\n", b""),
    "UTF-16": ("velocity.F1,gain.F1\n0,0\n".encode("utf-16"), b""),
    "a thousand columns": (b",".join([b"velocity.F1"] * 5_000) + b"\n0,0\n", b""),
    "nothing": (b"", b""),
}
"""Kind -> what is written at once, and then again and again until nobody reads."""


def pour(path: Path, begin: bytes, endless: bytes, over: threading.Event) -> None:
    """The writer: a pipe that nobody opens is given up with `over`."""
    descriptor = -1
    while descriptor < 0 and not over.is_set():
        try:
            descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:  # nobody reads yet
            over.wait(0.005)
    try:
        while descriptor >= 0 and (begin or endless) and not over.is_set():
            begin = begin or endless
            with suppress(BlockingIOError):
                begin = begin[os.write(descriptor, begin) :]
                continue
            over.wait(0.001)
    except BrokenPipeError:
        pass
    finally:
        if descriptor >= 0:
            os.close(descriptor)


def try_pipe(kind: str, how: str, folder: Folder) -> Tried:
    """The one pipe that is read, with a writer that means no good."""
    with folder.scratch() as path:
        pipe, over = path / "pipe", threading.Event()
        os.mkfifo(pipe)
        folder.keep()
        writer = threading.Thread(target=pour, args=(pipe, *WRITERS[kind], over))
        writer.start()
        try:
            link = "fake://barrett?clock=virtual&initialized=1"
            words = ["barrett", "realtime", "--count", "3", "--control", str(pipe), "-p", link, "--yes"]
            return attempt([*words, *FORMATS[how]], how, folder)
        finally:
            over.set()
            writer.join()
