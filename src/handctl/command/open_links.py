"""An open link with its lock, its trace and the saved state of a simulated device, for one command or a session of several.

A session keeps the list of what its commands have set in motion and left (`Mover`): all of that is stopped, whichever
device a later command uses.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from handctl import __version__
from handctl.errors import Aftermath, HandctlError, Hint, Interrupted, LinkError, NoAnswer, UsageError, joined
from handctl.fast_classes import NamedTuple
from handctl.link import open_link
from handctl.system import clock

if TYPE_CHECKING:
    from handctl.command.settings_and_checks import Invocation
    from handctl.link import Link
    from handctl.link.device_lock import Reached
    from handctl.link.fake import Kept
    from handctl.link.transcript import TraceFile
    from handctl.model.prompts import Prompts
    from handctl.model.result import Journal, LineQuality
    from handctl.model.stop_sequence import RunningStop, Sent, Stopped, StopPlan
    from handctl.stop.device_access import DeviceAccess


class Trace:
    """The trace of one connection, or of several in sequence."""

    _file: TraceFile | None = None

    def file(self, run: Invocation, name: str) -> TraceFile | None:
        """What records, for --trace or -v; None without either."""
        settings = run.settings
        if self._file is None and (settings.trace or settings.verbose):
            from handctl.link.transcript import TraceFile

            try:
                header = f"handctl {__version__} {run.owner}, {name}"
                self._file = TraceFile(settings.trace, header, settings.verbose)
            except HandctlError as exc:
                if not run.stops:
                    raise
                run.journal.warn("trace", exc.text)
        return self._file

    def close(self) -> HandctlError | None:
        """The end of the file; why it ends early, None where it does not."""
        if self._file is not None:
            self._file.close()
        return self.failure

    @property
    def failure(self) -> HandctlError | None:
        """Why the recording ends early."""
        return self._file.failure if self._file is not None else None


class Connection:
    """The open link of one device: opened once and closed once, for all of its users."""

    def __init__(self, trace: Trace | None = None, name: str = "") -> None:
        """`trace`: one that continues after this connection. `name`: its LINK if it is one of several."""
        self.name = name
        self.key: Hashable = None
        self.link: Link | None = None
        self.device_access: DeviceAccess | None = None
        self.kept: Kept | None = None
        self.observers: tuple[Any, ...] = ()
        """Who is told of what passes, whatever command has the link."""
        self.trace = trace or Trace()
        self._lasting = trace is not None

    def opened(self, run: Invocation, baud: int | None, *, listening: bool = False) -> Link:
        """The link of this run, tapped when --trace or -v is given; `listening` as `open_link` has it. Raises UsageError, LinkError."""
        if self.link is None:
            name = run.link_name()
            tap = self.trace.file(run, name)
            if self.device_access is None:
                from handctl.stop.device_access import DeviceAccess, lock_for

                self.device_access = DeviceAccess(run, lock_for(run, name))
            self.link = self._open(run, name, baud, listening)
            if tap is not None:
                from handctl.link.transcript import observed

                observed(self.link, tap)
            self.observers = self.link.observers
        assert self.device_access is not None
        self.device_access.around(self.link)
        if run.writes and not run.stops and self.link.raw_access() is not None:
            refuse_rivals(run, self.link)
        return self.link

    @property
    def stopped(self) -> HandctlError | None:
        """How the device was stopped on the wish of another process or thread, once such a stop is over; None where it was not."""
        if self.device_access is None:
            return None
        with self.device_access.turn:
            return self.device_access.stopped

    def close(self, failure: HandctlError | None, journal: Journal) -> HandctlError | None:
        """Release everything; how the device was stopped, `failure`, or what went wrong here. May be called twice."""
        if self.device_access is not None:
            self.device_access.finish()
            failure = self.device_access.stopped or failure
        try:
            if self.link is not None:
                self.link.close()
                if self.kept is not None and self.kept.begun:
                    journal.info("kept", self.kept.text)
        except HandctlError as exc:
            failure = failure or exc
        finally:
            if not self._lasting:
                self.trace.close()
            if self.device_access is not None:
                self.device_access.release()
        return failure or self.trace.failure

    def _open(self, run: Invocation, name: str, baud: int | None, listening: bool) -> Link:
        """The LINK `name`, at `baud` if nothing else was asked for. Raises UsageError, LinkError."""
        family = run.family
        opening = partial(
            open_link,
            name,
            baud=run.settings.baud or baud or family.baud,
            tcp_port=family.tcp_port,
            exclusive=not run.stops,
            listening=listening,
        )
        if not run.settings.fake:
            return opening()
        from handctl.link.fake import Kept

        self.kept = kept = Kept(name, writes=run.keeps)
        used = {"use": "on"} if run.in_use else {}
        try:
            link = opening(simulator={**kept.options(), **used})
        except UsageError as exc:
            if kept.before is None:
                raise
            hint = "" if run.keeps else Hint("{} removes that file", f"sim forget {kept.kind}")
            run.journal.warn("kept", f"the simulated {kept.kind} starts over: {exc.__cause__}", hint)
            kept.discard()
            link = opening(simulator={**kept.options(), **used})
        if run.keeps and not kept.path:
            from handctl.system.user_folders import HINT

            run.journal.info(
                "not-kept", f"the state of the simulated {kept.kind} is not saved: you own no folder for it", HINT
            )
        if kept.before is not None:
            run.journal.info("kept", kept.text)
        return link


def refuse_rivals(run: Invocation, link: Link) -> None:
    """Raise LinkError if the system shows another program that could command the device at the same time."""
    from handctl.link.port_users import busy, rivals

    names, hidden = rivals(link)
    if names:
        raise busy(link.name, names)
    if hidden:
        run.journal.info(
            "owners-unknown",
            f"{link.name}: no other program of this user has the port open. Programs of other users cannot be seen from this account",
        )


def _device(run: Invocation) -> tuple[str, int]:
    """Family and id of the device of this run, as a `StopPlan` has them."""
    number = run.settings.id if run.opened is None else run.opened.stop_context().number
    return run.family.kind, 1 if number is None else number


def _named(run: Invocation, kind: str, number: int) -> str:
    return f"{kind} id {number}" if run.family.ids else kind


# -- many commands on open links ------------------------------------------------------------------------------------


class Mover(NamedTuple):
    """A device that a command has set in motion and left.

    run   that command: its record takes the stop
    link  the LINK
    plan  how it is stopped, whoever uses the link by then
    met   the open link on which it was identified
    was   the id with which it was set in motion, if handctl has given it another one since; else 0
    """

    run: Invocation
    link: str
    plan: StopPlan
    met: Link | None
    was: int = 0

    @property
    def name(self) -> str:
        """Family and id, for messages."""
        return _named(self.run, *self.plan.device)

    def plan_on(self, link: Link | None) -> StopPlan:
        """Its plan over this link, which asks anew who is there where it is another one than that on which it was identified."""
        if link is None or link is self.met:
            return self.plan
        from handctl.model.stop_sequence import StopPlan

        return StopPlan(self.plan.device[0], self.plan.context._replace(proven=False))

    def begin(self, link: Link, sent: list[Sent] | None = None) -> Callable[[], Stopped]:
        """Begin its stop over its link, as that is now, see `RunningStop`; what finishes it. Neither raises."""
        from handctl.model.stop_sequence import RunningStop, Stopped

        ledger = self.run.ledger
        stop = RunningStop(link, self.plan_on(link).sequence(link), sent, ledger if ledger.words is not None else None)

        def over(part: Callable[[], Any]) -> Any:
            try:
                with self._alone(link):
                    return part()
            except HandctlError as exc:
                return Stopped(exc.text, exc.hint, type(exc))

        over(stop.begin)
        return partial(over, stop.finish)

    @contextmanager
    def _alone(self, link: Link) -> Iterator[None]:
        """At its baud rate, and nothing of it in the record of another command. Raises LinkError."""
        from handctl.link.transcript import observed

        ledger, observers = self.run.ledger, link.observers
        link.observers = tuple(one for one in observers if not isinstance(one, type(ledger)))
        speed, before = self.plan.context.speed, getattr(link, "baud", None)
        try:
            if speed is not None and speed != before:
                link.set_baud(speed)  # type: ignore[attr-defined]  # a speed is that of a byte link
            observed(link, ledger)
            yield
        finally:
            link.observers = observers
            if speed is not None and speed != before:
                link.set_baud(before)  # type: ignore[attr-defined]


class Session:
    """The open links of several commands.

    command    in whose name they are locked
    writes     whether any of the commands may write
    began      when all of them were asked for, by `clock.now`; None where each is for itself
    guards     from the first command that sets something going, the death of this process stops it
    in_motion  what commands have set in motion and left, until a stop of it was acknowledged
    """

    def __init__(self, command: str, *, writes: bool, began: float | None = None, guards: bool = False) -> None:
        self.command = command
        self.writes = writes
        self.began = began
        self.guards = guards
        self.place: dict[str, Any] = {}
        """What the last line of a command's NDJSON says of its place among the others."""
        self._open: dict[Hashable, Connection] = {}  # by `_key`
        self.in_motion: list[Mover] = []
        self._guards: dict[Hashable, tuple[ExitStack, set[object]]] = {}  # by `_key`, with the devices that are guarded
        self._lines: dict[Hashable, LineQuality] = {}
        self._traces: dict[str | None, Trace] = {}

    def connection(self, run: Invocation, before: Connection) -> Connection:
        """The connection for this run: one that is open, or a new one. Another one to the same place is closed first.

        `before` is the one that it had when it was carried out before.
        """
        key = before.key or self._key(run)
        known = self._open.get(key)
        if known is not None and known.link is not None:
            try:
                if not known.link.replayed:
                    known.link.discard()
            except LinkError as exc:  # it was lost meanwhile
                moved = self.stop_lost(known, exc, run.prompts)
                if not (run.stops and moved and not exc.left.moving):  # else it is back, and serves this line
                    self._close(key, run.journal)
                    known = None
                if moved and not run.stops:
                    raise
        if known is None:
            name = run.link_name()
            for other in [other for other, one in self._open.items() if one.name == name]:
                self._close(other, run.journal)
            known = self._open[key] = Connection(self._traces.setdefault(run.settings.trace, Trace()), name)
            known.key = key
        run.journal.line = self._lines.setdefault(key, run.journal.line)
        if known.link is None or known.link.elsewhere:
            run.journal.line.met.clear()  # whoever is behind a new connection
        if known.device_access is not None:
            known.device_access.serve(run)
        if self.guards:
            run.journal.set_going = partial(self._guard, known, run)
        return known

    def watch_over(self, connection: Connection, run: Invocation) -> None:
        """The death of this process stops what is in motion on a link that was opened again for this run, too. Raises LinkError."""
        if self.guards and connection.key not in self._guards:
            for mover in self._moving_on(connection.name):
                self._guard_with(connection, mover.plan_on(connection.link), run.journal)

    def _guard(self, connection: Connection, run: Invocation) -> None:
        """From now on the death of this process stops the device of this run. Raises LinkError."""
        if run.opened is not None:
            for plan in run.opened.stop_plans(None, *run.journal.ledger.meant):
                self._guard_with(connection, plan, run.journal)

    def _guard_with(self, connection: Connection, plan: StopPlan, journal: Journal) -> None:
        from handctl.link.deadman import guard_link

        stack, devices = self._guards.setdefault(connection.key, (ExitStack(), set()))
        if connection.link is not None and plan.device not in devices:
            stack.enter_context(guard_link(connection.link, plan, journal.warn, beneath=True))
            devices.add(plan.device)

    def _unguard(self, key: Hashable) -> None:
        if key in self._guards:
            self._guards.pop(key)[0].close()

    @staticmethod
    def _key(run: Invocation) -> Hashable:
        """What must be equal for a link to serve two commands, of whatever family: it need not be closed while something moves."""
        family, settings = run.family, run.settings
        speed, in_use = settings.baud or family.baud, settings.fake and run.in_use
        return run.link_name(), speed, family.tcp_port, settings.trace, settings.verbose, in_use

    def keeps(self, connection: Connection, failure: HandctlError | None, run: Invocation) -> bool:
        """Whether the connection of a run is one of these: it stays open, unless it was lost or the device stopped."""
        if self._open.get(connection.key) is not connection:
            return False
        stopped, link = connection.stopped is not None, connection.link
        self._note_movement(connection, run, failure)
        if link is None or isinstance(failure, LinkError) or stopped:
            self._close(connection.key, run.journal)
        else:
            link.observers = connection.observers
        return True

    def _note_movement(self, connection: Connection, run: Invocation, failure: HandctlError | None) -> None:
        """Remember what the command leaves moving, or that it was stopped."""
        self._rename(connection, run)
        moving = run.opened is not None and run.journal.still_moving() is not None
        ledger = run.journal.ledger
        if (moving and isinstance(connection.stopped or failure, Interrupted)) or (run.stops and failure is None):
            for device in ledger.halted or (None,):
                self._forget(connection.name, device or _device(run))
        elif moving:
            for plan in run.opened.stop_plans(*(ledger.going or (None,))):
                self._forget(connection.name, plan.device, guarded=True)
                self.in_motion.append(Mover(run, connection.name, plan, connection.link))

    def _rename(self, connection: Connection, run: Invocation) -> None:
        """What is in motion is stopped at the id that this command has given it. Raises LinkError."""
        from handctl.model.stop_sequence import StopPlan

        names = run.journal.ledger.names
        for before, after in names:
            for at, mover in enumerate(self.in_motion):
                if (mover.link, mover.plan.device) == (connection.name, before):
                    plan = StopPlan(after[0], mover.plan.context.of(before, after))
                    self.in_motion[at] = mover._replace(plan=plan, was=mover.was or before[1])
                    if connection.key in self._guards:
                        self._guard_with(connection, plan, run.journal)
        names.clear()

    def moving_on(self, name: str) -> list[Reached]:
        """What commands have set in motion on this LINK and left, as `remembered` has it: a simulated device has no lock."""
        from handctl.link.device_lock import Reached

        movers = [(*mover.plan.device, mover.was) for mover in self._moving_on(name)]
        return [Reached(kind, {"id": number} if number != 1 else {}, was=was) for kind, number, was in movers]

    def _moving_on(self, name: str) -> list[Mover]:
        return [mover for mover in self.in_motion if mover.link == name]

    def _forget(self, name: str, device: object, *, guarded: bool = False) -> None:
        """This device on the LINK `name` was stopped, or is told of anew and stays `guarded`."""
        self.in_motion[:] = [mover for mover in self.in_motion if (mover.link, mover.plan.device) != (name, device)]
        if not guarded and not self._moving_on(name):
            for key in [key for key, one in self._open.items() if one.name == name]:
                self._unguard(key)

    def stop_moving(self, prompts: Prompts) -> list[HandctlError]:
        """Stop what commands have set going and left, as Ctrl-C stops the movement of one; how each of these stops ended."""
        from handctl.model.stop_on_interrupt import interrupt_error

        return [interrupt_error(stopped, where) for where, stopped in self._stopped(list(self.in_motion), prompts)]

    def stop_lost(self, connection: Connection, lost: HandctlError | None, prompts: Prompts) -> bool:
        """Where the link was `lost`: stop what earlier commands have left moving on it, as an error stops the movement of one; whether
        there was anything. The error says how that ended."""
        from handctl.model.stop_on_interrupt import STOPPED_EARLIER
        from handctl.model.stop_sequence import joined_stops

        moving = self._moving_on(connection.name)
        if not (moving and isinstance(lost, LinkError)) or connection.link is None or connection.stopped is not None:
            return False
        ended = self._stopped(moving, prompts)
        link = f"{connection.name}: "
        stopped = joined_stops([one._replace(text=where.removeprefix(link) + one.text) for where, one in ended])
        said = "what earlier commands have set in motion may still move, because the stop has not been confirmed"
        if stopped.error is None:
            said = STOPPED_EARLIER
        if stopped.text not in lost.text:  # as where the link is still lost
            said = f"{said}: {stopped.text}"
        lost.add_aftermath(Aftermath(said, stopped.hint, moving=stopped.error is not None))
        return True

    def _stopped(self, moving: Sequence[Mover], prompts: Prompts) -> list[tuple[str, Stopped]]:
        """The stop of each of these, and where it was, for messages. All are begun before the first one is checked."""
        from handctl.command import write_history
        from handctl.model.stop_on_interrupt import INTERRUPTED_AGAIN, interrupt_error

        ended = []
        with prompts.stopping():
            prompts.done()
            for name in dict.fromkeys(mover.link for mover in moving):
                with suppress(KeyboardInterrupt):  # pressed again, it ends the search, and the stop is tried
                    self._find_again(name)
            written = [len(mover.run.ledger.rows()) for mover in moving]
            begun = []
            for mover in moving:
                try:
                    begun.append(self._begin(mover))
                except KeyboardInterrupt:
                    begun.append(lambda: INTERRUPTED_AGAIN)
            for mover, before, finish in zip(moving, written, begun, strict=True):
                several = sum(other.link == mover.link for other in moving) > 1
                try:
                    stopped = finish()
                except KeyboardInterrupt:
                    stopped = INTERRUPTED_AGAIN
                where = f"{mover.link}: {mover.name}: " if several else f"{mover.link}: "
                ended.append((where, stopped))
                if stopped.error is None:
                    self._forget(mover.link, mover.plan.device)
                error = interrupt_error(stopped, where)
                write_history.keep(mover.run, mover.run.ledger.rows()[before:], [], error)
        return ended

    def _find_again(self, name: str) -> None:
        """Open this link again, before a stop, where it was lost meanwhile and is back."""
        from handctl.model.stop_sequence import found_again

        known = self._open_at(name)
        if known is not None and known.link is not None and known.stopped is None and not known.link.replayed:
            try:
                known.link.discard()
            except LinkError:
                found_again(known.link)

    def _begin(self, mover: Mover) -> Callable[[], Stopped]:
        """Begin its stop over the open link of its device, or where there is none, or nothing goes out any more, over a new one; what
        finishes it."""
        from handctl.model.stop_sequence import Stopped

        known = self._open_at(mover.link)
        try:
            if known is not None and known.stopped is not None:
                self._close(known.key, mover.run.journal)
                known = None
            known = known or self._opened_for(mover)
        except HandctlError as exc:
            kind = NoAnswer if isinstance(exc, Interrupted) else type(exc)
            lost = Stopped(exc.text, joined("switch the power off if the device is still moving", exc.hint), kind)
            return lambda: lost
        assert known.link is not None
        finish, access, device = mover.begin(known.link), known.device_access, mover.plan.device
        return lambda: access.judged(finish(), [device]) if access is not None else finish()

    def _open_at(self, name: str) -> Connection | None:
        return next((one for one in self._open.values() if one.name == name and one.link is not None), None)

    def _opened_for(self, mover: Mover) -> Connection:
        connection = self.connection(mover.run, Connection())
        connection.opened(mover.run, None)
        self.watch_over(connection, mover.run)
        return connection

    def take_back(self) -> None:
        """Open the links again on which something is in motion, behind a command that had them for itself: the death of
        this process is to stop that, and so is who asks for it. Raises LinkError."""
        for mover in self.in_motion:
            if self._open_at(mover.link) is None:
                self._opened_for(mover)

    def stop_all(self, run: Invocation, link: Link, sent: list[Sent], own: Callable[[], RunningStop]) -> Stopped:
        """Stop what is in motion on the link of this run, and its own device by `own`, which begins that: first that if it is what
        moves. Each is begun before the first one is checked."""
        name, device = run.link_name(), _device(run)
        if (known := self._open_at(name)) is not None:
            self._rename(known, run)
        others = [mover for mover in self._moving_on(name) if mover.plan.device != device]
        stops: list[tuple[object, str, Callable[[], Callable[[], Stopped]]]] = [
            (mover.plan.device, mover.name, partial(mover.begin, link, sent)) for mover in others
        ]
        from handctl.model.stop_sequence import joined_stops

        stops.insert(0 if run.journal.drives else len(stops), (device, _named(run, *device), lambda: own().finish))
        ended = []
        for which, called, finish in [(which, called, begin()) for which, called, begin in stops]:
            stopped = finish()
            if stopped.error is None:
                self._forget(name, which, guarded=True)
            ended.append(stopped._replace(text=f"{called}: {stopped.text}") if others else stopped)
        return joined_stops(ended)

    def stopped(self, journal: Journal) -> HandctlError | None:
        """How another process has stopped a device since the last command; its link is closed. None where none has."""
        for key, known in list(self._open.items()):
            if known.stopped is not None:
                self._close(key, journal)
                return known.stopped
        return None

    def sleep(self, seconds: float, journal: Journal) -> None:
        """Let `seconds` pass on the clock of the link that was opened last. Raises what `stopped` tells where that ended it."""
        links = [one.link for one in self._open.values() if one.link is not None]
        try:
            (links[-1].sleep if links else clock.sleep)(seconds)
        except KeyboardInterrupt as exc:
            raise self.stopped(journal) or exc from None

    def has(self, run: Invocation) -> bool:
        """Whether the device of this run is open here."""
        return any(one.name == run.link_name() for one in self._open.values())

    def release(self, journal: Journal, failure: HandctlError | None = None) -> HandctlError | None:
        """Close every link; the next command opens its own again. `failure`, or what went wrong here."""
        for key in list(self._open):
            failure = self._close(key, journal, failure)
        return failure

    def close(self, journal: Journal) -> HandctlError | None:
        """The end of the session; what went wrong here."""
        failure = self.release(journal)
        for trace in self._traces.values():
            failure = trace.close() or failure
        self._traces.clear()
        return failure

    def _close(self, key: Hashable, journal: Journal, failure: HandctlError | None = None) -> HandctlError | None:
        self._unguard(key)
        return self._open.pop(key).close(failure, journal)
