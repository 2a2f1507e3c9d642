"""Base classes of every family's device and line, as the common commands use them.

For the author of a family: its `Line` sends one request and judges the reply, its `Device` knows names and values and no
bytes. A family overrides what its protocol needs and inherits what every verb expects. Knows no family, does no I/O.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import lru_cache, partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ParamSpec, TypedDict, TypeVar

from handctl.errors import (
    CheckFailed,
    HandctlError,
    Hint,
    Interrupted,
    LinkError,
    NoAnswer,
    NotIdentified,
    NotPresent,
    ProtocolError,
    joined,
)
from handctl.families import FAMILIES
from handctl.fast_classes import NamedTuple
from handctl.model.command_settings import Settings
from handctl.model.param import PUSHES, Changes, Element, Number, Param, ParamMap, Reading, ValueChange, scale_of
from handctl.model.result import Column, Finding, Grid, Journal, Row, Table, hex_bytes
from handctl.model.stop_on_interrupt import stopped_by_ctrl_c, stopped_by_error
from handctl.model.stop_sequence import (
    StopContext,
    Stopped,
    StopPlan,
    StopSequence,
    context_for_link,
    found_again,
    run_stop,
    stop_sequence_of,
)
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.link import Deadline, Link
    from handctl.link.deadman import Guard
    from handctl.model.device_clock import Moment
    from handctl.model.movement import Clock
    from handctl.model.param import Step
    from handctl.model.prompts import Prompts
    from handctl.model.write_ledger import Addressee

OTHER_FORM = "other-form"
"""Code of a device whose replies are not those of the manual, in the same way each time."""
RETRIES = 2
"""Repetitions of a read that got no valid answer, unless --retries says otherwise."""

NOT_THERE = "not-on-this-firmware"
"""Code of what a device lacks, where everything is read."""

T = TypeVar("T")
P = ParamSpec("P")


class Limits(TypedDict):
    """What the user's options allow one exchange, and the whole command; None = what the family thinks right."""

    timeout: float | None
    retries: int | None
    bound: Deadline | None


@lru_cache(256)
def harmless_to_others(data: bytes, baud: int | None) -> bool:
    """Whether no other device on the line can act on these bytes. `baud` None = every device receives them unchanged.

    A device that listens at a slower baud rate than `baud` receives garbage.
    """
    triggers = (row.trigger for row in FAMILIES.values() if row.trigger is not None)
    return not any(set(data) & set(bytes_) for most, bytes_ in triggers if baud is None or baud <= most)


def limits_of(settings: Settings, link: Link) -> Limits:
    """--timeout, --retries and --deadline, this one from now on by the clock of the link."""
    end = link.deadline(settings.deadline) if settings.deadline is not None else None
    return {"timeout": settings.timeout, "retries": settings.retries, "bound": end}


TWO_REPLIES = "two-replies"


