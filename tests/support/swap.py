"""Attributes that are others for a while: as `mock.patch.object`, whose ceremony some ten thousand tests and commands would pay."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

NONE = object()


@contextmanager
def swapped(*places: tuple[Any, str, Any]) -> Iterator[None]:
    """Let each (thing, name) be the value."""
    before = [(thing, name, vars(thing).get(name, NONE)) for thing, name, _ in places]
    try:
        for place in places:
            setattr(*place)
        yield
    finally:
        for thing, name, was in before:
            if was is NONE:
                delattr(thing, name)
            else:
                setattr(thing, name, was)
