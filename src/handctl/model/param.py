"""Param: one quantity of a device as its manual describes it. ParamMap: all of them, in order.

A name meets its place on the wire in one table per device, made of these (or of a subclass that adds the place).
Everything that reads, writes, prints, explains, stores or completes a quantity asks the Param. Knows no wire.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache, cached_property
from typing import Generic, TypeVar

from handctl.errors import HandctlError, Hint, UsageError
from handctl.fast_classes import NamedTuple, fast_dataclass, field
from handctl.number_parsing import number_in, typed_number
from handctl.wording import frame_text, plural

Number = int | float

MEASURED, SETTING, COMMAND, TRIGGER = "measured", "setting", "command", "trigger"
"""What a quantity is to one who writes: nothing; kept, or changing how the device behaves; a set-point of now; a start."""
KINDS = (MEASURED, SETTING, COMMAND, TRIGGER)
MOVES, PUSHES = "moves", "pushes"
"""What writing it does to what the device holds: leads it to a place, or presses with a force until told otherwise."""


@fast_dataclass(frozen=True, kw_only=True, eq=False)
class Param:
    """One documented quantity, scalar or vector.

    name        lower_snake, the manual's word
    doc         one line for people
    source      manual section, e.g. "exo §2.3.7"
    unit        as printed, None where the manual gives none
    low, high   documented range in `unit`, inclusive; None = no range given
    special     values outside or inside the range with a meaning of their own, e.g. {-1: "not commanded"}
    choices     enumeration: value -> label; then nothing else is allowed
    bits        names of the bits of a flag byte, bit 0 first
    decimals    value = raw / 10**decimals; 0 = the raw integer is the value
    access      "r", "rw" or "w"
    elements    names of a vector's elements in wire order; () = scalar
    persistent  "yes", "no" or "unknown": kept over a power cycle once saved
    kind        "measured"; "setting": kept, or it changes how the device behaves; "command": a set-point that acts now;
                "trigger": writing it starts something, it holds no value
    verb        the command that writes it in the place of `set`
    acts        writing it "moves" or "pushes" what the device holds; "" where it does neither
    strands     writing it may leave the device unreachable or changed for good
    private     tells one device or one person from another: a report leaves it out
    tells       "model", "firmware" or "serial": it says which device this is, for `device` of the envelope
    note        a remark that belongs beside every value of it, e.g. that its scale is unknown
    """

    name: str
    doc: str
    source: str
    unit: str | None = None
    low: Number | None = None
    high: Number | None = None
    special: Mapping[Number, str] = field(default_factory=dict)
    choices: Mapping[Number, str] = field(default_factory=dict)
    bits: tuple[str, ...] = ()
    decimals: int = 0
    access: str = "r"
    elements: tuple[str, ...] = ()
    persistent: str = "no"
    kind: str = MEASURED
    verb: str = ""
    acts: str = ""
    strands: bool = False
    private: bool = False
    tells: str = ""
    note: str = ""

    @property
    def readable(self) -> bool:
        """Whether it can be read from the device."""
        return "r" in self.access

    @property
    def trigger(self) -> bool:
        """Whether writing it starts something; it holds no value."""
        return self.kind == TRIGGER

    @property
    def moves(self) -> bool:
        """Whether writing it moves or pushes what the device holds."""
        return bool(self.acts)

    @property
    def optional(self) -> bool:
        """Whether some devices of this kind do not have it: it stays out of snapshots."""
        return False

    @property
    def writable(self) -> bool:
        """Whether `set` may write it: a parameter with its own command is only written by that."""
        return "w" in self.access and not self.verb

    @cached_property
    def count(self) -> int:
        """Number of elements, 1 for a scalar."""
        return len(self.each)

    @cached_property
    def each(self) -> tuple[Element, ...]:
        """All elements, in wire order; made once, as each remembers its names."""
        return tuple([Element(self, index) for index in range(len(self.elements) or 1)])

    @property
    def meaning(self) -> tuple[object, ...]:
        """What a number of it means: equal on two maps where the same number does the same."""
        return self.unit, self.low, self.high, self.decimals, dict(self.special), dict(self.choices), self.bits

    @property
    def path(self) -> str:
        """What `get` takes for it: its name, unless another quantity has the same."""
        return self.name

    @cached_property
    def alarms(self) -> Mapping[int, str]:
        """The bits that stand for an error: mask -> name; {} where none do."""
        return {1 << bit: name for bit, name in enumerate(self.bits)} if self.bits else {}

    @property
    def range_text(self) -> str:
        """The allowed values for people: ``-1, 0..1000``, ``0 = 115200 baud, 1 = 57600 baud``, or ``""``."""
        if self.choices:
            return ", ".join(f"{value} = {label}" for value, label in self.choices.items())
        if self.bits:
            return f"bits 0..{len(self.bits) - 1}"
        outside = [f"{value}" for value in self.special if not self._within(value)]
        if self.low is not None and self.high is not None:
            return ", ".join([*outside, f"{self.low}..{self.high}"])
        return ", ".join(outside)

    @property
    def limits_source(self) -> str:
        """Whose the limits are: a section of the manual, where that has them."""
        return self.source

    def _within(self, value: Number) -> bool:
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)

    def allowed(self, value: Number) -> bool:
        """Whether the manual documents `value` (in `unit`) for this quantity."""
        if self.choices:
            return value in self.choices
        return value in self.special or self._within(value)

    def check(self, value: Number, where: str = "") -> None:
        """Raise UsageError when `value` is not documented; never clamps."""
        if not self.decimals and value != int(value):
            raise UsageError(
                f"{where or self.name} = {value}: not a whole number", hint="nothing was sent", code="not-a-number"
            )
        if not self.allowed(value):
            unit = f" {self.unit}" if self.unit else ""
            raise UsageError(
                f"{where or self.name} = {value}{unit} is out of range",
                hint=f"allowed: {self.range_text}{unit} ({self.limits_source}). Nothing was sent.",
                code="out-of-range",
            )

    def parse(self, text: str, where: str = "") -> Number:
        """The value that a user typed, checked. Accepts a number or a label of `choices`. Raises UsageError."""
        wanted = text.strip()
        for value, label in self.choices.items():
            if wanted.casefold() in (label.casefold(), label.split(" ")[0].casefold()) and not wanted.isdecimal():
                return value
        value = self._number(wanted, where or self.name)
        self.check(value, where)
        return value

    def _number(self, text: str, where: str) -> Number:
        try:
            return typed_number(text, self.decimals)
        except ValueError as exc:
            kind = f"a number with at most {self.decimals} decimals" if self.decimals else "a whole number"
            raise UsageError(
                f"{where}: {text!r} is not {kind}",
                hint=f"allowed: {self.range_text or kind} ({self.source})",
                code="not-a-number",
            ) from exc

    def from_raw(self, raw: int) -> Number:
        """The value in `unit` of a raw integer."""
        return raw / 10**self.decimals if self.decimals else raw

    def to_raw(self, value: Number) -> int:
        """The raw integer of a value in `unit`; exact for values with at most `decimals` decimals."""
        return round(value * 10**self.decimals) if self.decimals else int(value)

    def text(self, value: Number) -> str:
        """A value for people, with as many decimals as the wire has."""
        return f"{value:.{self.decimals}f}" if self.decimals else str(value)

    def label(self, value: Number) -> str | None:
        """What a value means in words, None where the number says it all."""
        if value in self.choices:
            return self.choices[value]
        if value in self.special:
            return self.special[value]
        if self.bits:
            return bit_names(int(value), self.bits)
        return None

    def errors(self, value: int) -> list[str]:
        """The names of the error bits that are set, lowest first; undefined ones are named as such."""
        known = self.alarms
        return [known.get(1 << bit, f"unknown_bit_{bit}") for bit in range(value.bit_length()) if value >> bit & 1]


P = TypeVar("P", bound=Param)


@fast_dataclass(frozen=True)
class Element:
    """One readable number: a scalar parameter, or element `index` of a vector."""

    param: Param
    index: int

    @cached_property
    def part(self) -> str | None:
        """The element's name, None for a scalar."""
        return self.param.elements[self.index] if self.param.elements else None

    @cached_property
    def full_name(self) -> str:
        """``position_set.index``, or the plain name of a scalar."""
        return f"{self.param.name}.{self.part}" if self.param.elements else self.param.name

    @cached_property
    def path(self) -> str:
        """The same as `get` takes it, also where two quantities have one name."""
        return f"{self.param.path}.{self.part}" if self.param.elements else self.param.path


