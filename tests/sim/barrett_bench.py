"""The simulated BarrettHand in virtual time, fed bytes by hand."""

from __future__ import annotations

from handctl.sim import create
from handctl.sim.engine.line_and_faults import Line

PROMPT = "\n\r=> "
MOTOR_33 = [
    *[
        "DP",
        "DS",
        "HSG",
        "LSG",
        "MOV",
        "MCV",
        "MSG",
        "OD",
        "P",
        "S",
        "SG",
        "LCV",
        "LCVC",
        "LCPG",
        "LFV",
        "LFVC",
        "LFS",
        "LFAP",
        "LFDP",
        "LFDPC",
    ],
    *[
        "ACCEL",
        "CT",
        "EN",
        "FDZ",
        "FIP",
        "FPG",
        "HOLD",
        "IHIT",
        "IOFF",
        "IVEL",
        "MPE",
        "OT",
        "SAMPLE",
        "SGFLIP",
        "TSTOP",
    ],
]
GLOBALS = ["BAUD", "LFT", "OTEMP", "TEMP", "PTEMP", "UPSECS", "SN", "LFDPD"]


class Bench:
    """A line on virtual time; options as in a link, with _ for -."""

    def __init__(self, **options: object) -> None:
        self.line: Line = create("barrett", {name.replace("_", "-"): str(text) for name, text in options.items()})
        self.now = 0.0
        self.line.advance(0.0)

    def send(self, text: str) -> str:
        """Writes bytes; what comes at once."""
        self.line.feed(text.encode("latin-1"))
        return self.heard()

    def heard(self) -> str:
        return self.line.take().decode("latin-1")

    def wait(self, seconds: float) -> str:
        """Lets time pass at once; returns what came."""
        self.now += seconds
        self.line.advance(self.now)
        return self.heard()

    def run(self) -> str:
        """Event by event until nothing is scheduled; what came."""
        came = ""
        while (event := self.line.next_event()) is not None:
            self.now = event
            self.line.advance(event)
            came += self.heard()
        return came

    def ask(self, command: str) -> list[str]:
        """A whole exchange: the lines between echo and prompt."""
        answer = self.send(command + "\r") + self.run()
        assert answer.startswith(command) and answer.endswith(PROMPT), repr(answer)
        return answer[len(command) : -len(PROMPT)].split("\n\r")[1:]

    def get(self, names: str, prefix: str = "") -> list[str]:
        return self.ask(f"{prefix}FGET {names}")

    def seconds(self, command: str) -> float:
        """How long a command takes; it must succeed."""
        start = self.now
        assert self.ask(command) == []
        return self.now - start

    def control(self, command: str) -> str:
        return self.line.command(command)


def ready(**options: object) -> Bench:
    """A hand after HI."""
    return Bench(initialized=1, **options)
