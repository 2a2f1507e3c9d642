"""What is typed for a vector: all its values in order, or NAME=VALUE for some of them. Knows no device and no numbers."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.errors import UsageError
from handctl.sentence import plural

PAIR = "="
SHOWN = 6
"""Names that a hint lists in full."""


def given(
    texts: Sequence[str],
    names: Sequence[str],
    *,
    what: str,
    noun: str = "finger",
    orders: Sequence[Sequence[int]] = (),
    more: str = "",
) -> dict[int, str]:
    """``["500", "400", …]`` or ``["ring=900", "index=100"]`` -> the text for each index, in the order of `names`.

    what    what takes the values, for messages
    noun    what one name is
    orders  indices that a whole vector may stand for; without them all of `names`
    more    a further hint where their number or a name is wrong

    Raises UsageError for a mistyped option, a wrong number of values, an unknown name, a name given twice, and a mixture.
    """
    for text in texts:
        if text.startswith("--"):
            raise UsageError(
                f"{text}: no such option", hint="`-h` lists the options of this command. Nothing was sent."
            )
    pairs = [text for text in texts if PAIR in text]
    if pairs and len(pairs) != len(texts):
        raise UsageError(
            "values in order and pairs are mixed",
            hint=f"give either all values in order, or {noun.upper()}=VALUE only. Nothing was sent.",
            code="mixed",
        )
    return _pairs(pairs, names, what, noun, more) if pairs else _whole(texts, names, what, noun, orders, more)


def _pairs(texts: Sequence[str], names: Sequence[str], what: str, noun: str, more: str) -> dict[int, str]:
    found: dict[int, str] = {}
    for text in texts:
        name, _, value = text.partition(PAIR)
        if name.casefold() not in names:
            raise UsageError(
                f"{what} has no {noun} {name!r}", hint=f"{noun}s: {_some(names)}{more}. Nothing was sent.",
                code="unknown-name",
            )  # fmt: skip
        index = list(names).index(name.casefold())
        if index in found:
            raise UsageError(f"{name} is given twice", hint="leave one of them out. Nothing was sent.", code="twice")
        found[index] = value
    return dict(sorted(found.items()))


def _whole(
    texts: Sequence[str], names: Sequence[str], what: str, noun: str, orders: Sequence[Sequence[int]], more: str
) -> dict[int, str]:
    orders = orders or [range(len(names))]
    for places in orders:
        if len(texts) == len(places):
            return dict(zip(places, texts, strict=True))
    counts = " or ".join(str(len(places)) for places in orders)
    raise UsageError(
        f"{plural(len(texts), 'value')} given, {what} takes {counts}",
        hint=f"in order: {_some(names)}. Or name single {noun}s, such as {names[orders[-1][-1]]}=VALUE{more}",
        code="wrong-count",
    )


def _some(names: Sequence[str]) -> str:
    shown = names if len(names) <= SHOWN + 2 else [*names[:SHOWN], "…", names[-1]]
    return " ".join(shown)
