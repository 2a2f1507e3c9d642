"""What a transcript shows of a device, for its simulator: `fake://FAMILY?transcript=FILE`. Knows no protocol.

The family's explainer decodes the bytes, and says with `simulated` what its simulator must be told to show the same values: an
option of a LINK (NAME=VALUE), or one of its control commands. Reply times are those of the reads.
"""

from __future__ import annotations

from contextlib import closing
from importlib import import_module

from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.files import transcript
from handctl.link.transcript import DIRECTIONS, parse

MOST_TIMES = 100_000
"""Reply times that are looked at."""
QUANTILES = 20
"""Reply times that are handed on: the middle of each twentieth of all."""


def values_of(kind: str, path: str, *, found: bool = False) -> str:
    """The option `values` of the simulator: as the device was left, or as it was `found`. Raises UsageError."""
    explainer = import_module(FAMILIES[kind].module("explain_bytes")).explainer()
    values: dict[str, float | str] = {}
    moments: dict[str, float] = {}
    asked: dict[str, float | None] = {}
    times: list[float] = []
    written: set[str] = set()
    who = None
    with closing(transcript(path)) as file:
        for entry in parse((line.decode("utf-8", "replace") for line in file), path):
            if entry.mark == "!":
                explainer.flush()
                explainer.event(entry.text)
                asked.clear()
                continue
            for piece in explainer.feed(DIRECTIONS[entry.mark], entry.data, entry.can_id):
                if piece.asks:
                    asked[piece.asks] = entry.time
                if found and piece.direction == "host":  # what it was before is not known, unless it was read
                    written.update(value.name for value in piece.values if value.name not in values)
                if piece.direction != "device" or not piece.frame or piece.problem or not piece.values:
                    continue
                if not piece.answers and entry.can_id is not None:
                    continue  # of another device on the bus
                since = asked.pop(piece.answers, entry.time)
                who = piece.fields.get("id") if who is None else who
                if piece.fields.get("id") != who:
                    continue
                for value in piece.values:
                    if value.value is not None and not (found and (value.name in values or value.name in written)):
                        values[value.name] = value.value
                        moments[value.name] = (since or 0.0) if found else 0.0
                if piece.answers and since is not None and entry.time is not None and len(times) < MOST_TIMES:
                    times.append(max(0.0, entry.time - since))
    if not (values or found):
        raise UsageError(
            f"{path}: shows no value of a device of family {kind}",
            hint="give a transcript that --trace made, of reads such as `dump`",
            code="no-values",
        )
    times.sort()
    some = [times[int((part + 0.5) * len(times) / QUANTILES)] for part in range(QUANTILES)] if times else []
    if isinstance(who, int):
        values.setdefault("id", who)  # whose replies they are, where it was not read
    told = [f"reply-times={','.join(f'{seconds:.6f}' for seconds in some)}"] if some else []
    return ";".join([*told, *explainer.simulated(values, moments)])