class Line:
    """The line to a device: its link, the journal, and the time limits of its requests.

    timeout  seconds allowed for a reply; `usual_timeout` where the user says nothing
    retries  repetitions of a read that got no valid answer; what writes is never repeated
    bound    deadline of the whole command, None = none
    """

    usual_timeout: float | None = None
    gave_up = False
    """A request got no reply in time: it may still come."""

    def __init__(
        self,
        link: Link,
        journal: Journal,
        *,
        timeout: float | None = None,
        retries: int | None = None,
        bound: Deadline | None = None,
    ) -> None:
        self.timeout = self.usual_timeout if timeout is None else timeout
        self.link = link
        self.journal = journal
        self.retries = RETRIES if retries is None else retries
        self.bound = bound

    @property
    def where(self) -> str:
        """Device and link for messages."""
        return self.link.name

    @property
    def at_speed(self) -> str:
        """`` at 9600 baud`` for messages, "" where this end cannot set it."""
        baud, ours = getattr(self.link, "baud", None), getattr(self.link, "can_set_baud", False)
        return f" at {baud} baud" if baud and ours else ""

    def wire_seconds(self, count: int) -> float:
        """Time that `count` bytes need on the wire, 10 bits each; 0 where the link has no speed."""
        baud = getattr(self.link, "baud", None)
        return count * 10 / baud if baud else 0.0

    @property
    def over(self) -> bool:
        """Whether --deadline has passed."""
        return self.bound is not None and self.bound.expired

    def deadline(self, seconds: float) -> Deadline:
        """The deadline `seconds` from now, or the command's own where that is earlier."""
        end = self.link.deadline(seconds)
        return end if self.bound is None else end.earlier(self.bound)

    def check_bound(self, unsent: str = "") -> None:
        """Raise NoAnswer when --deadline has passed; nothing is sent then, `unsent` neither: the device may be worn."""
        if self.over:
            unsent = f"{unsent} was not sent" if unsent else ""
            raise NoAnswer(
                joined(f"{self.where}: --deadline has passed", unsent), hint="give a longer --deadline", code="deadline"
            )

    def pause(self, seconds: float) -> None:
        """Let time pass, but not beyond the deadline of the command."""
        self.link.sleep(min(seconds, self.bound.remaining) if self.bound is not None else seconds)

    def clock(self, wait: float, refresh: float) -> Clock:
        """The time of a movement that is watched for `wait` seconds at most, every `refresh` seconds."""
        from handctl.model.movement import Clock

        end = self.link.deadline(wait)

        def tick() -> None:
            self.pause(refresh)
            self.out_of_time("the end of the movement", "that")

        return Clock(self.link.now, lambda: end.expired, tick)

    def out_of_time(self, before: str, awaited: str) -> None:
        """Raise NoAnswer when --deadline, not the device, ended a wait: it passed `before` something, and `awaited` is waited for."""
        if self.over:
            raise NoAnswer(
                f"{self.where}: --deadline passed before {before}. The result is not known",
                hint=f"read the values before you repeat the command. With a longer --deadline, handctl waits for {awaited}",
                code="deadline",
            )

    def reopened(self) -> None:
        """The port was opened again: pending replies are lost, and it may lead to a different device."""

    def overheard(self, data: bytes) -> None:
        """Take bytes that were read from this line before it was used: they may show the state of the device."""

    def repeated(self, retries: int | None, ask: Callable[P, T], *args: P.args, **more: P.kwargs) -> T:
        """Call `ask`, again if there is no valid reply, and return its result; for reads only. Raises its last error."""
        for attempt in range(1 + (self.retries if retries is None else retries)):
            if attempt:
                self.journal.counters.retries += 1
            try:
                return ask(*args, **more)
            except (NoAnswer, ProtocolError) as exc:
                error = self.journal.blame(exc)
            if self.over:
                break
        raise error

    def other_form(
        self, exc: ProtocolError, differs: Callable[[bytes], Sequence[str]], again: Callable[[], Sequence[str]]
    ) -> ProtocolError:
        """`exc`; or, where what came instead `differs` from a reply in the same known ways twice, the error that says so.

        Contact need only be evident; a value is read from nothing but what the manual describes. `again` asks something
        else that is harmless, and returns how what came then differs.
        """
        ways = [] if self.over or self.link.replayed else list(differs(exc.came))
        if not ways or list(again()) != ways:
            return exc
        made = exc.reworded(
            f"{self.where}: the device replies, but not as the manual describes: {', '.join(ways)} (received {hex_bytes(exc.came[:40])})",
            hint="record the bytes with --trace FILE, and ask the vendor: it may have another firmware. handctl reads no values from such replies",
            code=OTHER_FORM,
        )
        assert isinstance(made, ProtocolError)
        return made

    def two_replies(self, first: object, second: object) -> bool:
        """Warn once that one read got two replies with different data, as far as that was seen without waiting for it.

        Where a request was given up, the other one may be its late reply: then nothing is claimed. Returns whether it is.
        """
        if self.journal.counters.retries or self.gave_up:
            return False
        if not any(message.code == TWO_REPLIES for message in self.journal.messages):
            self.journal.warn(
                TWO_REPLIES,
                f"{self.where}: one request got two different replies: {first}, then {second}. The values may come from either of them",
                hint=Hint(
                    "check for two devices with this id, or another program that reads the same: {}",
                    f"doctor -p {self.link.name}",
                ),
            )
        return True

    def unanswered(self, request: str, allowed: float, since: float, hint: str) -> NoAnswer:
        """The error of silence: `request` was sent at the moment `since`, and `allowed` seconds were to be waited.

        Where --deadline has cut that short it tells so, and the seconds that were really waited.
        """
        self.gave_up = True
        seconds = self.link.now() - since
        bounded = self.over and seconds < allowed
        waited = f"before --deadline passed, after {round(seconds, 2):g} s" if bounded else f"within {allowed:g} s"
        error = NoAnswer(f"{self.where}: no reply to {request} {waited}", hint=hint)
        error.bounded = bounded
        return error


