"""The two systems side by side: handctl under this Python, and handctl under a Windows Python in wine.

Each runs a command line as a process of its own in a folder of its own, with pipes as its streams: wine cannot hand regular
files to a console program. What a system keeps for a user lies in that folder too.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Timer
from typing import NamedTuple

from tests.support.cli import clean_environment

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(CHECKOUT / ".packaging" / "windows"))
import assemble  # noqa: E402 - it lies beside what it is for

PLACES = (
    *("HOME", "XDG_CONFIG_HOME", "XDG_STATE_HOME", "XDG_RUNTIME_DIR", "TMPDIR"),
    *("USERPROFILE", "APPDATA", "LOCALAPPDATA", "TEMP", "TMP"),
)
"""Variables that name the folders of a user."""
LONGEST = 40.0
"""Seconds until a command line is ended."""


class Ended(NamedTuple):
    """One run: exit code, None when it had to be ended; what it wrote; the files that it left."""

    code: int | None
    out: bytes
    err: bytes
    files: Mapping[str, bytes]


def on_windows(path: Path | str) -> str:
    """A path of this machine as Windows programs see it."""
    return "Z:" + str(path).replace("/", "\\")


class System:
    """What both have."""

    name = ""

    def __init__(self, scratch: Path) -> None:
        self.scratch = scratch
        self.scratch.mkdir(parents=True, exist_ok=True)

    def begin(self, *words: str) -> list[str]:
        """The command that runs this system's Python."""
        raise NotImplementedError

    def environment(self, folder: Path) -> dict[str, str]:
        """The variables of a process whose own files lie in `folder`."""
        raise NotImplementedError

    def path(self, place: Path) -> str:
        """A path as this system writes it."""
        return str(place)

    def start(self, words: Sequence[str], folder: Path) -> subprocess.Popen[bytes]:
        """A Python process, its streams on pipes."""
        pipe = subprocess.PIPE
        return subprocess.Popen(
            self.begin(*words),
            cwd=folder,
            env=self.environment(folder),
            stdin=pipe,
            stdout=pipe,
            stderr=pipe,
            start_new_session=True,
        )

    def run(self, words: Sequence[str], folder: Path, stdin: bytes = b"") -> Ended:
        """`handctl WORDS` in `folder`, to its end."""
        before = contents(folder)
        process = self.start(["-m", "handctl", *words], folder)
        code: int | None
        try:
            out, err = assemble.said(process, stdin, LONGEST)
            code = process.returncode
        except subprocess.TimeoutExpired:
            end(process)
            out, err, code = b"", b"ended after %d s" % LONGEST, None
        left = {name: data for name, data in contents(folder).items() if before.get(name) != data}
        return Ended(code, out, err, left)


class Worker:
    """A system's process in which command lines run one after the other; see `worker.py`."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.process: subprocess.Popen[bytes] | None = None

    def run(self, words: Sequence[str], folder: Path) -> Ended:
        """`handctl WORDS` in `folder`. A process that does not answer, or ends, is followed by another one."""
        before = contents(folder)
        if self.process is None:
            self.process = self.system.start(
                [self.system.path(CHECKOUT / "tests" / "windows" / "worker.py")], self.system.scratch
            )
        own = {name.removeprefix("WINE_AS_"): value for name, value in self.system.environment(folder).items()}
        places = {name: own[name] for name in PLACES if name in own}
        asked = {"words": list(words), "folder": self.system.path(folder), "environment": places}
        late = Timer(LONGEST, end, [self.process])
        late.start()
        try:
            assert self.process.stdin is not None and self.process.stdout is not None
            self.process.stdin.write(json.dumps(asked).encode() + b"\n")
            self.process.stdin.flush()
            answer = json.loads(self.process.stdout.readline())
        except (OSError, ValueError):
            self.stop()
            return Ended(None, b"", b"the process ended, or did not answer in time", {})
        finally:
            late.cancel()
        left = {name: data for name, data in contents(folder).items() if before.get(name) != data}
        return Ended(answer["code"], bytes.fromhex(answer["out"]), bytes.fromhex(answer["err"]), left)

    def stop(self) -> None:
        """End the process."""
        if self.process is not None:
            end(self.process)
            self.process = None


def end(process: subprocess.Popen[bytes]) -> None:
    """A process and what it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def contents(folder: Path) -> dict[str, bytes]:
    """The files in a folder by their names in it; what a system keeps for its user is left out."""
    found = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in found
        if "own" not in path.relative_to(folder).parts
    }


class Linux(System):
    """This machine."""

    name = "Linux"

    def begin(self, *words: str) -> list[str]:
        return [sys.executable, *words]

    def environment(self, folder: Path) -> dict[str, str]:
        own = folder / "own"
        (own / "run").mkdir(mode=0o700, parents=True, exist_ok=True)
        places = {
            "HOME": own,
            "XDG_CONFIG_HOME": own,
            "XDG_STATE_HOME": own,
            "XDG_RUNTIME_DIR": own / "run",
            "TMPDIR": own,
        }
        return clean_environment(
            {**{name: str(place) for name, place in places.items()}, "PYTHONPATH": str(CHECKOUT / "src")}
        )


class Windows(System):
    """A Windows Python under wine."""

    name = "Windows"

    def __init__(self, scratch: Path, home: Path) -> None:
        super().__init__(scratch)
        self.python, self.prefix = home / "py" / "python.exe", home / "prefix"
        self.variables = assemble.environment(self.prefix)
        self.wine = assemble.wine()
        assemble.boot(self.prefix)

    def begin(self, *words: str) -> list[str]:
        return [self.wine, str(self.python), *words]

    def environment(self, folder: Path) -> dict[str, str]:
        own = folder / "own"
        own.mkdir(exist_ok=True)
        places = dict.fromkeys(("USERPROFILE", "APPDATA", "LOCALAPPDATA", "TEMP", "TMP"), on_windows(own))
        kept = {k: v for k, v in clean_environment().items() if not k.startswith("XDG_")}
        return {
            **kept,
            **{name: self.variables[name] for name in ("WINEPREFIX", "WINEDEBUG", "WINEDLLOVERRIDES", "WINEARCH")},
            **{f"WINE_AS_{name}": place for name, place in places.items()},
            "PYTHONPATH": on_windows(CHECKOUT / "src"),
            "PYTHONPYCACHEPREFIX": on_windows(self.prefix.parent / "compiled"),
        }

    def path(self, place: Path) -> str:
        return on_windows(place)

    def com(self, number: int, port: str) -> str:
        """COMn, which leads to a pseudo-terminal of this machine."""
        link = self.prefix / "dosdevices" / f"com{number}"
        link.unlink(missing_ok=True)
        link.symlink_to(port)
        return f"COM{number}"

    def clean(self) -> None:
        """No COM port leads anywhere."""
        for link in (self.prefix / "dosdevices").glob("com*"):
            link.unlink()

    def stop(self) -> None:
        """End this prefix's server, and with it whatever runs there."""
        self.clean()
        subprocess.run([assemble.server(), "-k"], env=self.variables, check=False)
