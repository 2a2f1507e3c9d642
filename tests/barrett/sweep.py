"""Every state in which a hand may be found x every `handctl barrett` command, scan and doctor: what was sent, what changed.

``python -m tests.barrett.sweep`` prints the table; ``--step 0.02`` begins every command at every 20 ms of the boot windows.
What changed is found by comparison with a twin that nobody talked to, field by field (`tests.harm.cell`).
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import click

import handctl.sim
from handctl.command.command_tree import root
from handctl.sim.barrett.shared_state import STATES
from handctl.sim.bus.wire_pair import RECEIVERS
from tests.barrett.commands import prepare
from tests.harm.cell import Port, changes
from tests.harm.states import State
from tests.support.cli import Result, run

WINDOWS = (0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0)
LASTING = ("--duration", "1")
ARGUMENTS: dict[str, tuple[str, ...]] = {
    "get": ("P",), "set": ("DP.F1=8000",), "watch": ("P", *LASTING), "snapshot": ("{}/new.json",), "diff": ("{}/factory.json",),
    "restore": ("{}/stored.json", "-y"), "report": ("{}/report.txt",), "gcl": ("FGET P",), "move": ("500",), "step-open": ("10",),
    "step-close": ("10",), "baud": (), "reset": ("-y",), "realtime": ("--receive", "position", "--motors", "1", "--count", "3"), "save": ("--force", "-y"),
    "help": ("HI",), "firmware check": ("{}/good.s19",), "firmware download": ("{}/good.s19", "-y"),
    "strain": ("--live", "--count", "1"), "fingertips": (), "load": ("-y",), "defaults": ("-y",),
    "doctor": ("--family", "barrett", "--count", "3"),
}  # fmt: skip
LOADS = ("firmware download",)
"""What replaces the image on purpose."""
TOOLS = ("scan", "doctor")
NAMES = {
    b"!\0\r": "!", bytes(8) + b"!\0\r": "rest of a block", b"\x03": "^C", b"\0\x03": "00 ^C", b"\x7f": "7F",
}  # fmt: skip
"""What a connect sends, by bytes; all else is called a command."""


def leaves() -> list[str]:
    """``status``, ``firmware check`` …: every command below `handctl barrett`."""
    group = root.get_command(click.Context(root), "barrett")
    assert isinstance(group, click.Group)
    found = []
    for name, command in group.commands.items():
        inner = command.commands if isinstance(command, click.Group) else {"": command}
        found += [f"{name} {one}".strip() for one in inner]
    return sorted(found)


def reads(leaf: str) -> bool:
    """Whether a command says of itself that it does not write."""
    command: click.Command | None = root.get_command(click.Context(root), "barrett")
    for name in leaf.split():
        assert isinstance(command, click.Group)
        command = command.commands[name]
    return not getattr(command, "writes", False)


def words(leaf: str, scratch: Path) -> list[str]:
    """The words of a command, its files in place."""
    return [*leaf.split(), *(word.format(scratch) for word in ARGUMENTS.get(leaf, ()))]


def files(scratch: Path) -> Path:
    """The input files of the commands, an image of firmware among them."""
    from tests.barrett.srecords import END, HEADER, record

    prepare(scratch)
    lines = [HEADER, record(0x2C00, bytes(range(32))), END]
    (scratch / "good.s19").write_text("\n".join(str(line) for line in lines) + "\n", encoding="ascii")
    return scratch


def begin(leaf: str, scratch: Path, link: str) -> Result:
    """One command on `link`."""
    for made in ("new.json", "report.txt"):
        (scratch / made).unlink(missing_ok=True)
    family = () if leaf in TOOLS else ("barrett",)
    return run(*family, *words(leaf, scratch), "-p", link, "--json", *(("--deadline", "60") if family else ()))


class Outcome(NamedTuple):
    """One command on one hand: what the connect sent, how many commands followed, what changed, whether the image starts."""

    code: int
    sent: tuple[str, ...]
    commands: int
    changed: tuple[str, ...]
    whole: bool
    out: str


class Cable(Port):
    """Keeps what was sent, with the speed at which it went out."""

    def __init__(self, line: Any) -> None:
        super().__init__(line)
        self.sent: list[tuple[bytes, int | None]] = []

    def feed(self, data: bytes) -> None:
        self.sent.append((bytes(data), self.client_baud))
        super().feed(data)


PARTS = {"monitor.image": "image", "hand": "motors", "memory": "parameters", "_hear": "mode", "loop": "mode"}


def part_of(place: str) -> str:
    """``hand.motors[1].counts: 0 -> 5`` -> motors."""
    return next((name for start, name in PARTS.items() if place.startswith(start)), "")


def outcome(state: str, leaf: str, scratch: Path, at: float = 0.0, **options: object) -> Outcome:
    """Begin one command `at` s after somebody left the hand in `state`."""
    settings = {"found": state, "initialized": "1", **{name: str(value) for name, value in options.items()}}
    found = State("BarrettHand", state, "barrett", "barrett", settings, lambda line: line.advance(at))
    port = Cable(found.make())
    with mock.patch.object(handctl.sim, "create", lambda kind, options: port.opened()):
        result = begin(leaf, scratch, "fake://barrett?clock=virtual")
    twin = found.make()
    end = port.line.now + 0.3
    for one in (port.line, twin):
        one.advance(end)
    parts = {part_of(place) for place in changes(port.line, twin)} if port.sent else set()
    image = str(port.line.command("image")).partition(",")[0]
    sent = [(data, speed) for data, speed in port.sent if data in NAMES]
    told = dict.fromkeys(NAMES[data] + ("" if speed in (None, 9600) else f" at {speed}") for data, speed in sent)
    return Outcome(result.code, tuple(told), len(port.sent) - len(sent), tuple(sorted(parts - {""})),
                   image == "image valid" or state in ("monitor", "record"), result.out + result.err)  # fmt: skip


def starts(window: float, step: float) -> Iterator[float]:
    """Every `step` s from the switch to a little behind the window."""
    for number in range(int((window + 0.1) / step) + 1):
        yield round(number * step, 3)


Row = tuple[str, str, Outcome]


def sweep(windows: Sequence[float], step: float, scratch: Path, commands: Sequence[str]) -> Iterator[Row]:
    """(boot window and receiver, command, outcome), for every start."""
    for window in windows:
        for receiver in RECEIVERS:
            for leaf in commands:
                for at in starts(window, step):
                    name = f"boot, {window:g} s, {receiver}"
                    yield name, leaf, outcome("boot", leaf, scratch, at, boot=window, window=window, uart=receiver)


def lines(rows: Sequence[Row]) -> Iterator[str]:
    """The table: commands with the same outcome share a line."""
    for state in dict.fromkeys(row[0] for row in rows):
        same: dict[tuple[str, ...], Counter[str]] = {}
        for _, leaf, found in (row for row in rows if row[0] == state):
            sent = ", ".join(found.sent) or "nothing"
            sent += f", {'commands' if found.commands else 'no command'}"
            harm = "" if found.whole else "IMAGE HARMED"
            key = (sent, ", ".join(found.changed) or "nothing", f"exit {found.code}", harm)
            same.setdefault(key, Counter())[leaf] += 1
        harmed = sum(not found.whole for name, _, found in rows if name == state)
        yield f"{state}: {sum(sum(names.values()) for names in same.values())} starts, {harmed} images harmed"
        for (sent, changed, code, harm), names in same.items():
            shown = ", ".join(f"{name} x{count}" if count > 1 else name for name, count in names.items())
            yield f"    sent: {sent}; changed: {changed}; {code} {harm}".rstrip()
            yield f"        {shown}"


def main() -> None:
    """The table on stdout."""
    parser = argparse.ArgumentParser(prog="python -m tests.barrett.sweep", description=__doc__)
    parser.add_argument("--step", type=float, default=0.5, help="seconds between two starts (default 0.5)")
    parser.add_argument("--window", type=float, nargs="*", default=list(WINDOWS), help="boot windows in seconds")
    parser.add_argument("--command", nargs="*", help="commands (default: all)")
    given = parser.parse_args()
    commands = given.command or [leaf for leaf in [*leaves(), *TOOLS] if leaf not in LOADS]
    with tempfile.TemporaryDirectory() as folder:
        scratch = files(Path(folder))
        for state in STATES:
            if state != "boot":
                show([(state, leaf, outcome(state, leaf, scratch)) for leaf in commands])
        for window in given.window:
            show(list(sweep([window], given.step, scratch, commands)))


def show(rows: Sequence[Row]) -> None:
    """Part of the table."""
    print("\n".join(lines(rows)), flush=True)


if __name__ == "__main__":
    main()
