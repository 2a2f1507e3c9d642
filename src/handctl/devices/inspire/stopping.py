"""What the stops of this maker's devices have in common: a question in EB90, its answer, and a look at what still moves.

Knows no device: its stopper says which registers tell where it is, and where it is to go.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from itertools import zip_longest

from handctl.devices.inspire import eb90
from handctl.devices.inspire.quiet import ahead, question
from handctl.model.param import Step
from handctl.model.stopping import BETWEEN, Aim, Pieces, Say, insist, settled, silence

QUICK = 0.05
"""Seconds for an answer that tells one of this maker's devices from another: it must not hold up a stop."""
SHOWN = 16
"""Bytes of what came instead of an answer that a sentence holds."""

READS = "read where it is, or is to be"

Read = Generator[Say, Pieces, list[int] | None]


def answer(pieces: Pieces, prefix: bytes) -> eb90.Frame | None:
    """The last frame that begins with `prefix`, of those that came whole and undamaged."""
    decoder = eb90.Decoder([prefix])
    decoder.feed(b"".join(pieces))
    return next(reversed(decoder.finish()), None)


def asks(number: int, flag: int) -> tuple[Step, bytes]:
    """What to ask an id first, so that nobody else who may be there acts upon it; and how its answer begins."""
    span = question(number, flag)
    return Step("ask who is there", eb90.read_request(number, *span, flag)), eb90.read_reply_prefix(number, *span, flag)


def lead(aim: Aim) -> bytes:
    """What goes ahead of a frame to whom nobody has met: a stranger may hear it at another speed."""
    return b"" if aim.proven or aim.can else ahead(aim.speed)


def values(aim: Aim, address: int, count: int, flag: int) -> Read:
    """So many signed 16-bit registers in EB90, asked again for a second; None where nothing answers."""
    prefix = eb90.read_reply_prefix(aim.number, address, 2 * count, flag)
    step = Step(READS, eb90.read_request(aim.number, address, 2 * count, flag))
    frame = yield from settled(
        aim, (yield from insist(aim, step, lambda pieces: answer(pieces, prefix), reads=True, ahead=lead(aim)))
    )
    return eb90.unpack_s16(frame.data) if frame is not None else None


def seen_since(
    places: Callable[[], Read],
    targets: Callable[[], Read],
    wanted: Sequence[int | None],
    still: int,
    held: Sequence[int] = (),
) -> Generator[Say, Pieces, str]:
    """After a silence: what is commanded now, and whether it moves. What speaks against a stop, in words; "" = nothing.

    `wanted` is what the stop has commanded, None where it has not; `still` the most that standing places differ by; `held`
    the places where it is to stay: on a slow line it still comes back to these.
    """
    yield from silence()
    told = yield from targets()
    if told is not None and any(one not in (None, now) for one, now in zip(wanted, told, strict=False)):
        return f"it is commanded to {' '.join(map(str, told))}"
    before = yield from places()
    if before is None:
        return ""
    yield from silence(BETWEEN)
    now = yield from places()
    if now is None:
        return ""
    back = [abs(there - place) < abs(here - place) for here, there, place in zip(before, now, held, strict=False)]
    moved = [abs(there - here) > still for here, there in zip(before, now, strict=True)]
    if any(one and not other for one, other in zip_longest(moved, back, fillvalue=False)):
        return f"it moves: {' '.join(map(str, before))}, then {' '.join(map(str, now))}"
    return ""


def instead(heard: Pieces) -> str:
    """What came where no answer did, in words: our own frames, which an echo brings back, or others; "" for silence."""
    came = b"".join(heard)
    if not came:
        return ""
    rest = came
    while rest.startswith(eb90.HOST) and len(rest) >= eb90.OVERHEAD:
        rest = rest[rest[3] + eb90.OVERHEAD :]  # byte 3 is the length
    return f"{came[:SHOWN].hex(' ').upper()} arrived instead" if rest else "only our own bytes came back"
