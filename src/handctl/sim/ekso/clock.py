"""The clocks of the simulated EksoNR: calendar time, and BootTime in ticks of 2 ms (manual §6; ticks from a field log).

Reads no clock: times are passed in, in seconds.
"""

from __future__ import annotations

TICK_MS = 2
WRAP = 4294967296  # ms; BootTime is two words
FIRST_BOOT_MS = 1  # after a restart; every value of the log was odd


class BootTime:
    """Milliseconds since power-on, always odd."""

    def __init__(self, start: int) -> None:
        self.start = start | 1
        self.since = 0.0

    def restart(self, start: int, now: float) -> None:
        self.start = start | 1
        self.since = now

    def read(self, now: float) -> int:
        # A millionth of a tick of rounding is forgiven.
        return (self.start + TICK_MS * int((now - self.since) * 500.0 + 0.000001)) % WRAP


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
