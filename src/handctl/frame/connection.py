"""An open link with its lock, its trace and what is kept of a simulated device: of one command, or of several in a row."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any

from handctl import __version__
from handctl.errors import HandctlError

if TYPE_CHECKING:
    from handctl.frame.run import Run
    from handctl.link import Link
    from handctl.link.kept import Kept
    from handctl.link.tap import Tap, TraceFile
    from handctl.model.result import Journal
    from handctl.stop.holding import Hold


class Trace:
    """The recording of one connection, or of several one behind the other."""

    def __init__(self) -> None:
        self.file: TraceFile | None = None
        self._tap: Tap | None = None

    def tap(self, run: Run, name: str) -> Tap | None:
        """What records, for --trace or -v; None without either."""
        settings = run.settings
        if self._tap is None and (settings.trace or settings.verbose):
            from handctl.link.tap import Tap, TraceFile

            try:
                header = f"handctl {__version__} {run.owner}, {name}"
                self.file = TraceFile(settings.trace, header, settings.verbose)
            except HandctlError as exc:
                if not run.stops:
                    raise
                run.journal.warn("trace", exc.text)
                return None
            self._tap = Tap(self.file.write)
        return self._tap

    def close(self) -> HandctlError | None:
        """The end of the file; why it ends early, None where it does not."""
        if self.file is not None:
            self.file.close()
        return self.failure

    @property
    def failure(self) -> HandctlError | None:
        """Why the recording ends early."""
        return self.file.failure if self.file is not None else None


class Connection:
    """What is open of one device. Opened once and closed once, whoever uses it meanwhile."""

    def __init__(self, trace: Trace | None = None) -> None:
        """`trace` is one that goes on behind this connection."""
        self.link: Link | None = None
        self.hold: Hold | None = None
        self.kept: Kept | None = None
        self._trace = trace or Trace()
        self._lasting = trace is not None

    def elsewhere(self) -> Connection:
        """One to another device of the same command, recorded in the same file."""
        return Connection(self._trace)

    def opened(self, run: Run, baud: int | None) -> Link:
        """The link of this run, tapped when --trace or -v is given. Raises UsageError, LinkError."""
        from handctl.frame.simulated import opened

        if self.link is None:
            name = run.link_name()
            tap = self._trace.tap(run, name)
            if self.hold is None:
                from handctl.stop.holding import Hold, lock_for

                self.hold = Hold(run, lock_for(run, name))
            self.link = opened(run, name, baud, tap)
        if run.writes and not run.stops and self.link.outlet() is not None:
            refuse_rivals(run, self.link)
        return self.link

    def close(self, failure: HandctlError | None, journal: Journal) -> HandctlError | None:
        """Release everything; `failure`, or what went wrong here. May be called twice."""
        try:
            if self.link is not None:
                self.link.close()
                if self.kept is not None and self.kept.begun:
                    journal.info("kept", self.kept.text)
        except HandctlError as exc:
            failure = failure or exc
        finally:
            if not self._lasting:
                self._trace.close()
            if self.hold is not None:
                self.hold.release()
        return failure or self.trace_failure

    @property
    def trace_failure(self) -> HandctlError | None:
        """Why the recording ends early."""
        return self._trace.failure


def refuse_rivals(run: Run, link: Link) -> None:
    """Raise LinkError where another program could command the device beside this command, as far as the system tells."""
    from handctl.link.owners import busy, rivals

    names, hidden = rivals(link)
    if names:
        raise busy(link.name, names)
    if hidden:
        run.journal.info(
            "owners-unknown",
            f"{link.name}: no other program of this user has the port open. Programs of other users cannot be seen from this account",
        )


def beside(run: Run, link: str, settings: dict[str, Any]) -> Run:
    """The same command at another LINK: it says, counts and writes in the same place, but has a link, a lock and a line of its own."""
    from handctl.model.profile import Profile

    other = copy(run)
    own = {**run.settings.own, **settings.pop("own", {})}
    other.settings = run.settings._replace(
        port=link, fake=False, wire=None, device=None, kind=None, own=own, **settings
    )
    if run.end is not None and run.link is not None:
        other.settings = other.settings._replace(deadline=max(run.end - run.link.now(), 0.001))
    other.connection = run.connection.elsewhere()
    other.link = other.opened = other.end = None
    other.others = []
    other.journal = copy(run.journal)
    other.journal.line = Profile()
    return other
