"""What a command means to do, found out by its own body: up to the point at which it would use the device, or ask."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import click

from handctl.frame.premises import check_before
from handctl.frame.run import Run
from handctl.frame.steps import plan_table
from handctl.model.guide import Guide

if TYPE_CHECKING:
    from handctl.frame.family import Family
    from handctl.frame.options import Settings
    from handctl.link import Link
    from handctl.model.param import Step
    from handctl.model.result import Table


class Plan(NamedTuple):
    """What a command would do.

    question  what it asks before, "" = nothing
    word      that must be typed for a yes, "" = none
    steps     what it writes, as far as that is known without the device
    """

    question: str = ""
    word: str = ""
    steps: tuple[Step, ...] = ()


class _UsesDeviceError(BaseException):
    """From here on the body would need the device. No Exception: no body may take it for a failure."""


class Planning(Run):
    """A run that ends where the device would be used. Sends nothing, shows nothing, asks nothing."""

    def __init__(self, ctx: click.Context, settings: Settings, family: Family | None) -> None:
        super().__init__(ctx, settings, family)
        self._plan = Plan()

    def person(self) -> Guide:
        return Guide()

    def plan(self, body: Callable[[], Any]) -> Plan:
        """What the body means to do. Raises UsageError and what else it finds wrong without the device."""
        check_before(self)
        with suppress(_UsesDeviceError):
            body()
        return self._plan

    def device(self) -> NoReturn:
        self.link_name()
        raise _UsesDeviceError

    def open_link(self, *, again: bool = False, baud: int | None = None) -> Link:
        return self.device()

    def planned(self, steps: Sequence[Step]) -> Table | None:
        self._plan = self._plan._replace(steps=tuple(steps))
        return plan_table(steps) if self.settings.dry_run else None

    def confirm(self, question: str, steps: Sequence[Step] = (), *, word: str = "") -> None:
        self._plan = Plan(question, word, tuple(steps) or self._plan.steps)
        raise _UsesDeviceError

    def need_answer(self, question: str) -> None:
        self._plan = self._plan._replace(question=question)

    def offer(self, question: str) -> bool:
        return False
