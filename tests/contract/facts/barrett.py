"""The BarrettHand, for the contract."""

from __future__ import annotations

from typing import Any

from tests.contract.facts import Facts, Faulty, Passed, Silent

GCL_GOODS = [
    b"FGET P\r",
    b"FGET P\n\r1 2 3 4\n\r=> ",
    b"1LOOP\r",
    b"1LOOP\n\r*",
    b"X",
    b":",
    b"C\x10\x0a",
    b"*\x01\x02",
    b"\x03",
    b"1FSET P 3\r",
    b"\n\r=> ",
    b"ERR 4\n\r=> ",
]
GCL_LIKELY = b"\r\n=> *XCcAa:0123456789FGETSILOP\x03\xff"


QUERIES = {
    *("FGET", "PGET", "FLIST", "FLISTV", "FLISTA", "FLISTAV", "PLIST", "PLISTV", "PLISTA", "PLISTAV"),
    *("VERS", "ERR", "A?", "!"),  # "!" is no command: a connection asks with it
}


MOTIONS = {"HI", "C", "O", "M", "IC", "IO", "HOME", "TC", "TO"}


class Gcl:
    """GCL lines are told by their first word; behind LOOP come blocks until ^C; ^C writes while something moves, and where it is repeated."""

    def __init__(self, *, stops: bool) -> None:
        self.stops = stops
        self.loop = self.moves = False

    def writes(self, entry: Passed) -> bool:
        data = entry.data
        if entry.mark == "<":
            self.moves = self.moves and b"=>" not in data
            return False
        if not data.strip(b"\x00\x7f"):  # DEL takes back what stands in the line
            return False
        if not data.strip(b"\x00\x03"):  # to leave a loop, a zero may go before
            self.moves, self.loop = self.moves or self.loop, False
            self.stops = self.stops or self.moves
            return self.moves or (self.stops and data[-1:] == b"\x03")
        if self.loop:
            return data not in (b"A", b"a")
        word = data.decode().strip("\0\r").replace("\0", "").upper().partition(" ")[0]  # 00 fills a control block
        name = word.lstrip("1234GS")
        self.loop = name == "LOOP"
        self.moves = self.moves or name in MOTIONS
        return bool(word) and name not in QUERIES and not word.startswith("?")


STATUS = {
    1: "No motor board found", 2: "No motor found", 4: "not initialized", 8: "(not used) (8)", 16: "Couldn't reach position", 32: "Unknown command",
    64: "Unknown parameter name", 128: "Invalid value", 256: "read only", 512: "(not used) (512)", 1024: "Too many arguments", 2048: "control block header",
    4096: "motor prefix", 8192: "over-temperature", 16384: "stopped by ^C", 32768: "unknown (32768)",
}  # fmt: skip
"""The status codes of a motor (barrett §5.1.3, T3), and three that the table does not have."""


def _put(line: Any, bits: int) -> None:
    """The status of F1 has them from now on."""
    device, read = line.device, line.device.read
    device.read = lambda name, number: read(name, number) | (bits if (name, number) == ("S", 0) else 0)


FAULTY = tuple(
    Faulty(
        words,
        "status.F1",
        STATUS,
        lambda line: line.device.hand.motors[0].position(line.device.now),
        target,
        _put,
        lasting=frozenset({1, 2, 4, 8192, 16384}),
        stops=frozenset({16, 16384}),
    )
    for words, target in (
        ("move 9000 --motors 1", 9000),
        ("close --motors 1", 17000),
        ("step-close 5000 --motors 1", 5000),
    )
)
FACTS = Facts(
    faulty=FAULTY,
    silent=(Silent(seconds=6.0, why="the boot window of 3 s, and seven baud rates"),),
    places=lambda line: [motor.position(line.device.now) for motor in line.device.hand.motors],
    forces=frozenset({"torque-open", "torque-close"}),
    nothing_waits="its set-points act with a movement command only (barrett §5.2.1)",
    writes={
        "set": "MCV=80 HSG.F1=150",
        "load": "",
        "defaults": "",
        "save": "--force",
        "baud": "19200",
        "reset": "",
        "init": "",
        "open": "",
        "close": "",
        "move": "9000 --motors 1",
        "step-open": "0",
        "step-close": "100",
        "home": "",
        "torque-open": "",
        "torque-close": "",
        "stop": "",
        "gcl": "FGET§P FSET§MCV§70 HI",
        "terminal": "FGET§P FSET§MCV§70 HI",
        "restore": "{barrett}",
        "realtime": "--init --velocity 20 --count 20",
        "strain": "--open",
        "diagnose": "early-breakaway --move",
        "first-light": "",
    },
    rule=lambda command: Gcl(stops=command == "stop").writes,
    goods=GCL_GOODS,
    likely=GCL_LIKELY,
    reads={
        "listen": "--duration 1",
        "get": "P",
        "snapshot": "{dir}/new.json",
        "diff": "{barrett}",
        "watch": "--count 2",
        "scan": "",
        "report": "{dir}/report.html --watch 0 --force",
        "log": "{dir}/log.csv --count 2 --force",
        "errors": "",
        "help": "",
    },
    state="initialized=1",
    snapshot={"max_close_velocity.F1": 80, "filter_derivative_zero.F2": 3, "over_temperature_limit": 700},
    halts=dict.fromkeys(
        ("init", "open", "close", "move", "step-open", "step-close", "home", "torque-open", "torque-close"), b"\x03"
    ),
    over=b"=> ",
    idle=b"\x03",
    plans=frozenset(["defaults", "gcl", "load", "terminal", "restore", "set"]),
    adapts=frozenset({"restore", "realtime", "first-light"}),
    confusing=frozenset({"noise", "no-echo", "late", "loop-silent"}),
    screens=("status", "dump", "maintenance", "fingertips", "diagnose", "strain"),
    broken_from=4,
    lines=(
        *(("log", "{dir}/log.csv", "--count", "2", "--force"),),
        *(("describe",), ("errors", "20"), ("report", "{dir}/report.html"), ("firmware", "check", "{dir}/image.s19")),
        *(("firmware", "download", "{dir}/image.s19", "--yes"), ("maintenance",), ("strain",), ("strain", "--open")),
        *(
            ("strain", "--live", "--count", "2"),
            ("fingertips",),
            ("fingertips", "--live", "--count", "2"),
            ("diagnose",),
        ),
        *(("diagnose", "sticks-open"), ("diagnose", "sticks-open", "--move", "--yes")),
        *(
            ("realtime", "--count", "3"),
            ("realtime", "--velocity", "20", "--count", "3"),
            ("realtime", "--measure", "5"),
        ),
        *(("gcl", "PSET BAUD 384"), ("gcl", "1C"), ("gcl", "LOOP"), ("gcl", "T"), ("watch", "--count", "2")),
    ),
    looking=frozenset(
        {
            *(("strain",), ("strain", "--live", "--count", "2"), ("diagnose",), ("diagnose", "sticks-open")),
        }
    ),
    rows_in="tests.barrett.commands",
    states_in="tests.barrett.states",
)