class ParamMap(Generic[P]):
    """The book of one device: parameters in the manual's order, found by name. Names are unique.

    texts  what the device tells in words: it is found, read and described by name, and is no number to anything else
    """

    def __init__(self, kind: str, params: Sequence[P], texts: Sequence[P] = ()) -> None:
        self.kind = kind
        self.texts = {param.name: param for param in texts}
        self._params = {param.name: param for param in params}
        if len(self._params) != len(params):
            raise ValueError(f"{kind}: a name is used twice")
        for param in params:
            if param.kind not in KINDS or ("w" in param.access) != (param.kind != MEASURED):
                raise ValueError(f"{kind}: {param.name} has access {param.access} and is of kind {param.kind}")

    def __iter__(self) -> Iterator[P]:
        return iter(self._params.values())

    def __len__(self) -> int:
        return len(self._params)

    def __getitem__(self, name: str) -> P:
        return self._params[name]

    def __contains__(self, name: str) -> bool:
        return name in self._params

    def kept(self, *, setpoints: bool = True, further: Collection[str] = ()) -> list[Element]:
        """Every element that a snapshot holds: settings, and with `setpoints` what was commanded.

        Of what only some devices have, that which `further` names, by parameter or element.
        """
        bases = {name.partition(".")[0] for name in further}
        return [
            element
            for param in self
            if param.writable and param.readable and (not param.optional or param.name in bases)
            if param.kind == SETTING or (setpoints and param.kind == COMMAND)
            for element in param.each
        ]

    @property
    def every(self) -> tuple[P, ...]:
        """All that has a name, numbers first."""
        return (*self, *self.texts.values())

    def get(self, name: str) -> P | None:
        """The parameter of that name, None where there is none."""
        return self._params.get(name)

    def find(self, name: str) -> tuple[P, Sequence[Element]]:
        """``position_set`` -> all its elements; ``position_set.index`` -> that one. Raises UsageError with near names."""
        base, dot, part = name.partition(".")
        param = self._params.get(base) or self.texts.get(base)
        if param is None:
            raise UsageError(f"{self.kind} has no quantity {name!r}", hint=self._near(base), code="unknown-name")
        if not dot:
            return param, param.each
        if part not in param.elements:
            known = ", ".join(param.elements) or "none: it is a single value"
            raise UsageError(f"{base} has no element {part!r}", hint=f"its elements: {known}", code="unknown-name")
        return param, [param.each[param.elements.index(part)]]

    def _near(self, name: str) -> str:
        from handctl.misspellings import near

        known = [known for one in self.every for known in (one.name, getattr(one, "mnemonic", "")) if known]
        ask = f"`handctl {self.kind} describe` lists them all"
        return f"did you mean {' or '.join(found)}? {ask}" if (found := near(name, known)) else ask

    def assignments(self, texts: Sequence[str]) -> list[tuple[Element, Number]]:
        """``["position_set.index=300", "force_set=0,0,0,0,0"]`` -> checked (element, value) pairs in wire order.

        Raises UsageError for anything that is not NAME=VALUE, not settable, out of range or given twice.
        """
        wanted: dict[tuple[str, int], tuple[Element, Number]] = {}
        for text in texts:
            name, equals, value = text.partition("=")
            if not equals:
                raise UsageError(f"{text!r} is not NAME=VALUE", hint=f"write `handctl {self.kind} set NAME=VALUE`")
            param, elements = self.find(name)
            self._refuse_unsettable(param)
            values = value.split(",") if len(elements) > 1 else [value]
            if len(values) != len(elements):
                raise UsageError(
                    f"{name} has {plural(len(elements), 'element')}, {plural(len(values), 'value')} given",
                    hint=f"give {','.join(e.part or '' for e in elements)}, or name one: {elements[0].full_name}=VALUE",
                )
            for element, single in zip(elements, values, strict=True):
                key = (param.name, element.index)
                if key in wanted:
                    raise UsageError(f"{element.full_name} is given twice", hint="leave one of them out")
                wanted[key] = (element, param.parse(single, element.full_name))
        order = {name: position for position, name in enumerate(self._params)}
        return [wanted[key] for key in sorted(wanted, key=lambda key: (order[key[0]], key[1]))]

    def _refuse_unsettable(self, param: Param) -> None:
        if param.verb:
            starts = "it is not a value: writing it starts something" if param.trigger else "it has its own command"
            raise UsageError(
                f"`{param.name}` is not written by `set`: {starts}",
                hint=Hint("use {}", f"{self.kind} {param.verb}"),
                code="trigger",
            )
        if not param.writable:
            raise UsageError(
                f"`{param.name}` is read-only ({param.source})",
                hint=Hint("{} lists the writable quantities", f"{self.kind} describe"),
                code="read-only",
            )


