"""Pair two hands: find out which is left, and give each its own id or address (rh56 §6, §7). Knows no file.

Both hands of a pair come with id 1 and one IP address, and no register holds a side. So one hand alone gets another
id or address while the other is unplugged; then each moves a finger, and whoever stands there says which one it was.

    one line, two ids       ->  move, ask                       two links  ->  move, ask
    one line, one id        ->  unplug one, new id (RAM), plug in, look for both, save, move, ask
    one address             ->  switch one off, new address, save, power-cycle, switch on, look for both, move, ask
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from handctl.devices.inspire import id_baud_save_reset
from handctl.devices.inspire.duplicate_id import naming_duplicate_id, refuse_duplicate_id
from handctl.devices.inspire.hand import baud_and_network
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.hand.motion import nudge, plan_nudge
from handctl.devices.inspire.hand.probe import TARGET, fingerprint
from handctl.devices.inspire.scan import sweep
from handctl.errors import Aftermath, CheckFailed, HandctlError, Hint, LinkError, NoAnswer, NotConfirmed, UsageError
from handctl.link import ByteLink
from handctl.model.prompts import Prompts
from handctl.model.scan_task import ScanTask
from handctl.model.stop_on_interrupt import on_early_end
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.command.run import Run

LEFT, RIGHT = "left", "right"
OTHER = {LEFT: RIGHT, RIGHT: LEFT}
NOBODY = Aftermath("no hand is named", joint=". ")
AGAIN = "run `handctl hand pair` again: it continues from the present state"
LOOKS = 3
SEARCH_SECONDS = 6.0
"""So long a silent line is asked for both hands."""
WAIT_SECONDS, AGAIN_SECONDS = 120.0, 1.0
"""How long a hand is waited for whose power or network was switched, and how often it is looked for."""


class Paired(NamedTuple):
    """One hand with its link, id and side."""

    hand: Hand
    link: str
    side: str


class Bench:
    """The hands that a command reaches, and whoever stands there."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self.prompts, self.confirm = run.prompts, run.confirm
        self.elsewhere: Callable[[str], Hand] = run.device_at

    def hand(self, number: int | None = None) -> Hand:
        """A hand on the first link, with this id; nothing is known of it yet."""
        run = self._run
        if run.opened is None:
            run.device()
        assert run.link is not None
        settings = run.settings._replace(id=number) if number is not None else run.settings
        hand: Hand = run.family.open(run.link, settings, run.journal)
        return hand

    def again(self) -> Hand:
        """The same behind the first link when that is opened again. Raises LinkError."""
        self._run.open_link(again=True)
        return self.hand()


def pair(
    bench: Bench, link: str, other: str | None, *, first: str | None = None, address: str | None = None
) -> list[Paired]:
    """Find both hands behind `link`, or behind it and `other`, and tell which is left and which is right.

    first    side of the first hand: by id or by link, or the one that gets a new id or address. None = found out by a movement
    address  what the first hand at one shared IP address gets, None = the next one

    Raises NotConfirmed where nobody can answer, Interrupted on Ctrl-C: no hand is named then, and both stand still.
    """
    if first is None and not bench.prompts.present:
        raise NotConfirmed(
            "someone has to see which hand moves, but this is not an interactive terminal",
            hint="specify the side with --first left or --first right: then nothing moves. Nothing was sent.",
        )
    try:
        with on_early_end(NOBODY, by=HandctlError):
            return _paired(bench, link, other, first, address)
    except HandctlError as exc:
        exc.hint = exc.hint or AGAIN
        raise


def _paired(bench: Bench, link: str, other: str | None, first: str | None, address: str | None) -> list[Paired]:
    if other is not None:
        found = [(bench.hand(), link), (bench.elsewhere(other), other)]
    elif baud_and_network.over_network(bench.hand()):
        found = _one_address(bench, link, address)
    else:
        found = [(hand, link) for hand in _one_line(bench)]
    for hand, _ in found:
        hand.identify()
    if other is not None and first is not None:
        _two(*(hand for hand, _ in found))
    sides = (first, OTHER[first]) if first is not None else _seen(bench, [hand for hand, _ in found])
    return [Paired(hand, where, side) for (hand, where), side in zip(found, sides, strict=True)]


