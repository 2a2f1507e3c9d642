"""The recorded bytes of a report as lines of a transcript, with what they mean as comments behind them.

What comes out is a transcript again, which `replay:` and `trace` take. Knows no protocol: a family's explainer, found by
name in `families`, finds the frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from handctl.families import FAMILIES
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
    explainer = _explainer(kind)
    for line in lines:
        yield privacy.transcript(line)
        if explainer is None:
            continue
        for entry in parse((line,)):
            if entry.mark == "!":
                yield from _comments(explainer.flush(), privacy)
            else:
                side = HOST if entry.mark == ">" else DEVICE
                yield from _comments(explainer.feed(side, entry.data, entry.can_id), privacy)
    if explainer is not None:
        yield from _comments(explainer.flush(), privacy)


def _explainer(kind: str) -> Explainer | None:
    made: Explainer | None = load(kind, "explain").explainer() if kind in FAMILIES else None
    return made


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
    passed = left_out = 0
    for line in lines:
        passed += len(line)
        if total > LONGEST and LONGEST * 3 // 4 < passed <= total - LONGEST // 4:
            left_out += 1
            continue
        if left_out:
            yield _gap(left_out)
            left_out = 0
        yield line
    if left_out:
        yield _gap(left_out)


def _gap(count: int) -> str:
    return f"# {count} lines left out: --trace FILE keeps them all"
