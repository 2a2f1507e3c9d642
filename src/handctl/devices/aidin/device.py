"""The AIDIN-hand: readings and rows from its feedback, status, commands as bytes, stop. See `model.device`.

Mode and data always travel in one object. Ctrl-C during anything that moves sends the stop mode, motor power off. There is no acknowledge and no error message: feedback is the only proof of anything (dossier 3).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext

from handctl.devices.aidin.conversation import MISSING, Conversation, Wire, number_of
from handctl.devices.aidin.exchange_settings import ExchangeMode
from handctl.devices.aidin.feedback_guard import NO_NOISE, OBJECTS, OLD
from handctl.devices.aidin.json_codec import TERMINATORS, Decoder, Out, encode
from handctl.devices.aidin.parameter_map import AIDIN, FEEDBACK, FINGERS, LARGEST_RADIAN, MODES, AidinParam, Mode
from handctl.devices.aidin.stopper import ENDS, FLOWED, PAUSE, flow
from handctl.errors import Aftermath, HandctlError, Hint, LinkError, ProtocolError, joined
from handctl.model.device import Device
from handctl.model.device_clock import Moment
from handctl.model.frame_decoder import frames_in
from handctl.model.param import Element, Reading, Step
from handctl.model.prompts import Prompts
from handctl.model.result import Cell, Column, Finding, Grid, Row, Table
from handctl.model.stop_on_interrupt import interrupt_error, on_early_end
from handctl.model.stop_sequence import StopContext, Stopped
from handctl.wording import plural, some

SLACK = 0.01
"""Share of a range by which a value may be outside: encoders and angles jitter at the stops."""
MOST_ERRORS = 5
"""As many as there are keys: more of them are counted."""
NO_ANGLE = "is not an angle in radians (possibly degrees)"
SHORT = {"current_state": "current"}


class AidinHand(Device):
    """One hand on a connection."""

    kind = "aidin"
    product = "AIDIN-hand"
    map = AIDIN
    live = tuple(param.name for param in FEEDBACK if param.name != "task_space_pos")
    columns = (
        Column("name", "Name"),
        Column("finger", "Finger"),
        Column("element", "Element"),
        Column("value", "Value", right=True),
        Column("unit", "Unit"),
    )

    plain = ("name", "finger", "element", "value")

    def __init__(self, conversation: Conversation) -> None:
        super().__init__(conversation)
        self.conversation = conversation
        self.ends = False
        """What the hand is driven with ends without a stop, too: it holds the last place then."""

    @property
    def line_end(self) -> bytes:  # type: ignore[override]
        """What ends an object."""
        return self.conversation.way.end

    def admit(self, data: bytes, can_id: int | None) -> None:
        self.conversation.identify()

    def stop_context(self) -> StopContext:
        """What ends an object is known, whether the last feedback showed a current, what that shows, and the noise of the sensors."""
        context = super().stop_context()
        end = next(name for name, data in TERMINATORS.items() if data == self.conversation.way.end)
        currents = self.conversation.feedback.values.get("current_state", (0,))
        own = {"tx_terminator": end, FLOWED: flow(currents), ENDS: self.ends, PAUSE: self.conversation.live.pause}
        return context._replace(settings=context.settings._replace(own=own))

    # -- reading -------------------------------------------------------------------------------------------------

    def found_again(self) -> bool:
        """See Device. `stopped_if_cut_short` does it, with the conversation."""
        return False

    def stopped_by_error(self, stop: Callable[[], Stopped], prompts: Prompts, who: str) -> AbstractContextManager[None]:
        """See Device. A stop lets go what the hand holds: each movement decides which of its errors stop it (`stopped_on_error`)."""
        return nullcontext()

    def ready(self) -> None:
        self.conversation.connect()

    def read(self, elements: Sequence[Element]) -> list[Reading]:
        """Readings of one moment: what the hand sends from now on. A key that is wrong is an error of its elements."""
        params = {element.param.name: param_of(element) for element in elements}
        came = self.conversation.refresh(tuple(params.values()))
        found = {name: came[param.key] for name, param in params.items()}
        return [reading(self.link.name, element, found[element.param.name]) for element in elements]

    def follow(self) -> None:
        """See Device."""
        self.conversation.each = True

    def reading_time(self) -> Moment | None:
        """See Device: of a stream, when the bytes of the last reading came."""
        follows = self.conversation.each and self.conversation.exchange is ExchangeMode.STREAM
        return self.conversation.came if follows else None

    def lacks(self, error: HandctlError) -> bool:
        """A key that stayed away while another came three times."""
        return error.code == MISSING

    def element_keys(self, element: Element) -> Row:
        param, index = param_of(element), element.index
        return {
            "name": param.name,
            "key": param.key,
            "finger": param.finger_of(index),
            "element": param.label_of(index),
        }

    def value_keys(self, taken: Reading) -> Row:
        """Angles in degrees, and in `rad` as on the wire."""
        param = param_of(taken.element)
        row: Row = {"value": taken.value, "unit": param.unit}
        return {**row, "rad": float(taken.raw)} if param.angles else row

    @staticmethod
    def view(rows: list[Row]) -> list[Grid]:
        """One line per element, fingers side by side."""
        return by_finger(rows)

    def partial(self, failed: Sequence[Reading]) -> HandctlError | None:
        """What is wrong with each key, each said once."""
        errors = {taken.error.text: taken.error for taken in failed if taken.error is not None}
        first = next(iter(errors.values()))
        return ProtocolError(some(list(errors), MOST_ERRORS, "; ", ", and"), hint=first.hint, code=first.code)

    def status(self, check: bool) -> Table:
        """The same, looked at: values out of their range, how the hand speaks. With `check`, unhealthy is exit 7."""
        table = self.dump()
        self.conversation.look_again()
        how = "streams" if self.conversation.exchange is ExchangeMode.STREAM else "replies to requests"
        self.journal.info("exchange", f"the hand {how}")
        found = unhealthy(table.rows)
        if check:
            state, evidence = self.liveness()
            if state == "fail":
                found.append(Finding(evidence, ("frozen",)))
            elif state == "skipped":
                self.journal.info("unchanged", evidence)
        encoders = [row.get("value") for row in table.rows if row["name"] == "motor_pos"]
        if encoders and all(value == 0 for value in encoders):
            from handctl.devices.aidin.remedies import ALL_ZERO, REMEDIES

            self.journal.info("homed-unknown", ALL_ZERO, REMEDIES["all-zero"].hint)
        return self.with_findings(table, found, check)

    def liveness(self) -> tuple[str, str]:
        """Look whether the feedback still changes, as a check has it: it does, it has frozen (fail), or nothing shows which; and the evidence."""
        from handctl.model.check_rows import FAIL, OK, SKIPPED

        changes, live = self.conversation.watch(), self.conversation.live
        if changes:
            return OK, "the values of the feedback change"
        if stands := live.frozen(self.conversation.feedback_at):
            return FAIL, f"the feedback has frozen: for {stands:.1f} s {OLD}"
        if not live.senses:
            return (
                SKIPPED,
                "the feedback has no valid sensor_state, whose noise would show whether the hand repeats old feedback",
            )
        if live.same < OBJECTS:
            return SKIPPED, f"feedback comes too seldom to see whether it changes: {plural(live.same + 1, 'message')}"
        return SKIPPED, f"in {plural(live.same + 1, 'message')} {OLD}: {NO_NOISE}"

    # -- typed bytes ---------------------------------------------------------------------------------------------

    def tell_left(self, data: bytes) -> None:
        """See Device: the last mode stays in force."""
        decoder = Decoder()
        decoder.feed(data)
        typed = [content.get("hand_mode") for content in frames_in(decoder)]
        mode = next((mode for number in reversed(typed) for mode in Mode if mode == number), Mode.STOP)
        if mode is Mode.STOP:
            return
        if mode in (Mode.BIAS, Mode.MAXTORQUE):
            self.journal.info("left", left_in(mode), LEFT_HINT)
            return
        text = f"mode {int(mode)} ({MODES[mode]}) was sent last, and no stop, so the hand probably goes on with it"
        self.journal.warn("left", text, Hint("{} switches the motors off and frees the fingers", "aidin stop"))


def param_of(element: Element) -> AidinParam:
    """The element's parameter, as one of this family."""
    assert isinstance(element.param, AidinParam)
    return element.param


