"""Streams for the fuzz tests: good pieces, mutated ones, likely bytes, floods; and the loop that counts and bounds them.

Knows no protocol. Everything comes from one seeded `random.Random`, so a failure repeats with its seed.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Sequence

Episode = Callable[[random.Random], int]
"""Feeds a few chunks to something under test, asserts what must hold, returns how many chunks it were."""

SEED = 9


def mutated(source: random.Random, good: bytes, likely: bytes = b"\x00\xff") -> bytes:
    """`good` with one to three changes: a bit, a byte, a span lost, doubled or put in, a cut."""
    data = bytearray(good)
    for _ in range(source.randrange(1, 4)):
        at = source.randrange(len(data) + 1)
        end = min(len(data), at + source.randrange(1, 9))
        match source.randrange(7):
            case 0 if at < len(data):
                data[at] ^= 1 << source.randrange(8)
            case 1 if at < len(data):
                data[at] = source.randrange(256)
            case 2:
                del data[at:end]
            case 3:
                data[at:at] = data[at:end]
            case 4:
                data[at:at] = source.choices(likely, k=source.randrange(1, 9))
            case 5:
                del data[at:]
            case _:
                data[at:at] = source.randbytes(source.randrange(1, 5))
    return bytes(data)


class Chunks:
    """Chunks of a byte stream: good ones whole or cut in two, mutated ones, likely bytes, random bytes, seldom a flood."""

    def __init__(self, goods: Sequence[bytes], likely: bytes, floods: Sequence[bytes] = ()) -> None:
        self._goods = goods
        self._likely = likely
        self._floods = [flood * (2048 // len(flood)) for flood in floods or [likely[:1]]]
        self._rest = b""

    def next(self, source: random.Random) -> bytes:
        """One chunk, perhaps empty."""
        if self._rest:
            rest, self._rest = self._rest, b""
            return rest
        dice = source.random()
        if dice < 0.25:
            return source.choice(self._goods)
        if dice < 0.35:
            good = source.choice(self._goods)
            at = source.randrange(len(good) + 1)
            self._rest = good[at:]
            return good[:at]
        if dice < 0.6:
            return mutated(source, source.choice(self._goods), self._likely)
        if dice < 0.85:
            return bytes(source.choices(self._likely, k=source.randrange(12)))
        if dice < 0.999:
            return source.randbytes(source.randrange(20))
        return source.choice(self._floods)


def run_episodes(episode: Episode, count: int, seed: int = SEED) -> tuple[int, float]:
    """Run episodes until `count` chunks are through; (chunks, processor seconds of the slowest)."""
    source = random.Random(seed)
    done, slowest = 0, 0.0
    while done < count:
        begin = time.process_time()
        done += episode(source)
        slowest = max(slowest, time.process_time() - begin)
    return done, slowest
