"""kill -9 in every command that drives a device: its stop reaches the device, and the device stands.

Every writing command is declared here: driven, with how it is killed; or ended by the device itself, with the reason.
What they drive and how is in drives.py.
"""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from handctl.docgen.read_command_tree import read_tree
from handctl.families import FAMILIES
from tests.contract.facts import facts_of
from tests.stop.drives import BENCHES, DRIVEN, FURTHER, Bench, Drive, first_of, standing
from tests.support.cli import clean_environment, program, wait_until

STAYS = "what it commands stays in force when the command ends, too, and it says so: nothing is promised to be stopped"
AS_ANOTHER = "its movement is guarded as that of `{}` is; the bytes of its own death are in the golden wire"
AS_CLOSE = AS_ANOTHER.format("close")
VALUES = "it changes values, and nothing moves for it"
STOPS = "it is a stop"
LINES = "its lines are commands, each of which is declared here: the child that stops the device is that of the line"
HERE = "it writes a file of this machine"
ENDED = {
    **dict.fromkeys(("exo force", "exo set", "exo write", "exo raw", "exo restore"), STAYS),
    **dict.fromkeys(("exo baud", "exo clear-errors", "exo factory-reset", "exo id", "exo save"), VALUES),
    "exo calibrate": "no documented command stops a calibration: it goes on to its end (exo §2.3.6)",
    **dict.fromkeys(("hand force", "hand set", "hand speed", "hand write", "hand raw", "hand restore"), STAYS),
    **dict.fromkeys(
        [f"hand {name}" for name in ("baud", "clear-errors", "factory-reset", "id", "network", "save")], VALUES
    ),
    "hand pair": "its movement is guarded as that of `angle` is: tests/inspire/test_rh56_pair_cli.py kills it",
    "hand calibrate": "no documented command stops a calibration: it goes on to its end (rh56 §6 Q8)",
    **dict.fromkeys(("wrist hand-write", "wrist raw", "wrist restore", "wrist set", "wrist write"), STAYS),
    **dict.fromkeys(
        [f"barrett {name}" for name in ("home", "init", "move", "open", "step-close", "step-open", "torque-close",
                                        "torque-open", "strain", "diagnose", "first-light")], AS_CLOSE
    ),
    **dict.fromkeys(
        [f"barrett {name}" for name in ("baud", "defaults", "load", "reset", "restore", "save", "set")], VALUES
    ),
    "barrett firmware download": "a hand without firmware does not move",
    "barrett stop": STOPS,
    "ekso cancel": "it ends the action of the wearer's device; the protocol has no stop (ekso §6)",
    **dict.fromkeys(("ekso restore", "ekso set"), VALUES),
    **dict.fromkeys(("aidin bias", "aidin max-torque"), VALUES),
    **dict.fromkeys(
        [f"aidin {name}" for name in ("home", "initial", "encoders", "joints", "fingertips", "check")], AS_ANOTHER.format("currents")
    ),
    "hand position": AS_ANOTHER.format("angle"),
    "wrist center": AS_ANOTHER.format("move"),
    "aidin stop": STOPS,
    **dict.fromkeys(("devices add", "devices remove", "completion"), HERE),
    "stop": STOPS,
    "prove": "its movements are those of commands that are tried here: torque-open, realtime, home, encoders, joints; a value that it did not put back is volatile, and a calibration goes on to its end",
    **dict.fromkeys(("batch", "shell"), LINES),
    **{f"{family} terminal": "from a line that may move the device on, it is guarded as a movement is" for family in FAMILIES},
    **dict.fromkeys(("exo stop", "hand stop", "wrist stop", "ekso stop"), STOPS),
    **{f"{family} {name}": why for family in FAMILIES for name, why in (facts_of(family).ends or {}).items()},
}  # fmt: skip
"""Writing command -> why its death leaves nothing running that it promised to stop."""


@pytest.fixture(scope="module")
def bench_of(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], Bench]]:
    running: dict[str, Bench] = {}

    def get(name: str) -> Bench:
        if name not in running:
            running[name] = Bench(tmp_path_factory.mktemp(name), *BENCHES[name])
        return running[name]

    yield get
    for bench in running.values():
        bench.simulator.stop()


