"""`python -m tests.kernel.budget`: the size of the code and the life of a get, against figures that only fall.

Code lines are those without docstrings, comments and blanks. The life of a get is what `handctl exo get temperature` runs
of handctl, without its simulator: functions, files, and frames on the stack. The command lowers what has become less, and
writes the page of handctl-development(7). To raise a figure, edit `budget.json` and give the reason in the commit.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

import handctl
from tests.support.places import PROJECT
from tests.support.syntax import statements, tree_of

SRC = PROJECT / "src/handctl"
RUN = Path(handctl.__file__).parent
"""The package that runs: it may be installed."""
KEPT = Path(__file__).with_name("budget.json")
GUIDE = SRC / "guides/development.md"
SECTION = re.compile(r"(<!-- life: [^>]*-->\n).*?(<!-- end -->)", re.DOTALL)
GET = ("exo", "get", "temperature", "-p", "fake://exo?clock=virtual")
NAMED = 0x2
"""CO_NEWLOCALS: a function, not the body of a class or a module."""
Budget = dict[str, Any]


def code_lines(text: str, tree: ast.Module | None = None) -> int:
    """Lines that hold code: neither blank, nor a comment, nor part of a docstring."""
    docstrings = {
        number
        for node in statements(tree or ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        for number in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    lines = map(str.strip, text.splitlines())
    return sum(bool(line) and not line.startswith("#") and at not in docstrings for at, line in enumerate(lines, 1))


def sizes() -> Budget:
    """Code lines of each room, of all of them, and the number of modules."""
    rooms: Counter[str] = Counter()
    paths = sorted(SRC.rglob("*.py"))
    for path in paths:
        rooms["/".join(path.relative_to(SRC).parts[:-1][:2]) or "."] += code_lines(
            path.read_text(encoding="utf-8"), tree_of(path)
        )
    return {"rooms": {room: count for room, count in sorted(rooms.items()) if count}, "modules": len(paths)}


class Life:
    """What one command line runs."""

    def __init__(self, *words: str) -> None:
        from handctl import cli

        self.calls: Counter[tuple[str, str, int]] = Counter()
        """(file, function, line) -> how often it was called, in the order of the first call."""
        self.deepest: list[str] = []
        sys.setprofile(self._profile)
        try:
            with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
                cli.main(list(words))
        finally:
            sys.setprofile(None)

    def _profile(self, frame: FrameType, event: str, _: object) -> None:
        file = self._file(frame)
        if event != "call" or not file:
            return
        code = frame.f_code
        if code.co_name.isidentifier() and code.co_flags & NAMED:
            self.calls[file, code.co_name, code.co_firstlineno] += 1
        stack, above = [], frame
        while above is not None:
            if self._file(above) and above.f_code.co_name != "<module>":
                stack.append(f"{self._file(above)}: {above.f_code.co_name}")
            above = above.f_back  # type: ignore[assignment]
        self.deepest = max(self.deepest, stack[::-1], key=len)

    @staticmethod
    def _file(frame: FrameType) -> str:
        """The file of handctl that a frame belongs to; empty for others, and for a simulator."""
        name = frame.f_code.co_filename
        inside = name.startswith(str(RUN)) and "/sim/" not in name
        return Path(name).relative_to(RUN).as_posix() if inside else ""

    @property
    def figures(self) -> dict[str, int]:
        files = {file for file, _, _ in self.calls}
        return {
            "functions": len(self.calls), "files": len(files), "frames": len(self.deepest), "calls": self.calls.total(),
        }  # fmt: skip

    def page(self) -> str:
        """A row for each file, in the order in which they are reached."""
        found: dict[str, list[str]] = {}
        for file, name, _ in self.calls:
            found.setdefault(file, []).append(name)
        rows = [f"| `{file}` | {', '.join(dict.fromkeys(names))} |" for file, names in found.items()]
        figures = ", ".join(f"{count} {name}" for name, count in self.figures.items())
        return "\n".join([f"{figures}.", "", "| file | functions |", "|---|---|", *rows, ""])


def measured() -> Budget:
    """All figures of this code. The command gets a process of its own, as a user has it."""
    return {**sizes(), "life": lived()[0]}


def lived() -> tuple[dict[str, int], str]:
    """The figures of a get and its page, from a new process."""
    command = [sys.executable, "-m", "tests.kernel.budget", "--life"]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=True)
    figures, page = json.loads(done.stdout)
    return figures, page


def over(now: Budget, kept: Budget, where: str = "") -> list[str]:
    """The figures that have grown."""
    found = []
    for key, value in now.items():
        if isinstance(value, dict):
            found += over(value, kept.get(key, {}), f"{where}{key} ")
        elif value > kept.get(key, 0):
            found.append(f"{where}{key}: {value} instead of {kept.get(key, 0)}")
    return found


def lowered(now: Budget, kept: Budget) -> Budget:
    """What is kept from now on: nothing grows, and a room that is gone leaves."""
    return {
        key: lowered(value, kept.get(key, {})) if isinstance(value, dict) else min(value, kept.get(key, value))
        for key, value in now.items()
    }


def main() -> int:
    """Lower the budget, write the page; 1 where something has grown."""
    if sys.argv[1:] == ["--life"]:
        life = Life(*GET)
        print(json.dumps([life.figures, life.page()]))
        return 0
    now, kept = measured(), json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    KEPT.write_text(json.dumps(lowered(now, kept), indent=1) + "\n", encoding="utf-8")
    text = GUIDE.read_text(encoding="utf-8")
    GUIDE.write_text(SECTION.sub(lambda found: found[1] + lived()[1] + found[2], text), encoding="utf-8")
    total = sum(now["rooms"].values())
    print(f"{total} code lines in {now['modules']} modules; exo get: {now['life']}")
    grown = over(now, kept) if kept else []
    print(*grown, sep="\n")
    return 1 if grown else 0


if __name__ == "__main__":
    sys.exit(main())
