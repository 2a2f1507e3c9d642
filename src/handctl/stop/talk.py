"""The stop of a device as a talk: what to send, how long to listen, what was seen. Knows no device and no link's inside.

A family's `stopper` is a module with one function:

    stop_talk(aim) -> Talk    yields `Say`s, is sent the pieces that came back, returns `Stopped`

It does no input or output of its own, so whoever holds the link can run it: the command `stop`, a command that is asked to
stop by another process, and the child that stands in for a command that died. What nobody answers goes out all the same.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Generator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from handctl.errors import HandctlError, LinkError, NoAnswer, ProtocolError
from handctl.families import FAMILIES
from handctl.model.param import Step

if TYPE_CHECKING:
    from handctl.frame.options import Settings
    from handctl.link import ByteLink, FrameLink, Link

WRITE_SECONDS = 1.0
MOST = 65536
"""Bytes listened to at the most for one answer: a line full of noise must not hold up what comes next."""

Pieces = list[bytes]
"""What came back: chunks of a byte stream, or the data of CAN frames that have the identifier of the request."""


class Aim(NamedTuple):
    """What a stopper may know of the device: the options that were given, and the wire.

    can    the link carries CAN frames
    speed  the speed of the port in bit/s, None where it cannot be changed
    """

    settings: Settings
    can: bool = False
    speed: int | None = None


class Say(NamedTuple):
    """One write of a stop, and the wait for what it brings back.

    step     the exact bytes and what they do in words
    seconds  how long to listen at most, beyond the time of the wire
    enough   whether the pieces that came answer it
    reads    it changes nothing: it asks who is there, or where the device stands
    size     bytes of an answer, whose time on the wire is waited for as well
    baud     the speed of the port at which it goes out, None as it is; where the port cannot have it, nothing goes out
    """

    step: Step
    seconds: float
    enough: Callable[[Pieces], object] = bool
    reads: bool = False
    baud: int | None = None
    size: int = 32


class Stopped(NamedTuple):
    """How a stop ended, from what came back.

    error     None where nothing speaks against it
    evidence  what shows that the device did it, where that is more than the acknowledgement of each frame; "" = nothing
    """

    text: str
    hint: str = ""
    error: type[HandctlError] | None = None
    evidence: str = ""


Talk = Generator[Say, Pieces, Stopped]


def insisting(step: Step, answer: bytes, done: str, *, times: int = 3, seconds: float = 0.2) -> Talk:
    """A stop that is one write: once, and again while no `answer` comes; what the device has `done` once it came."""
    came: Pieces = []
    for _ in range(times):
        before = tuple(came)
        came += yield Say(step, seconds, lambda pieces, before=before: answer in b"".join([*before, *pieces]))  # type: ignore[misc]
        if answer in b"".join(came):
            return Stopped(f"{done}, and acknowledged it")
    error = ProtocolError if came else NoAnswer
    return Stopped(
        f"{step.meaning} was sent and not acknowledged", "switch the power off if the device still moves", error
    )


class Sent(NamedTuple):
    """One write that was made, and the bytes that came back."""

    step: Step
    reads: bool
    came: bytes


def talk_of(kind: str, aim: Aim) -> Talk:
    """The stop of a device of family `kind`."""
    talk: Talk = importlib.import_module(FAMILIES[kind].module("stopper")).stop_talk(aim)
    return talk


def unheard(talk: Talk, *, reads: bool = False) -> list[Step]:
    """What a stop writes when nothing ever comes back, each once: for who cannot listen.

    Questions are left out but with `reads`: a stop that needs their answers, as a wrist's, is [] then.
    """
    steps: list[Step] = []
    try:
        say = next(talk)
        while True:
            if (reads or not say.reads) and say.step not in steps:
                steps.append(say.step)
            say = talk.send([])
    except StopIteration:
        return steps


def drive(link: Link, talk: Talk, sent: list[Sent], before: Callable[[Step], object] = lambda _step: None) -> Stopped:
    """Hold the talk over an open link. What was sent is appended to `sent`, also when LinkError ends it.

    `before` is told of each step that is not a question.
    """
    from handctl.link import FrameLink

    exchange = _frames if isinstance(link, FrameLink) else _bytes
    try:
        say = next(talk)
        while True:
            pieces: Pieces = []
            place = len(sent)
            if not say.reads:
                before(say.step)
            try:
                exchange(link, say, pieces, lambda say=say: sent.append(Sent(say.step, say.reads, b"")))  # type: ignore[arg-type, misc]
            finally:
                if len(sent) > place:
                    sent[place] = sent[place]._replace(came=b"".join(pieces))
            say = talk.send(pieces)
    except StopIteration as end:
        stopped: Stopped = end.value
        return stopped


def aimed(link: Link, settings: Settings) -> Aim:
    """What a stopper may know of the device behind an open link."""
    from handctl.link import FrameLink

    can = isinstance(link, FrameLink)
    return Aim(settings, can, None if can or not link.can_set_baud else link.baud)  # type: ignore[attr-defined]


def _bytes(link: ByteLink, say: Say, pieces: Pieces, went: Callable[[], None]) -> None:
    if say.baud is not None and say.baud != link.baud:
        try:
            link.set_baud(say.baud)
        except LinkError:
            return
    link.write(say.step.data, link.deadline(WRITE_SECONDS))
    went()
    wire = 10 / link.baud if link.baud else 0.0  # seconds of a byte, 10 bits
    deadline = link.deadline(say.seconds + wire * (len(say.step.data) + say.size))
    while not deadline.expired and sum(map(len, pieces)) < MOST:
        chunk = link.read(deadline)
        if not chunk:
            return
        pieces.append(chunk)
        if say.enough(pieces):
            return


def _frames(link: FrameLink, say: Say, pieces: Pieces, went: Callable[[], None]) -> None:
    from handctl.link import CanFrame

    if say.step.can_id is None:
        raise LinkError(
            f"{link.name}: bytes of a serial wire cannot go out on CAN",
            hint="give the LINK of the wire that the device has",
        )
    request = CanFrame(say.step.can_id, say.step.data)
    link.send(request, link.deadline(WRITE_SECONDS))
    went()
    deadline = link.deadline(say.seconds)
    while not deadline.expired:
        frame = link.receive(deadline)
        if frame is None:
            return
        if frame.can_id == request.can_id and frame != request:
            pieces.append(frame.data)
            if say.enough(pieces):
                return


def shown(sent: Sequence[Sent]) -> str:
    """What went out, without what only asked: ``03, 54 0D``; the same step several times running is counted."""
    runs: list[tuple[Step, int]] = []
    for one in sent:
        if one.reads:
            continue
        if runs and runs[-1][0] == one.step:
            runs[-1] = (one.step, runs[-1][1] + 1)
        else:
            runs.append((one.step, 1))
    return ", ".join(step.wire + (f" ({count} times)" if count > 1 else "") for step, count in runs)