class Device(ABC):
    """One device behind a line, as the verbs know it (`command.get_set_watch`, `command.snapshots`, `report`).

    kind         the name of its command and its simulator
    product      its model, if the reply to any read identifies it; "" = it does not
    map          its parameters; what is not in it does not exist for the verbs
    columns      of its tables; `plain` of --format plain, where these are fewer
    live         the quantities that change during use: the default of `watch`
    additional   also shown in the live view when no quantity was named; those in `slowly` once a second
    vital        without which `status --check` finds no device healthy
    scales       ends of the live view's bars where no range is documented: ours, and wider as soon as more is seen
    no_value     keys of a row whose value could not be read, beside its error
    worn         a person may be wearing it, so movements need a confirmation
    setpoint_pairs  set points and the quantities that follow them, `releases` the writes that let an axis go there (`SetpointPair`, `Release`)
    not_covered  what a snapshot cannot contain; `restore` reports it
    line_end     what ends a typed line of text, None where the protocol is no text
    options      what the user said of it

    A family writes `read`, `element_keys`, `value_keys` and `view`; `plan` and `write` where values can be set by name; and overrides
    what its device does otherwise, by calling this one first where it adds to it.
    """

    kind: str
    product = ""
    map: ParamMap[Any]
    columns: tuple[Column, ...]
    plain: tuple[str, ...] = ()
    live: tuple[str, ...]
    additional: tuple[str, ...] = ()
    slowly: tuple[str, ...] = ()
    vital: tuple[str, ...] = ()
    scales: Mapping[str, tuple[float, float]] = MappingProxyType({})
    no_value: Mapping[str, None] = MappingProxyType({})
    worn = False
    setpoint_pairs: Sequence[SetpointPair] = ()
    releases: Sequence[Release] = ()
    not_covered: tuple[str, ...] = ()
    line_end: bytes | None = None
    options = Settings()

    def __init__(self, line: Line) -> None:
        self._line = line
        self.about: dict[str, str] = {}
        """Model, firmware and serial number as far as they were read, whatever for."""

    @property
    def link(self) -> Link:
        """Where it is, and its clock."""
        return self._line.link

    @property
    def journal(self) -> Journal:
        """Where messages and counters go."""
        return self._line.journal

    def overheard(self, data: bytes) -> None:
        """Bytes that came before anything was asked, and were read by somebody else."""
        self._line.overheard(data)

    def reopen(self, again: Callable[[], bool]) -> bool:
        """Open a port that was lost by `again`, unless --deadline has passed; False where there is no such way. Raises LinkError."""
        self._line.check_bound()
        if not again():
            return False
        self._line.reopened()
        return True

    def again(self, journal: Journal) -> bool:
        """Serve the next command, which reads the same on the same link, and tells `journal`; False where each command begins anew."""
        return False

    # -- identity ------------------------------------------------------------------------------------------------

    def identity(self) -> dict[str, object]:
        """Model, firmware and serial number of this device, as far as they can be read."""
        return {"kind": self.kind}

    def identify(self) -> None:  # noqa: B027 - where whatever is read tells who it is, there is nothing to do
        """Identify the device before reading for a plan, so that a different one is named instead of called silent. Raises NotIdentified."""

    def ready(self) -> None:  # noqa: B027 - most have nothing to find out
        """Detect its protocol variant where that takes time, so that it does not delay the first sample of a stream."""

    def own_map(self) -> ParamMap[Any]:
        """The map of this particular device, for families with several."""
        return self.map

    def map_of(self, identity: Mapping[str, object]) -> ParamMap[Any]:
        """The map of the device that said this of itself, for families with several; where it is not known, this one's."""
        return self.own_map()

    def find_for_restore(self, values: dict[str, Number]) -> None:  # noqa: B027 - most have no address to set
        """Make the line address the device that a restore is for; nothing to do unless its address is a setting."""

    def further(self, identity: dict[str, object]) -> Collection[str]:
        """Names of the `optional` settings that this particular device has, according to its identity."""
        return ()

    # -- stopping ------------------------------------------------------------------------------------------------

    def stop_context(self) -> StopContext:
        """The context of its stop sequence: everything this program knows about it."""
        settings = self.options._replace(id=getattr(self._line, "id", self.options.id))
        context = context_for_link(self.link, settings)._replace(fixed=True, proven=not self.link.elsewhere)
        going = tuple(one for one in self.journal.ledger.going if one is not None)
        return context if going in ((), ((self.kind, context.number),)) else context._replace(going=going)

    def stop_plans(self, *devices: Addressee | None) -> list[StopPlan]:
        """How each of these devices on its line is stopped: family and id, None = this one."""
        context = self.stop_context()
        own = self.kind, context.number
        return [StopPlan(one[0], context.of(own, one)) for one in dict.fromkeys(one or own for one in devices)]

    def stop(self, *, powered: bool = False) -> Stopped:
        """Stop it by its family's plan, after --deadline too; `powered` as in `StopContext`. Never raises.

        A link that was lost is opened again for that, where that can be done, and who is there is asked anew.
        """
        stopped = self._stopped(powered)
        return self._stopped(powered) if stopped.error is LinkError and self.found_again() else stopped

    def found_again(self) -> bool:
        """Whether its link, which was lost, could be opened again for a stop. Never raises."""
        return found_again(self.link)

    def _stopped(self, powered: bool) -> Stopped:
        ledger = self.journal.ledger
        sequence = stop_sequence_of(self.kind, self.stop_context()._replace(powered=powered))
        return run_stop(self.link, sequence, ledger=ledger if ledger.words is not None else None)

    @contextmanager
    def guarded(
        self,
        *,
        heartbeat: float = 0.0,
        sequence: Callable[[StopContext], StopSequence] | None = None,
    ) -> Iterator[Guard]:
        """While this is active, the death of this process stops the device by the same plan, or by `sequence`, and whatever else on its
        line the command has said that it moves. Raises LinkError.

        `heartbeat` as in `link.deadman`.
        """
        from handctl.link.deadman import guard_link

        own, *others = self.stop_plans(None, *self.journal.ledger.meant)
        own = StopPlan(self.kind, own.context, sequence)
        with ExitStack() as stack:
            for stop in (own, *others):
                guard = stack.enter_context(guard_link(self.link, stop, self.journal.warn, heartbeat=heartbeat))
            yield guard

    @contextmanager
    def driven(
        self,
        prompts: Prompts,
        *,
        heartbeat: float = 0.0,
        powered: bool = False,
        what: str = "",
        who: str = "The device",
    ) -> Iterator[Guard]:
        """Around a movement of `who`: Ctrl-C, an error and the death of this process stop it. Raises Interrupted with `what` and the result of the stop.

        `powered` as in `StopContext`, but not for the death of this process: nobody is told then which motors hold on.
        """
        stop = partial(self.stop, powered=powered)
        with (
            self.guarded(heartbeat=heartbeat) as guard,
            stopped_by_ctrl_c(stop, prompts, what),
            self.stopped_by_error(stop, prompts, who),
        ):
            yield guard

    def stopped_by_error(self, stop: Callable[[], Stopped], prompts: Prompts, who: str) -> AbstractContextManager[None]:
        """Around a movement: an error stops it."""
        return stopped_by_error(stop, prompts, self.journal.counters, who)

    # -- reading -------------------------------------------------------------------------------------------------

    @abstractmethod
    def read(self, elements: Sequence[Element]) -> list[Reading]:
        """Read elements in as few questions as the protocol allows. An element that cannot be read carries its error.

        Raises NoAnswer, ProtocolError when nothing at all could be read, LinkError when the link is lost.
        """

    def block(self, name: str) -> Callable[[], list[Row]] | None:
        """What reads a block of values that the map does not have one by one, such as `tactile`; None = no such name. May read the device."""
        return None

    def follow(self) -> None:  # noqa: B027 - most devices say nothing unasked
        """From now on a reading is the next unsolicited message of the device, and none is skipped."""

    def reading_time(self) -> Moment | None:
        """The time within which the last reading arrived, if it may have waited in a buffer; None = since its request."""
        return None

    def of_this_device(self, elements: Sequence[Element]) -> Sequence[Element]:
        """Those of `elements` that this particular device has; another generation may have other parts. Raises what `read` raises."""
        return elements

    @abstractmethod
    def element_keys(self, element: Element) -> Row:
        """The keys of a row that identify its element (cli contract, row keys)."""

    @abstractmethod
    def value_keys(self, reading: Reading) -> Row:
        """The keys of a row for the value: value, unit and the family's own."""

    @staticmethod
    @abstractmethod
    def view(rows: list[Row]) -> list[Grid]:
        """The tables that show rows of readings to people."""

    def row(self, reading: Reading) -> Row:
        """The data row of one reading, or its error. The keys that come from the map are the same in all families."""
        element, value, error = reading.element, reading.value, reading.error
        param, row = element.param, self.element_keys(element)
        if error is not None or value is None:
            row |= {"error": error.text if error is not None else "not read", "unit": param.unit}
            return {**row, "path": element.path, **self.no_value}
        row |= self.value_keys(reading)
        row["path"] = element.path
        self.keep_facts(param, row["value"])
        if (scale := scale_of(param.unit or "")) is not None:
            row |= {"scaled": scale.of(value), "scaled_unit": scale.unit}
        if param.alarms:
            row["errors"] = param.errors(int(value))
        return row

    def keep_facts(self, param: Param, value: object) -> None:
        """What a value that was read tells about the device itself."""
        if self.product:
            self.about.setdefault("model", self.product)
        if param.tells and value:
            self.about[param.tells] = str(value)

    def table(self, readings: Sequence[Reading], title: str = "") -> Table:
        """Readings as a Table. If some could not be read, that is its failure, and the others are still shown."""
        failed = [reading for reading in readings if reading.error is not None]
        return Table(
            rows=[self.row(reading) for reading in readings],
            columns=self.columns,
            title=title,
            view=self.view,
            plain=self.plain,
            failure=self.partial(failed) if failed else None,
        )

    def partial(self, failed: Sequence[Reading]) -> HandctlError | None:
        """The error of a table of which these readings `failed`."""
        return failed[0].error

    def lacks(self, error: HandctlError) -> bool:
        """Whether this error of one reading, among others that came, shows that this firmware does not have it."""
        return isinstance(error, NotPresent)

    def present(self, readings: Sequence[Reading]) -> list[Reading]:
        """The readings without what this firmware does not have, which is told once; all of them where that is most of it.

        For what reads everything. Who asks for one thing by name is told that it is refused.
        """
        absent = [one for one in readings if one.error is not None and self.lacks(one.error)]
        lacks = dict.fromkeys(reading.element.param.name for reading in absent)
        has = {reading.element.param.name for reading in readings if reading.value is not None}
        if not absent or len(lacks) > len(has):
            return list(readings)
        names = ", ".join(lacks)
        may = f"no reply to reads of {names}: perhaps not on this firmware"
        text = may if is_silent(absent) else f"not on this firmware: {names}"
        if not any(message.text == text for message in self.journal.messages):
            said, why = reply_text(self._line.where, absent[0]), absent[0].error
            refused = why is not None and why.exit_code == NotPresent.exit_code
            self.journal.info(NOT_THERE, text, hint=f"it replied: {said}" if refused else said)
        return [one for one in readings if one.error is None or not self.lacks(one.error)]

    @contextmanager
    def keep_partial(self, so_far: Callable[[], Sequence[Reading]]) -> Iterator[None]:
        """Around reading: when it ends in the middle, what was read `so_far` is shown, if there is anything."""
        try:
            yield
        except (HandctlError, KeyboardInterrupt):
            if readings := so_far():
                self.journal.keep(self.table(readings))
            raise

    def dump(self) -> Table:
        """Everything documented that every device of this kind has."""
        dumped = [param for param in self.map if param.readable and not param.optional]
        return self.table(self.present(self.read([element for param in dumped for element in param.each])))

    def with_findings(
        self,
        table: Table,
        findings: Sequence[Finding],
        check: bool,
        *,
        more: Callable[[], Sequence[str]] = tuple,
    ) -> Table:
        """The table of `status` with its findings as warnings, each with its remedy.

        With `check`, findings and those of `more` give exit code 7, with the remedy of the most urgent one.
        """
        from handctl.model.device_picture import hint_for, hint_of

        read = {row["name"] for row in table.rows if row.get("value") is not None}
        if unread := [name for name in self.vital if name not in read]:
            text = f"{', '.join(unread)} could not be read: whether it is healthy is not known"
            findings = [*findings, Finding(text, (), Hint("run {}", f"{self.kind} doctor"))]
        for finding in findings:
            self.journal.warn("unhealthy", finding.text, hint_for(self.kind, finding))
        every = [*more(), *(finding.text for finding in findings)]
        if check and every and table.failure is None:
            text = joined(f"{self._line.where}: {plural(len(every), 'finding')}", *every)
            table.failure = CheckFailed(text, hint=hint_of(self.kind, findings), code="unhealthy")
        return table

    # -- typed bytes ---------------------------------------------------------------------------------------------

    def plan_typed(self, data: bytes, can_id: int | None) -> tuple[Step, str] | None:
        """What typed bytes would do, and the question before they go out, "" = none; None: ask before all but a request to read.

        Sends nothing. Raises UsageError for what is never sent as it is typed.
        """
        return None

    def ready_to_ask(self) -> None:  # noqa: B027 - most devices are alone on their line
        """Called before a question about a write. Sends nothing; raises DeviceRefused where it is already known that the write would be refused."""

    def admit(self, data: bytes, can_id: int | None) -> None:
        """Called before typed bytes that may write are sent. Raises NotIdentified."""
        self.identify()

    def tell_left(self, data: bytes) -> None:  # noqa: B027 - most devices end by themselves what they were told
        """Tell what goes on behind the end of a terminal in which this `data` was sent, and nothing has stopped the device since."""

    # -- writing -------------------------------------------------------------------------------------------------

    def will_move(self) -> None:
        """Call this before a write that moves the device: from then on an interrupt stops it."""
        self.journal.moves(self.stop)

    def plan(self, changes: Sequence[tuple[Element, Number]]) -> list[Step]:
        """The exact bytes that `write` would send for checked `changes`. Sends nothing."""
        raise NotImplementedError(f"{self.kind} sets nothing by name")

    def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        """Write checked changes, each once, and read all of them back.

        Raises DeviceRefused; CheckFailed when the read-back differs, which it says with both values.
        """
        raise NotImplementedError(f"{self.kind} sets nothing by name")

    def lets_go(self, changes: Sequence[tuple[Element, Number]]) -> list[PendingMove]:
        """The axes that these writes let go, beside those that they command. Raises what kept it from being read."""
        names = {element.param.name for element, _ in changes}
        if not any(release.by in names for release in self.releases):
            return []
        self.identify()
        return pending_moves(self, changes)

    def check_read_back(
        self, changes: Sequence[tuple[Element, Number]], readings: Sequence[Reading], hint: str
    ) -> None:
        """Raise CheckFailed where a reading is not what was written."""
        found = {reading.element.full_name: reading.value for reading in readings}
        wrong = [
            f"{name} could not be read back"
            if found[name] is None
            else f"{name} reads {found[name]} after {value} was written"
            for name, value in ((element.full_name, value) for element, value in changes)
            if found[name] != value
        ]
        if wrong:
            raise CheckFailed(f"{self._line.where}: {'; '.join(wrong)}", hint=hint, code="read-back")


