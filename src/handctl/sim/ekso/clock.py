"""The clocks of the simulated EksoNR: calendar time, and BootTime in ticks of 2 ms (manual §6; ticks from a field log).

BootTime need not run as other clocks do: it drifts as any crystal, and `Unrest` has it jump, or the device restart.

Reads no clock: times are passed in, in seconds.
"""

from __future__ import annotations

TICK_MS = 2
WRAP = 4294967296  # ms; BootTime is two words
FIRST_BOOT_MS = 1  # after a restart; every value of the log was odd

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.engine.model import Random

SIZES = {
    # ppm of drift, ms of a jump, ms that a restart takes: least and most of each; None: it does not restart
    "little": ((5, 100), (2, 20), None),
    "middling": ((300, 3000), (80, 900), (100, 900)),
    "much": ((20000, 60000), (5000, 700000), (300, 3000)),
}
FIRST_EVENT_MS, BETWEEN_MS = 2000, (1500, 2500)
SOON_MS = (200, 700)  # from the end of a restart to the next one: BootTime is small both times


class BootTime:
    """Milliseconds since power-on, always odd."""

    def __init__(self, start: int, drift: int = 0) -> None:
        self.start = start | 1
        self.since = 0.0
        self._per_second = 500.0 * (1.0 + drift / 1000000.0)  # ticks

    def restart(self, start: int, now: float) -> None:
        self.start = start | 1
        self.since = now

    def read(self, now: float) -> int:
        # A millionth of a tick of rounding is forgiven.
        return (self.start + TICK_MS * int((now - self.since) * self._per_second + 0.000001)) % WRAP


class Unrest:
    """How a device's clock and others disagree: `drift` in ppm, `events` of seconds from the start, what happens, and how much.

    jump MS: BootTime goes ahead or back; restart MS: the device is off for so long, and BootTime begins again.
    """

    def __init__(self, drift: int, events: tuple[tuple[float, str, int], ...] = ()) -> None:
        self.drift = drift
        self.events = events
        self._next = 0

    @classmethod
    def drawn(cls, size: str, random: Random) -> Unrest:
        """One of SIZES at random: two jumps and, unless it is little, two restarts, in any order."""
        drift, jump, restart = SIZES[size]
        kinds = ["jump", "jump", *(["restart", "restart"] if restart is not None else [])]
        order = [kinds.pop(random.between(0, len(kinds) - 1)) for _ in range(len(kinds))]
        at, events = FIRST_EVENT_MS, []
        for kind, following in zip(order, [*order[1:], ""], strict=True):
            low, high = restart if kind == "restart" and restart is not None else jump
            amount = 2 * (random.between(low, high) // 2)
            sign = 1 if kind == "restart" or random.between(0, 1) else -1
            events.append((at / 1000.0, kind, sign * amount))
            at += random.between(*(SOON_MS if kind == following == "restart" else BETWEEN_MS))
            at += amount if kind == "restart" else 0
        return cls(random.between(*drift) * (1 if random.between(0, 1) else -1), tuple(events))

    def due(self, seconds: float) -> list[tuple[float, str, int]]:
        """The events that have come since the last call."""
        first = self._next
        while self._next < len(self.events) and self.events[self._next][0] <= seconds:
            self._next += 1
        return list(self.events[first : self._next])

    def following(self) -> float | None:
        """When the next one comes."""
        return self.events[self._next][0] if self._next < len(self.events) else None


class Calendar:
    """Date and time of day to the second; it runs on through a power cycle (a guess)."""

    def __init__(self, text: str) -> None:
        self.since = 0.0
        self.set(text, 0.0)

    def set(self, text: str, now: float) -> None:
        """`text` is YYYY-MM-DDTHH:MM:SS, years 2000 to 2099; ValueError for anything else."""
        digits = text[:4] + text[5:7] + text[8:10] + text[11:13] + text[14:16] + text[17:]
        marks = (text[4:5], text[7:8], text[10:11], text[13:14], text[16:17])
        if marks != ("-", "-", "T", ":", ":") or len(digits) != 14 or not (digits.isascii() and digits.isdigit()):
            raise ValueError(f"{text!r} is not YYYY-MM-DDTHH:MM:SS")
        year, month, day = int(digits[:4]), int(digits[4:6]), int(digits[6:8])
        hour, minute, second = int(digits[8:10]), int(digits[10:12]), int(digits[12:])
        if not (2000 <= year <= 2099 and 1 <= month <= 12 and 1 <= day <= _days(year, month)):
            raise ValueError(f"{text!r}: there is no such day in 2000 to 2099")
        if hour > 23 or minute > 59 or second > 59:
            raise ValueError(f"{text!r}: there is no such time of day")
        self.date, self.second, self.since = (year, month, day), hour * 3600 + minute * 60 + second, now

    def read(self, now: float) -> tuple[int, int, int, int, int, int]:
        """Year, month, day, hour, minute, second; after 2099 comes 2000."""
        days, second = divmod(self.second + int(now - self.since + 0.000001), 86400)
        year, month, day = self.date
        while days:
            days -= 1
            day += 1
            if day > _days(year, month):
                day, month = 1, month + 1
            if month > 12:
                month, year = 1, 2000 + (year - 1999) % 100
        return year, month, day, second // 3600, second // 60 % 60, second % 60

    def text(self, now: float) -> str:
        return "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}".format(*self.read(now))


def _days(year: int, month: int) -> int:
    if month == 2:
        return 29 if year % 4 == 0 else 28
    return 30 if month in (4, 6, 9, 11) else 31
