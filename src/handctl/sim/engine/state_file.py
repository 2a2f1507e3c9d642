"""The state file of a simulated device: JSON, written atomically. Loaded only when a state file or a control command is used.

What a device keeps are rows, key in the file -> attribute of each thing, its type, lowest and highest value, and None where
the value may be missing. `kept` writes them, `checked` reads them, `spread` puts them in; so all of a file is checked
before anything of it is used.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from handctl.number_parsing import real_in
from handctl.sim.engine.simulated_device import Model
from handctl.system import disk

FORMAT = "handctl-sim/1"
MOST = 4_000_000
"""Bytes of a state file: more than ten times the largest, that of a BarrettHand with its firmware."""

Fields = Mapping[str, tuple[Any, ...]]


def kept(things: Sequence[Any], fields: Fields) -> dict[str, list[Any]]:
    """The values of these things, a list for each key."""
    return {key: [getattr(thing, field[0]) for thing in things] for key, field in fields.items()}


def checked(state: Mapping[str, Any], fields: Fields, count: int) -> dict[str, list[Any]]:
    """The lists of the file; KeyError, TypeError or ValueError when one does not fit."""
    found = {}
    for key, (_, kind, low, high, *optional) in fields.items():
        values = state[key]
        if len(values) != count or not all((optional and v is None) or low <= v <= high for v in values):
            raise ValueError(f"{key} are not {count} values from {low:g} to {high:g}")
        found[key] = [value if value is None else kind(value) for value in values]
    return found


def spread(things: Iterable[Any], fields: Fields, found: Mapping[str, list[Any]]) -> None:
    """Puts what `checked` gave into these things."""
    for place, thing in enumerate(things):
        for key, field in fields.items():
            setattr(thing, field[0], found[key][place])


def columns(rows: Sequence[Mapping[str, Any]], fields: Fields) -> dict[str, list[Any]]:
    """The lists of a file that has a row for each thing."""
    return {key: [row[key] for row in rows] for key in fields}


def rows_of(lists: Mapping[str, list[Any]]) -> list[dict[str, Any]]:
    """A row for each thing."""
    return [dict(zip(lists, values, strict=True)) for values in zip(*lists.values(), strict=True)]


def real(text: str, low: float, high: float) -> float:
    """A number that somebody typed, in its range. Raises ValueError."""
    value = real_in(text)
    if not low <= value <= high:
        raise ValueError(f"{text!r} is not a number from {low:g} to {high:g}")
    return value


def place_of(name: str, names: Sequence[str]) -> int:
    """The place of a finger that somebody typed among all. Raises ValueError."""
    if name not in names:
        raise ValueError(f"unknown finger {name!r}. Known: {', '.join(names)}")
    return names.index(name)


def load(path: str, device: Model) -> bool:
    """Puts the state into the device; False when there is no such file, ValueError when it cannot be used."""
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder):
        raise ValueError(f"state file {path}: there is no directory {folder}")
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # it could be without end, or never begin
            raise ValueError(f"state file {path} cannot be read: it is a folder, a device or a pipe")
        with open(path, "rb") as file:
            content = file.read(MOST + 1)
        if len(content) > MOST:
            raise ValueError(f"state file {path} cannot be read: larger than {MOST // 1_000_000} MB")
        text = content.decode("utf-8-sig")
    except FileNotFoundError:
        return False
    except (OSError, UnicodeDecodeError) as exc:
        raise ValueError(f"state file {path} cannot be read: {exc}") from exc
    try:
        state = json.loads(text)
        if state["format"] != FORMAT or state["kind"] != device.KIND:
            raise ValueError(f"it is {state['format']!r} of {state['kind']!r}, expected {FORMAT!r} of {device.KIND!r}")
        device.restore(state)
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as exc:
        reason = f"{exc} is missing" if isinstance(exc, KeyError) else str(exc)
        raise ValueError(f"state file {path} is damaged or foreign ({reason}). Delete it to start over") from exc
    return True


def save(path: str, device: Model) -> None:
    """Replace the file. Raises OSError."""
    state = {"format": FORMAT, "kind": device.KIND, "simulated": True, **device.snapshot()}
    try:
        replace(path, (json.dumps(state) + "\n").encode())
    except OSError as exc:
        raise OSError(f"state file {path} cannot be written: {exc.strerror or exc}") from exc


def replace(path: str, content: bytes) -> None:
    """Whole or not at all: a temporary file beside it, synced, then renamed. A symbolic link stays one. Raises OSError."""
    target = os.path.realpath(path)
    temporary = f"{target}.{os.getpid()}.tmp"
    try:
        with open(temporary, "wb") as file:
            file.write(content)
            file.flush()
            disk.sync(file.fileno())
        os.replace(temporary, target)
    except BaseException:
        if os.path.exists(temporary):
            os.unlink(temporary)
        raise
