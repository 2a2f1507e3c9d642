"""The stop of an EH55BF1: all forces to 0, then every finger is commanded to hold its position. The manual has no stop command.

The forces need no place. Their answer tells where the fingers are (exo §2.2.1), and that a hand is there at all: so a hold
is always from a place just read, and one that acknowledges no forces is asked for it. A finger whose reading is no position is left alone, and the others are held. The same bytes would be a write to a wrist: one quick read looks for that first.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

from handctl.devices.inspire import eb90
from handctl.devices.inspire.exo.register_map import EXO, FINGERS
from handctl.devices.inspire.register_map import ALONE, NEAR, NOISE
from handctl.devices.inspire.stop_requests import (
    QUICK,
    REFUSED,
    TAKEN,
    Axes,
    Wire,
    answer,
    asks,
    check_again,
    hold_target,
    instead,
    lead,
)
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError
from handctl.model.param import Step
from handctl.model.stop_repetition import HoldTries, behind, interval, repeat_until_answered
from handctl.model.stop_sequence import Pieces, Read, StopContext, Stopped, StopSequence, StopStep

POSITION_SET, FORCE_SET, POSITION_ACTUAL = (
    EXO[name].address for name in ("position_set", "force_set", "position_actual")
)
MEASURED = 6
"""Fingers, and the rotation of the thumb, which nothing drives."""
OF_A_WRIST = "run `handctl wrist stop`"
POWER = "switch the power off if the hand still pushes or moves"


def stop_steps(context: StopContext) -> StopSequence:
    """Forces to 0, then a hold, each repeated until the hand has acknowledged it; then a second check."""
    number, came, wire = context.number, list[bytes](), Wire(context, first=lead(context))
    step, wrist = asks(number, eb90.WRIST_READ)
    if not context.proven:
        came += yield StopStep(step, QUICK, lambda pieces: answer(pieces, wrist), reads=True, ahead=wire.first)
        if answer(came, wrist):
            return Stopped(
                "this is a wrist, not an exoskeleton hand. Nothing was written",
                OF_A_WRIST,
                DeviceRefused,
                stranger=True,
            )
    force = Step("all forces to 0", eb90.command_request(number, eb90.FORCE_COMMAND, [0] * len(FINGERS)), moves=True)
    told = eb90.command_reply_prefix(number, eb90.FORCE_COMMAND)
    meaning, late, verdict = "", False, None
    answers: Pieces = []
    released, acknowledges = False, True
    tries = HoldTries(context)
    while tries.another():
        heard = where = None
        if acknowledges:
            forced = yield from repeat_until_answered(
                context, force, lambda pieces: answer(pieces, told), ahead=wire.first
            )
            came += forced.came
            acknowledges = forced.found is not None
            if forced.found is not None:
                released, heard, where = True, forced, forced.found.payload
        if not acknowledges:
            where = yield from _asked_once(wire)
        if where is None or answer(came, wrist):
            break
        places = eb90.unpack_s16(where)[: len(FINGERS)]
        axes = Axes(FINGERS, places, [hold_place(place) for place in places])
        step, taken, meaning = hold(wire, axes.targets)
        action = StopStep(step, 0.0, lambda pieces, taken=taken: taken(pieces) == TAKEN)  # type: ignore[misc]
        tries.sent(heard)
        answers = yield from behind(context, heard, action)
        verdict = taken(answers)
        if verdict != TAKEN:
            continue
        wanted: list[int | None] = [*axes.targets, *[0] * len(FINGERS)]
        now = yield from _targets(wire)
        if now is not None and not _alike(wanted, now):
            if not late:
                late = True  # the answer was that of a force that was commanded before: it begins alike
                continue
            wanted = [None] * len(wanted)  # this hand does not show its commands there (the manual does not say)
        zero = now is not None and not any(now[len(FINGERS) :])
        done = f"the hand acknowledged two commands: all forces to 0, then {meaning}{axes.at_end}. The manual documents no stop"
        if not released:
            read = "its registers read 0 for each" if zero else "it is unknown whether they are"
            done = f"the hand acknowledged the command to {meaning}{axes.at_end}, but not the one that sets all forces to 0: {read}"
        stopped, last = yield from check_again(
            Stopped(done), lambda: _places(wire), lambda: _targets(wire), wanted, NOISE, axes.targets
        )
        if not (released or zero):
            stopped = Stopped(stopped.text, stopped.hint or POWER, stopped.error or NoAnswer)
        return axes.judge(stopped, [hold_place(place) for place in last], POWER)
    forces = "the command that sets all forces to 0"
    if verdict == REFUSED:
        first = f"acknowledged {forces}, but" if released else f"did not acknowledge {forces}, and"
        return Stopped(f"the hand {first} refused the next one: {meaning}", POWER, DeviceRefused)
    if meaning:
        text = f"the hand acknowledged {forces}, but not the next one: {meaning}"
        if not released:
            text = f"the hand can be read, but acknowledged neither {forces} nor the next one: {meaning}"
        seen = instead(answers)
        return Stopped(f"{text}: {seen}" if seen else text, POWER, ProtocolError if seen else NoAnswer)
    if answer(came, wrist):
        text = "handctl commanded all forces to 0, but a wrist replied instead of an exoskeleton hand. The wrist was not stopped"
        return Stopped(text, OF_A_WRIST, DeviceRefused, stranger=True)
    seen = instead(came)
    text = f"handctl commanded all forces to 0, but {f'no valid reply arrived: {seen}' if seen else 'no reply arrived'}"
    return Stopped(
        text, f"{POWER}. `handctl exo scan` finds the id and the baud rate", ProtocolError if seen else NoAnswer
    )


def _alike(wanted: list[int | None], now: list[int]) -> bool:
    return all(one in (None, other) for one, other in zip(wanted, now, strict=True))


def _targets(wire: Wire) -> Read:
    """The places that it is commanded to, and the forces; None where they are not answered."""
    places = yield from wire.values(POSITION_SET, len(FINGERS))
    forces = (yield from wire.values(FORCE_SET, len(FINGERS))) if places is not None else None
    return None if places is None or forces is None else [*places, *forces]


def _places(wire: Wire) -> Read:
    """The positions of the five fingers. Nothing drives the sixth, the rotation of the thumb: only its wearer moves it."""
    places = yield from wire.values(POSITION_ACTUAL, MEASURED)
    return None if places is None else places[: len(FINGERS)]


def _asked_once(wire: Wire) -> Generator[StopStep, Pieces, bytes | None]:
    """The positions, if they come at once: whoever has not acknowledged the forces may still tell where it is."""
    step, found = wire.asking(POSITION_ACTUAL, 2 * MEASURED)
    return found((yield StopStep(step, interval(wire.context), lambda pieces: found(pieces) is not None, reads=True)))


def hold_place(place: int) -> int | None:
    """Where to hold a finger; None if its reading is no position. -1, the mark for no value (exo §2.3.7), is none."""
    return None if place == ALONE else hold_target(place, 0, 1000, NEAR)


def hold(wire: Wire, targets: Sequence[int | None]) -> tuple[Step, Callable[[Pieces], int | None], str]:
    """The command to hold the fingers, what judges it in what comes, and the command in words. None for a finger that is left alone.

    The command for all five has no value for that, but their registers have one (exo §2.2.2, §2.3.7).
    """
    places, number = [ALONE if target is None else target for target in targets], wire.context.number
    held = f"hold at {' '.join(map(str, places))}"
    if None not in targets:
        data, prefix = eb90.command_request(number, eb90.POSITION_COMMAND, places), eb90.command_reply_prefix(number, eb90.POSITION_COMMAND)  # fmt: skip
        return Step(held, data, moves=True), lambda pieces: None if answer(pieces, prefix) is None else TAKEN, held
    meaning = f"move no finger (position_set {ALONE})" if not any(target is not None for target in targets) else held
    return *wire.writing(POSITION_SET, eb90.pack_s16(places), meaning), meaning
