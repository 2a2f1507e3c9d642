"""The FILE of a simulated bus, as tests write it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

Value = str | int | float | bool


def text(
    model: str,
    devices: Sequence[Mapping[str, Value]] = (),
    masters: Sequence[Mapping[str, Value]] = (),
    **line: Value,
) -> str:
    """A FILE with this line; further keys of [line] as keywords."""
    tables: list[tuple[str, Mapping[str, Value]]] = [("[line]", {"model": model, **line})]
    tables += [("[[device]]", device) for device in devices]
    tables += [("[[master]]", master) for master in masters]
    return "\n".join(
        "\n".join((head, *(f"{key} = {json.dumps(value)}" for key, value in rows.items()), "")) for head, rows in tables
    )
