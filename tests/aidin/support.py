"""What the tests of the AIDIN-hand share: feedback made by hand, a scripted hand that streams, polls or is mute."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import Any

from handctl.devices.aidin.conversation import Conversation
from handctl.devices.aidin.device import AidinHand
from handctl.link import ByteLink, Deadline, open_link
from handctl.model.command_settings import Settings
from handctl.model.prompts import Prompts
from handctl.model.result import Journal
from handctl.model.stop_sequence import StopContext, Stopped, exchange_steps, stop_sequence_of
from tests.support.scripted import RecordedLink, ScriptedLink

STOP = b'{"hand_mode":3}\n'
FINGERS = ("thumb", "index", "middle", "ring", "little")
Content = dict[str, object]
ENCODED = json.JSONEncoder(separators=(",", ":")).encode
"""Made once: a hand sends a hundred objects a second."""


FEEDBACK: dict[str, list[Any]] = {
    "motor_pos": [1000 * n for n in range(15)],
    "joint_pos": [
        *(0.1, 0.2, 2.1, 2.1),
        *(q for n in range(1, 5) for q in (n / 100, -n / 50, 2.5 + n / 100, 2.5 + n / 100)),
    ],
    "task_space_pos": [float(n) for pair in range(5) for n in (pair, 60 + pair, 100 + pair)],
    "current_state": list(range(-7, 8)),
    "sensor_state": [n / 100 for n in range(1, 31)],
}


def feedback(**changes: object) -> Content:
    """Feedback of a homed, open hand, every element of a key different from its neighbours where that is possible."""
    return {**{key: values.copy() for key, values in FEEDBACK.items()}, **changes}


AT_ORIGIN: Content = feedback(motor_pos=[0] * 15)


def line(content: object, end: bytes = b"\n") -> bytes:
    """An object as the hand sends it."""
    return ENCODED(content).encode() + end


class Notes(Prompts):
    """Keeps what a person would have been told."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def say(self, text: str) -> None:
        self.lines.append(text)

    def progress(self, text: str, safety: str = "") -> None:
        self.lines.append(f"{safety} {text}")


def objects(sent: list[bytes]) -> list[Content]:
    """What was sent, as objects."""
    return [json.loads(data) for data in sent]


def poller(content: Content | Callable[[bytes], Content | None], delay: float = 0.001) -> ScriptedLink:
    """A hand that answers every object with `content` (or what it makes of the object)."""

    def answer(request: bytes) -> Iterable[tuple[float, bytes]]:
        made = content(request) if callable(content) else content
        return [] if made is None else [(delay, line(made))]

    return ScriptedLink(answer)


class Streamer(ScriptedLink):
    """A hand that sends what `content` makes of the time, every `period` seconds, whatever it hears."""

    def __init__(self, content: Callable[[float], bytes], period: float = 0.01) -> None:
        super().__init__()
        self.content = content
        self.period = period
        self._next = 0.0

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        if self._next <= max(self.clock, deadline.at):
            self._pass_to(self._next)
            self._next += self.period
            return self.content(self.clock)
        return super().read(deadline, size)


def streamer(content: object = None) -> Streamer:
    """A hand that streams one and the same object."""
    data = line(feedback() if content is None else content)
    return Streamer(lambda _: data)


def hand_on(link: ByteLink, **options: object) -> AidinHand:
    """A hand behind `link`, with a journal of its own."""
    return AidinHand(Conversation(link, Journal(), **options))  # type: ignore[arg-type]


def simulated(**options: object) -> tuple[AidinHand, RecordedLink]:
    """The simulated hand on virtual time, with what was sent to it."""
    words = "&".join(["clock=virtual", *(f"{key.replace('_', '-')}={value}" for key, value in options.items())])
    opened = open_link(f"fake://aidin?{words}")
    assert isinstance(opened, ByteLink)
    link = RecordedLink(opened)
    return hand_on(link), link


def stopped_behind(sent: list[bytes]) -> bytes:
    """The object before the stop mode, which goes out four times at least, and behind which nothing else does."""
    count = sent.count(STOP)
    assert count > 3 and sent[-count:] == [STOP] * count, sent
    return sent[-count - 1]


def stopped(link: ByteLink, **settings: Any) -> Stopped:
    """Run the family's stopper over `link`; how it ended."""
    return exchange_steps(link, stop_sequence_of("aidin", StopContext(Settings(own=settings))), [])