class Reading(NamedTuple):
    """What a device said about one element: a value in its unit with the bytes it came in, or an error.

    Of a text (`ParamMap.texts`) the bytes are all there is, and the value is any number.
    """

    element: Element
    value: Number | None
    raw: bytes = b""
    error: HandctlError | None = None

    @property
    def required(self) -> Number:
        """The value. Raises why it could not be read."""
        if self.error is not None:
            raise self.error
        assert self.value is not None
        return self.value


class Step(NamedTuple):
    """One write of a plan: the exact bytes, what they do in words, and whether they move or strand the device.

    With `can_id` the bytes are the data of that CAN frame.
    """

    meaning: str
    data: bytes
    moves: bool = False
    strands: bool = False
    can_id: int | None = None

    @property
    def wire(self) -> str:
        """Its bytes as text."""
        return frame_text(self.data, self.can_id)


class ValueChange(NamedTuple):
    """A line of the table that a question shows: `what` goes from one value to another.

    now   the value of today, None where it was not read
    new   "?" where nobody knows it
    more  heading and text of what else counts, such as the speed
    """

    what: str
    now: Number | None
    new: Number | str
    more: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        """For a program that is asked, which sees no table."""
        began = "" if self.now is None else f" {self.now}"
        more = ", ".join(f"{heading.lower()} {text}" for heading, text in self.more)
        return f"{self.what}{began} to {self.new}" + (f" ({more})" if more else "")


