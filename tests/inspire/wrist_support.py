"""What the tests of the wrist share: a CAN bus that plays a script on virtual time, and wrists on both wires."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from handctl.devices.inspire.can_bus import CanBus
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.devices.inspire.wrist.device import Wrist
from handctl.link import ByteLink, CanFrame, Deadline, FrameLink, Trouble, open_link
from handctl.model.result import Journal
from tests.support.scripted import TOO_LONG, TOO_MANY_READS, RecordedLink

Arrival = tuple[float, CanFrame]
"""Seconds after the request, and the frame that arrives then."""
Answer = Callable[[CanFrame], Iterable[Arrival]]
WIRES = ("serial", "can")


def can(text: str) -> CanFrame:
    """``15038001 [4] E8 03 18 FC`` -> a frame; the announced length is checked."""
    identifier, dlc, *data = text.split()
    assert dlc == f"[{len(data)}]", text
    return CanFrame(int(identifier, 16), bytes.fromhex("".join(data)))


class ScriptedFrames(FrameLink):
    """A bus made of a function from frame to frames, on virtual time. Records what was sent, and when."""

    name = "scripted"

    def __init__(self, answer: Answer | None = None) -> None:
        self.answer: Answer = answer or (lambda frame: ())
        self.clock = 0.0
        self.sent: list[CanFrame] = []
        self.sent_at: list[float] = []
        self.interrupt_at = float("inf")
        self.acknowledges = True
        self._reads = 0
        self._incoming: list[Arrival] = []

    def now(self) -> float:
        return self.clock

    def sleep(self, seconds: float) -> None:
        self._pass_to(self.clock + max(0.0, seconds))

    def _pass_to(self, moment: float) -> None:
        if moment >= self.interrupt_at:
            self.clock, self.interrupt_at = max(self.clock, self.interrupt_at), float("inf")
            raise KeyboardInterrupt
        self.clock = max(self.clock, moment)
        assert self.clock < TOO_LONG, "the command does not end"

    def put(self, delay: float, text: str) -> None:
        """A frame that arrives by itself."""
        self._incoming.append((self.clock + delay, can(text)))
        self._incoming.sort(key=lambda arrival: arrival[0])

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        self.sent.append(frame)
        self.sent_at.append(self.clock)
        self.error_frames += not self.acknowledges
        self._incoming += [(self.clock + delay, came) for delay, came in self.answer(frame)]
        self._incoming.sort(key=lambda arrival: arrival[0])

    def receive(self, deadline: Deadline) -> CanFrame | None:
        self._reads += 1
        assert self._reads < TOO_MANY_READS, "the command does not end"
        if self._incoming and self._incoming[0][0] <= max(self.clock, deadline.at):
            moment, frame = self._incoming.pop(0)
            self._pass_to(moment)
            return frame
        self._pass_to(deadline.at)
        return None

    def close(self) -> None:
        self._incoming.clear()

    @property
    def texts(self) -> list[str]:
        """What was sent, as the transcripts write it."""
        return [str(frame) for frame in self.sent]


class BabblingFrames(ScriptedFrames):
    """A bus where always the same frame lies ready, also when the time is up."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.frame = can(text)

    def receive(self, deadline: Deadline) -> CanFrame | None:
        self._reads += 1
        assert self._reads < TOO_MANY_READS, "the command does not end while the bus babbles"
        self._pass_to(self.clock + 0.0001)
        return self.frame


class RecordedFrames(FrameLink):
    """Another CAN link, with every frame that was sent noted."""

    def __init__(self, inner: FrameLink) -> None:
        self.inner = inner
        self.name, self.fake = inner.name, inner.fake
        self.sent: list[CanFrame] = []
        self.sent_at: list[float] = []
        self.interrupt_at = float("inf")

    def _check(self) -> None:
        self.error_frames = self.inner.error_frames
        if self.inner.now() >= self.interrupt_at:
            self.interrupt_at = float("inf")
            raise KeyboardInterrupt

    def now(self) -> float:
        return self.inner.now()

    def sleep(self, seconds: float) -> None:
        self._check()
        self.inner.sleep(seconds)

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        self.sent.append(frame)
        self.sent_at.append(self.now())
        self.inner.send(frame, deadline)
        self.error_frames = self.inner.error_frames

    def receive(self, deadline: Deadline) -> CanFrame | None:
        self._check()
        frame = self.inner.receive(deadline)
        self.error_frames = self.inner.error_frames
        return frame

    def trouble(self, before: int = 0) -> Trouble | None:
        return self.inner.trouble(before)

    def close(self) -> None:
        self.inner.close()


def frames(*exchanges: tuple[str, Sequence[str | tuple[float, str]]]) -> Answer:
    """Exactly these frames, in this order, each with its answers (text, or (delay, text))."""
    position = iter(exchanges)

    def answer(frame: CanFrame) -> list[Arrival]:
        expected = next(position, None)
        assert expected is not None, f"one frame too many: {frame}"
        assert str(frame) == expected[0]
        return [(0.0, can(item)) if isinstance(item, str) else (item[0], can(item[1])) for item in expected[1]]

    return answer


def wrist_on(link: ByteLink | FrameLink, device_id: int = 1, **options: object) -> Wrist:
    """A wrist behind `link`; options are those of the bus."""
    if isinstance(link, FrameLink):
        return Wrist(CanBus(link, device_id, Journal(), **options))  # type: ignore[arg-type]
    return Wrist(SerialBus(link, device_id, Journal(), family="wrist", **options))  # type: ignore[arg-type]


def fake_wrist(
    wire: str = "serial", query: str = "", device_id: int = 1, **options: object
) -> tuple[Wrist, RecordedLink | RecordedFrames]:
    """A wrist in front of the simulator on virtual time, and its recorded link."""
    parts = ["clock=virtual", *(["bus=can"] if wire == "can" else []), *([query] if query else [])]
    inner = open_link(f"fake://wrist?{'&'.join(parts)}", baud=115200 if wire == "serial" else None)
    link: RecordedLink | RecordedFrames
    link = RecordedFrames(inner) if isinstance(inner, FrameLink) else RecordedLink(inner)  # type: ignore[arg-type]
    return wrist_on(link, device_id, **options), link


def sent_texts(link: RecordedLink | RecordedFrames) -> list[str]:
    """Everything that was sent, as the transcripts write it."""
    return [str(item) if isinstance(item, CanFrame) else item.hex(" ").upper() for item in link.sent]


def writes_of(link: RecordedLink | RecordedFrames) -> list[str]:
    """What was sent that is no read: serial flags but 30 and 11, CAN flags but 4 and 0."""
    return [
        text
        for item, text in zip(link.sent, sent_texts(link), strict=True)
        if (item.can_id >> 26 not in (0, 4) if isinstance(item, CanFrame) else item[4] not in (0x30, 0x11))
    ]


def fake_port(wire: str = "serial", query: str = "") -> str:
    """The LINK of a simulated wrist on virtual time."""
    return f"fake://wrist?clock=virtual{'&bus=can' if wire == 'can' else ''}{'&' if query else ''}{query}"
