"""`python -m tests.windows FOLDER [--quick] [--only PART] [--line TEXT]`: handctl under wine in FOLDER beside this system's.

FOLDER is what `.packaging/windows/assemble.py` puts together; `.ci/windows` does both. Prints what differs and a table. The exit
code is 1 where something differs without a written reason, a device is not held, a simulator does not serve or a test fails.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

from tests.windows import console, deaths, lines, matrix, simulators, units
from tests.windows.matrix import EQUAL, EXCUSED, LEFT, WRONG
from tests.windows.systems import Linux, Windows

SECONDS, QUICK_SECONDS = 320.0, 70.0
"""After which no command line and no scene begins: the whole then ends within 6 minutes, or 90 s."""
SCENE_SECONDS = 60.0
"""For one scene."""
QUICK_SHARE = 12
FIRST_COM, DEATH_COM = 200, 220
"""COM ports of the consoles, and of commands that die."""


class Scene(NamedTuple):
    """One thing that is tried in addition to the command lines; `wrong` is "" where all is well, `left` where there was no time."""

    part: str
    name: str
    wrong: str
    seen: str
    left: bool = False


Tried = Callable[[], tuple[str, str]]
"""What was seen, and what is wrong."""


def consoles(windows: Windows, root: Path, share: int) -> Iterator[tuple[str, str, Tried]]:
    """Part, name, and what tries it."""

    def held(family: str, number: int) -> tuple[str, str]:
        folder = root / f"console-{family}"
        folder.mkdir()
        return "held where it was, exit code 130", console.interrupted(windows, family, folder, FIRST_COM + number)

    for number, family in enumerate(list(console.SCENES)[::share]):
        yield "Ctrl-C during a movement", family, partial(held, family, number)

    def ended() -> tuple[str, str]:
        folder = root / "console-connecting"
        folder.mkdir()
        return "ended, exit code 130", console.given_up(windows, folder)

    yield "Ctrl-C while it connects", "aidin", ended


def others(linux: Linux, windows: Windows, root: Path, share: int) -> Iterator[tuple[str, str, Tried]]:
    """What may run at the same time as the command lines."""

    def driven(name: str) -> tuple[str, str]:
        return "as on Linux", simulators.tried(windows, linux, name, root / f"simulator-{name}")

    for name in simulators.scenes()[::share]:
        yield "simulators on Windows", name, partial(driven, name)
    for number, (name, way) in enumerate(deaths.every()[::share]):
        folder = root / f"death-{number}"
        seen = partial(deaths.survived, windows, linux, name, way, folder, DEATH_COM + number)
        yield "killed while it drives", f"{name}, {way}", seen
    files = units.FILES[::share]
    yield "tests on Windows", f"{len(files)} files", partial(units.passed, windows, root / "units", files)


def tried(
    scenes: Iterator[tuple[str, str, Tried]], seconds: float = SCENE_SECONDS, until: float = math.inf
) -> list[Scene]:
    """Each of them, one after the other, for so long at most: a row as it ends. None begins after `until` (time.monotonic)."""
    found = []
    for part, name, scene in scenes:
        began = time.monotonic()
        if began > until:
            found.append(Scene(part, name, "", "", left=True))
            continue
        seen, wrong = within(scene, seconds)
        found.append(Scene(part, name, wrong, seen))
        say(f"{part}, {name}: {f'wrong: {wrong}' if wrong else seen} ({time.monotonic() - began:.0f} s)")
    return found


def within(scene: Tried, seconds: float) -> tuple[str, str]:
    """What a scene saw and what is wrong; also that it did not end."""
    ended: list[tuple[str, str]] = []

    def run() -> None:
        try:
            ended.append(scene())
        except Exception as exc:  # noqa: BLE001 - whatever it is, the other scenes are tried
            ended.append(("", f"{type(exc).__name__}: {exc}"))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(seconds)
    return ended[0] if ended else ("", f"not over after {seconds:.0f} s")


def say(text: str) -> None:
    """A row, at once: whoever ends this run sees what was found until then."""
    print(text, flush=True)


def main() -> int:
    """Try everything that is asked for; the exit code."""
    words = argparse.ArgumentParser(prog="python -m tests.windows")
    words.add_argument("folder", type=Path)
    words.add_argument("--quick", action="store_true", help="a share of each part, 90 s")
    words.add_argument("--only", default="", help=f"one part: {', '.join(lines.PARTS)}, scenes")
    words.add_argument("--line", default="", help="only command lines with this text")
    words.add_argument("--seconds", type=float, default=0.0, help="after which nothing begins")
    asked = words.parse_args()
    began = time.monotonic()
    until = began + (asked.seconds or (QUICK_SECONDS if asked.quick else SECONDS))
    todo = [] if asked.only == "scenes" else lines.every(QUICK_SHARE if asked.quick else 1, asked.only)
    todo = [line for line in todo if asked.line in str(line)]
    with tempfile.TemporaryDirectory(prefix="handctl-windows-") as scratch:
        root = Path(scratch)
        linux = Linux(root / "linux-too")  # as long as "Z:" and "windows": some tables are as wide as a path in them
        windows = Windows(root / "windows", asked.folder.resolve())
        share = 5 if asked.quick else 1
        try:
            with ThreadPoolExecutor(1) as additional:
                seen: list[Scene] = []
                waiting = []
                if asked.only in ("", "scenes") and not asked.line:
                    seen += tried(
                        consoles(windows, root, share), until=until
                    )  # alone: the key must meet a movement of 0.7 s
                    waiting.append(additional.submit(tried, others(linux, windows, root, share), until=until))
                cells = matrix.compare(todo, linux, windows, root, until, told)
                seen += [scene for future in waiting for scene in future.result()]
        finally:
            windows.stop()
    tell(seen, cells)
    print(f"{time.monotonic() - began:.0f} s")
    return int(any(scene.wrong for scene in seen) or any(cell.verdict == WRONG for cell in cells))


def told(cell: matrix.Cell) -> None:
    """What is wrong with a line, as soon as it has ended."""
    if cell.verdict == WRONG:
        say("\n    ".join([f"wrong: handctl {cell.line}", *filter(None, (cell.reason, *cell.difference))]))


def tell(scenes: list[Scene], cells: list[matrix.Cell]) -> None:
    """What may differ, and the table."""
    for reason in dict.fromkeys(cell.reason for cell in cells if cell.verdict == EXCUSED):
        print(f"differs: {reason}", *(f"handctl {cell.line}" for cell in cells if cell.reason == reason), sep="\n    ")
    print(f"\n{'command lines':32}{'equal':>8}{'with a reason':>16}{'wrong':>8}{'not reached':>14}")
    for part, name in lines.PARTS.items():
        count = [
            sum(cell.line.part == part and cell.verdict == verdict for cell in cells)
            for verdict in (EQUAL, EXCUSED, WRONG, LEFT)
        ]
        print(f"{name:32}{count[0]:8}{count[1]:16}{count[2]:8}{count[3]:14}")
    for part in dict.fromkeys(scene.part for scene in scenes):
        own = [scene for scene in scenes if scene.part == part]
        wrong, left = sum(bool(scene.wrong) for scene in own), sum(scene.left for scene in own)
        print(f"{part:32}{len(own) - wrong - left:8}{'':16}{wrong:8}{left:14}")


if __name__ == "__main__":
    sys.exit(main())
