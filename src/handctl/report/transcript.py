"""The recorded bytes of a report as lines of a transcript, with what they mean as comments behind them.

What comes out is a transcript again, which `replay:` and `trace` take. Knows no protocol: a family's explainer, found by
name in `families`, finds the frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import accumulate, groupby

from handctl.frame.family import load
from handctl.link.tap import parse
from handctl.model.piece import DEVICE, HOST, Explainer, Piece
from handctl.report.private import Privacy

LONGEST = 120_000
"""Characters that a page takes; what is longer loses its middle."""
MEANING = 240
"""Characters of a meaning; a whole answer of text may have thousands."""


def explained(lines: Iterable[str], kind: str, privacy: Privacy) -> Iterator[str]:
    """The lines of a tap, private ones blanked, each followed by the frames that are complete with it."""
    explainer: Explainer = load(kind, "explain").explainer()
    for line in lines:
        yield privacy.transcript(line)
        for entry in parse((line,)):
            if entry.mark == "!":
                yield from _comments(explainer.flush(), privacy)
            else:
                side = HOST if entry.mark == ">" else DEVICE
                yield from _comments(explainer.feed(side, entry.data, entry.can_id), privacy)
    yield from _comments(explainer.flush(), privacy)


def _comments(pieces: Iterable[Piece], privacy: Privacy) -> Iterator[str]:
    """One comment per piece. Of what the device said nothing but its kind where its bytes are left out."""
    for piece in pieces:
        text = piece.meaning
        if piece.direction == DEVICE and privacy.masks:
            text = "a whole frame" if piece.frame else "no frame"
        if len(text) > MEANING:
            text = f"{text[:MEANING]} …"
        problem = f" [{piece.problem}]" if piece.problem else ""
        yield f"#   {'host' if piece.direction == HOST else 'device'}: {' '.join(text.split())}{problem}"


def shortened(lines: list[str]) -> Iterator[str]:
    """All lines, or the beginning and the end of them with what lies between counted."""
    total = sum(map(len, lines))
    passed = list(accumulate(map(len, lines)))
    kept = [total <= LONGEST or not LONGEST * 3 // 4 < place <= total - LONGEST // 4 for place in passed]
    for keep, group in groupby(zip(kept, lines, strict=True), key=lambda pair: pair[0]):
        some = [line for _, line in group]
        yield from some if keep else [f"# {len(some)} lines left out: --trace FILE keeps them all"]
