"""Simulators that run on Windows, driven by clients on Linux: each family's over TCP, asked and commanded.

What a client sees must be what the same simulator shows it on Linux. Its control and its state file are tried there too.
"""

from __future__ import annotations

import json
import shlex
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Timer

from handctl.families import FAMILIES
from tests.windows.matrix import common
from tests.windows.systems import LONGEST, Linux, System, assemble, end

OPTIONS = {"ekso": ("sway=0", "startup=0.1"), "barrett": ("initialized=1",), "aidin": ("start=homed",)}
COMMANDS = {
    "exo": ("dump", "set position_set.index=300 --yes"),
    "wrist": ("dump", "move --pitch 5 --yaw -5 --time 300 --yes"),
    "hand": ("dump", "set speed_set.index=300 --yes"),
    "barrett": ("dump", "set MCV=80 --yes"),
    "ekso": ("settings", "set step_length=15.5 --operator me --yes"),
    "aidin": ("describe", "joints index.q3=160 --yes"),
}
"""What clients do, in order, on one simulator."""
CONTROL = ("exo", "get 1492 2", "2C 01")
"""Family, control command and its answer after that."""


@contextmanager
def serving(system: System, family: str, folder: Path, *more: str) -> Iterator[str]:
    """The link of a simulator that runs on a system. Raises AssertionError where it says nothing of the kind."""
    sets = [word for option in OPTIONS.get(family, ()) for word in ("--set", option)]
    words = ["-m", "handctl", "sim", family, "--tcp", "127.0.0.1:0", "--seed", "1", *sets, *more]
    process = system.start(words, folder)
    assert process.stdout is not None
    late = Timer(LONGEST, end, [process])
    late.start()
    try:
        first = process.stdout.readline()
        if not first:
            raise AssertionError(
                f"it does not serve: {assemble.said(process, b'', LONGEST)[1].decode(errors='replace')[-400:]}"
            )
        yield str(json.loads(first)["link"])
    finally:
        late.cancel()
        end(process)
        assemble.said(process, b"", LONGEST)


def driven(windows: System, linux: Linux, family: str, folder: Path) -> str:
    """What is wrong with a simulator on Windows, as clients on Linux find it, "" for nothing."""
    seen: list[list[object]] = []
    for system in (linux, windows):
        own = folder / f"{family}-{system.name}"
        own.mkdir()
        with serving(system, family, own) as link:
            found: list[object] = []
            for text in COMMANDS.get(family, ("dump",)):
                ended = linux.run([family, *shlex.split(text), "-p", link], own)
                found.append(common(ended, own, link)[:3])
            seen.append(found)
    for text, one, other in zip(COMMANDS.get(family, ("dump",)), *seen, strict=True):
        if one != other:
            return f"{text}: {one!r:.300} on Linux, {other!r:.300} on Windows"
    return ""


def controlled(windows: System, linux: Linux, folder: Path) -> str:
    """What is wrong with the control and the state file of a simulator on Windows."""
    family, question, answer = CONTROL
    with serving(windows, family, folder, "--control", "panel", "--state", "state.json") as link:
        changed = linux.run([family, *COMMANDS[family][1].split(), "-p", link], folder)
        asked = windows.run(["sim", "control", "panel", *question.split()], folder)
    if changed.code or asked.code or answer not in asked.out.decode(errors="replace"):
        return f"control: {changed.code}, {asked!r:.400}"
    return "" if (folder / "state.json").is_file() else "no state file"


def scenes() -> list[str]:
    """Families, and the control."""
    return [*FAMILIES, "control"]


def tried(windows: System, linux: Linux, name: str, folder: Path) -> str:
    """One scene; what is wrong with it."""
    folder.mkdir()
    try:
        return controlled(windows, linux, folder) if name == "control" else driven(windows, linux, name, folder)
    except (AssertionError, OSError, ValueError, subprocess.SubprocessError) as exc:
        return str(exc)
