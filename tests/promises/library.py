"""What handctl-library(7) says: methods are commands, classes are there, and every stream of a simulated device ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import click

import handctl
from handctl.api import methods
from handctl.errors import NoAnswer
from handctl.families import FAMILIES
from handctl.link.fake import FakeFrames, FakeLink
from tests.contract.facts import facts_of
from tests.promises.cells import Cell, commands, made

MOST = 5000
"""Times that a stream of 0.2 s may listen: each takes its time on the wire."""


class Endless(AssertionError):
    """A stream that time does not end."""


class Counted:
    """Counts how often a link is listened to, and ends what has no end."""

    def __init__(self) -> None:
        self.count = 0

    def of(self, listen: Callable[..., Any]) -> Callable[..., Any]:
        def counted(link: Any, *args: Any, **more: Any) -> Any:
            self.count += 1
            if self.count > MOST:
                raise Endless(f"listened {MOST} times in 0.2 s")
            return listen(link, *args, **more)

        return counted


def cells() -> Iterator[Cell]:
    for family in FAMILIES:
        yield Cell(f"{family}: methods are the commands", partial(_methods, family))
        yield Cell(f"{family}: handctl.hands.{family.capitalize()}", partial(_class, family))
        for name, command in commands(family):
            options = {word for param in command.params if isinstance(param, click.Option) for word in param.opts}
            if "--duration" in options:
                yield Cell(f"{family} {name} of 0.2 s", partial(_ends, family, name, {}))
                if "--rate" in options:
                    yield Cell(f"{family} {name} of 0.2 s at any rate", partial(_ends, family, name, {"rate": 0}))


def _methods(family: str, _folder: Path) -> None:
    assert {name.replace(" ", "_").replace("-", "_") for name, _ in commands(family)} == {
        name.rstrip("_") for name in methods(family)
    }


def _class(family: str, _folder: Path) -> None:
    import sys

    code = f"import handctl; handctl.hands.{family.capitalize()}"
    loaded = {name: sys.modules.pop(name) for name in list(sys.modules) if name == "handctl.hands"}
    kept = handctl.__dict__.pop("hands", None)
    try:
        exec(code, {})  # noqa: S102 - a line of the guide
    finally:
        sys.modules.update(loaded)
        if kept is not None:
            handctl.hands = kept


def _ends(family: str, name: str, more: dict[str, Any], folder: Path) -> None:
    """On virtual time: by the time that passes, not by the number of samples."""
    counted = Counted()
    made(folder)
    state = dict(pair.split("=") for pair in facts_of(family).state.split("&") if pair)
    method = next(method for method in methods(family).values() if method.words == name)
    given = [str(folder / "file.csv")] if name == "log" else []
    live = {word for word in ("live", "watch") if any(word == argument.name for argument in method.arguments)}
    more = {**more, **dict.fromkeys(live, True)}
    given += ["index.m1=100"] if name == "currents" else []
    with (
        mock.patch.object(FakeLink, "read", counted.of(FakeLink.read)),
        mock.patch.object(FakeFrames, "receive", counted.of(FakeFrames.receive)),
        handctl.simulate(family, **state) as device,
    ):
        rows = getattr(device, method.name)(
            *given, duration=0.2, **{**more, **({"confirm": True} if method.command.writes else {})}
        )
        if method.command.streams:
            with suppress(NoAnswer) if name == "listen" else nullcontext():  # most devices say nothing unasked
                for number, _ in enumerate(rows):
                    if number > MOST:
                        raise Endless(f"{number} samples in 0.2 s")
