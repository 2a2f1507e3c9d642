"""The facts file: what proofs showed of one device. Written, read, compared; and which settings its facts stand for."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from handctl import __version__
from handctl.errors import CheckFailed, Hint, OutputError, UsageError
from handctl.families import FAMILIES
from handctl.files import atomic_write, read_text, writing
from handctl.model.proofs import SHOWN, Outcome, close, in_words
from handctl.model.result import Cell, Column, Grid, Row, Table
from handctl.wording import utc

SCHEMA = "handctl/facts-1"
MOST = 1_000_000
"""Characters of a facts file."""
DIFFERENCES = (Column("fact", "Fact"), Column("a", "A"), Column("b", "B"), Column("equal", "Equal"))


def document(
    family: str, outcomes: Iterable[Outcome], *, simulated: bool, time: float, device: Mapping[str, Any] | None
) -> dict[str, Any]:
    """The facts of one device. Without `device` nothing in it tells whose they are."""
    facts = {one.proof.name: one.fact() for one in outcomes}
    named = {} if device is None else {"device": dict(device)}
    return {"schema": SCHEMA, "version": __version__, "time": utc(int(time)), "family": family, "simulated": simulated, **named, "facts": facts}  # fmt: skip


def write(path: str, content: Mapping[str, Any]) -> None:
    """Replace the file at once. Raises OutputError."""
    with writing(path), atomic_write(path) as file:
        json.dump(content, file, indent=2, ensure_ascii=False)
        file.write("\n")


def keep(path: str, device: Any, outcomes: Iterable[Outcome], *, identify: bool) -> OutputError | None:
    """Write what was found on `device` to `path`, and say what it is for; the error where that is not possible."""
    kind, link = device.kind, device.link
    named = {"kind": kind, **device.about} if identify else None
    try:
        write(path, document(kind, outcomes, simulated=link.fake, time=link.wall(), device=named))
    except OutputError as exc:
        return exc
    device.journal.info(
        "facts", f"facts written to {path}", hint=Hint("use them with {}", f"{kind} status --facts {path}")
    )
    return None


def read(path: str) -> dict[str, Any]:
    """A facts file, checked as far as it is used. Raises UsageError."""
    text = read_text(path, "a facts file", MOST, code="facts")
    try:
        content: dict[str, Any] = json.loads(text)
        fits = content["schema"] == SCHEMA and content["family"] in FAMILIES
        fits = fits and all(isinstance(fact["verdict"], str) and "value" in fact for fact in content["facts"].values())
    except (ValueError, RecursionError, TypeError, KeyError, AttributeError):
        fits = False
    if not fits:
        raise UsageError(
            f"{path}: not a facts file of this version ({SCHEMA})",
            hint="make one with `handctl prove FAMILY -o FILE`. Nothing was sent.",
            code="facts",
        )
    return content


def shown(content: Mapping[str, Any]) -> dict[str, Any]:
    """The values of the facts that were shown, by name."""
    return {name: fact["value"] for name, fact in content["facts"].items() if fact["verdict"] in SHOWN}


def settings_of(content: Mapping[str, Any], path: str) -> dict[str, str]:
    """The settings that these facts stand for: key -> value. Raises UsageError for a value that is none of its kind."""
    values, found = shown(content), {}
    for name, (key, allowed) in FAMILIES[content["family"]].facts.items():
        value = values.get(name)
        if value is None:
            continue
        if not isinstance(value, str) or value not in allowed:
            raise UsageError(
                f"{path}: {name} has the unknown value {value!r}",
                hint=f"known: {', '.join(allowed)}. Nothing was sent.",
                code="facts",
            )
        if setting := allowed[value] if isinstance(allowed, dict) else value:
            found[key] = setting
    return found


def compared(one: str, other: str, measured: Callable[[str], Collection[str]]) -> Table:
    """Two facts files side by side; the facts of a family that are `measured` need only come close. Raises UsageError."""
    first, second = read(one), read(other)
    if first["family"] != second["family"]:
        raise UsageError(f"{one} is of family {first['family']}, {other} of family {second['family']}", hint="compare two files of one family", code="facts")  # fmt: skip
    a, b, near = shown(first), shown(second), measured(first["family"])
    names = [name for name in {**first["facts"], **second["facts"]} if name in a or name in b]
    rows: list[Row] = [
        {
            "fact": name,
            "a": a.get(name),
            "b": b.get(name),
            "equal": _equal(a[name], b[name], name in near) if name in a and name in b else None,
        }
        for name in names
    ]
    table = Table(rows=rows, columns=DIFFERENCES, view=_view, plain=("fact", "a", "b"))
    if differ := [row["fact"] for row in rows if row["equal"] is False]:
        table.failure = CheckFailed(f"the devices differ in {', '.join(differ)}", code="differ")
    return table


def _equal(one: Any, other: Any, measured: bool) -> bool:
    numbers = isinstance(one, int | float) and isinstance(other, int | float)
    return close(one, other) if measured and numbers else bool(one == other)


def _view(rows: list[Row]) -> list[Grid]:
    words = {True: Cell("yes", "good"), False: Cell("no", "warn"), None: Cell("shown once", "dim")}
    lines = tuple((row["fact"], in_words(row["a"]), in_words(row["b"]), words[row["equal"]]) for row in rows)
    return [Grid(("Fact", "A", "B", "Equal"), lines)]


def words(settings: Mapping[str, str], path: str) -> str:
    """What the facts say, for the message."""
    told = ", ".join(f"{key.replace('_', '-')} {value}" for key, value in settings.items())
    return f"on this device: {told} ({os.path.basename(path)})"
