"""A change of one setting: its value before and after, its steps, and their limits. Knows no link.

The limits are those of `write_policy`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from handctl.devices.ekso import write_checks
from handctl.devices.ekso.frames import Frame, set_value_body
from handctl.devices.ekso.parameter_map import (
    NOTHING_SENT,
    PERCENT_CODES,
    Word,
)
from handctl.devices.ekso.write_policy import largest_step, write_limits_of


class Change(NamedTuple):
    """One setting to be written: raw values before and after."""

    param: Word
    old: int
    new: int

    @property
    def text(self) -> str:
        """``step_length 15.50 in -> 16.00 in``."""
        before, after = (self.param.shown(self.param.from_raw(raw)) for raw in (self.old, self.new))
        return f"{self.param.name} {before} -> {after}"

    def shown_by(self, answer: Frame | None, after: Sequence[int]) -> bool:
        """Whether the read-back shows that it was taken; of a value that it had already only the status can."""
        accepted = answer is not None and answer.status & 0xFF == 0
        return after[self.param.word] == self.new and (self.old != self.new or accepted)

    @property
    def body(self) -> bytes:
        """What its SetValue holds."""
        assert self.param.id is not None
        return set_value_body(self.param.id, self.new)

    @property
    def asked_twice(self) -> bool:
        """Whether it enters or leaves a mode that is asked for twice."""
        return any(self.param.choices.get(raw) in write_limits_of(self.param).twice for raw in (self.old, self.new))

    def most(self, override: bool) -> int | None:
        """The largest step of this change as a raw value, None where the policy has none."""
        param, limits = self.param, write_limits_of(self.param)
        if limits.step is None or (param.choices and not {self.old, self.new} <= set(PERCENT_CODES)):
            return None
        return None if override and not limits.firm else param.to_raw(limits.step)

    def way(self, override: bool) -> list[Change]:
        """From the old value to the new one in permitted steps."""
        step = self.most(override)
        if step is None or abs(self.new - self.old) <= step:
            return [self]
        places = [*range(self.old, self.new, step if self.new > self.old else -step), self.new]
        return [Change(self.param, *pair) for pair in pairwise(places)]

    def check_code(self) -> None:
        """Raise UsageError for an unknown code."""
        if self.param.choices and self.new not in self.param.choices:
            text = f"{self.text}: this code is not documented, so handctl does not write it"
            raise write_checks.refusal(write_checks.LISTED, text, NOTHING_SENT)

    def check_step(self, override: bool) -> None:
        """Raise UsageError for a step beyond the policy without `override`."""
        if len(self.way(override)) == 1:
            return
        firm = write_limits_of(self.param).firm
        instead = "there is no override for leg lengths" if firm else "--override-step-limit"
        raise write_checks.refusal(
            write_checks.STEP,
            f"{self.text}: more than {largest_step(self.param)} at once is beyond this tool's policy (not the device's limit)",
            f"use smaller steps{': ' if firm else ', or '}{instead}. {NOTHING_SENT}",
        )
