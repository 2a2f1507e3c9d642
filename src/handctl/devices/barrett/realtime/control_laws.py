"""Control laws of the RealTime loop: ``velocity.F1 = clamp((9000 - P.F1)/20, -40, 40)``. Knows no wire and no clock.

The terms are those of the vendor's program (dossier 15): the values of the block before, results rounded and saturated, and
a result that is no number is velocity 0 and the end. A law is compiled to closures over a few kinds of syntax, once, before
the first byte; no text is ever evaluated. What it gives passes the guards like any other control value.
"""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.realtime.blocks import CONTROL, LIMITS, Feedback, Layout, Values, still
from handctl.devices.barrett.realtime.control_values import ALIASES, COLUMNS, Controls, targets
from handctl.errors import CheckFailed, UsageError

NAMES = {"P": "position", "V": "velocity", "S": "strain", "D": "delta"}
"""Letter -> name of FEEDBACK."""
WORDS = ("T", "N", "t")
"""Temperature in °C, number of the block from 0, seconds since the start."""
TEMPERATURE = (0, "temperature")
LONGEST = 300
"""Characters of a law: no more, so that none is nested too deeply to be worked out."""
EXPECTED = f"{', '.join(f'{letter}.MOTOR' for letter in NAMES)}, {', '.join(WORDS)}, or velocity.MOTOR and gain.MOTOR of the block before"
FUNCTIONS: dict[str, tuple[Callable[..., Any], int, int]] = {
    "abs": (abs, 1, 1),
    "min": (min, 2, 9),
    "max": (max, 2, 9),
    "clamp": (lambda value, low, high: min(max(value, low), high), 3, 3),
    "sign": (lambda value: (value > 0) - (value < 0), 1, 1),
    "floor": (math.floor, 1, 1),
    "round": (round, 1, 1),
    "sqrt": (math.sqrt, 1, 1),
    "sin": (math.sin, 1, 1),
    "cos": (math.cos, 1, 1),
}
"""Name -> what it does, and how many arguments it takes at least and at most. Angles in radians."""
OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Not: operator.not_,
}  # fmt: skip
TRUTHS = (ast.Compare, ast.BoolOp, ast.Not)


class Known:
    """What laws may name: the feedback of the block before with what was sent then, and the columns of the control file."""

    def __init__(self) -> None:
        self.seconds, self.number = 0.0, 0
        self.columns: Mapping[str, float] = {}
        self.feedback: dict[tuple[int, str], float] = {}
        self.sent: Values = {}

    def see(self, feedback: Feedback, positions: Mapping[int, int], sent: Values, layout: Layout) -> None:
        """Take a block: positions and deltas in counts, the temperature in °C."""
        for index, found in feedback.motors.items():
            for name, value in found.items():
                self.feedback[index, name] = layout.motors[index].scaled(name, value)
        self.feedback.update({(index, "position"): value for index, value in positions.items()})
        if feedback.temperature is not None:
            self.feedback[TEMPERATURE] = feedback.temperature / 10
        self.sent = sent


Value = Callable[[Known], float]


