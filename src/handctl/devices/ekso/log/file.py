"""Reading a log back: every line checked, so that what is exported is what was recorded.

A file that is not a log, or not whole, is refused with the number of the line. The sidecar says whether the log was
closed; one that was not (power failure, kill) may end in the middle of a row, which is then left out.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from typing import Any, NamedTuple

from handctl.devices.ekso.log.format import LEAD, NAMED, RowLayout, parse, parse_fixed
from handctl.devices.ekso.map import DATA, boot_ms, state_text
from handctl.errors import UsageError
from handctl.files import NoFile, opened, read_text
from handctl.record.recording import schema
from handctl.record.source import MARK
from handctl.sentence import plural

LONGEST_LINE = 65536
UNTOUCHED = "the file was not changed"
SCHEMA = schema("ekso")
NAMES = [name for name, _ in LEAD]


class LogRow(NamedTuple):
    """One row: its fields as they stand there, device time, segment, and the numbers of the shown words."""

    fields: list[str]
    t_ms: int
    segment: int
    numbers: dict[str, int]


def damaged(path: str, line: int, what: str) -> UsageError:
    """The error for a file that is not a whole log."""
    return UsageError(f"{path} line {line}: {what}", hint=f"not a log, or damaged. {UNTOUCHED}", code="damaged-log")


class LogFile:
    """A log on the disk. Raises UsageError when it cannot be read, or is none."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.sidecar = _load_sidecar(f"{path}.json")
        self.cut = False
        """True when an unfinished last row was left out."""
        with opened(path, "a log", hint=f"`handctl ekso log {path}` makes one") as file:
            header = file.readline(LONGEST_LINE).decode("utf-8", "replace")
        names = header.rstrip("\r\n").split(",")
        self.layout = next(
            (layout for raw in (False, True) if (layout := RowLayout(raw=raw)).names == tuple(names)), None
        ) or (self._foreign(names))

    @property
    def closed(self) -> bool:
        """Whether the sidecar says that the log was closed; an older one calls that complete."""
        return bool(self.sidecar and self.sidecar.get("closed", self.sidecar.get("complete")))

    @property
    def missing(self) -> list[str]:
        """What keeps a closed log from being whole, as its sidecar says."""
        return [str(reason) for reason in (self.sidecar or {}).get("missing") or []]

    @property
    def simulated(self) -> bool:
        """Whether the sidecar says that a simulator was recorded."""
        return bool(self.sidecar and self.sidecar.get("simulated"))

    def _foreign(self, names: list[str]) -> RowLayout:
        for number, wanted in enumerate(RowLayout(raw=False).names):
            if number >= len(names) or names[number] != wanted:
                found = repr(names[number][:40]) if number < len(names) else "missing"
                raise damaged(self.path, 1, f"column {number + 1} is {found}, but in a log it is {wanted!r}")
        raise damaged(self.path, 1, "the header continues after the columns of a log")

    def rows(self) -> Iterator[LogRow]:
        """Row after row, each checked. Raises UsageError with the number of the line."""
        count, last = 0, (0, 0)
        try:
            with opened(self.path, "a log") as file:
                file.readline(LONGEST_LINE)
                for number, data in enumerate(iter(lambda: file.readline(LONGEST_LINE), b""), 2):
                    if len(data) == LONGEST_LINE:
                        raise damaged(self.path, number, f"longer than {LONGEST_LINE} bytes")
                    if not data.endswith(b"\n"):
                        if self.closed:
                            raise damaged(self.path, number, "the row is cut short")
                        self.cut = True
                        break
                    row = self._row(number, data)
                    if (row.segment, row.t_ms) < last or row.segment > last[0] + 1:
                        raise damaged(self.path, number, "segment or t_s does not follow from the row before")
                    last = (row.segment, row.t_ms)
                    count += 1
                    yield row
        except OSError as exc:
            raise UsageError(
                f"{self.path}: cannot be read: {exc.strerror or exc}", hint="check the file and its permissions"
            ) from exc
        if self.sidecar and self.closed and self.sidecar.get("rows") != count:
            raise damaged(
                self.path, count + 1, f"the file ends after {count} rows, its sidecar counts {self.sidecar.get('rows')}"
            )

    def _row(self, number: int, data: bytes) -> LogRow:
        try:
            text = data.decode("utf-8").rstrip("\r\n")
            fields = next(csv.reader([text], strict=True)) if '"' in text else text.split(",")
        except (UnicodeDecodeError, csv.Error, StopIteration) as exc:
            raise damaged(self.path, number, f"not text in columns: {exc}") from exc
        names = self.layout.names
        if len(fields) != len(names):
            raise damaged(self.path, number, f"{plural(len(fields), 'column')} instead of {len(names)}")
        cells = dict(zip(names, fields, strict=True))
        name = ""
        try:
            lead = []
            for name, decimals in LEAD:
                lead.append(parse_fixed(cells[name], decimals))
            numbers = {}
            for quantity, name in zip(self.layout.shown, self.layout.columns, strict=True):
                numbers[quantity.name] = parse(quantity, cells[name])
            name = f"{NAMED}_name"
            if cells[name] != state_text(numbers[NAMED]):
                raise ValueError(f"{cells[name]!r} does not fit {NAMED}")
            if self.layout.raw:
                name = "raw columns"
                self._check_raw(fields[names.index(MARK) + 1 :], lead[NAMES.index("boot_ms")], numbers)
        except ValueError as exc:
            raise damaged(self.path, number, f"{name}: {exc}") from exc
        return LogRow(fields, lead[NAMES.index("t_s")], lead[NAMES.index("segment")], numbers)

    def _check_raw(self, texts: list[str], boot: int, numbers: dict[str, int]) -> None:
        words = [parse_fixed(text, 0) for text in texts]
        for quantity, word in zip(DATA, words, strict=True):
            if not 0 <= word <= 0xFFFF or numbers.get(quantity.name, quantity.raw_of(word)) != quantity.raw_of(word):
                raise ValueError(f"{word} does not fit {quantity.name}")
        if boot_ms(words) != boot:
            raise ValueError("they do not fit boot_ms")


def _load_sidecar(path: str) -> dict[str, Any] | None:
    """The sidecar, None when there is none. Raises UsageError for one that is damaged or of another kind."""
    try:
        content = json.loads(read_text(path, "a sidecar", 16_000_000))
    except NoFile:
        return None
    except (ValueError, RecursionError) as exc:
        line = exc.lineno if isinstance(exc, json.JSONDecodeError) else 1
        raise damaged(path, line, f"not a sidecar: {exc}") from exc
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        found = content.get("schema") if isinstance(content, dict) else None
        raise damaged(path, 1, f"schema {found!r} instead of {SCHEMA!r}")
    return content