class Changes(NamedTuple):
    """The table that a question shows: `what` heads its first column, `unit` is that of the values, "" = none."""

    what: str
    unit: str = ""
    rows: Sequence[ValueChange] = ()

    def lines(self) -> list[str]:
        """The table as text, aligned."""
        unit = f" ({self.unit})" if self.unit else ""
        known = any(row.now is not None for row in self.rows)
        more = [heading for heading, _ in self.rows[0].more] if self.rows else []
        cells = [[self.what, *([f"From{unit}"] if known else ()), f"To{unit}", *more]]
        for row in self.rows:
            now = () if not known else ("" if row.now is None else str(row.now),)
            cells.append([row.what, *now, str(row.new), *(text for _, text in row.more)])
        first, *widths = (max(map(len, column)) for column in zip(*cells, strict=True))
        return [
            "  ".join((f"  {line[0]:{first}}", *(f"{c:>{w}}" for c, w in zip(line[1:], widths, strict=True))))
            for line in cells
        ]

    def told(self, question: str) -> str:
        """The question with its table in words."""
        return f"{question}: {', '.join(map(str, self.rows))}"


def ids_in(text: str, check: Callable[[int], object]) -> list[int]:
    """``1-254`` or ``1,2,10-20`` of an option --ids -> ids in that order, each once; `check` refuses what is none.

    Raises UsageError.
    """
    ids: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        begin, end = number_in(first), number_in(last if dash else first)
        if begin is None or end is None:
            raise UsageError(
                f"--ids {text}: expected FROM-TO or a list", hint="write for example `--ids 1-254` or `--ids 1,2,7`"
            )
        check(begin)
        check(end)
        if begin > end:
            raise UsageError(
                f"--ids {text}: no id in {part.strip()}", hint="put the smaller one first, such as `--ids 1-254`"
            )
        ids += range(begin, end + 1)
    return list(dict.fromkeys(ids))


# -- units ----------------------------------------------------------------------------------------------------------


class Scale(NamedTuple):
    """A unit of the wire is `times`/`over` of the `unit` that a person uses: ``0.1 °C`` is 1/10 of a °C."""

    times: int
    over: int
    unit: str

    def of(self, value: int | float) -> int | float:
        """The same in a person's unit, without the error of a factor that is no binary fraction."""
        return value * self.times if self.over == 1 else value * self.times / self.over


@cache
def scale_of(unit: str) -> Scale | None:
    """``0.1 °C`` -> Scale(1, 10, "°C"); None for a unit that a person uses, and for none."""
    factor, _, rest = unit.partition(" ")
    if not rest or not factor[0].isdecimal():
        return None
    times, _, over = factor.partition("/")
    whole, _, decimals = times.partition(".")
    return Scale(int(whole + decimals), int(over or 1) * 10 ** len(decimals), rest)


def bit_names(value: int, names: Sequence[str]) -> str:
    """``0x06`` -> ``over_temperature, over_current``; undefined bits are named as such; 0 -> ``ok``."""
    found = [
        names[bit] if bit < len(names) else f"unknown_bit_{bit}"
        for bit in range(max(8, value.bit_length()))
        if value >> bit & 1
    ]
    return ", ".join(found) or "ok"


