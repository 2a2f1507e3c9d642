"""What a hand tells: the newest value of every key, or why it was refused. Knows no bytes and no link."""

from __future__ import annotations

from handctl.devices.aidin.fields import FEEDBACK, AidinParam
from handctl.devices.aidin.messages import numbers
from handctl.errors import ProtocolError
from handctl.param import Number

Wire = tuple[int, ...] | tuple[float, ...]
ALL = tuple(param.key for param in FEEDBACK)


class Feedback:
    """The newest value of every key, or why it was refused; how often it came, and how often running it was refused."""

    def __init__(self) -> None:
        self.wrong: dict[str, int] = {}
        self.values: dict[str, Wire] = {}
        self.errors: dict[str, ProtocolError] = {}
        self.seen: dict[str, int] = {}

    def take(self, content: dict[str, object]) -> int:
        """Merge an object; number of known keys in it."""
        known = 0
        for param in FEEDBACK:
            if param.key not in content:
                continue
            known += 1
            self.seen[param.key] = self.seen.get(param.key, 0) + 1
            try:
                self.values[param.key] = numbers(content[param.key], param.count, whole=param.whole)
                self.errors.pop(param.key, None)
                self.wrong.pop(param.key, None)
            except ProtocolError as exc:
                self.errors[param.key] = exc
                self.wrong[param.key] = self.wrong.get(param.key, 0) + 1
        return known

    def complete(self, keys: tuple[str, ...] = ()) -> bool:
        """Whether a good value of every key (or of these) has come."""
        return all(key in self.values and key not in self.errors for key in keys or ALL)

    def result(self, key: str) -> Wire | ProtocolError:
        """The newest value of a key, or why there is none."""
        error = self.errors.get(key)
        if error is not None:
            return error
        value = self.values.get(key)
        return value if value is not None else ProtocolError("missing in what the hand sends", code="missing-key")


def values_of(param: AidinParam, wire: Wire) -> list[Number]:
    """A whole array in the parameter's unit."""
    return [param.from_wire(number) for number in wire]