# -- which is which -------------------------------------------------------------------------------------------------


def _seen(bench: Bench, hands: Sequence[Hand]) -> tuple[str, str]:
    """Move a finger of each hand, one after the other; the sides as they are seen."""
    plans = [plan_nudge(hand) for hand in hands]
    steps = [step for hand, plan in zip(hands, plans, strict=True) for step in hand.plan(plan.changes)]
    moves = ", then ".join(plan.question for plan in plans)
    bench.confirm(f"This moves {moves}. Keep both hands empty and clear", steps)
    sides = []
    for hand, plan in zip(hands, plans, strict=True):
        nudge(hand, plan, bench.prompts)
        side = bench.prompts.choose(f"{hand.bus.where}: which hand moved", (LEFT, RIGHT))
        if not side:
            raise NotConfirmed(
                f"{hand.bus.where}: your answer names neither the left nor the right hand",
                hint="run the command again and watch both hands. The finger is back in its old position",
                code="not-seen",
            )
        if side in sides:
            raise CheckFailed(
                f"{hand.bus.where}: the {side} hand moved both times",
                hint="check the cables: both connections lead to the same hand, or both hands have the same id",
                code="same-hand",
            )
        sides.append(side)
    return sides[0], sides[1]


def _two(one: Hand, other: Hand) -> None:
    """Raise CheckFailed where nothing shows that two LINKs lead to two hands: no reading differs, and no hand moves."""
    for _ in range(LOOKS):
        if one.found().model != other.found().model or fingerprint(one) != fingerprint(other):
            return
    raise CheckFailed(
        f"{one.bus.where} and {other.bus.where} give the same readings each time: both connections may lead to the same hand",
        hint="leave out --first: then each hand moves a finger, and you say which one moved",
        code="same-hand",
    )


def ids_on(hand: Hand, prompts: Prompts) -> list[int]:
    """The ids that answer to `hand` at its speed, in a protocol that anybody answers in, also where two hands have one."""
    protocol = "auto" if len(hand.wires) > 1 else "eb90" if hand.bus.wire == "eb90" else "modbus"
    link = hand.link
    baud = link.baud if isinstance(link, ByteLink) else None
    task = ScanTask(
        find_all=True, baud=baud or 0, silence=SEARCH_SECONDS, own={"protocol": protocol}, progress=prompts.progress
    )
    sweep(link, hand.journal, hand.bus.bound, task, [TARGET])
    prompts.done()
    return sorted({row["id"] for row in task.rows} | {*task.twins})


# -- one serial line or CAN bus ---------------------------------------------------------------------------------------


def _one_line(bench: Bench) -> list[Hand]:
    """The two hands on one line, each with its own id."""
    hand = bench.hand()
    ids = ids_on(hand, bench.prompts)
    if not ids:
        raise NoAnswer(
            f"{hand.link.name}: no hand replies",
            hint=Hint("check power, wiring and baud rate: {} tries all baud rates", "hand scan"),
        )
    if len(ids) > 2:
        raise CheckFailed(
            f"{hand.link.name}: {plural(len(ids), 'device')} reply, with the ids {', '.join(map(str, ids))}",
            hint="leave only the two hands on the line. Nothing was written.",
            code="too-many",
        )
    return [bench.hand(number) for number in ids] if len(ids) == 2 else _apart(bench, ids[0])


def _apart(bench: Bench, number: int) -> list[Hand]:
    """Two hands with one id: the one that stays plugged in gets another. Saved only when both have answered."""
    new = 2 if number == 1 else 1
    _done(
        bench,
        f"Only id {number} replies. Two hands with the same id both obey it.\n"
        f"Unplug the data cable of one hand. The other one gets id {new}. Then press Enter",
    )
    hand = bench.hand(number)
    with naming_duplicate_id(hand):
        hand.know()
    refuse_duplicate_id(hand)
    steps = hand.plan([(hand.map["id"].each[0], new)])
    saving = bench.hand(new).trigger_step("save", "save to flash")
    bench.confirm(
        f"This changes id {number} to {new} at once, on the connected hand, and saves it once both hands reply",
        [*steps, saving],
    )
    id_baud_save_reset.change_id(hand, new, saved_next=True)
    with on_early_end(
        Aftermath(
            f"one hand has id {new} until the next power-cycle",
            Hint("{} keeps it", f"hand save --id {new}"),
            joint=". ",
        ),
        by=HandctlError,
    ):
        _done(bench, "Plug the other hand back in, and keep this one switched on. Then press Enter")
        missing = [one for one in (number, new) if not id_baud_save_reset.probe(hand.bus, one)]
        if missing:
            raise CheckFailed(
                f"{hand.link.name}: no hand responds to id {' or '.join(map(str, missing))}",
                hint="check the cable of the other hand. A power-cycle of both hands brings back the saved ids",
                code="gone",
            )
        changed = bench.hand(new)
        changed.know()
        id_baud_save_reset.save(changed, bench.prompts)
    return [changed, bench.hand(number)]


