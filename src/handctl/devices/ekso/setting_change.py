"""A change of one setting: its value before and after, its steps and their limits, and what came of it. Knows no link.

The limits are those of `write_policy`. The result is what the status of a SetValue and the read-back say together.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from handctl.devices.ekso import write_checks
from handctl.devices.ekso.frames import Frame, set_value_body, status_text
from handctl.devices.ekso.parameter_map import NOTHING_SENT, PERCENT_CODES, SETTINGS, Word
from handctl.devices.ekso.write_policy import largest_step, write_limits_of
from handctl.errors import HandctlError, Interrupted

Raws = tuple[int, ...]
"""The 22 settings as raw integers."""
REFUSALS = {
    1: "sit or stand still, then repeat: the device does not accept it now",
    2: "try a smaller step: the device has its own limits, which are not documented",
    3: "use another value: the device does not allow this value or command",
}


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


# -- what came of it -------------------------------------------------------------------------------------------------


def judge(
    where: str,
    change: Change,
    before: Raws,
    after: Raws,
    answer: Frame | None,
    lost: HandctlError | None,
    contradicted: str = "",
) -> HandctlError | None:
    """What the status and the read-back say together; None when the setting is as wanted and nothing else changed.

    `contradicted`: both statuses, where the device answered twice and once refused. That is never a success.
    """
    word = change.param.word
    wanted = (*before[:word], change.new, *before[word + 1 :])
    status = answer.status if answer is not None else None
    accepted = status is not None and status & 0xFF == 0
    if contradicted and after in (wanted, before):
        reads = "the old" if after == before else "the new"
        return write_checks.refusal(
            write_checks.READ_BACK,
            f"{where}: {change.text}: the device answered twice: {contradicted}. It reads back {reads} value",
            "check with `handctl ekso settings` before anything else. Report it",
        )
    if status is not None and not accepted and after == wanted != before:
        return write_checks.refusal(
            write_checks.READ_BACK,
            f"{where}: {change.text}: {status_text(status)}, but the new value reads back",
            "check with `handctl ekso settings` before anything else. Report it",
        )
    if after != wanted and (after != before or accepted):
        return write_checks.refusal(
            write_checks.READ_BACK,
            f"{where}: {change.text}: the read-back differs: {differences(wanted, after)}"
            + (f"; status {status_text(status)}" if status is not None else ""),
            _way_back(before, after),
        )
    if status is not None and not accepted:
        return write_checks.refusal(
            write_checks.STATUS,
            f"{where}: {change.text}: {status_text(status)} (status 0x{status:04X})",
            REFUSALS.get(status & 0xFF, "report it: this status is not documented"),
            status & 0xFF,
        )
    if after == before and status is None:
        if lost is None:
            return Interrupted(f"interrupted. {change.text} was not applied")
        if after == wanted:  # the value that it had: reading it back shows nothing
            return lost.reworded(
                f"{change.text}: its reply was lost, and all settings read as before. {lost.text}",
                hint="check the line, then run it again",
            )
        return lost.reworded(
            f"{change.text}: not applied, the old value was read twice. {lost.text}",
            hint="nothing was changed. Repeat the command if you still want it",
        )
    return None


def _way_back(before: Raws, after: Raws) -> str:
    """What would set the settings that changed to what they were."""
    changed = [param for param in SETTINGS if after[param.word] != before[param.word]]
    if not changed:
        return "check with `handctl ekso settings`. The old value is still set, so nothing needs to be undone"
    # a code that nobody knows is never written
    able = [p for p in changed if p.id is not None and (not p.choices or before[p.word] in p.choices)]
    ways = ", ".join(
        f"`handctl ekso set {shlex.quote(f'{p.name}={p.typed(p.from_raw(before[p.word]))}')}`" for p in able
    )
    left = ", ".join(p.name for p in changed if p not in able)
    text = "check with `handctl ekso settings` first" + (f". Then {ways} undoes the change" if ways else "")
    return text + (f". handctl cannot undo {left}" if left else "")


def differences(expected: Raws, found: Raws) -> str:
    """``step_length 15.50 in, expected 16.00 in; …`` for every word that differs."""
    return "; ".join(
        f"{param.name} is {param.shown(param.from_raw(is_))}, expected {param.shown(param.from_raw(should))}"
        for param, should, is_ in zip(SETTINGS, expected, found, strict=True)
        if should != is_
    )