def reply_text(where: str, reading: Reading) -> str:
    """The reply of the device to a read that failed, without the name of the link."""
    return reading.error.text.removeprefix(where).lstrip(": ") if reading.error is not None else ""


def is_silent(absent: Sequence[Reading]) -> bool:
    """Whether the device did not reply to some of these reads, which may have another cause than that it lacks them."""
    return any(one.error is not None and one.error.exit_code == NoAnswer.exit_code for one in absent)


# -- check of the identity, before the first write ---------------------------------------------------------------------------


class Gate:
    """The identity check before writes: passed once the identity was checked, or with `--assume-identity`."""

    def __init__(self, assumed: bool = False) -> None:
        self.assumed = assumed
        self.passed = False

    def check(self, link: Link, journal: Journal, look: Callable[[], object]) -> None:
        """Look, unless that is done. Raises NotIdentified, Interrupted: nothing was written then.

        `look` raises what speaks against this family. On a transcript without it, it is left out with a note.
        """
        if self.passed:
            return
        if self.assumed:
            self.tell(journal)
        else:
            try:
                look()
            except KeyboardInterrupt as exc:
                raise Interrupted("interrupted while checking the device's identity. Nothing was written") from exc
            except HandctlError as exc:
                if not link.replayed or exc.code != "replay-miss":
                    raise NotIdentified(exc) from exc
                journal.info("not-recorded", "the identity check was not recorded, so this replay skips it")
        self.passed = True

    @staticmethod
    def tell(journal: Journal) -> None:
        """Report once that the identity is not checked."""
        if not any(message.code == "identity-assumed" for message in journal.messages):
            text = "the device's identity was not checked, because of --assume-identity"
            journal.warn("identity-assumed", text)


