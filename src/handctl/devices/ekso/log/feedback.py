"""GetFeedback beside a log: steps, times, step lengths and assistance as they changed. Knows no device and no file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from handctl.devices.ekso.map import FEEDBACK, boot_ms
from handctl.record.timeline import BOOT_WRAP, Place

WORDS = FEEDBACK[:15]
"""What is kept of it: its BootTime dates an entry."""
SESSION = ("steps_taken", "upright_time", "walk_time")
"""What counts from power-on, and wraps."""
LONGEST_MS = 60_000
"""A BootTime further from that of the row before is another power-on's: the entry then stands at that row."""


class FeedbackLine:
    """The words of GetFeedback over time: all of them first, then those that changed."""

    def __init__(self) -> None:
        self.answered = 0
        self.unanswered = 0
        self._entries: list[dict[str, Any]] = []
        self._last: dict[str, int] = {}

    def add(self, words: Sequence[int], place: Place, row: int) -> bool:
        """Take an answer; `place` is that of the last row, which has the number `row`.

        Returns whether a count of the session fell: the device has restarted since the answer before.
        """
        self.answered += 1
        raws = {word.name: word.raw_of(words[word.word]) for word in WORDS}
        changed = {
            word.name: word.from_raw(raws[word.name]) for word in WORDS if self._last.get(word.name) != raws[word.name]
        }
        fell = any((raws[name] - self._last.get(name, raws[name])) % 0x10000 >= 0x8000 for name in SESSION)
        self._last = raws
        if changed:
            boot = boot_ms(words)
            since = (boot - (place.boot_ms or 0)) % BOOT_WRAP
            t_ms = place.t_ms + (since if since <= LONGEST_MS else 0)
            entry = {"row": row, "segment": place.segment, "boot_ms": boot, "t_s": t_ms / 1000, "changed": changed}
            self._entries.append(entry)
        return fell

    def as_row(self) -> dict[str, Any]:
        """As it stands in the sidecar."""
        return {
            "words": [{"name": q.name, "word": q.word, "unit": q.unit, "type": q.type_name} for q in WORDS],
            "answered": self.answered,
            "unanswered": self.unanswered,
            "timeline": self._entries,
        }
