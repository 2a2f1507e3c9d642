"""Feedback of the hand: the newest value of every key, or why it was rejected. Knows no bytes and no link."""

from __future__ import annotations

from handctl.devices.aidin.json_codec import WrongNumbers, numbers
from handctl.devices.aidin.map import FEEDBACK, AidinParam
from handctl.errors import ProtocolError
from handctl.model.param import Element, Number

MISSING = "missing-key"
"""Code of a key that the hand does not send."""
Wire = tuple[int, ...] | tuple[float, ...]
ALL = tuple(param.key for param in FEEDBACK)


class Quality:
    """How good each key is over a whole connection, counted into `keys`: key -> bad, missing, skipped.

    bad      it was there and had not the form that the manual says
    missing  all that comes in one round, in one object or several, came without it
    skipped  a good value that a newer one replaced before it was shown
    """

    def __init__(self) -> None:
        self.keys: dict[str, dict[str, int]] = {key: {"bad": 0, "missing": 0, "skipped": 0} for key in ALL}
        self._round: set[str] = set()

    def came(self, key: str) -> None:
        """A round ends with the first key that comes again."""
        if key in self._round:
            for other in self.keys.keys() - self._round:
                self.keys[other]["missing"] += 1
            self._round.clear()
        self._round.add(key)


class Feedback:
    """The newest value of every key, or why it was refused; how often it came, and how often running it was refused."""

    def __init__(self, quality: Quality | None = None) -> None:
        self.quality = quality or Quality()
        self.good: dict[str, int] = {}
        self.wrong: dict[str, int] = {}
        self.values: dict[str, Wire] = {}
        self.errors: dict[str, ProtocolError] = {}
        self.seen: dict[str, int] = {}

    def merge(self, content: dict[str, object]) -> int:
        """Merge an object; number of known keys in it."""
        known = 0
        for param in FEEDBACK:
            if param.key not in content:
                continue
            known += 1
            self.quality.came(param.key)
            self.seen[param.key] = self.seen.get(param.key, 0) + 1
            try:
                self.values[param.key] = numbers(content[param.key], param.count, int_range=param.int_range)
                self.good[param.key] = self.good.get(param.key, 0) + 1
                self.errors.pop(param.key, None)
                self.wrong.pop(param.key, None)
            except ProtocolError as exc:
                self.quality.keys[param.key]["bad"] += 1
                self.errors[param.key] = exc
                self.wrong[param.key] = self.wrong.get(param.key, 0) + 1
        return known

    def replaced(self, keys: tuple[str, ...]) -> None:
        """Of these keys one value was shown; the other good ones that have come were not."""
        for key in keys:
            self.quality.keys[key]["skipped"] += max(0, self.good.get(key, 0) - 1)

    def complete(self, keys: tuple[str, ...] = ()) -> bool:
        """Whether a good value of every key (or of these) has come."""
        return all(key in self.values and key not in self.errors for key in keys or ALL)

    def result(self, key: str) -> Wire | ProtocolError:
        """The newest value of a key, or why there is none."""
        error = self.errors.get(key)
        if error is not None:
            return error
        value = self.values.get(key)
        return value if value is not None else ProtocolError("the hand does not send it", code=MISSING)


def keys_in(data: bytes) -> list[str]:
    """Keys of the manual in text that has none of them as it should be: in another spelling, or within something else."""
    letters = "".join(chr(byte) for byte in data if chr(byte).isalpha()).lower()
    return [key for key in ALL if key.replace("_", "") in letters] if data.isascii() else []


def values_of(param: AidinParam, wire: Wire) -> list[Number]:
    """A whole array in the parameter's unit."""
    return [param.from_wire(number) for number in wire]


def named(where: str, param: AidinParam, found: Wire | ProtocolError) -> Wire | ProtocolError:
    """The received value of a key; an error names the hand, the key and the elements as `get` accepts them."""
    if isinstance(found, WrongNumbers):
        texts = (f"{Element(param, place).full_name} {exc.text}" for place, exc in found.wrong.items())
        return _spelled(where, "; ".join(texts), found)
    return _spelled(where, f"{param.key}: {found.text}", found) if isinstance(found, ProtocolError) else found


def number_of(where: str, element: Element, param: AidinParam, found: Wire | ProtocolError) -> Number | ProtocolError:
    """The number of one element; an error only where it concerns this one."""
    if isinstance(found, WrongNumbers):
        wrong, number = found.wrong.get(element.index), found.numbers[element.index]
        if wrong is None and number is not None:
            return number
        return _spelled(where, f"{element.full_name} {wrong.text if wrong else found.text}", wrong or found)
    found = named(where, param, found)
    return found if isinstance(found, ProtocolError) else found[element.index]


def _spelled(where: str, text: str, why: ProtocolError) -> ProtocolError:
    return ProtocolError(f"{where}: {text}", hint="check it with --trace FILE", code=why.code)