# -- movements that a write would release --------------------------------------------------------------------------------------


class SetpointPair(NamedTuple):
    """A set point and the quantity that shows the position of its axis; within `near` it counts as reached.

    closing  1 or -1: whether the axis closes as the number grows or falls; 0 = not known
    unknown  a reading that is no position
    """

    target: str
    actual: str
    near: Number
    closing: int = 0
    unknown: Number | None = None

    def reached(self, here: Number, target: Number) -> bool:
        """Whether the axis is at its target, as far as its position is known."""
        return here != self.unknown and abs(target - here) <= self.near

    def closes(self, here: Number, target: Number) -> bool:
        """Whether going from here to there closes, as far as that is known."""
        return self.closing == 0 or (target - here) * self.closing > 0


class Release(NamedTuple):
    """Writing the quantity `by` may let an axis go.

    held   what shows whether it is held by that now
    frees  (the number it holds now, the number that is written) -> whether it is let go
    closing  only axes that would close are held by it
    """

    by: str
    held: str
    frees: Callable[[Number, Number], bool]
    closing: bool = False


class PendingMove(NamedTuple):
    """An axis that would move from `here` to `there`, or push with the force `there`: then `here` is None.

    `there` is None where the device does not show its target: nobody knows whether it would move.
    """

    part: str
    target: str
    here: Number | None
    there: Number | None

    def row(self, *more: tuple[str, str]) -> ValueChange:
        """Its line of the table that a question shows."""
        return ValueChange(f"{self.part} ({self.target})", self.here, "?" if self.there is None else self.there, more)


