"""A simulator that takes what was found out about a real device: the facts file of `handctl prove` as options and faults.

Each simulator says in its package what a fact makes of it: FACTS, fact -> value -> options as a LINK spells them. "" = it is so
already; "*" stands for any other value, {} for that value and {seconds} for one in ms. What no fact says stays the manual's.
"""

from __future__ import annotations

import importlib
import json

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

SCHEMA = "handctl/facts-1"
SHOWN = ("as-assumed", "differs")


class Twin:
    """The options of a simulator with facts: `raw`, and which facts were `taken`, or are `left` because it cannot show them."""

    def __init__(self, kind: str, given: dict[str, str]) -> None:
        """`given` are the raw options with `facts`: what they say themselves wins. Raises ValueError."""
        path = given["facts"]
        self.raw = {name.replace("_", "-"): text for name, text in given.items() if name != "facts"}
        said, faults = set(self.raw) - {"fault"}, [self.raw["fault"]] if "fault" in self.raw else []
        self.taken: list[str] = []
        self.left: list[str] = []
        table: dict[str, dict[object, str]] = importlib.import_module(f"handctl.sim.{kind}").FACTS
        for name, fact in _facts(kind, path).items():
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

    @property
    def words(self) -> str:
        """What became of the facts, in a line."""
        left = f", {len(self.left)} not simulated ({', '.join(self.left)})" if self.left else ""
        return f"facts: {len(self.taken)} taken{left}. Everything else is as in the manual"


def _facts(kind: str, path: str) -> dict[str, Any]:
    try:
        with open(path, encoding="utf-8") as file:
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
