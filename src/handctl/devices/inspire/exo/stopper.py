"""The stop of an EH55BF1: all forces to 0, then every finger is commanded to hold its position. The manual has no stop command.

The forces need no place. Their answer tells where the fingers are (exo §2.2.1), and that a hand is there at all: so a hold
is always from a place just read. The same bytes would be a write to a wrist: one quick read looks for that first.
"""

from __future__ import annotations

from handctl.devices.inspire import eb90
from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.register_map import ALONE
from handctl.devices.inspire.stop_requests import QUICK, Read, Wire, answer, asks, instead, lead, seen_since
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError
from handctl.model.param import Step
from handctl.model.stop_repetition import attempts, interval, repeat_until_answered
from handctl.model.stop_sequence import StopContext, Stopped, StopSequence, StopStep, did_not_last

POSITION_SET, FORCE_SET, POSITION_ACTUAL = (
    EXO[name].address for name in ("position_set", "force_set", "position_actual")
)
FINGERS, MEASURED = 5, 6
STILL = 15
"""Counts of 1000: what stands is read alike within so many."""
OF_A_WRIST = "run `handctl wrist stop`"
POWER = "switch the power off if the hand still pushes or moves"


def stop_steps(context: StopContext) -> StopSequence:
    """Forces to 0, then a hold, each repeated until the hand has acknowledged it; then a second check."""
    number, came, wire = context.number, list[bytes](), Wire(context, first=lead(context))
    step, wrist = asks(number, eb90.WRIST_READ)
    if not context.proven:
        came += yield StopStep(step, QUICK, lambda pieces: answer(pieces, wrist), reads=True, ahead=wire.first)
        if answer(came, wrist):
            return Stopped("this is a wrist, not an exoskeleton hand. Nothing was written", OF_A_WRIST, DeviceRefused)
    force = Step("all forces to 0", eb90.command_request(number, eb90.FORCE_COMMAND, [0] * FINGERS), moves=True)
    told = eb90.command_reply_prefix(number, eb90.FORCE_COMMAND)
    meaning, late = "", False
    for _ in range(attempts(context)):
        heard = yield from repeat_until_answered(context, force, lambda pieces: answer(pieces, told), ahead=wire.first)
        came += heard.came
        if heard.found is None:
            break
        places = eb90.unpack_s16(heard.found.payload)[:FINGERS]
        step, taken, meaning = hold(number, places)
        # on a slow line as long as the forces have taken
        pieces = yield StopStep(
            step,
            max(interval(context), heard.seconds),
            lambda pieces, taken=taken: answer(pieces, taken),  # type: ignore[misc]
        )
        if answer(pieces, taken) is None:
            continue
        wanted: list[int | None] = [*(places if meaning.startswith("hold") else [None] * FINGERS), *[0] * FINGERS]
        now = yield from _targets(wire)
        if now is not None and not _alike(wanted, now):
            if not late:
                late = True  # the answer was that of a force that was commanded before: it begins alike
                continue
            wanted = [None] * len(wanted)  # this hand does not show its commands there (the manual does not say)
        done = f"the hand acknowledged two commands: all forces to 0, then {meaning}. The manual documents no stop"
        against = yield from seen_since(
            lambda: wire.values(POSITION_ACTUAL, MEASURED),
            lambda: _targets(wire),
            wanted,
            STILL,
            places,
        )
        return did_not_last(Stopped(done), against) if against else Stopped(done)
    if meaning:
        text = f"the hand acknowledged the command that sets all forces to 0, but not the next one: {meaning}"
        return Stopped(text, POWER, NoAnswer)
    if answer(came, wrist):
        text = "handctl commanded all forces to 0, but a wrist replied instead of an exoskeleton hand. The wrist was not stopped"
        return Stopped(text, OF_A_WRIST, DeviceRefused)
    seen = instead(came)
    text = f"handctl commanded all forces to 0, but {f'no valid reply arrived: {seen}' if seen else 'no reply arrived'}"
    return Stopped(
        text, f"{POWER}. `handctl exo scan` finds the id and the baud rate", ProtocolError if seen else NoAnswer
    )


def _alike(wanted: list[int | None], now: list[int]) -> bool:
    return all(one in (None, other) for one, other in zip(wanted, now, strict=True))


def _targets(wire: Wire) -> Read:
    """The places that it is commanded to, and the forces; None where they are not answered."""
    places = yield from wire.values(POSITION_SET, FINGERS)
    forces = (yield from wire.values(FORCE_SET, FINGERS)) if places is not None else None
    return None if places is None or forces is None else [*places, *forces]


def hold(number: int, places: list[int]) -> tuple[Step, bytes, str]:
    """The command to hold all positions, its acknowledgement, and both in words. -1 for a position that is no valid target."""
    if len(places) == FINGERS and all(0 <= place <= 1000 for place in places):
        meaning = f"hold at {' '.join(map(str, places))}"
        data, prefix = eb90.command_request(number, eb90.POSITION_COMMAND, places), eb90.command_reply_prefix(number, eb90.POSITION_COMMAND)  # fmt: skip
    else:
        meaning = f"move no finger (position_set {ALONE})"
        data, prefix = eb90.write_request(number, POSITION_SET, eb90.pack_s16([ALONE] * FINGERS)), eb90.write_ack_prefix(number, POSITION_SET)  # fmt: skip
    return Step(meaning, data, moves=True), prefix, meaning
