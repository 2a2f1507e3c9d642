"""The gate of a command: a family's look at who is there, before the first write, and at what was read. Knows no protocol."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from handctl.errors import HandctlError, Interrupted, NotIdentified
from handctl.link import Link
from handctl.model.result import Journal


class Gate:
    """Open once somebody has looked, or once `--assume-identity` has said that nobody looks."""

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

    def check_read(self, link: Link, journal: Journal, who: Hashable, judge: Callable[[], object]) -> None:
        """Judge what was read, unless that of `who` was on this line already. `judge` raises what speaks against this family."""
        if self.passed or who in journal.line.met:
            return
        if self.assumed:
            self.tell(journal)
        else:
            try:
                judge()
            except HandctlError as exc:
                if not link.replayed or exc.code != "replay-miss":
                    raise
        journal.line.met.add(who)

    @staticmethod
    def tell(journal: Journal) -> None:
        """Say that nobody looks, once."""
        if not any(message.code == "identity-assumed" for message in journal.messages):
            text = "the device's identity was not checked, because of --assume-identity"
            journal.warn("identity-assumed", text)
