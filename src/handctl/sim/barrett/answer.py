"""What a supervisory command of the simulated BarrettHand comes to."""

from __future__ import annotations


class Answer:
    """What a command prints: lines, then a status code if it is not 0; `seconds` is how long it is busy before that."""

    __slots__ = ("code", "lines", "seconds")

    def __init__(self, code: int = 0, lines: list[str] | None = None, seconds: float = 0.0) -> None:
        self.code = code
        self.lines = [] if lines is None else lines
        self.seconds = seconds
