"""An EksoNR as the source of a recording: GetData for each row, GetFeedback once a second, GetSettings at both ends (manual §6).

One row per good GetData. The quantities come from the map; only the two words that make BootTime and the one that is also told
in words are named here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from handctl.devices.ekso.device import Ekso
from handctl.devices.ekso.frames import Command
from handctl.devices.ekso.parameter_map import DATA, FEEDBACK, SETTINGS, Word, boot_ms, state_text
from handctl.errors import NoAnswer, ProtocolError
from handctl.record.csv_columns import MARK, Layout, Stamp, lead, quoted
from handctl.record.log_reader import Known, forget, parse_fixed
from handctl.record.row_source import Sample, Source
from handctl.record.timeline import BOOT_WRAP, Place

PERSONAL = "pilot_id"
USUAL_MS = 20.0
"""50 Hz, as in the field."""


class EksoSource(Source):
    """One EksoNR. `personal`: the wearer's number is kept; `again` opens a lost port, see `Source.reopen`."""

    kind = "ekso"
    period_ms = USUAL_MS
    clock_name = "BootTime"
    looks = True

    def __init__(self, ekso: Ekso, again: Callable[[], bool], *, raw: bool, personal: bool) -> None:
        self.layout = RowLayout(raw=raw)
        self.feedback = FeedbackLine()
        self._ekso, self._port, self._again, self._personal = ekso, ekso.port, again, personal

    def sample(self) -> Sample:
        frame = self._port.read(Command.GET_DATA)
        return Sample(self._port.moment, frame)

    def made(self, sample: Sample) -> Sample:
        words = sample.values.words
        return Sample(sample.moment, words, boot_ms(words), lambda: self._ekso.rows_of("data", words))

    def ask_ahead(self) -> None:
        self._port.send_ahead(Command.GET_DATA)

    def settings(self) -> dict[str, dict[str, Any]]:
        """The 22 words of GetSettings, raw and scaled; the wearer's number only on request."""
        return {
            param.name: {
                "raw": raw,
                "value": param.from_raw(raw),
                "unit": param.unit,
                "label": param.label(param.from_raw(raw)),
            }
            for param, raw in zip(SETTINGS, self._port.settings_raw(), strict=True)
            if self._personal or param.name != PERSONAL
        }

    def about(self) -> dict[str, Any]:
        link = self._port.link
        return {
            "link": {"port": link.name, "baud": link.baud, "length_mode": self._port.mode},
            "device_time": self._device_time(),
        }

    def _device_time(self) -> dict[str, Any] | None:
        """The device's clock next to the host's time of day; None if it does not report it."""
        from datetime import datetime

        with suppress(NoAnswer, ProtocolError, ValueError):
            date, time = self._ekso.now()
            device = datetime.fromisoformat(f"{date['value']}T{time['value']}")
            host = datetime.fromtimestamp(self._port.link.wall())  # noqa: DTZ006 - the device tells no zone
            return {"device": device.isoformat(), "host_local": host.isoformat(timespec="seconds"), "offset_s": round((device - host).total_seconds(), 1)}  # fmt: skip
        return None

    def is_next_look(self, *, due: bool) -> bool:
        link = self._port.link
        return link.is_next_recorded(self._port.request(Command.GET_FEEDBACK)) if link.replayed else due

    def look(self, place: Place, row: int) -> bool:
        """GetFeedback, once: the next row is worth more than a second try."""
        return self.feedback.add(self._port.exchange(Command.GET_FEEDBACK).words, place, row)

    def unanswered(self) -> None:
        self.feedback.unanswered += 1

    def reopen(self) -> bool:
        return self._ekso.reopen(self._again)

    def sidecar(self) -> dict[str, Any]:
        return {
            "feedback": self.feedback.as_row(),
            "counters": {**self._port.journal.counters.as_row(), **asdict(self._port.counts)},
            "answer_length_mode": self._port.answer_mode,
        }


# -- GetFeedback beside a log: steps, times, step lengths and assistance as they changed --------------------------------


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


# -- the columns: how a word becomes text, and text becomes the word again ----------------------------------------------