# -- one IP address ---------------------------------------------------------------------------------------------------


def _one_address(bench: Bench, link: str, address: str | None) -> list[tuple[Hand, str]]:
    """Two hands with one IP address: the one that is on gets another, then both are looked for."""
    prompts = bench.prompts
    _done(
        bench,
        f"Two hands with the same IP address take turns replying at {link}.\n"
        "Switch one hand off. The other one gets a new address. Then press Enter",
    )
    hand = bench.again()
    old = baud_and_network.held(hand)
    octets = baud_and_network.octets_of(address) if address is not None else baud_and_network.next_to(old)
    if octets == old:
        raise UsageError(
            f"{address} is the address that both hands have", hint="choose another --address. Nothing was sent."
        )
    new = ".".join(map(str, octets))
    target = baud_and_network.link_of(link, octets)
    steps = hand.plan(baud_and_network.address_plan(hand, octets))
    steps.append(hand.trigger_step("save", "save to flash"))
    bench.confirm(
        f"This changes the address {'.'.join(map(str, old))} to {new}. It takes effect after a power-cycle",
        steps,
        word=new,
    )
    baud_and_network.change_network(hand, octets, prompts, cycled_next=True)
    _done(bench, f"Power-cycle this hand, and leave the other one off. Then press Enter to look for it at {new}")
    hand.link.power_cycle()
    moved = _wait_for(bench, lambda: bench.elsewhere(target), octets, hand)
    with on_early_end(Aftermath(f"one hand has the address {new} now, and keeps it", joint=". "), by=HandctlError):
        _done(bench, "Switch the other hand on. Then press Enter")
        stayed = _wait_for(bench, bench.again, old, hand)
    return [(moved, target), (stayed, link)]


def _wait_for(bench: Bench, opened: Callable[[], Hand], octets: Sequence[int], clock: Hand) -> Hand:
    """The hand that holds this address where `opened` finds one. Raises CheckFailed for another, or what kept it from being found."""
    link, text = clock.link, ".".join(map(str, octets))
    end = link.deadline(WAIT_SECONDS)
    while True:
        bench.prompts.progress(f"waiting for the hand at {text}, {end.remaining:.0f} s left")
        try:
            hand = opened()
            found = baud_and_network.held(hand)
            break
        except (LinkError, NoAnswer) as exc:
            if end.expired or clock.bus.over:
                bench.prompts.done()
                raise exc.reworded(
                    f"no hand at {text}: {exc.text}",
                    hint=f"give this computer an address such as {baud_and_network.laptop_for(octets)}, mask 255.255.255.0, and run the command again",
                ) from exc
            link.sleep(AGAIN_SECONDS)
    bench.prompts.done()
    if found != list(octets):
        raise CheckFailed(
            f"{hand.bus.where}: the hand there has the address {'.'.join(map(str, found))}, not {text}",
            hint=Hint(
                "check which hand is switched on: only one should be changed. {} shows its address", "hand network"
            ),
            code="other-address",
        )
    return hand


def _done(bench: Bench, what: str) -> None:
    """Ask the person to do something. Raises NotConfirmed without a person."""
    if not bench.prompts.wait_for_enter(f"{what}."):
        raise NotConfirmed(
            f"this step has to be done by hand, next to the hands: {what.splitlines()[-1]}",
            hint="run the command on a terminal next to the hands",
            code="nobody-there",
        )
