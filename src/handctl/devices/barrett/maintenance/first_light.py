"""First light: a hand out of the cupboard, step by step (dossier 16). What a step asks is here; when an answer counts is `model.proofs`.

A step that fails is data, and the next one is offered. What could harm ends the run, and the hand is stopped: heat, a restart in the
middle of a movement, a movement without a reply. Nothing moves before the hand has been read: its temperature, its settings, and
whether HI has found the origin. No answer to a question can replace that.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import NamedTuple

from handctl.devices.barrett import proofs
from handctl.devices.barrett.device import BarrettHand, step_of
from handctl.devices.barrett.gcl.codec import BANNER, MOTORS, has_prompt
from handctl.devices.barrett.gcl.status_codes import NOT_INITIALIZED, explain_status, shows_heat
from handctl.devices.barrett.maintenance import health_limits, lubrication, signs_of_harm, strain_gauges
from handctl.devices.barrett.maintenance.diagnose import ExaminedHand, Values, slowest
from handctl.devices.barrett.parameter_map import BARRETT, FINGERS, travel_seconds
from handctl.errors import (
    Aftermath,
    CheckFailed,
    DeviceRefused,
    HandctlError,
    Hint,
    Interrupted,
    LinkError,
    NotPresent,
    UsageError,
)
from handctl.model.check_rows import OK, SKIPPED
from handctl.model.movement import CODES, REACHED, UNREAD
from handctl.model.param import Step
from handctl.model.prompts import CTRL_C, Prompts
from handctl.model.proofs import (
    DIFFERS,
    MOVE,
    NOT_SHOWN,
    READ,
    REFUSED,
    Observation,
    Outcome,
    Proof,
    SignOfHarm,
    carry_out,
)
from handctl.model.result import Row
from handctl.wording import some

ATTENDED, ALONE = 60.0, 5.0
"""Seconds in which the power must come on: somebody was asked to switch it on, or nobody was."""
SILENT = 6.0
"""Seconds of silence after which nothing more comes: the boot monitor waits, as at a connect."""
READINGS = 10
QUESTION = "First light moves every motor of the hand. Keep people and things out of its reach"
ONLY_READ = "Nothing has been moved or stopped: the hand was only read"
STOP = Hint("{} stops it and switches off the power of its motors", "barrett stop")
GRASPING = "3"
"""The finger that stands opposite the other two."""
SKIP, DECLINED, NOT_REACHED, ENDED = "skipped", "declined", "not-reached", "ended"
NO_FINDING = (SKIP, DECLINED, "no-sign", "not-present", "needs-person")
"""Why a step has no result, where nothing is wrong with the hand."""


class LightStep(NamedTuple):
    """One step of the hour.

    homed    it moves motors that HI must have initialized
    needs    parameters that only some firmware has, without which it is left out
    attended it needs somebody at the hand who answers
    """

    proof: Proof
    homed: bool = True
    needs: tuple[str, ...] = ()
    attended: bool = False


Ask = Callable[[LightStep], bool]
"""Whether a step is wanted. What moves is asked for here, with what is going to be sent."""


# -- power -----------------------------------------------------------------------------------------------------------


def _power_on(hand: BarrettHand, prompts: Prompts, *, attended: bool) -> Observation:
    """What the hand says by itself from power-on to its prompt; nothing is sent."""
    link = hand.line.link
    if attended:
        prompts.wait_for_enter(
            "Switch the hand's power supply OFF, do not pull any cable, and wait 5 seconds. Press Enter, then switch it ON."
        )
    prompts.progress("Listening for the start of the hand. Nothing is sent.", CTRL_C)
    end = link.deadline(ATTENDED if attended else ALONE)
    came, began, last = b"", 0.0, 0.0
    at: dict[str, float] = {}
    while not end.expired and "prompt" not in at:
        piece = link.read(link.deadline(0.1).earlier(end))
        now = link.now()
        if piece:
            began, last = (began if came else now), now
            came += piece
            seen = {"':'": b":" in came, "banner": BANNER in came.upper(), "prompt": has_prompt(came)}
            at |= {name: now - began for name, is_there in seen.items() if is_there and name not in at}
        elif came and now - last > SILENT:
            break
    prompts.done()
    hand.overheard(came)
    if not came:
        return Observation(
            None, f"no data for {ALONE if not attended else ATTENDED:.0f} s: the hand was already on, or is off"
        )
    moments = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in at.items())
    speed = f" at {link.baud} bit/s" if link.baud else ""
    value = " ".join(name for name in at if name != "prompt") or "other bytes"
    told = f"{moments} after the first byte" if moments else "neither ':' nor banner nor prompt"
    return Observation(value, f"{told}{speed}: {came[:80]!r}")


def _firmware(hand: BarrettHand) -> Observation:
    text = hand.version()
    return Observation(text or None, f"VERS: {text}")


# -- reading ---------------------------------------------------------------------------------------------------------


def _read(hand: BarrettHand) -> Values:
    """All settings and states. Raises SignOfHarm where the status of a motor shows heat."""
    values = ExaminedHand(hand).read()
    signs_of_harm.refuse_heat(hand, values)
    return values


def _settings(hand: BarrettHand) -> Observation:
    """All settings of RAM, read twice: decayed RAM gives other values (§3.7, §8)."""
    once, again = _read(hand), _read(hand)
    written = {key: value for key, value in once.items() if BARRETT.by_mnemonic(key[0]).writable}
    names = {key: ".".join(filter(None, key)) for key in written}
    unstable = [
        f"{names[key]} {value} then {again.get(key)}" for key, value in written.items() if again.get(key) != value
    ]
    if unstable:
        return Observation("not stable", f"differs when read twice: {', '.join(unstable[:4])}")
    changed = [
        f"{names[name, motor]}={value}"
        for (name, motor), value in written.items()
        if value != BARRETT.by_mnemonic(name).default_of(MOTORS.index(motor) if motor else 0)
    ]
    if harmful := signs_of_harm.objections(once):
        return Observation("harmful", "; ".join(harmful[:3]))
    absent = [name for name, error in once.errors.items() if isinstance(error, NotPresent)]
    missing = f". Not on this firmware: {', '.join(absent)}" if absent else ""
    text = f"changed: {some(changed, 8)}" if changed else f"{len(written)} values, all read alike twice"
    return Observation("changed" if changed else "factory values", text + missing)


def _temperature(hand: BarrettHand) -> Observation:
    now, limit = signs_of_harm.heat(hand)
    return Observation(now / 10, f"{now / 10:.1f} °C now, and the limit is {limit / 10:.1f} °C")


def _strain(hand: BarrettHand) -> Observation:
    if loaded := strain_gauges.loaded_fingers(hand):
        return Observation(None, f"not without load: {', '.join(loaded)}")
    found = strain_gauges.no_load(strain_gauges.measure(hand, READINGS))
    if found[0].status == SKIPPED:
        return Observation("no gauges", found[0].evidence)
    wrong = [one.check.rpartition(".")[2] for one in found if one.status != OK]
    return Observation(f"outside: {', '.join(wrong)}" if wrong else "in range", "; ".join(f"{one.check.rpartition('.')[2]} {one.evidence}" for one in found))  # fmt: skip


def _grease(name: str, hand: BarrettHand) -> Observation:
    rows = lubrication.MaintenanceLog(hand, name).lubrication()
    due: list[Row] = [row for row in rows if row["status"] != OK]
    text = "; ".join(f"{row['point']} {row['value']} strokes, {row['label']}" for row in due[:3])
    more = f"; and {len(due) - 3} more points" if len(due) > 3 else ""
    return Observation("due" if due else "not due", (text or f"all below {lubrication.STROKES_BETWEEN} strokes") + more)


# -- movement --------------------------------------------------------------------------------------------------------


def _initialize(hand: BarrettHand, prompts: Prompts) -> Observation:
    """HI, one motor after the other, so that the first sign of harm shows before the rest has moved."""
    seen, wrong = [], []
    for digit, motor in enumerate(MOTORS, 1):
        try:
            (row,), seconds = signs_of_harm.driven(hand, str(digit), "HI", None, prompts)
            status = row["status"] or 0
        except DeviceRefused as exc:
            if is_harm(exc):
                raise
            (status,), seconds = hand.numbers(BARRETT.elements("S", motors=[digit - 1])), 0.0
            status = status or int(exc.code.removeprefix("err-"))
        if status:
            wrong.append(f"{motor}: {explain_status(status)}")
        else:
            seen.append(f"{motor} {seconds:.2f} s")
    return Observation("; ".join(wrong) or "ready", f"HI: {', '.join([*seen, *wrong])}")


def _origin(hand: BarrettHand, prompts: Prompts) -> Observation:
    """HOME of each motor ends at 0, within MPE."""
    places, wrong = [], []
    for digit, motor in enumerate(MOTORS, 1):
        (row,), _ = signs_of_harm.driven(hand, str(digit), "HOME", None, prompts)
        places.append(f"{motor} {row['value']}")
        if row["arrival"] != REACHED:
            wrong.append(f"{motor} at {row['value']}")
    return Observation("; ".join(wrong) or "reached", f"P after HOME: {', '.join(places)}")


def _speed(motors: Collection[int], hand: BarrettHand, prompts: Prompts) -> Observation:
    """Each of `motors` closes and opens alone: where it ends, and how long it takes against its own settings."""
    set_to = hand.by_name("MCV", "MOV", "SAMPLE", motors=motors)
    signs_of_harm.driven(hand, "123", "O", None, prompts)  # the spread may move beside open fingers only
    times, wrong = [], []
    for index in motors:
        motor = MOTORS[index]
        for name, velocity in (("O", ""), ("C", "MCV"), ("O", "MOV")):
            (row,), seconds = signs_of_harm.driven(hand, str(index + 1), name, None, prompts)
            if row["arrival"] != REACHED:
                wrong.append(f"{motor} {name}: {row['ended']} at {row['value']}")
            if velocity:
                usual = travel_seconds(index, set_to[velocity, motor], set_to["SAMPLE", motor])
                times.append(f"{motor} {name} {seconds:.2f} s, set to {usual:.2f} s")
                wrong += [f"{motor} {name} slow"] if seconds > slowest(usual) else []
    return Observation("; ".join(wrong) or "as set", "; ".join(times))


def _broken(hand: BarrettHand, index: int) -> int | None:
    """Where the clutch of a finger has let go, None = it has not (BD, BP)."""
    gone, place = hand.numbers(BARRETT.elements("BD", "BP", motors=[index]))
    return place if gone else None


def _free(hand: BarrettHand, prompts: Prompts) -> Observation:
    """Each finger closes in free air: no clutch may let go (barrett §8, premature breakaway)."""
    early, ends = [], []
    for index, motor in enumerate(FINGERS):
        signs_of_harm.driven(hand, str(index + 1), "O", None, prompts)
        (row,), _ = signs_of_harm.driven(hand, str(index + 1), "C", None, prompts)
        place = _broken(hand, index)
        ends.append(f"{motor} closed to {row['value']}" + ("" if place is None else f", let go at {place}"))
        early += [] if place is None else [motor]
        signs_of_harm.driven(hand, str(index + 1), "O", None, prompts)
    return Observation(", ".join(early) or "none", "; ".join(ends))


def _grasp(hand: BarrettHand, prompts: Prompts) -> Observation:
    """F3 closes on an object that meets its inner link: its clutch lets go, and opening resets it (barrett §9.3.1, §9.5)."""
    index = int(GRASPING) - 1
    signs_of_harm.driven(hand, GRASPING, "C", None, prompts)
    place = _broken(hand, index)
    signs_of_harm.driven(hand, GRASPING, "O", None, prompts)
    left = _broken(hand, index)
    value = "did not let go" if place is None else "stays broken away" if left is not None else "lets go and resets"
    return Observation(value, f"{FINGERS[index]}: " + ("BD 0 after C" if place is None else f"BP {place}") + f", BD {int(left is not None)} after O")  # fmt: skip


# -- the steps -------------------------------------------------------------------------------------------------------


def _sends(*texts: str) -> Callable[[BarrettHand], list[Step]]:
    return lambda _: [step_of(text) for text in texts]


def _alone(digits: str, *names: str) -> list[str]:
    return [f"{digit}{name}" for digit in digits for name in names]


def steps_for(name: str, *, attended: bool) -> tuple[LightStep, ...]:
    """All steps in their order; `name` of the hand for the greasing journal, `attended` = somebody answers."""
    known = {proof.name: proof for proof in proofs.PROOFS}
    early, late = "123", ("O", "C", "O")
    return (
        LightStep(Proof("power-on", "not documented: a ':' of the boot monitor, then the banner (§3.7; dossier 16)", "':' banner", "listen from power-on to the prompt, and send nothing", partial(_power_on, attended=attended), alone=True)),
        LightStep(Proof("firmware", "VERS (§5.2.4); without firmware the boot monitor waits (§3.7)", (), "connect, then VERS", _firmware)),
        LightStep(Proof("settings", "factory values (§5.3, §5.4); decayed RAM is erratic (§3.7, §8)", "factory values", "every setting, read twice, against its factory value", _settings)),
        LightStep(Proof("temperature", f"40 to {health_limits.WARM} is normal, {health_limits.LIMIT} the limit (§2)", health_limits.LIMIT_TENTHS / 10, "TEMP and OTEMP", _temperature, limit="most", measured=True)),
        LightStep(Proof("init", "HI must be the first movement (§5.2.1)", "ready", "HI, one motor at a time", _initialize, MOVE, steps=_sends(*_alone("1234", "HI")), question="Each motor is initialized: the fingers OPEN fully, one at a time, and the spread turns. Keep people and things out of its reach"), homed=False),
        LightStep(Proof("strain", f"{strain_gauges.NO_LOAD[0]} to {strain_gauges.NO_LOAD[1]} without load (§7.4); 255 = no gauge (§5.3.2)", ("in range", "no gauges"), "FGET SG with open fingers, several times", _strain)),
        LightStep(Proof("origin", "HI sets the origin, and HOME goes there (§5.2.1)", "reached", "HOME, one motor at a time, then P", _origin, MOVE, steps=_sends(*_alone("1234", "HOME")), question="Each motor moves to position 0, one at a time. Keep clear")),
        LightStep(known["position-at-stop"]),
        LightStep(Proof("finger-speed", "open to closed in 1.0 s (appendix A); MOV, MCV and SAMPLE set the speed (§5.3)", "as set", "each finger alone: O, C, O", partial(_speed, (0, 1, 2)), MOVE, steps=_sends("123O", *_alone(early, *late)), question="Each finger OPENS, CLOSES fully and OPENS, one at a time. Keep hands and objects out of the hand")),
        LightStep(Proof("spread-speed", "180° (§9.6); MOV, MCV and SAMPLE set the speed (§5.3)", "as set", "the fingers open, then the spread: O, C, O", partial(_speed, (3,)), MOVE, steps=_sends("123O", *_alone("4", *late)), question="The fingers OPEN, and the spread turns to its end and back. Keep clear")),
        LightStep(known["highest-speed"]),
        LightStep(Proof("early-breakaway", "no clutch lets go in free air (§8)", "none", "each finger alone: C, BD and BP, O", _free, MOVE, steps=_sends(*_alone(early, *late)), question="Each finger CLOSES fully in free air and OPENS, one at a time. Keep hands and objects out of the hand"), needs=("BD", "BP")),
        LightStep(Proof("breakaway", "the clutch lets go when the inner link is blocked, and opening resets it (§9.3.1, §9.5)", "lets go and resets", "F3 closes on an object at its inner link: BD and BP, then O", _grasp, MOVE, steps=_sends(f"{GRASPING}C", f"{GRASPING}O"), question="Put a firm object between the palm and the inner link of F3, and take your hands away. F3 CLOSES on it, then OPENS"), needs=("BD", "BP"), attended=True),
        LightStep(Proof("grease", "every 5,000 strokes (§7.3, Table 6)", "not due", "OD against the greasing journal of this computer", partial(_grease, name))),
    )  # fmt: skip


# -- the run ---------------------------------------------------------------------------------------------------------


def is_harm(error: HandctlError) -> bool:
    """Whether nothing may move after this: heat, or a movement of which it is not known how it ended."""
    if isinstance(error, SignOfHarm) or shows_heat(error):
        return True
    return error.code == CODES[UNREAD] or not isinstance(error, DeviceRefused | CheckFailed | UsageError)


class FirstLight:
    """The steps one after the other; `outcomes` has one of each, `failure` is what ended them early.

    healthy  the cheapest documented read
    attended somebody at the hand answers
    """

    def __init__(
        self, hand: BarrettHand, prompts: Prompts, ask: Ask, healthy: Callable[[], object], *, attended: bool
    ) -> None:
        self.hand, self.prompts = hand, prompts
        self._ask, self._healthy, self._attended = ask, healthy, attended
        self._values: Values | None = None
        self._moved = False
        self.outcomes: list[Outcome] = []
        self.failure: HandctlError | None = None

    def run(self, steps: Sequence[LightStep], skip: Collection[str], repeat: int) -> None:
        """Raises nothing but a bug: what ends the steps early is the `failure`."""
        for number, step in enumerate(steps, 1):
            self.prompts.progress(f"{number} of {len(steps)}: {step.proof.name}")
            self.outcomes.append(one := self._outcome(step, step.proof.name in skip, repeat))
            self.prompts.done()
            if self._attended and one.why not in (SKIP, ENDED):  # who decides on the next step has to know
                self.prompts.say(f"  {one.verdict.replace('-', ' ')}: {one.evidence}")

    @property
    def findings(self) -> list[str]:
        """Names of the steps about which somebody must do something."""
        return [
            one.proof.name
            for one in self.outcomes
            if one.verdict in (DIFFERS, REFUSED) or (one.verdict == NOT_SHOWN and one.why not in NO_FINDING)
        ]

    def _outcome(self, step: LightStep, unwanted: bool, repeat: int) -> Outcome:
        if self.failure is not None:
            return _none(step, ENDED, "not done: the run ended before it")
        if unwanted:
            return _none(step, SKIP, "skipped")
        try:
            return self._carried_out(step, repeat)
        except KeyboardInterrupt:
            self.failure = Interrupted()
        except HandctlError as exc:
            self._stop(exc)
            self.failure = exc
        return _none(step, self.failure.code, self.failure.text)

    def _carried_out(self, step: LightStep, repeat: int) -> Outcome:
        """Raises what ends the run."""
        proof = step.proof
        if not proof.alone:
            self.hand.line.connect()
        if (objection := self._objection(step)) is not None:
            return objection
        if not self._ask(step):
            return _none(step, DECLINED, "declined")
        self._moved = self._moved or proof.level == MOVE
        times = repeat if proof.level == READ and not proof.alone else 1
        try:
            outcome = carry_out(proof, self.hand, self._healthy, times, self.prompts)
        except HandctlError as exc:
            if proof.level == MOVE and is_harm(exc):
                raise
            if isinstance(exc, LinkError) or (proof.level != MOVE and not isinstance(exc, DeviceRefused)):
                raise
            verdict = REFUSED if isinstance(exc, DeviceRefused | UsageError) else NOT_SHOWN
            return Outcome(proof, verdict, None, exc.text, why=exc.code)
        if proof.level == MOVE and outcome.why == "disturbed":
            raise SignOfHarm(
                f"{self.hand.link.name}: {proof.name}: {outcome.evidence}",
                hint=signs_of_harm.CHECK_CABLE,
                code="disturbed",
            )
        return outcome

    def _objection(self, step: LightStep) -> Outcome | None:
        """What speaks against a step, whatever anyone answers: nothing has moved. Raises SignOfHarm."""
        if step.attended and not self._attended:
            return _none(
                step, "needs-person", "needs somebody at the hand who answers: run it on a terminal, without --yes"
            )
        for reading in self.hand.read(BARRETT.elements(*step.needs, motors=range(3))) if step.needs else ():
            if reading.error is not None:
                why = "not-present" if isinstance(reading.error, NotPresent) else reading.error.code
                return _none(step, why, "this firmware does not have BD and BP (4.34 and later do)")
        if step.proof.level != MOVE:
            return None
        now = signs_of_harm.look_for_harm(self.hand)
        if self._values is None:
            self._values = _read(self.hand)
        if harmful := signs_of_harm.objections(
            now | {key: value for key, value in self._values.items() if key[0] not in health_limits.READ_BEFORE_MOVING}
        ):
            text = f"nothing is moved with this: {'; '.join(harmful[:3])}"
            return Outcome(step.proof, REFUSED, None, text, why="settings")
        if lost := [motor for motor in MOTORS if step.homed and now["S", motor] & NOT_INITIALIZED]:
            return Outcome(step.proof, REFUSED, None, f"{', '.join(lost)}: not initialized, and HI must come first", why="not-initialized")  # fmt: skip
        return None

    def _stop(self, error: HandctlError) -> None:
        """^C, and the power off all motors, from the first movement on that was agreed to. Until then the hand is only read."""
        if isinstance(error, Interrupted | LinkError):  # it was stopped, or cannot be reached
            return
        if self._moved:
            signs_of_harm.stop(self.hand, error)
        elif isinstance(error, SignOfHarm):
            error.add_aftermath(Aftermath(ONLY_READ, STOP))


def _none(step: LightStep, why: str, text: str) -> Outcome:
    return Outcome(step.proof, NOT_SHOWN, None, text, why=why)


def verdict_of(light: FirstLight) -> HandctlError | None:
    """What the run comes to as an error, None = every step went as the manual has it."""
    if light.failure is not None or not light.findings:
        return light.failure
    return CheckFailed(
        f"{light.hand.link.name}: {', '.join(light.findings)} did not match the manual",
        hint=Hint("read the evidence in each row. {} lists checks and remedies", "barrett diagnose"),
        code="findings",
    )