class Expression:
    """A compiled text. Raises UsageError with the column of what cannot be understood.

    needs    (motor index, name) of the feedback that it names
    columns  of the control file; sent = the control values
    truth    its result is yes or no
    """

    def __init__(
        self, text: str, where: str, motors: Sequence[int], own: int | None = None, *, offset: int = 0, columns: bool
    ) -> None:
        self.where = where
        self.needs: set[tuple[int, str]] = set()
        self.columns: set[str] = set()
        self.sent: set[tuple[int, str]] = set()
        self._motors, self._own, self._columns = motors, own, columns
        self._offset = offset + len(text) - len(text.lstrip())
        tree = self._tree(text.strip())
        self.truth = isinstance(tree.op if isinstance(tree, ast.UnaryOp) else tree, TRUTHS)
        self._value = self._compiled(tree)

    def value(self, known: Known) -> float:
        """The number. Raises CheckFailed where it is none."""
        why = "the result is not a finite number"
        try:
            value = float(self._value(known))
            if math.isfinite(value):
                return value
        except ZeroDivisionError:
            why = "division by zero"
        except (ArithmeticError, ValueError):
            pass
        raise CheckFailed(
            f"{self.where}: {why}, in block {known.number}. The loop has ended",
            hint="keep the divisor away from 0, for example with max(1, abs(V.F1)), and roots away from negative numbers",
            code="law",
        )

    def _error(self, column: int, what: str, hint: str) -> UsageError:
        return UsageError(f"{self.where}, column {self._offset + column + 1}: {what}", hint=hint, code="law")

    def _tree(self, text: str) -> ast.expr:
        place = next((place for place, c in enumerate(text) if place >= LONGEST or not " " <= c <= "~"), None)
        if place is not None:
            raise self._error(place, f"expected no more than {LONGEST} printable ASCII characters", "shorten it")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return ast.parse(text, mode="eval").body
        except SyntaxError as exc:
            place = exc.offset - 1 if exc.offset else len(text)
            raise self._error(place, exc.msg, "expected a formula such as (9000 - P.F1)/20") from None

    def _compiled(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                value = float(number)
                return lambda known: value
            case ast.BinOp(left=one, op=op, right=two) | ast.Compare(left=one, ops=[op], comparators=[two]):
                if type(op) in OPERATORS:
                    do, left, right = OPERATORS[type(op)], self._compiled(one), self._compiled(two)
                    return lambda known: do(left(known), right(known))
            case ast.UnaryOp(op=op, operand=one) if type(op) in OPERATORS:
                do, inner = OPERATORS[type(op)], self._compiled(one)
                return lambda known: do(inner(known))
            case ast.BoolOp():
                parts, both = [self._compiled(part) for part in node.values], isinstance(node.op, ast.And)
                return lambda known: (all if both else any)(part(known) for part in parts)
            case ast.Call(func=ast.Name(id=name), keywords=[]):
                return self._call(node, name)
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Attribute(value=ast.Name(id=name)):
                return self._of_motor(node, name, node.attr)
        known = ", ".join(FUNCTIONS)
        raise self._error(node.col_offset, "this cannot be used", f"use + - * / comparisons, {EXPECTED}, and {known}")

    def _call(self, node: ast.Call, name: str) -> Value:
        if name not in FUNCTIONS:
            raise self._error(node.col_offset, f"there is no function {name!r}", f"use {', '.join(FUNCTIONS)}")
        do, least, most = FUNCTIONS[name]
        if not least <= len(node.args) <= most:
            takes = f"{name} takes {least}{'' if least == most else f' to {most}'} values"
            raise self._error(node.col_offset, takes, "give it as many as it takes")
        parts = [self._compiled(part) for part in node.args]
        return lambda known: do(*[part(known) for part in parts])

    def _name(self, node: ast.expr, name: str) -> Value:
        if name == "T":
            self.needs.add(TEMPERATURE)
            return lambda known: known.feedback.get(TEMPERATURE, math.nan)
        if name in ("N", "t"):
            return (lambda known: known.number) if name == "N" else (lambda known: known.seconds)
        if name in (*NAMES, *CONTROL):
            if self._own is None:
                raise self._error(node.col_offset, f"{name} of which motor?", f"write {name}.F1")
            return self._of_motor(node, name, MOTORS[self._own])
        if not self._columns:
            raise self._error(node.col_offset, f"unknown name {name!r}", f"use {EXPECTED}. Columns need --control")
        self.columns.add(name)
        return lambda known: known.columns[name]

    def _of_motor(self, node: ast.expr, name: str, motor: str) -> Value:
        index = ALIASES.get(motor.upper(), -1)
        if index not in self._motors:
            listed = ", ".join(MOTORS[one] for one in self._motors)
            raise self._error(node.col_offset, f"{motor} is not one of the loop's motors", f"use one of {listed}")
        if name in CONTROL:
            self.sent.add((index, name))
            return lambda known: known.sent.get(index, {}).get(name, 0)
        if name not in NAMES:
            raise self._error(node.col_offset, f"unknown name {name!r}", f"use {EXPECTED}")
        key = (index, NAMES[name])
        self.needs.add(key)
        return lambda known: known.feedback.get(key, math.nan)


class Law(NamedTuple):
    """What gives one control value of one motor."""

    motor: int
    name: str
    expression: Expression

    def value(self, known: Known) -> int:
        """As a block can carry it: rounded, saturated, and a gain is never 0. Raises CheckFailed."""
        low, high = LIMITS[self.name]
        return max(low if self.name == "velocity" else 1, min(high, round(self.expression.value(known))))


class Laws(Controls):
    """Control values that laws make of the feedback; those without a law, and columns, come from `source`."""

    live = True
    follows = True

    def __init__(self, laws: Sequence[Law], known: Known, source: Controls) -> None:
        self._laws, self._known, self._source = laws, known, source
        carried = {(index, name) for index, names in source.carries.items() for name in names}
        for index, name, expression in laws:
            if (index, name) in carried:
                raise UsageError(
                    f"{expression.where}: {name}.{MOTORS[index]} has another value as well",
                    hint=f"leave out one of the laws, --{name}, or its column in --control",
                )
            carried.add((index, name))
        for index, name in set().union(*(law.expression.sent for law in laws)) - carried:
            hint = f"add --{name}, or a law for it"
            raise UsageError(f"{name}.{MOTORS[index]} is not sent, but a law uses it", hint=hint)
        motors = [index for index in source.carries if index != COLUMNS]
        self.carries = {index: tuple(name for name in CONTROL if (index, name) in carried) for index in motors}

    @property
    def first(self) -> Values:
        """What it is like: the values are known only in the loop."""
        given = self._source.first
        return {
            index: {name: given[index].get(name, int(name == "gain")) for name in names}
            for index, names in self.carries.items()
        }

    def at(self, seconds: float) -> Values | None:
        given = self._source.at(seconds)
        if given is None:
            return None
        self._known.columns = given.get(COLUMNS, {})
        values = {index: dict(given[index]) for index in self.carries}
        for law in self._laws:
            values[law.motor][law.name] = law.value(self._known)
        return still(values) if self._source.silent else values


class Rules:
    """The laws and the end that a person gave, in their texts. Raises UsageError.

    needs    (motor index, name) of the feedback without which they could not be told
    columns  that the control file must have for them
    """

    def __init__(self, laws: Sequence[str], until: str | None, motors: Sequence[int], *, columns: bool) -> None:
        self.known = Known()
        self._motors = motors
        self._laws = [law for text in laws for law in _laws_in(text, motors, columns=columns)]
        self._until = Expression(until, f"--until {until}", motors, columns=columns) if until is not None else None
        if self._until is not None and not self._until.truth:
            hint = "compare two values, such as abs(P.F1 - 9000) < 50"
            raise UsageError(f"{self._until.where}: expected a comparison", hint=hint)
        every = [*(law.expression for law in self._laws), *([self._until] if self._until is not None else [])]
        self.needs: frozenset[tuple[int, str]] = frozenset().union(*(one.needs for one in every))
        self.columns: frozenset[str] = frozenset().union(*(one.columns for one in every))

    def over(self, source: Controls | None) -> Controls | None:
        """The control values, with the laws."""
        nothing = Controls(dict.fromkeys(self._motors, ()), {})
        return Laws(self._laws, self.known, source or nothing) if self._laws or self.columns else source

    def met(self) -> str:
        """What ends the loop, "" = nothing yet. Raises CheckFailed."""
        return self._until.where if self._until is not None and self._until.value(self.known) else ""


def _laws_in(text: str, motors: Sequence[int], *, columns: bool) -> list[Law]:
    where = f"--law {text}"
    key, _, rest = text.partition("=")
    name, which = targets(key.strip(), motors, f"{where}, column 1")
    if name == "t":
        raise UsageError(
            f"{where}, column 1: expected velocity.MOTOR or gain.MOTOR",
            hint="begin with velocity.MOTOR or gain.MOTOR, as in velocity.F1 = 10; t is the time",
        )
    return [Law(one, name, Expression(rest, where, motors, one, offset=len(key) + 1, columns=columns)) for one in which]
