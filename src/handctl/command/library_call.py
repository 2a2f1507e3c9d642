"""Call a command from Python: the same body with values instead of words. Prints nothing and handles no signals.

A question goes to `confirm`, the result is returned, what went wrong is raised. Ctrl-C stops what is being driven, as in a
command, and is raised again.
"""

from __future__ import annotations

import atexit
import io
import os
import threading
from collections.abc import Callable, Generator, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from handctl.command.command_tree import Command
from handctl.command.envelope import explained_error, from_click
from handctl.command.options import COMMAND_LINE, command_line
from handctl.command.run import Run, plan_table
from handctl.command.settings_and_checks import told
from handctl.errors import STOPPED, HandctlError, Interrupted, UsageError
from handctl.files import atomic_write, writing
from handctl.model.prompts import Prompts
from handctl.model.result import Journal, Row
from handctl.model.stop_on_interrupt import NOT_STOPPED, ended_by_interrupt

if TYPE_CHECKING:
    from handctl.command.family import Family
    from handctl.command.open_links import Session
    from handctl.link import Link
    from handctl.model.command_settings import Settings
    from handctl.model.param import Changes, Step

Confirm = bool | Callable[[str, list[Row]], bool]
"""The answer to what asks: True, or who is asked, with the question and the steps that are going to be written."""
MOST_BOUND = 1000
"""Calls of one line that are kept as they were understood."""


class Caller(Prompts):
    """The prompts of a calling program: silent. Critical sections delay Ctrl-C without a handler."""

    nobody = "Confirmation needed"
    otherwise = "give confirm=True, or a function that answers. dry_run=True returns the bytes"
    refused = "the function given as confirm said no"

    def __init__(self, confirm: Confirm) -> None:
        self._confirm = confirm
        self.interactive = callable(confirm)

    def confirm(self, question: str, word: str, steps: Sequence[Step], changes: Changes | None) -> bool:
        if not callable(self._confirm):
            return False
        answer = self._confirm(told(question, changes), plan_table(steps).rows)
        if not isinstance(answer, bool):  # "n" counts as true in Python
            raise UsageError(
                f"the function given as confirm returned {answer!r}, which is neither True nor False",
                hint="return True or False. Nothing was sent.",
                code="confirm-answer",
            )
        return answer

    @contextmanager
    def without_interrupts(self) -> Iterator[None]:
        from handctl.system.signals import held_back, numbers

        with held_back(numbers()):
            yield


class Call(Run):
    """One run of one command for a program: its caller takes the rows, also of a stream, and Ctrl-C is the caller's."""

    shows = False
    body: Callable[[], Any]

    def __init__(
        self,
        ctx: click.Context,
        settings: Settings,
        family: Family | None,
        confirm: Confirm = False,
        session: Session | None = None,
    ) -> None:
        super().__init__(ctx, settings, family, Caller(confirm), session)
        self.typed = io.StringIO()
        self.opening = threading.RLock()
        self.ended: Interrupted | None = None

    def open_link(self, *, again: bool = False, baud: int | None = None, listening: bool = False) -> Link:
        """See `Run`. Raises Interrupted where the device was stopped since this call began, as while its question was answered."""
        with self.opening:
            if self.ended is not None:
                raise self.ended
            return super().open_link(again=again, baud=baud, listening=listening)

    def finished(self, body: Callable[[], Any]) -> list[Row]:
        """The rows of a body that is no stream. Raises HandctlError; KeyboardInterrupt for Ctrl-C."""
        self.carry_out(body)
        self.end_device()
        return self.result()

    def result(self) -> list[Row]:
        """The rows of what has ended. Raises what went wrong, with them; KeyboardInterrupt for Ctrl-C."""
        told, table = self.outcome.failure, self.outcome.table
        rows = table.rows if table is not None and table.samples is None else []
        if told is None:
            return rows
        if isinstance(told, Interrupted) and told.code != STOPPED:
            raise KeyboardInterrupt(told.text) from told
        told.rows = tuple(rows)
        raise told

    def samples(self) -> Generator[list[Row], None, None]:
        """The samples of a stream, each as its rows. The device is left when it ends, or is closed."""
        outcome, table = self.outcome, self.outcome.table
        assert table is not None
        assert table.samples is not None
        source = iter(table.samples)
        try:
            for sample in source:
                yield sample.stamped(self.settings.time)
        except HandctlError as exc:
            outcome.failure = explained_error(self, exc)
        except KeyboardInterrupt:
            outcome.failure = Interrupted()
        finally:
            if isinstance(source, Generator):
                source.close()
            table.extra = table.summary() if table.summary is not None else {}
            self.end_device()
        self.result()


