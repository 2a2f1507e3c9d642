"""`handctl prove`: every changed simulator is found fact by fact, and no odd line gives a false fact.

A simulator with one option or state that the manual leaves open stands for a device that is not as the books have it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from handctl.families import FAMILIES
from handctl.model.proofs import AS_ASSUMED, DIFFERS
from handctl.sim.engine.line_and_faults import LINE_FAULTS
from tests.search.suite import Listed, key, parts
from tests.support.cli import Result, run

WRITES = ("--level", "write-back", "-y", "--only")
STAYS = ("--level", "permanent", "-y", "--only")
STOP = ("--level", "move", "-y", "--only", "position-at-stop")
LATER = "BD, BP, BS, BDAT"
CHANGED: list[tuple[str, str, str, object, tuple[str, ...]]] = [
    # family, what its simulator is told, the fact that must be found and its value, and further words
    ("barrett", "prompt=bare", "prompt", "bare", ()),
    ("barrett", "line-end=crlf", "line-end", "crlf", ()),
    ("barrett", "texts=names", "version-text", "Version N", ()),
    ("barrett", "texts=names", "parameter-list", "name - text", ()),
    ("barrett", "texts=prose", "value-list", "name: text", ()),
    ("barrett", "texts=prose", "help-text", "name: text", ()),
    ("barrett", "line-limit=66", "longest-line", 60, ()),
    ("barrett", "max-arguments=13", "most-arguments", 12, ()),
    ("barrett", "firmware=4.34", "later-parameters", LATER, ()),
    ("barrett", "firmware=4.4", "later-parameters", f"{LATER}, LCT, LFBP, LFAIN", ()),
    ("barrett", "fault=no-gauges", "strain-gauges", 0, ()),
    ("barrett", "max-baud=19200", "highest-speed", 19200, (*WRITES, "highest-speed")),
    ("barrett", "initialized=1&position-sign=unsigned", "position-at-stop", "unsigned", STOP),
    ("barrett", "initialized=1&position-sign=clamped", "position-at-stop", "clamped", STOP),
    (
        "barrett",
        "initialized=1&loop-exit=stop",
        "motors-after-loop",
        "stop",
        ("--level", "move", "-y", "--only", "motors-after-loop"),
    ),
    ("ekso", "length=frame", "length-convention", "frame", ()),
    ("ekso", "length=n-2", "length-convention", "n-2", ()),
    ("ekso", "answer-length=n-4", "answer-length", "n-4", ()),
    ("ekso", "time-body=3", "time-body", 3, ()),
    ("ekso", "quantum=10", "service-grid", 10, ()),
    ("ekso", "quantum=20", "service-grid", 20, ()),
    ("ekso", "bad-crc=acknowledge", "bad-crc", "acknowledged", ()),
    ("ekso", "fault=frozen-clock", "boot-time-words", "stands still", ()),
    ("ekso", "posture=sitting", "knee-sign", "flexion positive", ()),
    ("exo", "result-flag=18", "save-frames", "acknowledged, result 00 with flag 12", (*STAYS, "save-frames")),
    ("exo", "fault=no-late-frames", "save-frames", "acknowledged", (*STAYS, "save-frames")),
    ("exo", "fault=no-late-frames", "calibration-frames", "not reported", (*STAYS, "calibration-frames")),
    ("hand", "result-flag=18", "save-frames", "acknowledged, result 00 with flag 12", (*STAYS, "save-frames")),
    ("hand", "fault=no-late-frames", "calibration-frames", "not reported", (*STAYS, "calibration-frames")),
    ("aidin", "start=open&q4=half", "q4-range", "147.5 to 177.5", ("--level", "move", "-y", "--only", "q4-range")),
    ("aidin", "exchange=poll", "exchange", "poll", ()),
    ("aidin", "rate=40", "rate", 40, ()),
    ("aidin", "between=nul", "between-objects", "nul", ()),
    ("aidin", "exchange=poll&between=none", "between-objects", "none", ()),
    (
        "aidin",
        "exchange=poll&reader=nul",
        "request-terminator",
        "nul",
        ("--only", "exchange", "--only", "request-terminator"),
    ),
    ("aidin", "objects=separate", "objects", "separate", ()),
    ("aidin", "layout=indented", "layout", "indented", ()),
    ("aidin", "integers=1", "whole-numbers", "decimals", ()),
    ("aidin", "digits=4", "decimals", 4, ()),
    ("aidin", "q4=half", "q4", "half", ()),
    ("aidin", "q4=zero", "q4", "zero", ()),
    ("exo", "fault=block-silent", "reads-across-gaps", "silent", ()),
    ("exo", "fault=block-silent", "longest-read", 12, ()),
    ("exo", "fault=fresh", "set-points-at-power-on", -1, ()),
    ("exo", "baud=57600&fault=baud-at-1002", "speed-register", 1002, ("--baud", "57600")),
    ("exo", "ack-id=old", "id-acknowledged-by", "old", (*WRITES, "id-acknowledged-by")),
    ("exo", "turnaround=0.05", "reply-time", 48, ()),
    ("wrist", "fault=block-silent", "reads-across-gaps", "silent", ()),
    ("wrist", "fault=block-silent", "gap-bytes", "silent", ()),
    ("hand", "model=df", "generation", "df", ()),
    ("hand", "model=f1", "generation", "f1", ()),
    ("hand", "model=dg2", "generation", "dg2", ()),
    ("hand", "speaks=modbus", "protocol", "modbus", ()),
    ("hand", "speaks=eb90", "protocol", "eb90", ()),
    ("hand", "bus=can&ack=empty", "write-acknowledgement", "empty", (*WRITES, "write-acknowledgement")),
    ("barrett", "", "idle-abort", "prompt", (*WRITES, "idle-abort")),
    ("hand", "fault=high-half", "byte-groups", "high half first", ()),
    ("hand", "fault=rtu-unpacked", "byte-groups", "one a register", ()),
    ("hand", "model=df&baud=57600&baud-register=1001", "speed-register", 1001, ("--baud", "57600")),
    ("hand", "ack-id=old", "id-acknowledged-by", "old", (*WRITES, "id-acknowledged-by")),
]

QUIETER = {"aidin": "rate=50"}
"""It streams while it is looked at: half of its objects shows the same."""
WHOLE = [
    *((family, QUIETER.get(family, "")) for family in FAMILIES),
    ("aidin", "exchange=poll"),
    ("ekso", "posture=sitting"),
]
"""Devices that are as the books have them, with both ways to speak, and a wearer who sits."""
ODD = [fault for fault in LINE_FAULTS if fault != "healthy"]
WHEN = ((1, 0), (2, 0), (5, 0), (1, 6))
"""Every N-th request is hit, after so many healthy ones."""
ARRIVES = {"reply-time": ("dribble", "split", "slow"), "rate": ("silent", "slow")}
"""What is measured as it arrives, and the faults that change when or whether it does: then it is no false fact."""


def prove(family: str, said: str = "", *words: str) -> Result:
    """`handctl prove` of a simulator that is told `said`."""
    return run("prove", family, "-p", f"fake://{family}?clock=virtual&{said}".rstrip("&?"), "--json", *words)


def shown(result: Result) -> dict[str, Any]:
    """The facts that were shown, by name."""
    rows = result.json.get("rows", [])
    return {row["fact"]: row["value"] for row in rows if row["verdict"] in (AS_ASSUMED, DIFFERS)}


@cache
def healthy(family: str, said: str = "", *words: str) -> dict[str, Any]:
    """The facts of a simulator on a healthy line."""
    return shown(prove(family, said, *words))


def state_of(said: str) -> str:
    """Of what a simulator is told that which no fact tells."""
    return "&".join(pair for pair in said.split("&") if pair[:5] in ("baud=", "initi", "postu", "start", "bus=c"))


class Twins(Listed):
    """Family, what its simulator is told, further words: the facts make a simulator that shows the same ones."""

    name = "prove-twins"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family, said, _, _, words in CHANGED:
            yield (family, said, " ".join(words)), (family, said, words)

    def tried(self, row: Any, folder: Path) -> str:
        family, said, words = row
        result = prove(family, said, *words, "-o", str(path := folder / "facts.json"))
        found = shown(result)
        twin = healthy.__wrapped__(family, f"{state_of(said)}&facts={path}".lstrip("&"), *words)
        assert twin == found | {name: seen for name, seen in twin.items() if name == "reply-time"}, (found, twin)
        return f"exit {result.code}"


class OddLines(Listed):
    """Family, what its simulator is told, fault, how often, after how many: what is shown is true."""

    name = "prove-odd"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family, said in WHOLE:
            for fault in ODD:
                for every, after in WHEN:
                    yield (family, said, fault, f"every {every}", f"after {after}"), (family, said, fault, every, after)

    def tried(self, row: Any, folder: Path) -> str:
        """Its exit code, and that of its error."""
        family, said, fault, every, after = row
        true = healthy(family, said)
        result = prove(family, f"{said}&fault={fault}&every={every}&after={after}".lstrip("&"), "--repeat", "2")
        wrong = {
            fact: value
            for fact, value in shown(result).items()
            if value != true.get(fact) and fault not in ARRIVES.get(fact, ())
        }
        assert not wrong, wrong
        return " ".join([f"exit {result.code}", *(result.said[-1:] if result.code else ())])

    def wanted(self) -> Iterable[str]:
        """Every device, every fault."""
        return [f"device {key(*device)}" for device in WHOLE] + [f"fault {fault}" for fault in ODD]

    def shows(self, cell: str) -> Iterator[str]:
        _, family, said, fault, *_ = parts(cell)
        yield from (f"device {key(family, said)}", f"fault {fault}")


SUITES = (Twins(), OddLines())
