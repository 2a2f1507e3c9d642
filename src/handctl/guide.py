"""Guide: how a procedure talks with the person at the device. The silent base serves tests and scripts.

Procedures get one and never print; the terminal's own guide lives in `console`.
"""

from __future__ import annotations


class Guide:
    """Says nothing. `interactive` tells whether a person can answer."""

    interactive = False

    def say(self, text: str) -> None:
        """A line that stays, e.g. what the wearer has to do now."""

    def progress(self, text: str) -> None:
        """A line that replaces the last progress line; only a terminal shows it."""

    def done(self) -> None:
        """The progress line is over."""
