"""The plug of a simulated port: when it is out, by a plan or by hand. Knows time, and nothing of what it plugs."""

from __future__ import annotations

COMMANDS = ("unplug [SECONDS]", "replug")


class Plug:
    """Out at the moments of a plan "AT:SECONDS,AT:SECONDS", counted from the start, or from `pull` to `push`."""

    def __init__(self, plan: str | None) -> None:
        """Raises ValueError for a plan that is none."""
        self._plan = sorted(_pair(item) for item in (plan or "").split(",") if item.strip())
        self._start = 0.0
        self._until = 0.0  # by hand

    def begin(self, now: float) -> None:
        """The start of the plan."""
        self._start = now

    def pull(self, until: float) -> None:
        """Out until this moment."""
        self._until = until

    def push(self) -> None:
        """In again, whatever the plan says of the present."""
        self._until = 0.0

    def command(self, words: list[str], now: float) -> str:
        """unplug [SECONDS] | replug, as words. Raises ValueError."""
        match words:
            case ["unplug", *seconds] if len(seconds) < 2:
                self.pull(now + _seconds(seconds[0]) if seconds else float("inf"))
            case ["replug"]:
                self.push()
            case _:
                raise ValueError(f"unknown command {' '.join(words)!r}. Known: {' | '.join(COMMANDS)}")
        return " ".join(words)

    def out(self, now: float) -> bool:
        """Whether it is out."""
        if not self._plan:
            return now < self._until
        since = now - self._start
        return now < self._until or any(at <= since < at + seconds for at, seconds in self._plan)

    def next_event(self, now: float) -> float | None:
        """When that changes next."""
        if not self._plan and self._until <= now:
            return None
        moments = [self._until, *(self._start + edge for at, seconds in self._plan for edge in (at, at + seconds))]
        return min((moment for moment in moments if now < moment < float("inf")), default=None)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds <= 1e9:
        raise ValueError(f"{text!r} is not a number of seconds")
    return seconds


def _pair(text: str) -> tuple[float, float]:
    at, _, seconds = text.partition(":")
    try:
        found = float(at), float(seconds)
    except ValueError:
        found = (-1.0, -1.0)
    if not (0.0 <= found[0] <= 1e9 and 0.0 < found[1] <= 1e9):
        raise ValueError(f"unplug={text}: expected AT:SECONDS, for example 2.5:1")
    return found