class Samples(Iterator[list[Row]]):
    """The samples of a stream, taken one at a time, in whichever thread. It can be ended while another thread takes one."""

    def __init__(self, session: LibrarySession, begin: Callable[[Samples], Generator[list[Row], None, None]]) -> None:
        self._session, self._source = session, begin(self)
        self._turn = threading.RLock()
        self._over = False

    def __next__(self) -> list[Row]:
        self._session.check_process()
        with self._turn:
            if self._over:
                raise StopIteration
            return next(self._source)

    def behind(self, act: Callable[[], object]) -> list[Row]:
        """The next sample, with `act` before it; no other thread takes one in between."""
        with self._turn:
            act()
            return next(self)

    def close(self) -> bool:
        """End it, behind the sample that another thread is taking; whether it had not ended by itself. A fork leaves it to its parent."""
        if self._session.forked:
            return False
        with self.ending():
            going = getattr(self._source, "gi_frame", None) is not None
            self._source.close()
        return going

    @contextmanager
    def ending(self) -> Iterator[None]:
        """Around what ends it: no further sample is taken, also by a thread that never rests."""
        self._over = True
        with self._turn:
            yield


class LibrarySession:
    """One device with many calls: its session and the settings of its link.

    What calls have left moving is stopped when Ctrl-C ends another call, or when the program ends with the link open.
    """

    def __init__(self, family: Family, settings: Settings, session: Session) -> None:
        self.family = family
        self.settings = settings
        self.session = session
        self.last: Call | None = None
        self._closed = False
        self._parsed: dict[Any, click.Context] = {}
        self._bound: dict[Any, Call] = {}  # readings that went well: the next one asks the same
        self._running: Generator[list[Row], None, None] | None = None
        self._stream: Samples | None = None
        self._current: Call | None = None
        self._turn = threading.RLock()
        self._stops = threading.RLock()
        self._process = os.getpid()

    def open(self) -> None:
        """Open the link now. Raises LinkError, UsageError."""
        call = self._call(click.Command("connect"), "connect", {}, self.settings, False)

        def body() -> None:
            call.open_link()

        call.finished(body)

    def close(self) -> HandctlError | None:
        """Close the link, and stop nothing; what went wrong. A fork of this program leaves both to it."""
        if self.forked:
            return None
        with self._turn:
            self._closed = True
            self._bound.clear()
        self._end_stream()
        with self._turn:
            atexit.unregister(self._ended)
            return self.session.close(self.last.journal if self.last is not None else Journal())

    def stop_moving(self) -> HandctlError | None:
        """Stop what calls have set in motion, also one in another thread; the first of these stops that was not acknowledged."""
        if self.forked:
            return None
        failure = None
        try:
            self._stop_running()
        except HandctlError as exc:
            failure = exc
        self._end_stream()
        with self._turn:
            ended = self.session.stop_moving(Caller(False))
        return next((stop for stop in ended if stop.code == NOT_STOPPED), failure)

    def _ended(self) -> None:
        """The program ends, and has not closed the link."""
        failure = self.stop_moving()
        self.close()
        if failure is not None:
            raise failure

    @property
    def forked(self) -> bool:
        """Whether this is a fork of the program that has opened the link: link, lock and guard are that one's."""
        return os.getpid() != self._process

    def check_process(self) -> None:
        """Raise UsageError in a fork: two processes would take each other's replies, and the lock keeps them both."""
        if self.forked:
            raise UsageError(
                f"{self.settings.port}: the connection belongs to process {self._process}, of which this one is a fork",
                hint="close it there, then call handctl.connect in this process. `stop` can be called at any time",
                code="forked",
            )

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Around a call that may set something in motion."""
        try:
            yield
        except (KeyboardInterrupt, HandctlError) as exc:
            self._interrupted(exc)
            raise
        finally:
            link = self.last.link if self.last is not None else None
            if self.session.in_motion and link is not None and not link.fake:
                atexit.unregister(self._ended)
                atexit.register(self._ended)

    @contextmanager
    def _within(self, call: Call) -> Iterator[None]:
        """Around a call: what comes in this thread until its end, in a signal handler or in `confirm`, comes in the middle of it."""
        before, self._current = self._current, call
        try:
            yield
        finally:
            self._current = before

    def _interrupted(self, error: BaseException) -> None:
        """Where Ctrl-C has ended a call, and stopped what that drives: stop what earlier calls have left moving, too."""
        ours = isinstance(error, HandctlError) and (not ended_by_interrupt(error) or error.code == STOPPED)
        if not ours and (failure := self.stop_moving()) is not None:
            raise failure from error

    def _stop_running(self) -> list[Row] | None:
        """Stop the device under a call that another thread is in, which ends by that: what was sent. None where there is none.

        Raises how that stop failed.
        """
        who, call = "by another thread of this program", self._current
        if self._turn.acquire(blocking=False):
            try:
                who = "in the middle of this call" if call is not None else who
                if call is None and not getattr(self._running, "gi_running", False):
                    return None
            finally:
                self._turn.release()
        if call is not None:
            with call.opening:
                if call.link is None:
                    call.ended = Interrupted(f"stopped {who}, before it reached the device", code=STOPPED)
                    return None
        access = self.last.connection.device_access if self.last is not None else None
        stopped = access.stop_from_outside(f"stopped {who}") if access is not None else None
        if access is None or stopped is None:  # no link is open yet
            return None
        if stopped.code != STOPPED:
            raise stopped
        return access.sent

    def again(self, key: Hashable) -> list[Row] | None:
        """Carry out the reading that `key` was bound to; None where there is none. Raises HandctlError."""
        try:
            call = self._bound.get(key)
        except TypeError:  # a value that cannot be a key
            return None
        if call is None:  # `stop` does not wait for a turn
            return None
        self.check_process()
        with self._turn:
            if self._running is not None:
                return None
            self.check_open()
            self.last = call
            call.again()
            try:
                with self._within(call):
                    return call.finished(call.body)
            except (KeyboardInterrupt, HandctlError) as exc:
                self._interrupted(exc)
                raise

    def call(
        self,
        command: Command,
        words: str,
        values: Mapping[str, Any],
        *,
        confirm: Confirm,
        dry_run: bool,
        output: Any = None,
        key: Hashable = None,
    ) -> list[Row] | Iterator[list[Row]]:
        """Carry out the command that is typed as `words` with these values, by click's names. Raises HandctlError.

        `output` is the file that it makes. A reading with a `key` that goes well is bound to that.
        """
        if command.stops and not dry_run and (sent := self._stop_running()) is not None:
            return sent
        turn = self._turn
        if command.stops:
            self._end_stream()
            if (current := self._current) is not None and current.ended is not None:
                turn = self._stops  # that one only waits for an answer, and reaches no device any more
        else:
            self.check_process()
        with turn, self._watched():
            if not (command.stops or command.offline):
                self.check_open()
            self._check_free()
            settings = self.settings._replace(yes=confirm is True, dry_run=dry_run)
            if command.to_file:
                if output in (None, "", "-"):
                    raise UsageError(
                        f"{words}() makes a file", hint="name it: output=FILE. Nothing was written.", code="no-output"
                    )
                settings = settings._replace(output=os.fspath(output), format="table")
            if self._closed:
                settings = settings._replace(trace=None)  # the file is complete
            call = self._call(command, words, values, settings, confirm)
            call.body = command.body(call)
            with nullcontext() if command.stops else self._within(call):
                outcome = call.carry_out(call.body)
            if settings.output is not None and outcome.table is not None and outcome.table.spool is not None:
                with writing(settings.output), atomic_write(settings.output) as file:
                    file.writelines(outcome.table.spool())
            if outcome.streams and outcome.failure is None:
                return Samples(self, partial(self._taken, call))
            call.end_device()
            if self._closed:
                self.close()  # behind a stop
            rows = call.result()
            if key is not None and command.only_reads and outcome.table is not None and len(self._bound) < MOST_BOUND:
                with suppress(TypeError):
                    self._bound[key] = call
            return iter([rows]) if command.streams else rows

    def _call(
        self, command: click.Command, words: str, values: Mapping[str, Any], settings: Settings, confirm: Confirm
    ) -> Call:
        """One call of this command; what click makes of its values is kept, as a loop asks for the same again."""
        try:
            key = (words, *values.items(), *map(type, values.values()))
            ctx = self._parsed.get(key)
        except TypeError:  # a value that cannot be a key
            key, ctx = None, None
        if ctx is None:
            ctx = self._context(command, words, values)
            if key is not None and len(self._parsed) < MOST_BOUND:
                self._parsed[key] = ctx
        settings = settings._replace(own={**settings.own, **command_line(ctx).own})
        self.last = Call(ctx, settings, self.family, confirm, self.session)
        return self.last

    def _context(self, command: click.Command, words: str, values: Mapping[str, Any]) -> click.Context:
        ctx = click.Context(command, info_name=f"handctl {self.family.kind} {words}")
        told = command_line(ctx)
        told.words = (self.family.kind, *words.split(), *(f"{name}={value}" for name, value in values.items()))
        known = [key for key in ("id", "baud") if getattr(self.settings, key) is not None]
        told.sources = dict.fromkeys((*known, "yes"), COMMAND_LINE)
        try:
            with ctx:
                for param in command.params:
                    given = {param.name: values[param.name]} if param.name in values else {}
                    param.handle_parse_result(ctx, given, [])
            for name, value in ctx.params.items():
                if type(value).__module__.startswith("click"):
                    ctx.params[name] = None  # click's own mark of what was not given
        except click.UsageError as exc:
            raise from_click(exc) from exc
        if "-" in ctx.params.values():
            raise UsageError("standard input is not read here", hint="give a file instead of -")
        return ctx

    def check_open(self) -> None:
        """Raise UsageError where the caller has closed the link: nobody would close it a second time.

        Within a turn. A stop that met a question goes out beside it, and is waited for.
        """
        with self._stops:
            pass
        if self._closed:
            raise UsageError(
                f"{self.settings.port}: the connection is closed",
                hint="call handctl.connect again, or make this call inside the `with` block. `stop` can be called at any time",
                code="closed",
            )

    def _check_free(self) -> None:
        if self._running is not None:
            hint = "leave its loop, or close it. `stop` can be called at any time"
            raise UsageError(f"{self.settings.port}: a stream is running on this link", hint=hint)

    def _taken(self, call: Call, stream: Samples) -> Generator[list[Row], None, None]:
        with self._turn:
            self.check_open()
            self._check_free()
            self._stream, self._running = stream, call.samples()
            samples = self._running
        try:
            with self._watched():
                yield from samples
        finally:
            if self._running is samples:
                self._running = None

    def _end_stream(self) -> None:
        """End the stream that is running. Not within a turn: the thread that takes its samples may wait for one."""
        running, stream = self._running, self._stream
        if running is not None and stream is not None:
            with stream.ending():
                running.close()
                self._running = None