def pending_moves(device: Device, changes: Sequence[tuple[Element, Number]]) -> list[PendingMove]:
    """The axes that these writes would let go, from what the device tells now. Raises what kept it from being read."""
    freed: dict[tuple[str, bool], None] = {}
    # let go by a trigger: it was driven until its error came, so a target that reads as none is one that is not shown
    triggered: set[str] = set()
    unshown: dict[str, PendingMove] = {}
    for release in device.releases:
        written = {element.part: value for element, value in changes if element.param.name == release.by}
        if not written:
            continue
        whole = None in written  # a trigger concerns all axes
        parts = [one for one in device.map[release.held].each if whole or one.part in written]
        for element, old in zip(parts, _values(device, parts), strict=True):
            if release.frees(old, written[None if whole else element.part]):
                freed[element.part or "", release.closing] = None
                triggered |= {element.part or ""} if whole else set()
    if not freed:
        return []
    found: dict[PendingMove, None] = {}
    for course in device.setpoint_pairs:
        wanted = {part for part, _ in freed}
        targets = [one for one in device.map[course.target].each if one.part in wanted]
        places = [one for one in device.map[course.actual].each if one.part in wanted]
        values = _values(device, [*targets, *places])
        at = dict(zip((one.full_name for one in (*targets, *places)), values, strict=True))
        for element in targets:
            part = element.part or ""
            there, here = at[element.full_name], at.get(f"{course.actual}.{part}")
            if here is None or there in element.param.special:
                if part in triggered:
                    unshown.setdefault(part, PendingMove(part, course.target, here, None))
                continue
            triggered.discard(part)
            if course.reached(here, there):
                continue
            if (part, False) in freed or course.closes(here, there):
                found[PendingMove(part, course.target, here, there)] = None
    found.update({one: None for part, one in unshown.items() if part in triggered})
    forces = [one for param in device.map if param.acts == PUSHES for one in param.each]
    forces = [one for one in forces if (one.part or "", False) in freed]
    for element, force in zip(forces, _values(device, forces) if forces else (), strict=True):
        if force:
            found[PendingMove(element.part or "", element.param.name, None, force)] = None
    return list(found)


def _values(device: Device, elements: Sequence[Element]) -> list[Number]:
    return [reading.required for reading in device.read(elements)]


def pending_table(waiting: Sequence[PendingMove]) -> Changes:
    """The table of the question before such a write."""
    return Changes("Axis", rows=[one.row() for one in waiting])


def question(waiting: Sequence[PendingMove]) -> str:
    """The question before such a write."""
    moving = [one.part for one in waiting if one.here is not None and one.there is not None]
    hidden = [one for one in waiting if one.there is None]
    text = "This moves what has not reached its target yet" if moving else ""
    if hidden:
        text = joined(text, "This may move what was stopped by an error: the device does not show its target")
    if len(set(moving)) < len(moving):
        text += ". Of two targets of a finger, the one that was set last counts"
    return joined(
        text, "This may let a finger push with its commanded force" if len(moving) + len(hidden) < len(waiting) else ""
    )
