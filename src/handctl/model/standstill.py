"""The last part of a stop: whether the device stands still between two readings of its positions. Knows no device, does no I/O."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

from handctl.model.movement import stands_still
from handctl.model.param import Number
from handctl.model.stop_sequence import LOOKS, Pieces, Read, Stopped, StopStep, did_not_last, not_seen_again, silence


def check_standing(
    stopped: Stopped,
    places: Callable[[], Read],
    noise: Number,
    held: Sequence[Number | None] = (),
    strange: Callable[[Pieces], str] = lambda _heard: "",
) -> Generator[StopStep, Pieces, tuple[Stopped, list[int]]]:
    """Whether it stands still between two readings of its `places`. The result of the stop, and the last positions.

    `noise` and `held` as in `stands_still`. An axis that brakes has until the last of `LOOKS` to rest. `strange`: what
    speaks against the stop in what came between two readings, "" = nothing.
    """
    moved = ""
    now = yield from places()
    for _ in range(LOOKS):
        if now is None:
            break
        before = now
        if why := strange((yield from silence())):
            return did_not_last(stopped, why), []
        now = yield from places()
        if now is not None and stands_still(before, now, noise, held):
            return stopped, now
        moved = f"it moves: {' '.join(map(str, before))}, then {' '.join(map(str, now or ()))}"
    return (not_seen_again(stopped) if now is None else did_not_last(stopped, moved)), []