def test_every_writing_command_is_declared() -> None:
    written = {node.name for node in read_tree().walk() if node.path and not node.children and node.writes}
    assert not set(DRIVEN) & set(ENDED)
    assert written - set(DRIVEN) - set(ENDED) == set(), "driven, or ended by the device itself?"
    assert set(DRIVEN) <= written
    assert all(ENDED.values())


def killed(
    bench: Bench, drive: Drive, *, group: bool, words: tuple[str, ...] = ()
) -> tuple[float, list[tuple[float, bytes]]]:
    """The moment of the kill, and what has reached the device since the command began, once nothing more comes."""
    for command in drive.before:
        bench.do(command)
    begun = len(bench.heard())
    process = subprocess.Popen(
        program(*(words or bench.words(drive.command))), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, env=clean_environment(), start_new_session=True,
    )  # fmt: skip
    try:
        wait_until(lambda: bench.bytes_since(begun).count(drive.driving) >= drive.times or process.poll() is not None)
        assert process.poll() is None, process.communicate()[1]
        (guard,) = guards_of(process.pid)
        moment = time.monotonic()
        (os.killpg if group else os.kill)(process.pid, signal.SIGKILL)
    finally:
        process.kill()
        process.communicate()
    wait_until(lambda: gone(guard))
    wait_until(lambda: first_of(drive, bench.heard()[begun:]) is not None)
    return moment, bench.heard()[begun:]


def guards_of(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def gone(pid: int) -> bool:
    """A zombie that nobody has fetched yet does nothing any more."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


@pytest.mark.real
def test_a_killed_batch_stops_the_device(bench_of: Callable[[str], Bench], tmp_path: Path) -> None:
    """Killed in the middle of a line that moves: the stop is that of the line."""
    drive = DRIVEN["exo position"]
    bench = bench_of(drive.bench)
    script = tmp_path / "script"
    script.write_text(
        "\n".join(["exo get id", " ".join(map(str, bench.words(drive.command)))]) + "\n", encoding="utf-8"
    )
    _, heard = killed(bench, drive, group=False, words=("batch", str(script), "-y", "-p", bench.simulator.link))
    assert first_of(drive, heard) is not None, [data.hex(" ") for _, data in heard[-30:]]
    wait_until(lambda: drive.stands(bench))


CELLS = [(name, drive, name in ("aidin currents", "barrett realtime")) for name, drive in {**DRIVEN, **FURTHER}.items()]
"""Command, how it drives, and whether its whole group is killed."""


@pytest.mark.real
@pytest.mark.parametrize(
    ("name", "drive", "group"), CELLS, ids=[f"{name}{' (group)' if group else ''}" for name, _, group in CELLS]
)
def test_a_killed_command_stops_the_device(
    bench_of: Callable[[str], Bench],
    record_property: Callable[[str, object], None],
    name: str,
    drive: Drive,
    group: bool,
) -> None:
    bench = bench_of(drive.bench)
    moment, heard = killed(bench, drive, group=group)
    first = first_of(drive, heard)
    assert first is not None, (name, [data.hex(" ") for _, data in heard[-30:]])
    # A wrist takes its movement time also for the way back to where it is to stay.
    wait_until(lambda: drive.stands(bench))
    wait_until(lambda: standing(bench, drive.place))
    record_property("milliseconds", round((first - moment) * 1000, 1))
    bench.do("status")  # who comes next has lock and port


@pytest.mark.real
def test_who_only_reads_has_no_child(bench_of: Callable[[str], Bench]) -> None:
    bench = bench_of("aidin")
    begun = len(bench.heard())
    process = subprocess.Popen(
        program(*bench.words("watch --rate 50 --json")), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, env=clean_environment(),
    )  # fmt: skip
    try:
        assert process.stdout is not None and process.stdout.readline()
        assert guards_of(process.pid) == []
    finally:
        process.kill()
        process.communicate()
    assert b"hand_mode" not in bench.bytes_since(begun)
