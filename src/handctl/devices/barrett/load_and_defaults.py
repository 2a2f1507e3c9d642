"""FLOAD, PLOAD, FDEF and PDEF: what they did to the values in RAM, as far as reading them back shows it (barrett §5.2.2, §5.2.3).

The prompt shows only that the command has ended. Factory values are documented, so RAM is compared with them. The EEPROM
cannot be read: what shows a load is a value that has changed, or RAM that is now as handctl saved it last.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from handctl.devices.barrett import eeprom_saves
from handctl.devices.barrett.device import BarrettHand, step_of
from handctl.devices.barrett.gcl import passthrough
from handctl.devices.barrett.gcl.codec import motors_of, split
from handctl.devices.barrett.parameter_map import check_careful, standard
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, Hint
from handctl.model.param import Element
from handctl.model.result import Table
from handctl.wording import plural, some

NAMED = 6
"""Values that a message names."""


def load(hand: BarrettHand, commands: Sequence[str]) -> Table:
    """Send FLOAD and PLOAD, and say of each whether it was seen to take effect."""
    saved = eeprom_saves.SaveJournal(hand).last
    table, before, now = _sent(hand, commands)
    for command in commands if now else ():
        mine = _of(command, now)
        changed = [name for name in mine if name in before and before[name] != mine[name]]
        other = [name for name in mine if name in saved and saved[name] != mine[name]]
        as_saved = mine.keys() <= saved.keys() and not other
        if as_saved or changed:
            text = (
                "as handctl saved them last" if as_saved else f"{len(changed)} of {plural(len(mine), 'value')} changed"
            )
            hand.journal.ledger.confirm(f"read back: {text}", step_of(command))
            hand.journal.info("loaded", f"{command}: {text}{_list(changed)}")
        else:
            hand.journal.ledger.doubt("acknowledged, and no value has changed", step_of(command))
            hand.journal.info(
                "load-unseen",
                f"{command} was acknowledged, but no value has changed: either RAM already held the saved values, or they were not loaded",
            )
        loaded = [(element, mine[element.full_name]) for element in _settings() if element.full_name in mine]
        for objection in check_careful(loaded, force=True):
            hint = Hint(
                "set another value, or {} sets the factory values. Openings that may deform the clutch are refused",
                "barrett defaults",
            )
            hand.journal.warn("careful", f"{command} has loaded {objection}", hint=hint)
        if other:
            text = f"{command}: not as handctl saved them last{_list(other)}"
            hand.journal.warn("saved-elsewhere", text, hint="another program may have saved since: check these values")
    return table


def defaults(hand: BarrettHand, commands: Sequence[str]) -> Table:
    """Send FDEF and PDEF, and compare what they set with the documented factory values; a value that stayed another is a failure."""
    table, before, now = _sent(hand, commands)
    for command in commands if now else ():
        mine = _of(command, now)
        off = [name for name, value in mine.items() if value != eeprom_saves.default_of(name)]
        stuck = [name for name in off if before.get(name, mine[name]) == mine[name]]
        if not off:
            hand.journal.ledger.confirm("read back: factory values", step_of(command))
        elif stuck:
            hand.journal.ledger.doubt("reads back otherwise", step_of(command))
            table.failure = table.failure or CheckFailed(
                f"{hand.link.name}: {command} was acknowledged, but {len(stuck)} of {plural(len(mine), 'value')} did not become the documented factory value{_list(stuck)}",
                hint=Hint("compare them with {}, and set them: this firmware may have other factory values", "barrett describe"),
                code="read-back",
            )  # fmt: skip
        else:
            hand.journal.ledger.confirm(
                f"read back: changed, {len(off)} to other than factory values", step_of(command)
            )
            text = f"{command} has set {plural(len(off), 'value')} to another one than the documented factory value{_list(off)}"
            hand.journal.warn("other-defaults", text, hint=Hint("compare them with {}", "barrett describe"))
    return table


def _settings() -> list[Element]:
    return [element for param in standard() if param.writable for element in param.each]


def _sent(hand: BarrettHand, commands: Sequence[str]) -> tuple[Table, Mapping[str, int], Mapping[str, int]]:
    """The answers, and the values in RAM before and after; without values where the hand did not tell them."""
    try:
        before = eeprom_saves.present(hand)
    except DeviceRefused:  # such as over its temperature limit, which FDEF may set
        before = {}
    table = passthrough.run_all(hand, map(passthrough.ScriptLine, commands), keep_going=False)
    if table.failure is not None:
        return table, before, {}
    try:
        return table, before, eeprom_saves.present(hand)
    except HandctlError as exc:
        for command in commands:
            hand.journal.ledger.doubt("acknowledged, and the values could not be read back", step_of(command))
        table.failure = exc
        return table, before, {}


def _of(command: str, values: Mapping[str, int]) -> dict[str, int]:
    """Those of the values that this command sets: of its motors, or the hand's own."""
    prefix, known, _ = split(command)
    assert known is not None
    motors = motors_of(prefix) if known.name.startswith("F") else [""]
    return {name: value for name, value in values.items() if name.partition(".")[2] in motors}


def _list(names: Sequence[str]) -> str:
    return f": {some(names, NAMED)}" if names else ""
