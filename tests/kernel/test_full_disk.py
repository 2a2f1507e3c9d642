"""A full disk: every command that writes a file leaves the old one whole, none beside it, and says that nothing was written."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path

import pytest

from handctl.errors import OutputError
from handctl.files import atomic_write
from handctl.link.transcript import TraceFile
from handctl.sim.engine import state_file
from tests.support.cli import fake, run
from tests.support.each_row import each_row

resource = pytest.importorskip("resource")  # no Windows


@contextmanager
def room(size: int, *, once: bool = False) -> Iterator[None]:
    """No file gets longer than `size` bytes meanwhile: the write fails as on a full disk.

    With `once` there is room again behind the first failure, as Python's buffers forget what they could not write: the file
    would be closed without an error, and empty.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    lift = lambda *_: resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))  # noqa: E731
    before = signal.signal(signal.SIGXFSZ, lift if once else signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        lift()
        signal.signal(signal.SIGXFSZ, before)


EXO = ("-p", fake())
NEEDED = {"mcap": "mcap", "parquet": "pyarrow"}
"""Writer -> the library of an extra that it needs."""
WRITERS: dict[str, tuple[str, ...]] = {
    "-o table": ("exo", "status", *EXO, "-o", "F"),
    "-o json": ("exo", "dump", "--json", *EXO, "-o", "F"),
    "-o csv": ("exo", "dump", "--csv", *EXO, "-o", "F"),
    "-o of a stream": ("exo", "watch", "--count", "3", *EXO, "-o", "F"),
    "-o of samples": ("exo", "watch", "--count", "2", "--format", "openmetrics", *EXO, "-o", "F"),
    "--append": ("exo", "dump", "--csv", "--append", *EXO, "-o", "F"),
    "-o without a device": ("exo", "describe", "--json", "-o", "F"),
    "-o of a trace": ("trace", "show", "trace.txt", "-o", "F"),
    "batch -o": ("batch", *EXO, "lines", "-o", "F"),
    "batch -o, a line after the failure": ("batch", "--keep-going", *EXO, "lines", "-o", "F"),
    "snapshot": ("exo", "snapshot", "F", *EXO),
    "report": ("exo", "report", "F.html", "--watch", "0", "--force", *EXO),
    "service": ("service", fake(), "--family", "exo", "--report", "F.html", "--watch", "0.1", "--count", "1", "--force"),
    "plot": ("plot", "log.csv", "-o", "F.svg"),
    "plot, a page": ("plot", "log.csv", "-o", "F.html"),
    "c3d": ("exo", "export", "log.csv", "--to", "c3d", "-o", "F"),
    "xdf": ("exo", "export", "log.csv", "--to", "xdf", "-o", "F"),
    "mcap": ("exo", "export", "log.csv", "--to", "mcap", "-o", "F"),
    "parquet": ("exo", "export", "log.csv", "--to", "parquet", "-o", "F"),
    "prove": ("prove", "exo", *EXO, "--only", "set-points-at-power-on", "-y", "-o", "F"),
    "gait --steps": ("ekso", "gait", "walk.csv", "--steps", "F"),
    "gait --page": ("ekso", "gait", "walk.csv", "--page", "F.html"),
    "completion": ("completion", "bash", "-o", "F"),
    "completion --install": ("completion", "bash", "--install"),
    "devices add": ("devices", "add", "right", "exo", "-p", fake()),
}  # fmt: skip
CONFIG = "# mine\n[devices.left]\nkind = 'exo'\nport = '/dev/ttyUSB0'\n"


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the commands read, made once; each test has a copy of its own."""
    made = tmp_path_factory.mktemp("inputs")
    log, walk, walking = made / "log.csv", made / "walk.csv", "fake://ekso?clock=virtual&posture=walking"
    assert run("exo", "log", log, "--count", "20", "--rate", "20", *EXO, "--trace", made / "trace.txt").code == 0
    assert run("ekso", "log", walk, "--duration", "7", "-p", walking).code == 0
    (made / "lines").write_text("exo dump\nexo status\nexo status\n", encoding="ascii")
    return made


@pytest.fixture(scope="module")
def older() -> dict[str, dict[str, bytes]]:
    """What each of them writes where there is room: the old file, the same in each test."""
    return {}


@pytest.fixture
def folder(inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(shutil.copytree(inputs, tmp_path, dirs_exist_ok=True))
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(("most", "once"), [(0, False), (0, True), (64, True), (9000, False)])
def test_the_old_file_stays_and_nothing_is_beside_it(
    most: int, once: bool, folder: Path, older: dict[str, dict[str, bytes]]
) -> None:
    """Full at once, in the first block, and behind it. `--force` and an older file of its own kind allow the replacement."""
    failed = []
    for name, words in WRITERS.items():
        if find_spec(NEEDED.get(name, "handctl")) is None:
            continue
        env = {
            "devices": {"HANDCTL_CONFIG": str(folder / "F")},
            "completion": {"XDG_DATA_HOME": str(folder / "data")},
        }.get(words[0])
        (folder / "F").write_text(CONFIG, encoding="ascii")
        if words[0] != "devices":
            (folder / "F").unlink()
            if name not in older:
                empty = contents(folder)
                assert run(*words, env=env).code in (0, 7), name
                older[name] = {path: data for path, data in contents(folder).items() if empty.get(path) != data}
            for path, data in older[name].items():
                (folder / path).parent.mkdir(parents=True, exist_ok=True)
                (folder / path).write_bytes(data)
        for path in folder.rglob("handctl*"):  # another one of handctl's own
            path.write_text(path.read_text(encoding="utf-8") + "# an older one\n", encoding="utf-8")
        before = contents(folder)
        with room(most, once=once):
            result = run(*words, env=env)
        changed = {path for path, data in contents(folder).items() if before.get(path) != data}
        beside = set(contents(folder)) - set(before)
        if (changed and result.code not in (0, 7)) or beside or result.code not in (0, 1, 7):
            failed.append((name, result.code, changed))
        if result.code != 1 and not changed and most < 64:
            failed.append((name, result.code, "told as written"))
        for path in folder.glob("F*"):
            path.unlink()
    assert not failed


def test_a_failure_that_the_body_ignored_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"old")
    with room(0, once=True), pytest.raises(OSError), atomic_write(path) as file:
        with suppress(OSError):
            file.write("x" * 20)
            file.flush()
        file.write("the rest")
    assert contents(tmp_path) == {"a": b"old"}


def test_a_simulator_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"old")
    with room(10), pytest.raises(OSError):
        state_file.replace(str(path), b"x" * 20)
    assert contents(tmp_path) == {"a": b"old"}


@each_row("words", [("status",), ("position", "500", "500", "500", "500", "500", "-y"), ("dump",)])
def test_a_trace_without_room_sends_nothing_and_says_so(words: tuple[str, ...], tmp_path: Path) -> None:
    with room(10):
        result = run("exo", *words, *EXO, "--trace", tmp_path / "t", "--json")
    assert result.code == 1 and result.json["counters"]["sent"] == 0
    assert result.error["hint"].endswith("Nothing was sent.")


def test_a_trace_that_ends_later_lets_the_command_go_on(tmp_path: Path) -> None:
    with room(200):
        result = run("exo", "dump", *EXO, "--trace", tmp_path / "t", "--json")
    assert result.code == 1 and len(result.rows) > 20
    assert "continued" in result.error["hint"] and os.path.getsize(tmp_path / "t") <= 200


def test_the_header_of_a_trace_fails_before_the_link_is_opened(tmp_path: Path) -> None:
    with room(0), pytest.raises(OutputError):
        TraceFile(str(tmp_path / "t"), "handctl", verbose=False)


def test_a_trace_that_another_command_writes_is_left_alone_and_holds_up_no_stop(tmp_path: Path) -> None:
    """As with HANDCTL_TRACE and two terminals: the lines of both, with zeros in between, were no transcript of either."""
    path = tmp_path / "t"
    first = TraceFile(str(path), "first", verbose=False)
    first.event(0.0, "before")
    done = run("exo", "dump", *EXO, "--json", env={"HANDCTL_TRACE": str(path)})
    assert done.code == 1 and done.json["counters"]["sent"] == 0
    done = run("exo", "stop", *EXO, "--json", env={"HANDCTL_TRACE": str(path)})
    assert done.code == 0 and "trace" in done.codes() and done.json["counters"]["sent"] > 0
    first.event(0.0, "behind")
    first.close()
    assert path.read_text(encoding="utf-8") == "# first\n0.000000 ! before\n0.000000 ! behind\n"
    assert run("exo", "dump", *EXO, "--trace", path).code == 0
