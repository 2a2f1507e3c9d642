"""Private data that a report leaves out unless requested: users, home folders, serial numbers, private quantities.

Values are blanked while they are still rows, before anything is drawn. For a device with such a quantity, all bytes that
it sent are left out, because the number could be anywhere in a late or damaged reply.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from handctl.errors import command_of, reworded
from handctl.model.param import ParamMap
from handctl.model.result import Message, Row, Table

REDACTED = "redacted"
LEFT_OUT = "(left out)"
_PLACES = frozenset(
    {"name", "parameter", "motor", "finger", "element", "key", "word", "id", "address", "unit", "message"}
)
"""Keys of a row that say which quantity it is. All others may hold its value."""

_HOMES = re.compile(r"(?<![\w.])((?:/home|/Users|/run/media|/media|[A-Za-z]:\\Users)[/\\])[^/\\\s'\"&;,]+")
_BY_ID = re.compile(r"/dev/serial/by-id/[^\s'\",;]+")
_CALLOUT = re.compile(r"(/dev/(?:cu|tty)\.usb(?:serial|modem)-?)[^\s'\",;]+")
"""macOS names ports by serial number."""
_USB = re.compile(r"\b(usb:[0-9A-Fa-f]{4}:[0-9A-Fa-f]{4}):[^\s'\",;?]+")
_BYTES = re.compile(r"\b[0-9A-Fa-f]{2}(?: [0-9A-Fa-f]{2}){2,}\b")
_QUOTED = re.compile(r"(?<!\w)(['\"])(?:(?!\1).)*\d(?:(?!\1).)*\1")
_NAMED = re.compile(r"(?i)\b((?:serial|pilot)[ _]?(?:number|no\.?|id)|SN|S/N)(\W{1,4}(?:is )?)(\d\w*)")


class Privacy:
    """What is blanked in one report. `keep_ids` leaves serial numbers and pilots alone; users and homes never appear.

    holds   names of the private quantities that this kind of device has
    masks   whether the bytes it sends are left out of the transcript
    """

    def __init__(self, params: ParamMap[Any], keep_ids: bool) -> None:
        self.keep_ids = keep_ids
        self.holds = tuple(param.name for param in params if param.private)
        self.masks = bool(self.holds) and not keep_ids
        self._home = os.path.expanduser("~")
        self._secrets: set[str] = set()

    def rows(self, rows: Sequence[Row]) -> list[Row]:
        """The same rows, private quantities without their values; what they held is blanked in texts from now on."""
        return [self._row(row) if row.get("name") in self.holds and not self.keep_ids else row for row in rows]

    def table(self, table: Table) -> Table:
        """The same table with such rows. Its own view must cope with words instead of numbers."""
        table.rows = self.rows(table.rows)
        return table

    def identity(self, facts: Mapping[str, object]) -> dict[str, str]:
        """What a device says of itself, as texts; what is unknown stays out."""
        known = {key: value for key, value in facts.items() if value is not None}
        for key in known.keys() & set(self.holds) if not self.keep_ids else ():
            self._learn(known[key])
            known[key] = REDACTED
        return {key: self.text(str(value)) for key, value in known.items()}

    def text(self, text: str) -> str:
        """A text for people without users, home folders and serial numbers of adapters, and without what is private here.

        Of a device that holds private quantities also bytes and quoted answers go: nobody knows what stands in them.
        """
        text = _HOMES.sub(r"\1(user)", text)
        if len(self._home) > 1:
            text = re.sub(rf"{re.escape(self._home)}(?=[/\\\s'\",;&]|$)", "~", text)
        if self.keep_ids:
            return text
        text = _USB.sub(rf"\1:({REDACTED})", _BY_ID.sub(f"/dev/serial/by-id/({REDACTED})", text))
        text = _CALLOUT.sub(rf"\1({REDACTED})", text)
        if not self.masks:
            return text
        text = _QUOTED.sub(LEFT_OUT, _BYTES.sub(LEFT_OUT, _NAMED.sub(rf"\1\2{REDACTED}", text)))
        for secret in self._secrets:
            text = re.sub(rf"(?<![\w.]){re.escape(secret)}(?![\w]|\.\d)", REDACTED, text)
        return text

    def step(self, hint: str) -> str:
        """A next step with such a text; its command stays data only if nothing private was in it."""
        text, command = self.text(hint), command_of(hint)
        return reworded(hint, text) if command == self.text(command) else text

    def messages(self, messages: Iterable[Message]) -> list[Message]:
        """Messages with such texts."""
        return [found._replace(text=self.text(found.text), hint=self.step(found.hint)) for found in messages]

    def transcript(self, line: str) -> str:
        """One recorded line. What a device with private quantities sent becomes a comment with its number of bytes."""
        time, _, rest = line.partition(" ")
        if not self.masks or not rest.startswith("<"):
            return line
        words = rest.split()[1:]
        count = len(words) - 3 if words[:1] == ["can"] else len(words)
        return f"# {time} < {count} byte{'s' if count != 1 else ''} left out"

    def _row(self, row: Row) -> Row:
        self._learn(row.get("value"))
        return {
            key: self.text(str(value)) if key == "error" else value if key in _PLACES or value is None else REDACTED
            for key, value in row.items()
        }

    def _learn(self, value: object) -> None:
        """A number of one or two digits is not looked for in texts: it would be found everywhere."""
        if value is not None and len(str(value)) > 2:
            self._secrets.add(str(value))
