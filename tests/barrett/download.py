"""Downloads in virtual time: a hand with its boot monitor, an operator at the cables, and one run of the procedure."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.firmware.download import Loader
from handctl.devices.barrett.firmware.srecords import Firmware, parse
from handctl.errors import HandctlError
from handctl.model.prompts import InterruptCount, Prompts
from handctl.model.result import Table
from tests.barrett.srecords import END, HEADER, record
from tests.barrett.support import Simulated, hand_on

SIZE = 200
DATA = bytes((number * 7 + 3) & 255 for number in range(SIZE))


def firmware(data: bytes = DATA, name: str = "fw.s19", step: int = 32, start: int = 0x2C00) -> Firmware:
    lines = [record(start + place, data[place : place + step]) for place in range(0, len(data), step)]
    return parse(name, "\n".join([HEADER, *lines, END]).encode())


def sha(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


class Operator(Prompts):
    """Somebody who does what is asked: turns the switch, presses Ctrl-C after `presses` bytes of progress."""

    interactive = True

    def __init__(self, link: Operated | None = None, answers: int = 0) -> None:
        self.link = link
        self.answers = answers
        self.said: list[str] = []
        self.instructed: list[str] = []
        self.shown: list[str] = []
        self.asked: list[str] = []
        self.press_at: dict[int, int] = {}  # number of the progress -> presses so far
        self.presses = InterruptCount()
        self.ready = True

    def say(self, text: str) -> None:
        self.said.append(text)
        if self.link is not None and self.ready and "ON" in text:
            self.link.control("power on")

    def instruct(self, text: str) -> None:
        self.instructed.append(text)
        self.say(text)

    def progress(self, text: str, safety: str = "") -> None:
        self.shown.append(text)
        self._press()

    def _press(self) -> None:
        self.presses.count = max([count for at, count in self.press_at.items() if len(self.shown) >= at], default=0)

    def ask(self, question: str, word: str) -> bool:
        self.asked.append(question)
        self.answers -= 1
        return self.answers >= 0

    def wait_for_enter(self, text: str) -> bool:
        self.said.append(text)
        assert self.link is not None
        if "OFF" in text:
            self.link.control("power off")
            self.link.sleep(5.0)
        if "ON" in text:
            self.link.control("power on")
            self.link.sleep(2.0)
        return True

    moving = True

    @contextmanager
    def count_interrupts(self) -> Iterator[InterruptCount]:
        yield self.presses


class Operated(Simulated):
    """A simulated hand behind a real cable: somebody has to turn its switch."""

    def __init__(self, query: str = "", baud: int | None = 9600) -> None:
        super().__init__(query, baud)
        self.fake = False

    def power_cycle(self) -> bool:
        return False

    def control(self, command: str) -> str:
        line = self.inner._line  # type: ignore[attr-defined]
        line.advance(self.now())
        return str(line.command(command))


class Run:
    """One download."""

    def __init__(
        self,
        query: str = "",
        *,
        file: Firmware | None = None,
        window: int = 1,
        expect: str | None = None,
        prompts: Prompts | None = None,
        link: Simulated | None = None,
        **options: Any,
    ) -> None:
        self.link = link or Simulated(query)
        self.hand: BarrettHand = hand_on(self.link, **options)
        self.file = file or firmware()
        self.prompts = prompts or Prompts()
        self.loader = Loader(self.hand, self.prompts, self.file, window=window, expect=expect)
        self.done: Table | None = None
        self.error: HandctlError | None = None
        try:
            self.done = self.loader.run()
        except HandctlError as exc:
            self.error = exc

    @property
    def image(self) -> str:
        line = self.link.inner._line  # type: ignore[attr-defined]
        line.advance(self.link.now())
        return str(line.command("image"))

    @property
    def rows(self) -> dict[str, Any]:
        assert self.done is not None, self.error
        return {row["name"] + (f".{row['motor']}" if row["motor"] else ""): row["value"] for row in self.done.rows}

    @property
    def failed(self) -> tuple[str | None, int, str]:
        assert self.error is not None
        return self.error.code, self.error.exit_code, self.error.text