def reading(where: str, element: Element, found: Wire | ProtocolError) -> Reading:
    """One element of the received value of its key, on the link `where`."""
    param = param_of(element)
    number = found[element.index] if isinstance(found, tuple) else number_of(where, element, param, found)
    if isinstance(number, ProtocolError):
        return Reading(element, None, b"", number)
    return Reading(element, param.from_wire(number), repr(number).encode("ascii"))


def outside(param: AidinParam, index: int, value: float, share: float = SLACK) -> bool:
    """Whether a value is out of its documented range by more than `share` of it, by default the jitter at a stop."""
    limit = param.limit(index)
    if limit is None:
        return False
    slack = (limit[1] - limit[0]) * share
    return not limit[0] - slack <= value <= limit[1] + slack


def unhealthy(rows: Sequence[Row]) -> list[Finding]:
    """Findings: elements out of their range, by quantity."""
    found = []
    for param in FEEDBACK:
        mine = [row for row in rows if row["name"] == param.name and "value" in row]
        wrong = [
            f"{row['finger']}.{row['element']} {row['value']:g}"
            for row in mine
            if outside(param, param.elements.index(f"{row['finger']}.{row['element']}"), row["value"])
        ]
        if param.angles and any(abs(row["rad"]) > LARGEST_RADIAN for row in mine):
            found.append(Finding(f"{param.name} {NO_ANGLE}", ("no-angle",)))
        elif wrong:
            found.append(Finding(f"{param.name} out of range: {some(wrong)}. Not homed since power-on?", ("range",)))
    return found