BASES = {
    "°C": Scale(1, 1, "celsius"),
    "°": Scale(1, 1, "degrees"),
    "deg": Scale(1, 1, "degrees"),
    "s": Scale(1, 1, "seconds"),
    "ms": Scale(1, 1000, "seconds"),
    "A": Scale(1, 1, "amperes"),
    "mA": Scale(1, 1000, "amperes"),
    "V": Scale(1, 1, "volts"),
    "mV": Scale(1, 1000, "volts"),
    "m": Scale(1, 1, "meters"),
    "mm": Scale(1, 1000, "meters"),
    "in": Scale(254, 10000, "meters"),
    "g": Scale(1, 1, "grams"),
    "N": Scale(1, 1, "newtons"),
    "%": Scale(1, 100, "ratio"),
    "bit/s": Scale(1, 1, "bits_per_second"),
    "cts": Scale(1, 1, "counts"),
    "raw counts": Scale(1, 1, "counts"),
    "cts/sample": Scale(1, 1, "counts_per_sample"),
    "cts/sample²": Scale(1, 1, "counts_per_sample_squared"),
    "steps": Scale(1, 1, "steps"),
}
"""A person's units as a monitoring system has them: base units, but degrees for angles, as all manuals have."""


# -- what is typed for a vector -------------------------------------------------------------------------------------


PAIR = "="
SHOWN = 6
"""Names that a hint lists in full."""


def given(
    texts: Sequence[str],
    names: Sequence[str],
    *,
    what: str,
    noun: str = "finger",
    orders: Sequence[Sequence[int]] = (),
    more: str = "",
) -> dict[int, str]:
    """``["500", "400", …]`` or ``["ring=900", "index=100"]`` -> the text for each index, in the order of `names`.

    what    what takes the values, for messages
    noun    what one name is
    orders  indices that a whole vector may stand for; without them all of `names`
    more    a further hint where their number or a name is wrong

    Raises UsageError for a mistyped option, a wrong number of values, an unknown name, a name given twice, and a mixture.
    """
    for text in texts:
        if text.startswith("--"):
            raise UsageError(
                f"{text}: no such option", hint="`-h` lists the options of this command. Nothing was sent."
            )
    pairs = [text for text in texts if PAIR in text]
    if pairs and len(pairs) != len(texts):
        raise UsageError(
            "values in order and pairs are mixed",
            hint=f"give either all values in order, or {noun.upper()}=VALUE only. Nothing was sent.",
            code="mixed",
        )
    return _pairs(pairs, names, what, noun, more) if pairs else _whole(texts, names, what, noun, orders, more)


def _pairs(texts: Sequence[str], names: Sequence[str], what: str, noun: str, more: str) -> dict[int, str]:
    found: dict[int, str] = {}
    for text in texts:
        name, _, value = text.partition(PAIR)
        if name.casefold() not in names:
            raise UsageError(
                f"{what} has no {noun} {name!r}", hint=f"{noun}s: {_some(names)}{more}. Nothing was sent.",
                code="unknown-name",
            )  # fmt: skip
        index = list(names).index(name.casefold())
        if index in found:
            raise UsageError(f"{name} is given twice", hint="leave one of them out. Nothing was sent.", code="twice")
        found[index] = value
    return dict(sorted(found.items()))


def _whole(
    texts: Sequence[str], names: Sequence[str], what: str, noun: str, orders: Sequence[Sequence[int]], more: str
) -> dict[int, str]:
    orders = orders or [range(len(names))]
    for places in orders:
        if len(texts) == len(places):
            return dict(zip(places, texts, strict=True))
    counts = " or ".join(str(len(places)) for places in orders)
    if texts[0].casefold() in names:  # `position ring 1000`
        meant = [f"{name}={value}" for name, value in zip(texts[::2], texts[1::2], strict=False)]
        raise UsageError(
            f"{what} takes {noun.upper()}=VALUE, with an equals sign",
            hint=f"write {' '.join(meant) or f'{texts[0]}=VALUE'}{more}. Nothing was sent.",
            code="wrong-count",
        )
    raise UsageError(
        f"{plural(len(texts), 'value')} given, {what} takes {counts}",
        hint=f"the order is {_some(names)}. Or name individual {noun}s, such as {names[orders[-1][-1]]}=VALUE{more}",
        code="wrong-count",
    )


def _some(names: Sequence[str]) -> str:
    shown = names if len(names) <= SHOWN + 2 else [*names[:SHOWN], "…", names[-1]]
    return " ".join(shown)
