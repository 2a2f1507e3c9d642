"""A simulator that takes what was found out about a real device: the facts file of `handctl prove` as options and faults, and
the values that a transcript shows.

Each simulator says in its package what a fact makes of it: FACTS, fact -> value -> options as a LINK spells them. "" = it is so
already; "*" stands for any other value, {} for that value and {seconds} for one in ms. What no fact says stays the manual's.
"""

from __future__ import annotations

import importlib
import json
import os

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

SCHEMA = "handctl/facts-1"
SHOWN = ("as-assumed", "differs")
SHOWN_LEFT = 12
"""Facts or values that are not simulated: so many are named."""


class Twin:
    """The options of a simulator with facts or values: `raw`, and which facts were `taken`, or are `left` because it cannot show them."""

    def __init__(self, kind: str, given: dict[str, str]) -> None:
        """`given` are the raw options with `facts`, `values` or both: what they say themselves wins. Raises ValueError."""
        self.raw = {name.replace("_", "-"): text for name, text in given.items() if name not in ("facts", "values")}
        said, faults = set(self.raw) - {"fault"}, [self.raw["fault"]] if "fault" in self.raw else []
        self.taken: list[str] = []
        self.left: list[str] = []
        table: dict[str, dict[object, str]] = importlib.import_module(f"handctl.sim.{kind}").FACTS
        self.values = [item for item in given.get("values", "").split(";") if item]
        for pair in [item for item in self.values if "=" in item]:  # an option; the others are control commands
            self.raw.setdefault(*pair.split("=", 1))
        if commands := [item for item in self.values if "=" not in item]:
            self.raw["values"] = ";".join(commands)
        for name, fact in _facts(kind, given["facts"]).items() if "facts" in given else ():
            if fact["verdict"] not in SHOWN:
                continue
            value = fact["value"]
            row = table.get(name, {})
            text = row.get(value, row.get("*"))
            if text is None:
                self.left.append(name)
                continue
            ms = value if isinstance(value, int | float) else 0
            for pair in filter(None, text.format(value, seconds=f"{ms / 1000:g}").split("&")):
                key, _, word = pair.partition("=")
                if key == "fault":
                    faults += [] if word in faults else [word]
                elif key not in said:
                    self.raw.setdefault(key, word)
            self.taken.append(name)
        if faults:
            self.raw["fault"] = ",".join(faults)

    def words(self, values: tuple[list[str], list[str]]) -> str:
        """What became of the facts, and of the values by their commands (see `Cable`), in a line."""
        parts = [_counted("facts", self.taken, self.left)] if self.taken or self.left else []
        if any(values):
            parts.append(_counted("values", values[0], [" ".join(words.split()[:-1]) for words in values[1]]))
        return f"{'; '.join(parts) or 'nothing is known of the device'}. Everything else is as in the manual"


def _counted(what: str, taken: list[str], left: list[str]) -> str:
    more = ", …" if len(left) > SHOWN_LEFT else ""
    names = f", {len(left)} not simulated ({', '.join(left[:SHOWN_LEFT])}{more})" if left else ""
    return f"{len(taken)} {what} taken{names}"


def _facts(kind: str, path: str) -> dict[str, Any]:
    if os.path.exists(path) and not os.path.isfile(path):
        raise ValueError(f"{path}: not a file of facts")  # to open a port can set its control lines
    try:
        with open(path, encoding="utf-8-sig") as file:
            content = json.load(file)
        family, facts, schema = content["family"], content["facts"], content["schema"]
        good = schema == SCHEMA and all({"verdict", "value"} <= set(fact) for fact in facts.values())
    except OSError as exc:
        raise ValueError(f"option facts={path}: {exc.strerror or exc}") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        good, family = False, kind
    if not good:
        raise ValueError(f"option facts={path}: not a facts file of `handctl prove`")
    if family != kind:
        raise ValueError(f"option facts={path}: the facts of a device of family {family}, not {kind}")
    found: dict[str, Any] = facts
    return found