# -- how people see it -------------------------------------------------------------------------------------------


def by_finger(rows: list[Row]) -> list[Grid]:
    """One line per element, the fingers side by side; values out of their range are marked."""
    fingers = [finger for finger in FINGERS if any(row["finger"] == finger for row in rows)]
    lines: list[tuple[str | Cell, ...]] = []
    notes: list[str] = []
    for name in dict.fromkeys(row["name"] for row in rows):
        param = AIDIN[name]
        mine = [row for row in rows if row["name"] == name]
        for label in dict.fromkeys(row["element"] for row in mine):
            at = {row["finger"]: row for row in mine if row["element"] == label}
            head = SHORT.get(name, "") + (" " if name in SHORT else "") + label
            lines.append((head, *(cell(param, at.get(finger)) for finger in fingers), param.unit or "raw"))
        errors = list(dict.fromkeys(str(row["error"]) for row in mine if "error" in row))
        notes += errors[:MOST_ERRORS]
    if any(isinstance(single, Cell) and single.tone == "warn" for line in lines for single in line):
        notes.append("* out of its documented range")
    if any(row.get("reached") is False for row in rows):
        notes.append("≠ target not reached")
    headings = ("", *(finger.capitalize() for finger in fingers), "Unit")
    return [Grid(headings, tuple(lines), right=frozenset(range(1, len(headings) - 1)), notes=tuple(notes))]


def cell(param: AidinParam, row: Row | None) -> str | Cell:
    """One value: ``?`` for an error, ``*`` out of range, ``≠ target`` where a target was missed."""
    if row is None:
        return ""
    if "error" in row:
        return Cell("?", "bad")
    text = f"{row['value']:.{param.places}f}"
    if row.get("reached") is False:
        return Cell(f"{text} ≠ {row['target']:.{param.places}f}", "bad")
    index = param.elements.index(f"{row['finger']}.{row['element']}")
    return Cell(f"{text}*", "warn") if outside(param, index, row["value"]) else text


# -- commands, and how they end ------------------------------------------------------------------------------------


AGAIN = 1.0
"""Seconds in which a connection that was lost is opened again, all tries together."""
TRY = 0.05
"""Seconds from one try to the next."""
UNTOLD = "switch the hand's power off if it is still moving: the connection is lost, so stop cannot be sent"
MENDS = "the connection was lost. This command is reconnecting and will send the stop itself"
MENDED = "the connection was lost. handctl reconnected"


def object_of(mode: Mode, **data: Out) -> bytes:
    """The object of one command, without its terminator."""
    return encode({"hand_mode": int(mode), **data})


def step_of(meaning: str, data: bytes, end: bytes) -> Step:
    """A command for --dry-run: what it does with the object in words, and its bytes with their terminator."""
    return Step(f"{meaning}: {data.decode()}", data + end, moves=True)


LEFT_HINT = Hint("use `handctl aidin joints …` to hold a position again, or {} to free the fingers", "aidin stop")


