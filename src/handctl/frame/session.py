"""Many commands on open links: what each finds open, and what it leaves to the next.

A command of a session is a command: it has its own device, gate, ledger, counters and deadline, and begins with an input
in which nothing old lies. What stays is the link with its lock, its trace, and what was learned of the line. Where a link
was lost, or a device was stopped on the wish of another process, nothing stays: the next command opens it again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from handctl.errors import HandctlError, LinkError
from handctl.frame.connection import Connection, Trace

if TYPE_CHECKING:
    from handctl.frame.run import Run
    from handctl.link import Link
    from handctl.model.profile import Profile
    from handctl.model.result import Journal

STALE_READS = 1000
"""A device that speaks unasked has filled the input meanwhile; more than this many pieces come from one that never pauses."""


class _Key(NamedTuple):
    """What must be equal for a link to serve two commands."""

    kind: str
    link: str
    baud: int | None
    trace: str | None
    verbose: bool
    in_use: bool


class Session:
    """The open links of several commands.

    command  in whose name they are locked
    writes   whether any of the commands may write
    """

    def __init__(self, command: str, *, writes: bool) -> None:
        self.command = command
        self.writes = writes
        self.place: dict[str, Any] = {}
        """What the last line of a command's NDJSON says of its place among the others."""
        self._open: dict[_Key, Connection] = {}
        self._lines: dict[_Key, Profile] = {}
        self._traces: dict[str | None, Trace] = {}

    def connection(self, run: Run) -> Connection:
        """The connection for this run: one that is open, or a new one. Another one to the same place is closed first."""
        key = _key(run)
        known = self._open.get(key)
        if known is not None and known.link is not None:
            try:
                _discard(known.link)
            except LinkError:
                self._close(key, run.journal)  # it was lost meanwhile
                known = None
        if known is None:
            for other in [other for other in self._open if other.link == key.link]:
                self._close(other, run.journal)
            known = self._open[key] = Connection(self._traces.setdefault(key.trace, Trace()))
        run.journal.line = self._lines.setdefault(key, run.journal.line)
        if known.link is None:
            run.journal.line.met.clear()  # whoever is behind a new connection
        if known.hold is not None:
            known.hold.serve(run)
        return known

    def keeps(self, run: Run, failure: HandctlError | None) -> bool:
        """Whether the connection of this run is one of these: it stays open, unless it was lost or the device stopped."""
        connection = run.connection
        for key, known in self._open.items():
            if known is connection:
                lost = connection.link is None or isinstance(failure, LinkError)
                stopped = connection.hold is not None and connection.hold.stopped is not None
                if lost or stopped:
                    self._close(key, run.journal)
                return True
        return False

    def stopped(self, journal: Journal) -> HandctlError | None:
        """How another process has stopped a device since the last command; its link is closed. None where none has."""
        for key, known in list(self._open.items()):
            if known.hold is not None and known.hold.stopped is not None:
                self._close(key, journal)
                return known.hold.stopped
        return None

    def has(self, run: Run) -> bool:
        """Whether the device of this run is open here."""
        return any(key.link == run.link_name() for key in self._open)

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

    def _close(self, key: _Key, journal: Journal, failure: HandctlError | None = None) -> HandctlError | None:
        connection = self._open.pop(key)
        if connection.hold is not None:
            connection.hold.finish()
        return connection.close(failure, journal)


def _key(run: Run) -> _Key:
    assert run.family is not None
    settings = run.settings
    in_use = settings.fake and run.in_use
    return _Key(run.family.kind, run.link_name(), settings.baud, settings.trace, settings.verbose, in_use)


def _discard(link: Link) -> None:
    """What lies in the input belongs to nobody: a late answer, or what a device has said unasked since the last command."""
    from handctl.link import ByteLink, FrameLink

    if link.replayed:
        return
    now = link.deadline(0)
    for _ in range(STALE_READS):
        if isinstance(link, ByteLink):
            if not link.read(now):
                return
        elif not isinstance(link, FrameLink) or link.receive(now) is None:
            return
