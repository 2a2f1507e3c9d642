"""`terminal` of every family: bytes both ways, as they are typed and as they come, each with what it means. Knows no family.

What is dangerous the family's device tells (`Device.plan_typed`), as `raw` and `gcl` ask for it; where a family has neither,
everything is asked for that is not a whole request to read. Bytes of an incomplete line count with those that follow.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, NamedTuple

from handctl.command.family import load, on_can
from handctl.command.run import PlannedAction
from handctl.command.terminal_prompts import is_terminal
from handctl.errors import (
    DeviceRefused,
    HandctlError,
    Hint,
    Interrupted,
    LinkError,
    NoAnswer,
    ProtocolError,
    UsageError,
)
from handctl.files import refuse_controls, unmarked
from handctl.link.link_interface import CanFrame, FrameLink
from handctl.link.transcript import Entry, observed
from handctl.model.explainer import DEVICE, HOST
from handctl.model.param import Step
from handctl.model.result import Column, Row, Table
from handctl.system import terminal as keys
from handctl.tools.listen import COLUMNS, line_of, received, row_of, width_of
from handctl.tools.trace import parse_given
from handctl.tools.trace_reader import TranscriptReader, TranscriptRow, explainer_of
from handctl.wording import sentence

if TYPE_CHECKING:
    from handctl.command.run import Run
    from handctl.link import Link

PATIENCE = 10
"""So many times as long is waited while a reply is incomplete, or the device goes on speaking."""
LOOK = 0.05
"""Seconds between two looks whether a line was typed."""
LONGEST = 4096
UNANSWERED = (NoAnswer.exit_code, ProtocolError.exit_code)
"""Exit codes of a line without a valid reply: what it has set going nobody has seen to end."""
WRITE_SECONDS = 2.0


class Typed(NamedTuple):
    """One line: what goes out, the same with what was begun before, the question before it ("" = none), whether it may write."""

    step: Step
    whole: bytes
    question: str
    writes: bool

    @property
    def asked(self) -> str:
        """The question with what the line does."""
        return f"{self.question}: {self.step.meaning}" if self.question else ""


class Keyboard:
    """Typed lines -> what they would send. Sends nothing."""

    def __init__(self, run: Run, *, as_hex: bool) -> None:
        self._planner = run.planner()
        self._kind, self._can = run.family.kind, on_can(run.settings)
        self._end: bytes | None = None if as_hex or self._can else self._planner.line_end
        self._rules = load(self._kind, "write_rules").words()
        self._begun = b""
        """The end of what was sent before, where that is no whole frame: the device may take what follows for its rest."""

    @property
    def takes(self) -> str:
        """What a line is, for people."""
        if self._can:
            return "type CAN frames, such as 1A3#DEADBEEF"
        return "type hexadecimal bytes" if self._end is None else "type lines of text, or hex and bytes"

    def take(self, text: str, *, goes: bool = False) -> Typed:
        """One line, which `goes` out before the next. Raises UsageError for what cannot be sent, and what is never sent."""
        refuse_controls(text)
        data, can_id = self._parsed(text)
        whole = data if self._can else self._begun + data
        planned = self._planner.plan_typed(whole, can_id)
        step, question = planned if planned is not None else self._judged(whole, can_id)
        writes = bool(question) or self._rules.planned(whole, can_id) is not None
        typed = Typed(step._replace(data=data, can_id=can_id), whole, question, writes)
        if goes:
            self.sent(typed)
        return typed

    def sent(self, typed: Typed) -> None:
        """These bytes have gone out."""
        if not self._can:
            pieces = explainer_of(self._kind).decode(typed.whole, HOST)
            self._begun = b"" if not pieces or pieces[-1].frame else pieces[-1].raw[-LONGEST:]

    def _parsed(self, text: str) -> tuple[bytes, int | None]:
        if self._end is not None and not text.startswith("hex "):
            return text.encode() + self._end, None
        found = parse_given(text.removeprefix("hex "))
        if len(found) != 1 or (found[0].can_id is not None) != self._can:
            what, form = "stretch of bytes", "hexadecimal bytes, such as EB 90 01"
            if self._can:
                what, form = "CAN frame", "IDENTIFIER#DATA, such as 1A3#DEADBEEF"
            raise UsageError(f"{text!r} is not one {what}", hint=f"write {form}")
        return found[0].data, found[0].can_id

    def _judged(self, data: bytes, can_id: int | None) -> tuple[Step, str]:
        """Only what is a whole request to read goes out unasked."""
        pieces = explainer_of(self._kind).decode(data, HOST, can_id)
        step = Step("; ".join(piece.meaning for piece in pieces), data, moves=True, strands=True, can_id=can_id)
        if all(piece.frame and piece.asks and self._rules.planned(piece.raw, can_id) is None for piece in pieces):
            return step._replace(moves=False, strands=False), ""
        return step, "This may move or change the device"


class Conversation:
    """The open link, with every byte that passes as rows. It observes the link, so that an identity check and a stop show too.

    told  the rows of what was typed and came, without those of the identity check
    """

    def __init__(self, run: Run, wait: float, show: Callable[[Row], None]) -> None:
        """Opens the link. Raises UsageError, LinkError."""
        self._run, self._wait, self._show = run, wait, show
        self._reader = TranscriptReader(run.family.kind)
        self.told: list[TranscriptRow] = []
        self._last: float | None = None
        self._checking = False
        self._guarded: set[tuple[str, int]] = set()
        self._moved = b""  # what was sent since the first line that moves something
        self._stack = ExitStack()
        self.link: Link = run.open_link()
        self._start = self.link.now()
        observed(self.link, self)

    # -- what passes (see link.transcript.Observer) ---------------------------------------------------------------------

    def opened(self, now: float) -> None:
        """See Observer."""

    def event(self, now: float, text: str) -> None:
        """See Observer."""
        self._take(self._reader.take(Entry(max(0.0, now - self._start), "!", b"", text)))

    def passed(self, now: float, mark: str, data: bytes, can_id: int | None) -> None:
        """See Observer."""
        self._take(self._reader.take(Entry(max(0.0, now - self._start), mark, data, "", can_id)))

    def _take(self, told: Sequence[TranscriptRow]) -> None:
        counters = self._run.journal.counters
        for one in told:
            self._show(row_of(one, self._last))
            self._last = one.last.t
            if not self._checking and (piece := one.piece) is not None and piece.direction == DEVICE:
                counters.received += piece.frame
                counters.stray_bytes += 0 if piece.frame else len(piece.raw)
        self.told += () if self._checking else told

    def over(self) -> None:
        """Show what is incomplete as it is, and which replies are missing."""
        self._take(self._reader.over())

    # -- both ways -----------------------------------------------------------------------------------------------------

    def send(self, typed: Typed) -> None:
        """One line, once. From the first that moves something on, Ctrl-C, a missing reply and the death of this process stop the device.

        Raises NotIdentified, NoAnswer where --deadline has passed, LinkError, UsageError for what no stranger may get.
        """
        run, step, link = self._run, typed.step, self.link
        device = run.device()
        if run.settings.assume_identity and step.can_id is None:
            from handctl.model.other_family_bytes import refuse_for_strangers

            refuse_for_strangers(typed.whole)
        if typed.writes:
            self._checking = True
            try:
                device.admit(typed.whole, step.can_id)
                self.over()
            finally:
                self._checking = False
        if run.end is not None and link.now() >= run.end:
            text = f"{link.name}: --deadline has passed. {step.wire} was not sent"
            raise NoAnswer(text, hint="give a longer --deadline", code="deadline")
        run.ledger.meant.update(dict.fromkeys(self._addressed(typed)))
        if step.moves and not (run.journal.drives and self._guarded.issuperset(run.ledger.meant)):
            guarded = device.guarded() if run.journal.drives else device.driven(run.prompts, what="in the terminal: ")
            device.will_move()  # a batch or a shell remembers it behind the end of the terminal
            self._stack.enter_context(guarded)
            self._guarded = set(run.ledger.meant)
        run.journal.counters.sent += 1
        run.journal.counters.writes += typed.writes
        deadline = link.deadline(WRITE_SECONDS)
        if isinstance(link, FrameLink):
            link.send(CanFrame(step.can_id or 0, step.data), deadline)
        else:
            link.write(step.data, deadline)  # type: ignore[attr-defined]
        self._moved += step.data if run.journal.drives else b""

    def _addressed(self, typed: Typed) -> Collection[tuple[str, int]]:
        """Family and id of what a line moves. An earlier one may have begun its frame."""
        words = self._run.ledger.words
        return words.addressed(typed.whole, typed.step.can_id) if words is not None and typed.step.moves else ()

    def hear(self) -> None:
        """Until nothing has come for the wait; longer while a reply is missing. Raises LinkError."""
        link, run = self.link, self._run
        longest, least = link.deadline(PATIENCE * self._wait), link.deadline(self._wait)
        while not (longest.expired or link.over or (run.end is not None and link.now() >= run.end)):
            data, can_id = received(link, link.deadline(self._wait).earlier(longest))
            silent = not data and can_id is None
            if not self._reader.waits and (silent or least.expired):
                break

    @property
    def waits(self) -> bool:
        """Whether the reply to a line is missing."""
        return self._reader.waits

    def failure(self) -> HandctlError | None:
        """What speaks against the replies to what was typed."""
        where, hint = self.link.name, "listen longer with --wait S"
        came = [one.piece for one in self.told if one.piece is not None and one.piece.direction == DEVICE]
        refused = next((piece for piece in came if piece.problem == "refused"), None)
        if refused is not None:
            return DeviceRefused(
                f"{where}: {refused.meaning}",
                hint=Hint("{} shows the state of the device", f"{self._run.family.kind} status"),
            )
        missing = next((one.unanswered for one in self.told if one.unanswered is not None), None)
        if not came:
            what = f" to: {missing.meaning}" if missing is not None else ""
            return NoAnswer(f"{where}: no reply{what}", hint=hint)
        if missing is None:
            return None
        code = "echo" if all(piece.problem == "echo" for piece in came) else "garbage"
        return ProtocolError(f"{where}: what came is no valid reply to: {missing.meaning}", hint=hint, code=code)

    def __enter__(self) -> Conversation:
        return self

    def __exit__(self, kind: type[BaseException] | None, *exc: Any) -> bool | None:
        if self._moved and (kind is None or issubclass(kind, HandctlError)):  # Ctrl-C has stopped it
            self._run.device().tell_left(self._moved)
        return self._stack.__exit__(kind, *exc)


# -- the command ------------------------------------------------------------------------------------------------------


def terminal(run: Run, lines: Sequence[str], wait: float, *, as_hex: bool) -> Table | PlannedAction:
    """Send the lines, or those of stdin; a prompt for them where stdin is a terminal."""
    if not lines and run.typed.isatty():
        return _at_prompt(run, wait, as_hex=as_hex)
    texts = list(lines) or [
        text for line in unmarked(run.typed) if (text := line.rstrip("\r\n")).strip() and text[0] != "#"
    ]
    if not texts:
        raise UsageError("no line given", hint="give lines as arguments or on stdin, or run it on a terminal")
    keyboard = Keyboard(run, as_hex=as_hex)
    typed = [keyboard.take(text, goes=True) for text in texts]
    asks = [one for one in typed if one.question]
    questions = dict.fromkeys(one.question for one in asks)
    question = asks[0].asked if len(asks) == 1 else ". ".join(questions)

    def act(_device: Any) -> Table:
        rows: list[Row] = []
        failure: HandctlError | None = None
        try:
            with Conversation(run, wait, rows.append) as talk:
                for one in typed:
                    talk.send(one)
                    talk.hear()
                    talk.over()
                    failure = talk.failure()
                    if failure is not None and failure.exit_code in UNANSWERED:
                        raise failure  # what it has set going is stopped
                    if failure is not None:
                        break
        except HandctlError as exc:  # what passed before is shown
            failure = exc
        width = width_of(run)
        text = lambda rows: "".join(line_of(row, width, as_hex=as_hex) + "\n" for row in rows)  # noqa: E731
        return Table(rows=rows, columns=(Column("t", unit="s"), *COLUMNS), text=text, failure=failure)

    return PlannedAction([one.step for one in typed], act, question, asks=[one.step for one in asks])


def _at_prompt(run: Run, wait: float, *, as_hex: bool) -> Table:
    if run.settings.dry_run:
        raise UsageError(
            "the terminal sends each line as it is typed, so it cannot do a dry run", hint="give the lines as arguments"
        )
    if run.settings.format != "table" or run.settings.output or not is_terminal(sys.stdout):
        hint = "for --json, -o or a redirected stdout, give the lines as arguments or on stdin"
        raise UsageError("`terminal` must write to an interactive terminal", hint=hint, code="no-terminal")
    keyboard = Keyboard(run, as_hex=as_hex)
    show = lambda row: run.out(line_of(row, width_of(run), as_hex=as_hex))  # noqa: E731
    with Conversation(run, wait, show) as talk:
        kept = "" if run.settings.trace else " --trace FILE keeps a transcript."
        run.prompts.say(f"{talk.link.name}: {keyboard.takes}. Ctrl-D ends, Ctrl-C also stops what was set going.{kept}")
        quiet = talk.link.now()
        while (line := keys.typed_line(sys.stdin)) != "":
            if line is not None and line.strip():
                _one(run, keyboard, talk, line.rstrip("\r\n"))
            came = received(talk.link, talk.link.deadline(LOOK)) != (b"", None)
            quiet = talk.link.now() if came or line else quiet
            if talk.link.now() - quiet >= wait * (PATIENCE if talk.waits else 1):
                talk.over()
        unanswered = talk.waits
        talk.over()
        if unanswered and run.journal.drives:
            hint = "end the terminal when the reply has come, if the movement is to go on"
            raise NoAnswer(f"{talk.link.name}: the terminal ended before the reply came", hint=hint)
    return Table()


def _one(run: Run, keyboard: Keyboard, talk: Conversation, text: str) -> None:
    """One typed line. What is wrong with it is said; a link that is lost ends the terminal."""
    try:
        typed = keyboard.take(text)
        if typed.question:
            run.confirm(typed.asked, [typed.step])
        talk.send(typed)
        keyboard.sent(typed)
    except LinkError:
        raise
    except HandctlError as exc:
        if exc.exit_code == Interrupted.exit_code:
            raise
        run.ledger.forget()
        run.prompts.say(f"{sentence(exc.text)}\n  Next: {sentence(exc.hint)}" if exc.hint else sentence(exc.text))
