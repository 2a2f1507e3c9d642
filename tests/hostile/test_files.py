"""Every FILE of every command, led to what is no such file, or to one that means no good.

Which parameter takes a file is asked of the tree, as in `tests.support.leaves`; beside them stand -o, --trace,
`replay:`, the configuration file and the state file of a simulator. The one pipe that is read has writers that mean no
good.
"""

from __future__ import annotations

import os
import threading
import zlib
from contextlib import suppress
from pathlib import Path

import pytest

from tests.harm import lines
from tests.hostile.cell import FORMATS, Cell, Folder, attempt
from tests.hostile.devices import KINDS, RAW
from tests.hostile.file_cells import PLACES, Place, kinds, try_cell
from tests.hostile.table import Tried, note, share

pytestmark = pytest.mark.hostile


# -- what stands in place of a file -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Folder:
    path = tmp_path_factory.mktemp("files")
    lines.prepare(path)
    return Folder(path)


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.name.replace(" ", "-"))
def test_a_file_that_is_none(place: Place, folder: Folder, request: pytest.FixtureRequest) -> None:
    tried = Tried(request)
    for kind, make in kinds(place).items():
        how = ("json", "table", "csv", "plain", "always")[zlib.crc32(f"{place.name}{kind}".encode()) % 5]
        if share(request.config, f"{place.name}|{kind}"):
            tried.append(try_cell(place, kind, make, how, folder))
    note(request, tried)


# -- what a command reads, spoiled as an answer is ----------------------------------------------------------------

READING = [
    line
    for listed in lines.examples().values()
    for line in listed
    if any(word.startswith("{dir}/") for word in line.words)
]


@pytest.mark.parametrize("line", READING, ids=str)
def test_a_file_that_means_no_good(line: lines.Line, folder: Folder, request: pytest.FixtureRequest) -> None:
    """Snapshots, logs and images that were good, with escapes, bombs and other encodings in them."""
    tried = Tried(request)
    for kind, made in KINDS.items():
        for how in ("json", "table"):
            if not share(request.config, f"{line}|{kind}|{how}"):
                continue
            with folder.scratch() as path:
                words, spoiled = [], False
                for said in line.words:
                    word, good = said, folder.path / line.family / said.removeprefix("{dir}/")
                    if said.startswith("{dir}/") and good.is_file():
                        bad = path / good.name
                        bad.write_bytes(b"".join(piece for _, piece in made(b"").answer(good.read_bytes())))
                        word, spoiled = str(bad), True
                    words.append(word.replace("{dir}", str(path)))
                if not spoiled:
                    continue
                folder.keep()
                link = f"fake://{line.family}?clock=virtual"
                asked = ("--yes",) if line.asks else ()
                code, failure = attempt([*words, "-p", link, *asked, *FORMATS[how]], how, folder)
            tried.append(Cell(line.family, f"content: {kind}", f"{line} --{how}", code, failure))
    note(request, tried)


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


@pytest.mark.parametrize("kind", WRITERS)
def test_a_pipe_whose_writer_means_no_good(kind: str, folder: Folder, request: pytest.FixtureRequest) -> None:
    tried = Tried(request)
    for how in ("json", "table"):
        if not share(request.config, f"pipe|{kind}|{how}"):
            continue
        with folder.scratch() as path:
            pipe, over = path / "pipe", threading.Event()
            os.mkfifo(pipe)
            folder.keep()
            writer = threading.Thread(target=pour, args=(pipe, *WRITERS[kind], over))
            writer.start()
            try:
                words = [
                    "barrett",
                    "realtime",
                    "--count",
                    "3",
                    "--control",
                    str(pipe),
                    "-p",
                    "fake://barrett?clock=virtual&initialized=1",
                    "--yes",
                ]
                code, failure = attempt([*words, *FORMATS[how]], how, folder)
            finally:
                over.set()
                writer.join()
        tried.append(Cell("barrett", f"writer: {kind}", f"barrett realtime --control PIPE --{how}", code, failure))
    note(request, tried)