LEAD = lead("boot_ms")
"""Names and decimals of the leading columns."""
SUFFIXES = {"deg": "deg", "in": "in", "A": "a"}
"""Unit -> ending of a column's name. A quantity with decimals and another unit has none, one without decimals is raw."""
BOOT_WORDS = ("boot_time_high", "boot_time_low")
NAMED = "state"
"""The quantity that is also told in words, in a column of its own."""


def column_of(quantity: Word) -> str:
    """Name of its column, the unit in it: ``torso_pitch_deg``."""
    if not quantity.decimals:
        return f"{quantity.name}_raw"
    suffix = SUFFIXES.get(quantity.unit or "")
    return f"{quantity.name}_{suffix}" if suffix else quantity.name


def text_of(quantity: Word, number: int) -> str:
    """The text of an integer in the field's own sign, with exactly as many decimals as the wire has."""
    return f"{number / 10**quantity.decimals:.{quantity.decimals}f}" if quantity.decimals else str(number)


def parse(quantity: Word, text: str) -> int:
    """The integer (see `Word.raw_of`) whose text this is. Raises ValueError for any other spelling."""
    number = parse_fixed(text, quantity.decimals)
    if text_of(quantity, quantity.raw_of(number)) != text:
        raise ValueError(f"{text!r} does not fit 16 bit")
    return number


def _says(quantity: Word) -> Callable[[int], str]:
    """What makes a word of a quantity its text."""
    return lambda word: text_of(quantity, quantity.raw_of(word))


class RowLayout(Layout):
    """The columns of one file: those of GetData in wire order, with `raw` also its words as they came."""

    def __init__(self, *, raw: bool) -> None:
        self.shown = tuple(quantity for quantity in DATA if quantity.name not in BOOT_WORDS)
        self.columns = tuple(column_of(quantity) for quantity in self.shown)
        self._named = next(at for at, quantity in enumerate(self.shown) if quantity.name == NAMED)
        self.raw = raw
        kinds: dict[tuple[int, bool], Known] = {}
        self._cells = [
            (quantity.word, kinds.setdefault((quantity.decimals, quantity.signed), Known(_says(quantity))))
            for quantity in self.shown
        ]
        """Where the word of each column is, and the texts of its kind."""
        self._kinds = kinds.values()
        names = [name for name, _ in LEAD]
        for quantity in self.shown:
            names += [column_of(quantity), f"{NAMED}_name"] if quantity.name == NAMED else [column_of(quantity)]
        names.append(MARK)
        if raw:
            names += [f"raw_{quantity.word:02d}_{quantity.name}" for quantity in DATA]
        self.names = tuple(names)

    def as_rows(self) -> list[dict[str, Any]]:
        """The columns of GetData as the sidecar explains them."""
        return [
            {"column": column, "name": q.name, "word": q.word, "unit": q.unit, "type": q.type_name}
            for q, column in zip(self.shown, self.columns, strict=True)
        ]

    def line(self, stamp: Stamp, values: Sequence[int], mark: str) -> str:
        """One row of the 27 words."""
        forget(self._kinds)
        cells = [texts[values[word]] for word, texts in self._cells]
        state = self.shown[self._named]
        cells.insert(self._named + 1, quoted(state_text(state.raw_of(values[state.word]))))
        texts = [*stamp.texts(), *cells, quoted(mark)]
        if self.raw:
            texts += [str(word & 0xFFFF) for word in values]
        return ",".join(texts) + "\r\n"


def to_si(column: str, quantity: Word | None) -> tuple[str, Callable[[int], str] | None]:
    """Name of a column in SI units, and how a number becomes text there; None = it stays as it is.

    Inches become metres, exactly; degrees radians with 8 decimals, which still tell neighbouring words apart.
    """
    if quantity is None or quantity.unit not in ("deg", "in") or not quantity.decimals:
        return column, None
    decimals = quantity.decimals
    if quantity.unit == "in":
        return f"{quantity.name}_m", lambda number: f"{number * 254 / 10 ** (decimals + 4):.{decimals + 4}f}"
    return f"{quantity.name}_rad", lambda number: f"{math.radians(number / 10**decimals):.8f}"
