"""A change of one setting, and the step limits that this tool keeps to (`ekso policy` shows them). Never limits of the device."""

from __future__ import annotations

from typing import NamedTuple

from handctl.devices.ekso import gates
from handctl.devices.ekso.map import ASSIST, NOTHING_SENT, PERCENT_CODES, Word


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


def check_code(change: Change) -> None:
    """Raise UsageError for a code that nobody knows."""
    if change.param.choices and change.new not in change.param.choices:
        raise gates.refusal(
            gates.LISTED, f"{change.text}: this code is not documented, so handctl does not write it", NOTHING_SENT
        )


def most(change: Change, override: bool) -> int | None:
    """The largest step of this change as a raw value, None where the policy has none."""
    param = change.param
    if param.step is None or (param.choices and not {change.old, change.new} <= set(PERCENT_CODES)):
        return None
    return None if override and not param.firm else param.to_raw(param.step)


def way(change: Change, override: bool) -> list[int]:
    """The raw values on the way from the old to the new one in permitted steps; the new one is the last."""
    step = most(change, override)
    if step is None or abs(change.new - change.old) <= step:
        return [change.new]
    step = step if change.new > change.old else -step
    return [*range(change.old + step, change.new, step), change.new]


def check_change(change: Change, override: bool) -> None:
    """Raise UsageError for an unlisted code, or a step beyond the policy without `override`."""
    check_code(change)
    check_step(change, override)


def check_step(change: Change, override: bool) -> None:
    """Raise UsageError for a step beyond the policy without `override`."""
    param = change.param
    step = most(change, override)
    if step is None or abs(change.new - change.old) <= step:
        return
    instead = (
        "use smaller steps: there is no override for leg lengths"
        if param.firm
        else "use smaller steps, or --override-step-limit"
    )
    raise gates.refusal(
        gates.STEP,
        f"{change.text}: more than {limit_of(param)} at once is beyond this tool's policy (not the device's limit)",
        f"{instead}. {NOTHING_SENT}",
    )


def limit_of(param: Word) -> str:
    """The largest step in words: ``10 %``, ``1.00 in``."""
    return "10 %" if param.choices is ASSIST else param.shown(param.step or 0)


def needs_second_answer(change: Change) -> bool:
    """Whether it enters or leaves a mode that is asked for twice."""
    return any(change.param.choices.get(raw) in change.param.twice for raw in (change.old, change.new))
