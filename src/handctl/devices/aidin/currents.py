"""Current control of the AIDIN-hand: a ramp from 0, held, back to 0, stop (aidin, Modes: current control).

There is no position limit: however it ends, the currents go to 0 and the stop mode is sent.
"""

from __future__ import annotations

from handctl.devices.aidin.adjust import SHORT
from handctl.devices.aidin.device import AidinHand, reading
from handctl.devices.aidin.exchange import PERIOD
from handctl.devices.aidin.feedback import Wire
from handctl.devices.aidin.homing import connect_or_command
from handctl.devices.aidin.map import Mode
from handctl.devices.aidin.motion import followed, last_step, measured, target_object
from handctl.devices.aidin.stop import object_of, stop_after, stopped_if_cut_short
from handctl.devices.aidin.targets import Goal, ramp
from handctl.errors import CheckFailed, HandctlError, NoAnswer
from handctl.model.guide import CTRL_C, Guide, Presses
from handctl.model.param import elements_of
from handctl.model.result import Table
from handctl.model.stopping import BEAT, Stopped


def currents(
    hand: AidinHand,
    goal: Goal,
    guide: Guide,
    *,
    seconds: float,
    cap: float,
    ramp_down: bool = False,
    beat: float = BEAT,
) -> Table:
    """Mode 41: maxtorque 1000 first, a ramp from 0, held for `seconds`, back to 0, stop; rows have `target` and `reached`.

    Ctrl-C stops at once; with `ramp_down` it takes the currents back to 0 on the same ramp first, and a second one stops
    at once. Every error stops, and so does a `beat` of seconds in which this process stands still, 0 = it may. Raises CheckFailed when the currents were not there.
    """
    blind = connect_or_command(hand)
    values = _values(hand, goal, cap, blind=blind)
    drive = _Drive(hand, goal, guide)
    ledger = hand.journal.ledger
    ledger.plan([last_step(goal, values, hand.talk.way.end)])
    with stopped_if_cut_short(hand, guide, beat=beat):
        try:
            try:
                table = drive.run(values, seconds, blind=blind)
                drive.to(drive.zero, "Currents return to 0,")
            except KeyboardInterrupt:
                if not ramp_down:
                    raise
                with guide.counting() as presses:
                    guide.say("Interrupted. The currents return to 0. Press Ctrl-C again to stop immediately.")
                    drive.to(drive.zero, "Currents return to 0,", presses)
                raise
        except HandctlError as exc:
            stop_after(hand, exc)
            raise
        finally:
            guide.done()
        if table.failure is None:
            ledger.confirm("the currents followed", since=drive.begun)
        stopped = hand.stop()
    hand.talk.check_bound()
    _tell_stop(hand, stopped)
    return table


def _tell_stop(hand: AidinHand, stopped: Stopped) -> None:
    """What the hand has said behind the stop."""
    free = "Without power the fingers move freely. The maximum torque stays at 1000"
    if stopped.error is not None:
        hand.journal.warn("not-stopped", stopped.text, stopped.hint)
    elif stopped.evidence:
        text = f"the currents were ramped down to 0 and stop was sent. No current flows. {free}"
        hand.journal.info("stopped", text)
    else:
        hand.journal.info("stopped", f"the currents were ramped down to 0. {stopped.text}. {free}")


def _values(hand: AidinHand, goal: Goal, cap: float, *, blind: bool) -> list[float]:
    """The whole vector, the elements that are not given as measured. A hand that only answers commands needs it whole."""
    if blind:
        if not goal.names_all:
            raise NoAnswer(
                f"{hand.link.name}: the hand sends nothing without a request, so the currents that you did not give are unknown",
                hint="give all 15 values. Nothing was commanded.",
            )
        return goal.complete(None)
    values = goal.complete(measured(hand, goal.target))
    beyond = [f"{goal.target.command.elements[i]} {value:g}" for i, value in enumerate(values) if abs(value) > cap]
    if beyond:
        raise CheckFailed(
            f"{hand.link.name}: {', '.join(beyond)} would be kept, but the cap is {cap:g}",
            hint="give a value for it as well. Nothing was sent.",
            code="beyond-cap",
        )
    return values


class _Drive:
    """Currents on their way; `at` is what the hand was told last."""

    def __init__(self, hand: AidinHand, goal: Goal, guide: Guide) -> None:
        self._hand = hand
        self._goal = goal
        self._guide = guide
        self.begun = 0  # in the ledger
        self.zero = [0.0] * goal.target.command.count
        self.at = self.zero

    def run(self, values: list[float], seconds: float, *, blind: bool) -> Table:
        """Up the ramp and hold; the currents that the hand told last. A hand of which nothing is known must answer first."""
        talk = self._hand.talk
        first, end = object_of(Mode.MAXTORQUE, maxtorque=1000), talk.deadline(SHORT)
        while not end.expired:
            talk.tick(first, blind=blind)
        if blind:
            self._told()
        self.begun = self._hand.journal.ledger.mark
        self.to(values, "Currents rise,")
        data, end = target_object(self._goal, values), talk.deadline(seconds)
        while not end.expired:
            talk.tick(data, by=self._goal.target.feedback)
            self._guide.progress(f"Currents on, {end.remaining:.1f} s left.", CTRL_C)
        found, param = self._told(), self._goal.target.feedback
        table = self._hand.table([reading(self._hand.link.name, element, found) for element in elements_of(param)])
        followed(self._hand, self._goal, values, table)
        return table

    def to(self, values: list[float], what: str, presses: Presses | None = None) -> None:
        """Go there on the ramp, until one of `presses` ends it. Raises NoAnswer when the hand falls silent meanwhile."""
        way = ramp(self._goal, self.at, values, PERIOD)
        for number, step in enumerate(way, 1):
            if presses is not None and presses.count:
                return
            self.at = list(step)
            self._hand.talk.tick(target_object(self._goal, step), by=self._goal.target.feedback)
            self._guide.progress(f"{what} {number * PERIOD:.1f} of {len(way) * PERIOD:.1f} s.", CTRL_C)

    def _told(self) -> Wire:
        """The currents of the last feedback, without asking: nothing may come between the objects."""
        param, talk = self._goal.target.feedback, self._hand.talk
        if not talk.feedback.seen:
            raise talk.nothing_came()
        return talk.usable(param, talk.feedback.result(param.key))
