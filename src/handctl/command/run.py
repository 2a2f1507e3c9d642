"""The life of one command: open the link, ask, run the body, show its table, close, and tell what went wrong.

A command body gets a `Run`, asks it for a device and returns a `Table`. Nobody else opens links, asks questions or
decides where output goes. What a run does not need is not imported.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from copy import copy
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from handctl.command.envelope import (
    device_row,
    explained_error,
    from_click,
    interrupted,
    make_envelope,
    more_serious,
    renamed,
    with_cause,
)
from handctl.command.family import Family, implied
from handctl.command.open_links import Connection, Session
from handctl.command.options import FACTS
from handctl.command.settings_and_checks import Invocation, check_before, shown_steps, tell_unasked, told, unsent
from handctl.command.terminal_prompts import print_message, print_writes
from handctl.errors import OTHER_DEVICE, HandctlError, Interrupted, NotConfirmed, OutputError, joined
from handctl.interrupts import device_done, end_on_signals, finish_on_signals, output_abandoned
from handctl.model.command_settings import Settings
from handctl.model.result import Column, Journal, LineQuality, Message, Table
from handctl.model.write_ledger import SENT
from handctl.screen.sanitize import text_shown
from handctl.wording import honest

if TYPE_CHECKING:
    from handctl.link import Deadline, Link
    from handctl.model.param import Changes, Step
    from handctl.model.prompts import Prompts
    from handctl.screen.render import Context


class Asked(NamedTuple):
    """A question: "" = none, the steps that it shows, its table, and the word that must be typed for a yes."""

    question: str = ""
    steps: Sequence[Step] = ()
    changes: Changes | None = None
    word: str = ""


class PlannedAction(NamedTuple):
    """What a command is going to do to a device: its body returns this, and the run plans, asks, opens the link and carries it out.

    steps     what is going to be written, as far as that is known without the device; a function where only a dry run needs it
    do        carries it out on the device
    question  what is asked before, "" = nothing
    word      that must be typed for a yes, "" = none
    asks      the steps that the question shows, None = all
    look      what looks at the device before that is asked, and then says what is asked
    """

    steps: Sequence[Step] | Callable[[], Sequence[Step]]
    do: Callable[[Any], Table]
    question: str = ""
    word: str = ""
    asks: Sequence[Step] | None = None
    look: Callable[[Any], Asked] | None = None

    @property
    def known(self) -> Sequence[Step]:
        """The steps that are known before the device is."""
        return () if callable(self.steps) else self.steps

    @property
    def asked(self) -> Asked:
        """What is asked before the device is known."""
        return Asked(self.question, self.known if self.asks is None else self.asks, word=self.word)

    def every(self) -> Sequence[Step]:
        """All steps, for a dry run."""
        return self.steps() if callable(self.steps) else self.steps

    def looked(self, device: Any) -> Asked:
        """What is asked once the device is known."""
        return self.look(device) if self.look is not None else self.asked


class Outcome:
    """What comes of one command. Messages are shown after the result, or as they arrive once a stream has begun.

    table    what its body returned, or what was read before it failed
    failure  what went wrong
    """

    def __init__(self, asked: Invocation) -> None:
        self.table: Table | None = None
        self.failure: HandctlError | None = None
        self._asked = asked
        self._held: list[Message] = []
        self._told: set[str] = set()
        self._live = False

    @property
    def streams(self) -> bool:
        """Whether the table is a stream."""
        return self.table is not None and self.table.samples is not None

    @property
    def extra(self) -> dict[str, Any]:
        """Further keys of the envelope."""
        return self.table.extra if self.table is not None else {}

    def heard(self, message: Message) -> None:
        """A message of the device or of a check."""
        if message.code in self._asked.journal.times:  # see Journal.count
            if message.code in self._told:
                return  # the envelope has the number
            self._held = [one for one in self._held if one.code != message.code]
        self._held.append(message)
        if self._live:
            self.tell()

    def tell(self) -> None:
        """What has been held back so far."""
        settings = self._asked.settings
        held = [] if settings.quiet or settings.format in ("json", "ndjson") else self._held
        for message, later in zip(held, [*held[1:], None], strict=False):
            self._asked.prompts.done()
            once = later is not None and later[:2] == message[:2] and later.hint == message.hint
            _print(message._replace(hint="") if once else message)  # what is to be done stands behind the last of them
        self._told.update(one.code for one in self._held)
        self._held.clear()

    @contextmanager
    def delaying_messages(self) -> Iterator[None]:
        """Messages wait until it is over."""
        before, self._live = self._live, False
        try:
            yield
        finally:
            self._live = before
            self.tell()

    def stream(self, context: Context) -> HandctlError | None:
        """Show a stream to its end; what went wrong."""
        from handctl.screen import render

        table = self.table
        assert table is not None
        self.tell()  # of what was met before the first row
        self._live = True
        try:
            with render.Sink(self._asked.settings) as place:
                return render.stream(table, place, context)
        except OutputError as exc:
            return more_serious(table.failure, exc)

    def show(self, context: Context) -> None:
        """Show a finished result, or the error in formats that include it. Raises OutputError."""
        from handctl.screen import render

        if self.table is not None or render.speaks(self._asked.settings.format, self.failure):
            with render.Sink(self._asked.settings) as place:
                render.show(self.table, self.failure, place, context)
        self.tell()

    def lost(self, exc: OutputError) -> HandctlError:
        """No result can be shown: what is known of the device goes to stderr, as JSON too, and its own error weighs more."""
        for message in () if self._asked.settings.quiet else self._held:
            _print(message)
        self._held.clear()
        return more_serious(self.failure, exc)


def _print(message: Message) -> None:
    print_message("note" if message.level == "info" else message.level, message.text, message.hint)


class Run(Invocation):
    """One run of one command: what was asked (`Invocation`), the `connection` to a device, and the `outcome`."""

    def __init__(
        self,
        ctx: click.Context,
        settings: Settings,
        family: Family | None,
        prompts: Prompts | None = None,
        session: Session | None = None,
    ) -> None:
        super().__init__(ctx, settings, family, prompts, session)
        self.connection = Connection()
        self.checked = False
        """Its words were understood and carried out before: `again` begins it once more."""
        self.before: Any = None
        """The device of the time before, if nothing was remarkable then."""
        self.known: tuple[Any, ...] = ()
        """What was known of its line when it ended."""
        self.after_output = ExitStack()
        """What is closed behind the last byte of output: the file of a command that runs others."""
        self.begin()

    def begin(self, before: Journal | None = None) -> None:
        """Nothing of it has happened yet; `before` is the journal of the same reading before."""
        self.outcome = Outcome(self)
        self.journal = Journal(self.outcome.heard if self.shows else None, self.prompts.progress, before)
        self.link = self.opened = self.end = None
        self.remembered = False
        self.others: list[Run] = []
        """The same command at further LINKs, see `device_at`."""

    def again(self) -> None:
        """Begin once more what went well: what was understood of its words holds."""
        plain = self.outcome.failure is None and not self.journal.messages and self.settings.deadline is None
        self.before, self.checked = self.opened if plain else None, True
        self.begin(self.journal)

    def device(self) -> Any:
        """The device behind the link; opens it on first use. Raises UsageError, LinkError."""
        if self.opened is not None:
            return self.opened
        link, before, settings = self.open_link(), self.before, self.settings
        if before is not None and before.link is link and before.again(self.journal):
            self.opened = before
            return before
        if self.writes:
            settings = settings._replace(own={**settings.own, **implied(self.family.kind)})
        opened = self.family.open(link, self.in_time(link, settings), self.journal)
        opened.options = settings
        facts = {key: settings.own[key] for key, source in self.sources.items() if source.level == FACTS}
        if facts:
            from handctl.model.facts_file import words

            self.journal.info("facts-used", words(facts, str(settings.facts)))
        self.opened = opened
        return opened

    def device_at(self, link: str, **settings: Any) -> Any:
        """A further device of this family, at another LINK, let go of with the first. Raises UsageError, LinkError."""
        other = copy(self)  # it says, counts and writes in the same place, but has a link, a lock and a line of its own
        if self.end is not None and self.link is not None:
            settings["deadline"] = self.in_time(self.link, self.settings).deadline
        given = {"port": link, "fake": False, "wire": None, "device": None, "kind": None, **settings}
        other.settings = self.settings.having(given)
        other.connection = Connection(self.connection.trace)
        other.link = other.opened = other.end = None
        other.others = []
        other.journal = copy(self.journal)
        other.journal.line = LineQuality()
        other.journal.set_going = None
        self.others.append(other)
        return other.device()

    def open_link(self, *, again: bool = False, baud: int | None = None, listening: bool = False) -> Link:
        """The link the user asked for, tapped when --trace or -v is given; `again` where it was lost. `listening`: see `link.open_link`."""
        if again and self.link is not None:
            self.link.close()
            self.link = self.connection.link = None
        if self.link is None:
            if self.session is not None:
                self.connection = self.session.connection(self, self.connection)
            self.link = link = self.connection.opened(self, baud, listening=listening)
            if self.session is not None:
                self.session.watch_over(self.connection, self)
            if self.writes:
                from handctl.link.transcript import observed

                observed(link, self.ledger)
                if (access := self.connection.device_access) is not None:
                    self.ledger.unstoppable = partial(access.unstoppable, self)
                    self.ledger.moving = partial(access.moving, self)
                    self.ledger.renamed = access.renamed
            self.end = link.now() + settings.deadline if (settings := self.settings).deadline is not None else None
        return self.link

    def bound(self, link: Link, seconds: float) -> Deadline:
        """When this command must end, by the clock of its open `link`: where there is no --deadline, `seconds` from now."""
        return link.deadline(seconds if self.end is None else self.end - link.now())

    def in_time(self, link: Link, settings: Settings) -> Settings:
        """The settings with what is left of --deadline, by the clock of the open `link`: other parts of the command have used some of it."""
        return settings if self.end is None else settings._replace(deadline=max(self.end - link.now(), 0.001))

    @property
    def stopped(self) -> HandctlError | None:
        """How a device of this command was stopped on the wish of another process; None where none was."""
        stopped = self.connection.stopped
        for other in self.others:
            stopped = stopped or other.connection.stopped
        return stopped

    @contextmanager
    def viewed(self, pressed: Callable[[str], bool]) -> Iterator[bool]:
        """While a view has the terminal messages wait, and each key goes to `pressed`, which says whether the command ends; whether there are keys."""
        from handctl.stop.device_access import keyboard

        with self.outcome.delaying_messages(), keyboard(self.connection.device_access, pressed) as keyed:
            yield keyed

    @property
    def stop_key(self) -> str:
        """The key of a live view that stops the device; "" without a device to stop."""
        access = self.connection.device_access
        return access.stop_key if access is not None else ""

    def act(self, act: PlannedAction) -> Table:
        """Carry it out, or show its plan for --dry-run. Raises NotConfirmed."""
        if self.settings.dry_run:
            return self.dry_run(act.every())
        self.ledger.plan(act.known)
        asked = act.asked
        if act.look is not None:
            if act.question:
                self.need_answer(act.question)
            asked = act.look(self.device())
        if asked.question:
            self.confirm(asked.question, asked.steps, word=act.word, changes=asked.changes)
        return act.do(self.device())

    def confirm(
        self, question: str, steps: Sequence[Step] = (), *, word: str = "", changes: Changes | None = None
    ) -> None:
        """Ask before something that moves, persists or strands; --yes answers. Raises NotConfirmed.

        With `word` the user must type it. `steps` is what is going to be written: -v and --dry-run show its bytes.
        `changes` is the table above the question.
        """
        self.ledger.plan(steps)
        if self.settings.yes:
            tell_unasked(self, told(question, changes), steps)
            return
        self.need_answer(told(question, changes))
        if self.opened is not None:
            self.opened.ready_to_ask()
        self.outcome.tell()  # who is asked must know of it before answering
        for line in (*shown_steps(steps, self.settings, changes), *(changes.lines() if changes else ())):
            self.prompts.say(line)
        if not self.prompts.confirm(question, word, steps, changes):
            raise NotConfirmed(f"not confirmed: {unsent(self.journal)}", hint=self.prompts.refused)

    def need_answer(self, question: str) -> None:
        """Raise NotConfirmed where nobody could answer a question that only reading the device can put: not a byte is sent."""
        if not (self.settings.yes or self.settings.dry_run or self.prompts.interactive):
            raise NotConfirmed(
                f"{question}. {self.prompts.nobody}", hint=joined(self.prompts.otherwise, unsent(self.journal))
            )

    @property
    def asks(self) -> bool:
        """Whether somebody is there whose answer is needed."""
        return self.prompts.interactive and not self.settings.yes

    def offer(self, question: str) -> bool:
        """Ask for an optional further step; no terminal or --yes means no."""
        return self.asks and self.prompts.ask(question, "")

    def out(self, text: str) -> None:
        """A line of data of an interactive session, at once."""
        sys.stdout.write(text_shown(text) + "\n")
        sys.stdout.flush()

    def dry_run(self, steps: Sequence[Step]) -> Table:
        """The exact bytes of a plan as a Table; sends nothing."""
        self.ledger.plan(steps)
        looks = "" if self.settings.assume_identity else ". handctl would first check the device's identity with reads"
        self.journal.info("dry-run", f"dry run: nothing was sent{looks}")
        return plan_table(steps)

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Around `carry_out`: answer to signals, close the link, show the table, and raise what went wrong."""
        if end_on_signals(suspend=self.writes) and self.session is not None:
            raise Interrupted
        with self.after_output:
            try:
                yield
            except BaseException:  # a bug of ours: the link and its lock are let go all the same
                finish_on_signals()
                self.close(None)
                self.remember(HandctlError("internal error"))
                if self.writes:
                    print_writes(self.journal.ledger, self.settings, None)
                raise
            finish_on_signals()  # from now on a Ctrl-C changes neither the result nor the exit code, unless its reader sleeps
            failure = self.end_device()
            if not self.outcome.streams:
                try:
                    self.outcome.show(self)
                except OutputError as exc:
                    if failure is None and not self.journal.ledger.began:
                        raise
                    failure = self.outcome.lost(exc)
            if self.writes:
                print_writes(self.journal.ledger, self.settings, failure)
            if output_abandoned():
                text = "interrupted while writing the result: the reader had stopped reading"
                failure = failure or Interrupted(text)
        if failure is not None:
            failure.shown = True
            raise failure

    def carry_out(self, body: Callable[[], Table | PlannedAction | None]) -> Outcome:
        """Run the body, and show a stream to its end; the outcome has what it returned, and what went wrong."""
        outcome = self.outcome
        try:
            try:
                if not self.checked:
                    check_before(self)
                made = body()
                outcome.table = self.act(made) if isinstance(made, PlannedAction) else made
                if self.shows and outcome.streams:
                    outcome.failure = outcome.stream(self)
            except HandctlError as exc:
                outcome.failure = exc  # stands, should Ctrl-C come while its cause is looked for
                outcome.failure = explained_error(self, exc)
            except click.UsageError as exc:
                outcome.failure = from_click(exc)
            if self.shows:
                device_done()
        except KeyboardInterrupt:
            if self.shows:
                device_done()
            outcome.failure = outcome.failure or interrupted(self)
            if outcome.streams:
                outcome.table = None  # its stream has not begun: whoever writes it answers to Ctrl-C
        if outcome.failure is not None and outcome.table is None and not self.writes:
            outcome.table = self.journal.kept  # what was read before it went wrong
        return outcome

    def with_cause_named(self, error: HandctlError | None) -> HandctlError | None:
        """What is shown of an error: whose bytes came, and what held a command up that --deadline ended."""
        return None if error is None else renamed(self, with_cause(self, error))

    def end_device(self) -> HandctlError | None:
        """Let go of the link; what went wrong with the command, or else what is wrong with its table."""
        outcome, table = self.outcome, self.outcome.table
        if self.before is not None and table and not (outcome.failure or table.failure) and self._left_as_found():
            outcome.failure = self.connection.trace.failure
            return outcome.failure
        failure = outcome.failure and self.with_cause_named(outcome.failure)
        if table is not None and table.failure is not None:
            table.failure = self.with_cause_named(table.failure)
        failure = self.stopped or failure
        try:
            failure = self.close(failure)
        except KeyboardInterrupt:
            failure = self.close(failure or Interrupted())
        outcome.failure = failure = failure or (table.failure if table is not None else None)
        if failure is not None and self.journal.ledger.began:
            failure.text, failure.hint = honest(failure.text), honest(failure.hint)
        self.remember(failure)
        return failure

    def _left_as_found(self) -> bool:
        """Whether it has asked the same as before, on a link that stays open, and finds there what it has left."""
        access, asked_again = self.connection.device_access, self.opened is self.before
        return asked_again and access is not None and access.known == self.known and not (self.stopped or self.others)

    def remember(self, failure: HandctlError | None) -> None:
        """Add what was written to the history, once, now that the device has been served. Never raises."""
        stopped = self.stopped  # waits for a stop in another thread, which remembers it, too
        if not self.remembered and (self.journal.ledger.began or stopped is not None):
            self.remembered = True
            from handctl.command import write_history

            others = [run.link.name for run in self.others if run.link is not None]
            write_history.keep(self, self.written, others, failure)

    @property
    def written(self) -> list[dict[str, Any]]:
        """What went out, as the record of writes has it; of a command that only reads the stop that it was asked for."""
        if self.writes:
            return self.ledger.rows() if self.ledger.began else []
        access = self.connection.device_access
        sent = access.sent if access is not None and self.stopped is not None else ()
        return [
            {"step": step, "bytes": row["bytes"], "meaning": row["meaning"], "state": SENT}
            for step, row in enumerate((row for row in sent if not row["reads"]), 1)
        ]

    def close(self, failure: HandctlError | None) -> HandctlError | None:
        """Let go of the link, unless the next command of a session can use it."""
        for other in self.others:
            failure = other.close(failure)
        if (access := self.connection.device_access) is not None and self.family.kind and self._met(failure):
            access.remember(self)
            self.known = access.known if self.session is not None else ()
        table = self.outcome.table
        ended = failure or (table.failure if self.stops and table is not None else None)
        if self.session is not None:
            self.session.stop_lost(self.connection, ended, self.prompts)
        if self.session is not None and self.session.keeps(self.connection, ended, self):
            return failure or self.connection.trace.failure
        return self.connection.close(failure, self.journal)

    def _met(self, failure: HandctlError | None) -> bool:
        """Whether the device is of the family that was asked: it replied as one, or has been written to. A stop shows that
        by its acknowledgement alone."""
        if self.stops:
            return self.outcome.table is not None and (self.outcome.table.failure or failure) is None
        other = failure is not None and failure.code == OTHER_DEVICE
        return self.journal.ledger.began or (self.journal.counters.received > 0 and not other)

    def closing(self, failure: HandctlError | None, extra: dict[str, Any] | None = None) -> dict[str, Any]:
        """The last line of NDJSON."""
        return {**(self.session.place if self.session is not None else {}), "end": self.envelope(failure, extra)}

    def envelope(self, failure: HandctlError | None, extra: dict[str, Any] | None = None) -> dict[str, Any]:
        """The JSON envelope without rows (cli contract, section 4)."""
        failure = self.stopped or failure or self.connection.trace.failure
        writes = {"writes": self.ledger.rows()} if self.writes and self.family.kind else {}
        more = {**(extra or {}), **writes}
        return make_envelope(self.command, failure, device_row(self), self.journal, more, self.link)

    @property
    def simulated(self) -> bool:
        """Whether a simulator answered."""
        return self.link is not None and self.link.fake


def plan_table(steps: Sequence[Step]) -> Table:
    """The exact bytes of a plan."""
    rows = [
        {"step": number, "bytes": step.wire, "meaning": step.meaning, "moves": step.moves, "strands": step.strands}
        for number, step in enumerate(steps, 1)
    ]
    columns = (Column("step", "Step", right=True), Column("bytes", "Bytes"), Column("meaning", "Meaning"))
    return Table(rows=rows, columns=columns, plain=("bytes",))
