"""RealTime loops in virtual time: one run against the simulated hand, and what must be left behind."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from handctl.devices.barrett.realtime.control_values import Change, Controls
from handctl.devices.barrett.realtime.guards import GUARDS
from handctl.devices.barrett.realtime.loop import RealtimeLoop
from handctl.devices.barrett.realtime.loop_flags import FlagRequest
from handctl.errors import HandctlError
from handctl.model.prompts import Prompts
from handctl.model.result import Sample
from tests.barrett.support import CR, Simulated, hand_on, simulated
from tests.support.scripted import hexed

Names = dict[int, tuple[str, ...]]
FLAGS = ("LCV", "LCPG", "LFV", "LFS", "LFAP", "LFDP", "LFT")
EXAMPLE: Names = {0: ("strain", "delta"), 1: ("strain", "delta"), 3: ("delta",)}
"""§6.4: what 124LOOP receives, with the temperature; motors 1 and 2 take a velocity."""
TWENTY: Change = {(0, "velocity"): 20, (1, "velocity"): 127}


class Run:
    """One loop on the simulator, whatever became of it."""

    def __init__(
        self,
        query: str = "",
        *,
        receive: Names | None = EXAMPLE,
        temperature: bool | None = True,
        controls: Controls | None = None,
        hold: bool = False,
        sequential: bool | None = None,
        motors: tuple[int, ...] = (0, 1, 3),
        guards: Collection[str] = GUARDS,
        delta_unit: int | None = 1,
        link: Simulated | None = None,
        prompts: Prompts | None = None,
        **options: Any,
    ) -> None:
        if link is None:
            self.hand, self.link = simulated("initialized=1" + (f"&{query}" if query else ""), **options)
        else:
            self.link = link
            self.hand = hand_on(link, **options)
            self.hand.line.connect()
            link.sent.clear()
        self.before = self.flags()
        flag_request = FlagRequest(motors, receive, temperature, hold, frozenset(guards), delta_unit)
        sequential = controls is not None if sequential is None else sequential
        self.loop = RealtimeLoop(self.hand, prompts or Prompts(), flag_request, controls, sequential=sequential)
        self.samples: list[Sample] = []
        self.error: BaseException | None = None

    def go(self, count: int | None = 5, rate: float = 0.0, duration: float | None = None) -> Run:
        try:
            for sample in self.loop.run(rate=rate, count=count, duration=duration):
                self.samples.append(sample)
        except (HandctlError, KeyboardInterrupt) as exc:
            self.error = exc
        return self

    def control(self, command: str) -> str:
        return str(self.link.inner._line.command(command))  # type: ignore[attr-defined]

    def flags(self) -> dict[str, str]:
        return {name: self.control(f"ram {name}") for name in FLAGS}

    @property
    def inside(self) -> list[bytes]:
        """What was sent between LOOP and the first supervisory line after it, ^C included."""
        sent = self.link.sent
        start = next(number for number, data in enumerate(sent) if data.endswith(b"LOOP" + CR)) + 1
        end = next((n for n in range(start, len(sent)) if sent[n].endswith(CR) and len(sent[n]) > 1), len(sent))
        return sent[start:end]

    @property
    def after(self) -> list[str]:
        """The supervisory lines behind the loop."""
        lines = [data for data in self.link.sent if data.endswith(CR)]
        start = next(number for number, data in enumerate(lines) if data.endswith(b"LOOP" + CR)) + 1
        return [line.removesuffix(CR).decode() for line in lines[start:] if line != CR]

    def values(self, key: str, motor: str | None = None) -> list[Any]:
        return [
            row["value"]
            for sample in self.samples
            for row in sample.rows
            if (row["name"], row["motor"]) == (key, motor)
        ]

    def stands(self) -> bool:
        """Whether no joint moves any more."""
        first = self.control("motors")
        self.link.sleep(0.5)
        self.hand.line.until_prompt(0.5)
        return [word for word in first.split() if word.isdigit()] == [
            word for word in self.control("motors").split() if word.isdigit()
        ]


def example(values: Change = TWENTY) -> Controls:
    return Controls({0: ("velocity",), 1: ("velocity",), 3: ()}, values)


def assert_left(run: Run, *, zero: bool = True, power_off: bool = True) -> None:
    """Velocity 0, ^C, T, flags: in this order, whatever happened before."""
    inside = [hexed(data) for data in run.inside]
    abort = "00 03" if (run.link.baud or 0) > 9600 else "03"
    assert inside[-2:] == ["63 00 00", abort] if zero else inside[-1] == abort, inside[-4:]
    assert run.after[:1] == (["124T"] if power_off else run.after[:1])
    assert power_off or "124T" not in run.after
    assert run.flags() == run.before
    assert run.stands()
