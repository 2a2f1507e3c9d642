"""What came of one SetValue: what its status and the read-back say together. Knows no link."""

from __future__ import annotations

import shlex

from handctl.devices.ekso import write_checks
from handctl.devices.ekso.frames import Frame, status_text
from handctl.devices.ekso.parameter_map import SETTINGS
from handctl.devices.ekso.setting_change import Change
from handctl.errors import HandctlError, Interrupted

Raws = tuple[int, ...]
"""The 22 settings as raw integers."""
REFUSALS = {
    1: "sit or stand still, then repeat: the device does not accept it now",
    2: "try a smaller step: the device has its own limits, which are not documented",
    3: "use another value: the device does not allow this value or command",
}


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
