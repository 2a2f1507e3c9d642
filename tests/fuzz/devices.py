"""One episode for each explainer of `trace` and for each simulator: nothing lost, nothing raised, nothing piled up."""

from __future__ import annotations

import random

import handctl.sim
from handctl.model.explainer import DEVICE, HOST, SIDES
from handctl.sim.engine.slcan import Adapter
from handctl.tools.trace_reader import explainer_of
from tests.contract.facts import facts_of
from tests.fuzz.decoders import SLCAN_GOODS
from tests.fuzz.support import Chunks


def chunks_of(family: str) -> Chunks:
    """A stream of bytes as they may pass between that device and its host."""
    facts = facts_of(family)
    return Chunks(facts.goods, facts.likely)


class Explain:
    """An explainer: every byte of both directions comes back in order, in pieces; little is held back."""

    def __init__(self, family: str) -> None:
        self._family = family
        self._chunks = {side: chunks_of(family) for side in SIDES}

    def __call__(self, source: random.Random) -> int:
        explainer = explainer_of(self._family)
        given, told = {HOST: b"", DEVICE: b""}, {HOST: b"", DEVICE: b""}
        for _ in range(30):
            side = source.choice(SIDES)
            chunk = self._chunks[side].next(source)
            if not chunk:
                continue
            given[side] += chunk
            for piece in explainer.feed(side, chunk):
                told[piece.direction] += piece.raw
                assert piece.meaning
        for piece in explainer.flush():
            told[piece.direction] += piece.raw
        assert told == given
        sample = self._chunks[HOST].next(source)[:200] or b"\0"
        explainer.recognises(sample)
        assert b"".join(piece.raw for piece in explainer.decode(sample)) == sample
        return 31


class Simulated:
    """A simulator: any client may send anything; it raises nothing and piles nothing up."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._chunks = chunks_of(kind)
        self._now = 0.0

    def __call__(self, source: random.Random) -> int:
        line = handctl.sim.create(self._kind, {"seed": str(source.randrange(9))})
        now, out = 0.0, 0
        line.advance(now)
        fed = 0
        for _ in range(100):
            chunk = self._chunks.next(source)
            if self._kind == "barrett":  # X leaves the firmware, 03 ends everything; both have tests of their own
                chunk = chunk.replace(b"X", b"").replace(b"x", b"")
            fed += len(chunk)
            line.feed(chunk)
            now += source.random() * 0.05
            line.advance(now)
            out += len(line.take())
        assert out < 300 * fed + 100_000
        return 100


class SlcanAdapter:
    """The simulated slcan adapter: an answer to every line, and still one after junk."""

    def __init__(self) -> None:
        self._chunks = Chunks(
            [b"S8\r", b"O\r", b"C\r", b"V\r", b"F\r", *SLCAN_GOODS], b"TtRrOCLSsZMmVvNF0123456789ABCDEF\r\r\n\x07"
        )

    def __call__(self, source: random.Random) -> int:
        adapter = Adapter(handctl.sim.create("wrist", {"bus": "can"}))
        now = 0.0
        adapter.advance(now)
        for _ in range(60):
            adapter.feed(self._chunks.next(source))
            now += source.random() * 0.01
            adapter.advance(now)
            adapter.take()
        adapter.feed(b"\rC\r")
        adapter.advance(now + 1)
        adapter.take()
        adapter.feed(b"V\r")
        assert adapter.take().startswith(b"V1013\r")
        return 62