def left_in(mode: Mode) -> str:
    """What the hand is left in by a mode that ended another one; the manual says nothing of it (dossier 5)."""
    return f"the hand is left in mode {int(mode)}. It is not documented whether it keeps holding its position"


@contextmanager
def stopped_on_error(
    hand: AidinHand, prompts: Prompts, kind: type[HandctlError] = HandctlError, *, otherwise: str = ""
) -> Iterator[None]:
    """Around what must not go on after an error of this `kind`: it stops the hand, and has the result of the stop in its words.

    Other errors say what is in force `otherwise`. Of a link that is lost `stopped_if_cut_short` tells.
    """
    try:
        yield
    except HandctlError as exc:
        if not isinstance(exc, kind):
            exc.add_aftermath(Aftermath(hint=otherwise))
            raise
        if not isinstance(exc, LinkError):
            stopped = hand.stop()
            exc.add_aftermath(Aftermath(behind=_told(stopped), moving=stopped.error is LinkError))
        raise
    finally:
        prompts.done()


def _told(stopped: Stopped) -> str:
    return f"{stopped.text}: {stopped.hint}" if stopped.error is not None and stopped.hint else stopped.text


def in_force(what: str, *, moving: bool = True) -> AbstractContextManager[None]:
    """Around objects that stay in force: an error in between says `what` the hand has got.

    Ctrl-C does so where nothing is `moving`, so that nothing is stopped.
    """
    return on_early_end(Aftermath(hint=what), by=HandctlError, interrupt=not moving)


@contextmanager
def stopped_if_cut_short(
    hand: AidinHand, prompts: Prompts, what: str = "", *, heartbeat: float = 0.0, ends: bool = True
) -> Iterator[None]:
    """Around a movement: Ctrl-C and any unexpected error stop the hand before anything is reported.

    The death of this process stops it, too. Where the link was lost it is opened again for that, whatever was to be kept
    up: nobody sees the hand any more. Without `ends` the hand is driven until a stop (see AidinHand).
    """
    driven = False
    hand.ends = ends
    try:
        with hand.driven(prompts, heartbeat=heartbeat, what=what), hand.conversation.guarded():
            hand.journal.moves(hand.stop)
            driven = True
            try:
                yield
            except HandctlError:
                raise  # who raised it has decided what becomes of the fingers
            except Exception:
                with prompts.stopping():
                    hand.stop()
                raise
    except HandctlError as exc:  # the child that guarded the old connection has gone, and with it the last to hold that
        lost, pressed = isinstance(exc, LinkError), isinstance(exc.__cause__, KeyboardInterrupt)
        if not driven or not (lost or exc.left.moving):
            raise
        stopped, told = _stop_again(hand, prompts, presses=0 if pressed else 1)
        if stopped is None:
            exc.hint = joined(UNTOLD if lost else "", exc.hint, told)
        elif pressed:  # what was said before it was stopped is no longer so
            raise interrupt_error(stopped._replace(text=f"{MENDED}: {stopped.text}"), what) from exc
        else:
            exc.hint = f"{MENDED}: {_told(stopped)}"
        raise
    finally:
        hand.ends = False


def _stop_again(hand: AidinHand, prompts: Prompts, presses: int) -> tuple[Stopped | None, str]:
    """Reopen a lost connection and stop the hand. Returns the result, or None and why it could not be opened.

    So many `presses` of Ctrl-C are passed over, for they ask for what is being done; one more ends it.
    """
    end, before = hand.link.deadline(AGAIN), prompts.unstoppable
    prompts.unstoppable = MENDS
    try:
        with prompts.count_interrupts() as counted:
            counted.most = presses
            while True:
                try:
                    if not hand.conversation.reconnect(end.remaining):
                        return None, ""
                except LinkError as exc:
                    told = f"tried to reconnect for {AGAIN:g} s ({exc.text})"
                else:
                    stopped = hand.stop()
                    if stopped.error is not LinkError:
                        return stopped, ""
                    told = f"tried to reconnect for {AGAIN:g} s ({stopped.text})"
                if end.expired:
                    return None, told
                hand.link.sleep(min(TRY, end.remaining))
    except KeyboardInterrupt:
        return None, "interrupted while reconnecting to send the stop"
    finally:
        prompts.unstoppable = before
