"""The last part of a stop: whether the device stands still over readings of its positions. Knows no device, does no I/O."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from operator import eq

from handctl.model.movement import stands_still
from handctl.model.param import Number
from handctl.model.stop_sequence import LOOKS, Pieces, Read, Stopped, StopStep, did_not_last, not_seen_again, silence

Places = Sequence[Number]


class Looks:
    """Judges readings of a stopped device, one `SILENCE` apart.

    Two that are the `same` show that it stands. Two that differ no more than at rest (`still`) may also be a slow movement,
    which only a longer time shows: each is compared with the first one too. What brakes has until the last of `LOOKS` to rest.
    """

    def __init__(
        self, first: Places, still: Callable[[Places, Places], bool], same: Callable[[Places, Places], bool] = eq
    ) -> None:
        self._still, self._same = still, same
        self._first = self._before = first
        self._count = self._quiet = 0
        self.moved: tuple[Places, Places] | None = None
        """Two readings between which it moved, the last ones that show it."""

    def judge(self, now: Places) -> bool | None:
        """Whether it stands, by one more reading; None = it has to be read again."""
        before, self._before = self._before, now
        self._count += 1
        if self._same(before, now):
            return True
        if self._still(before, now):
            self._quiet += 1
            self.moved = None if self._still(self._first, now) else (self._first, now)
        else:
            self._first, self._quiet, self.moved = now, 0, (before, now)
        if self.moved is not None:
            return False if self._count >= LOOKS else None
        return True if self._quiet >= LOOKS else None


def check_standing(
    stopped: Stopped,
    places: Callable[[], Read],
    noise: Number,
    held: Sequence[Number | None] = (),
    strange: Callable[[Pieces], str] = lambda _heard: "",
) -> Generator[StopStep, Pieces, tuple[Stopped, list[int]]]:
    """Whether it stands still over readings of its `places`, judged by `Looks`. The result of the stop, and the last positions.

    `noise` and `held` as in `stands_still`. `strange`: what speaks against the stop in what came between two readings, "" = nothing.
    """
    now = yield from places()
    looks = Looks(
        now or (),
        lambda before, now: stands_still(before, now, noise, held),
        lambda before, now: stands_still(before, now, 0, held),
    )
    stands = None
    while now is not None and stands is None:
        if why := strange((yield from silence())):
            return did_not_last(stopped, why), []
        now = yield from places()
        stands = None if now is None else looks.judge(now)
    if now is None:
        return not_seen_again(stopped), []
    if stands or looks.moved is None:
        return stopped, now
    before, after = (" ".join(map(str, one)) for one in looks.moved)
    return did_not_last(stopped, f"it moves: {before}, then {after}"), []
