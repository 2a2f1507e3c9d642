"""The shared options of a command as every layer sees them. Knows neither where they were said nor who takes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from handctl.families import HISTORY
from handctl.fast_classes import NamedTuple


class Settings(NamedTuple):
    """The shared options after precedence. `kind` is the family of the named device, None without one.

    `own` holds what only one family has (`families.OwnOption`), as far as it is said.
    """

    device: str | None = None
    kind: str | None = None
    port: str | None = None
    fake: bool = False
    wire: str | None = None
    facts: str | None = None
    id: int | None = None
    baud: int | None = None
    timeout: float | None = None
    deadline: float | None = None
    retries: int | None = None
    format: str = "table"
    output: str | None = None
    append: bool = False
    time: bool = False
    no_formulas: bool = False
    wide: bool | None = None
    trace: str | None = None
    dry_run: bool = False
    yes: bool = False
    assume_identity: bool = False
    history: str = HISTORY[0]
    quiet: bool = False
    verbose: bool = False
    color: str = "auto"
    debug: bool = False
    own: Mapping[str, Any] = {}

    def having(self, values: Mapping[str, Any]) -> Settings:
        """With these values, by key; a key that is not shared is one of the family's own."""
        shared = {key: value for key, value in values.items() if key in self._fields and key != "own"}
        own = {key: value for key, value in values.items() if key not in self._fields}
        return self._replace(**shared, own={**self.own, **own, **values.get("own", {})})
