"""A change of one setting: its limits, whether the device stands still for it, and its result. Knows no link.

The limits are those of `policy`.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from handctl.devices.ekso import write_checks
from handctl.devices.ekso.frames import Frame, set_value_body, status_text
from handctl.devices.ekso.map import (
    DATA,
    DRIVEN,
    NOTHING_SENT,
    PERCENT_CODES,
    SETTINGS,
    SITTING,
    STANDING,
    Word,
    boot_ms,
    state_text,
)
from handctl.devices.ekso.policy import MOST_SPEED, largest_step, write_limits_of
from handctl.errors import HandctlError, Interrupted
from handctl.model.sampling import Span


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


# -- whether the wearer keeps still: two looks at GetData, before any setting is written --------------------------------


STATE = 18
JOINTS = tuple(param for param in DATA if param.name.endswith(("hip_angle", "knee_angle")))


class StillnessCheck(NamedTuple):
    """Two looks: State of the one that is judged, the settings that are written only while sitting, the words of both, and
    the ms of BootTime and those of ours between them."""

    state: int
    sitting: Sequence[Word]
    first: Sequence[int]
    second: Sequence[int]
    passed: int
    span: Span


def _posture(seen: StillnessCheck) -> str | None:
    if seen.state >> 12 in (SITTING, STANDING):
        return None
    return f"the posture is {state_text(seen.state)}, neither sitting nor standing"


def _driven(seen: StillnessCheck) -> str | None:
    return f"the joints are being driven: {state_text(seen.state)}" if seen.state & DRIVEN else None


def _seated(seen: StillnessCheck) -> str | None:
    if not seen.sitting or seen.state >> 12 == SITTING:
        return None
    names = ", ".join(param.name for param in seen.sitting)
    return f"{names}: only while sitting, but the state is {state_text(seen.state)}"


def _reboot(seen: StillnessCheck) -> str | None:
    return "BootTime went back: the device has restarted" if seen.passed >= 2**31 else None


def _fresh(seen: StillnessCheck) -> str | None:
    if seen.span.fits(seen.passed):
        return None
    return f"BootTime advanced by {seen.passed} ms in {seen.span}: the values are not fresh"


def _speed(seen: StillnessCheck) -> str | None:
    for param in JOINTS:
        turned = abs(param.raw_of(seen.second[param.word]) - param.raw_of(seen.first[param.word])) / 100
        speed = turned / (seen.passed / 1000 or 1e-3)
        if speed >= MOST_SPEED:
            return f"{param.name} moves at {speed:.1f} deg/s"
    return None


STILL: Mapping[str, Callable[[StillnessCheck], str | None]] = {
    write_checks.POSTURE: _posture, write_checks.DRIVEN: _driven, write_checks.SEATED: _seated,
    write_checks.REBOOT: _reboot, write_checks.FRESH: _fresh, write_checks.SPEED: _speed,
}  # fmt: skip


def moving(first: Sequence[int], second: Sequence[int], span: Span, sitting: Sequence[Word] = ()) -> str | None:
    """Why two GetData `span` apart show that the wearer moves; None if they show a wearer who sits or stands still.

    `sitting` are settings that are written only while sitting.
    """
    passed = (boot_ms(second) - boot_ms(first)) % 2**32
    looks = [StillnessCheck(words[STATE] & 0xFFFF, sitting, first, second, passed, span) for words in (first, second)]
    found = [STILL[gate](look) for look in looks for gate in write_checks.at(write_checks.LOOK)]
    found += [] if any(found) else [STILL[gate](looks[0]) for gate in write_checks.at(write_checks.LOOKS)]
    return next(filter(None, found), None)


# -- what came of one SetValue: what its status and the read-back say together ------------------------------------------


Raws = tuple[int, ...]
"""The 22 settings as raw integers."""
REFUSALS = {
    1: "sit or stand still, then repeat: the device does not accept it now",
    2: "try a smaller step: the device has its own limits, which are not documented",
    3: "use another value: the device does not allow this value or command",
}


def judge(
    where: str, change: Change, before: Raws, after: Raws, answer: Frame | None, lost: HandctlError | None
) -> HandctlError | None:
    """What the status and the read-back say together; None when the setting is as wanted and nothing else changed."""
    word = change.param.word
    wanted = (*before[:word], change.new, *before[word + 1 :])
    status = answer.status if answer is not None else None
    accepted = status is not None and status & 0xFF == 0
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
