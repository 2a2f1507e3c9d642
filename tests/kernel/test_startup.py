"""What a command loads and runs does not grow, and what makes the start light is what it stands for."""

from __future__ import annotations

import inspect
import json
import sys
from collections.abc import Iterator
from typing import Any

import click
import pytest

from handctl import fast_classes, lazy_stdlib
from handctl.command.family import load
from handctl.families import FAMILIES
from tests.kernel.budget import over
from tests.kernel.startup import KEPT, counted, machine

HINT = "Load later or call less, or raise the figure in tests/kernel/startup.json and give the reason in the commit."


@pytest.mark.real
def test_no_command_loads_or_runs_more() -> None:
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    if kept["machine"] != machine():
        pytest.skip(f"counted with {kept['machine']}")
    assert not (grown := over(counted(kept["commands"]), kept["commands"])), f"{grown}. {HINT}"


# -- modules that are stood in for --------------------------------------------------------------------------------------


@pytest.fixture
def nothing_loaded(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name in ("inspect", "uuid", "fractions", "gettext", "pickle", "random", "ast"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    lazy_stdlib.defer_unused_modules()
    yield
    monkeypatch.undo()


@pytest.mark.usefixtures("nothing_loaded")
def test_a_module_is_the_real_one_once_it_is_used() -> None:
    import fractions
    import inspect as late_inspect

    assert late_inspect.cleandoc("  a\n    b\n") == "a\nb" and late_inspect.isclass(int)
    assert "signature" not in vars(late_inspect), "nothing has asked for it"
    assert str(late_inspect.signature(lambda a: a)) == "(a)"
    assert str(fractions.Fraction(2, 4)) == "1/2"
    assert sys.modules["inspect"] is not late_inspect and late_inspect.getdoc(int)
    with pytest.raises(AttributeError):
        _ = late_inspect.nothing_of_this_name  # type: ignore[attr-defined]


def test_what_is_loaded_already_stays() -> None:
    before = dict(sys.modules)
    lazy_stdlib.defer_unused_modules()
    assert {name: module for name, module in before.items() if sys.modules[name] is not module} == {}


TEXTS = ("", "one", "  one\n    two\n      three\n\n    four\n", "\n\n  a\n\tb\n", "a\n b\n  c", "a\n\n\n")


def helps(command: click.Command) -> Iterator[str]:
    yield from (text for one in (command, *command.params) if (text := getattr(one, "help", None)))
    for below in command.commands.values() if isinstance(command, click.Group) else ():
        yield from helps(below)


def test_helps_are_cleaned_as_python_does() -> None:
    texts = [*TEXTS, *(text for family in FAMILIES for text in helps(load(family, "cli").cli))]
    assert len(texts) > 400
    assert [lazy_stdlib._cleandoc(text) for text in texts] == [inspect.cleandoc(text) for text in texts]


# -- classes that are defined in little time ------------------------------------------------------------------------------


@fast_classes.fast_dataclass(frozen=True)
class Point:
    """Two numbers."""

    x: int
    y: int = 2

    @property
    def sum(self) -> int:
        return self.x + self.y


@fast_classes.fast_dataclass(frozen=True, kw_only=True)
class Named(Point):
    """With a name."""

    y: int = 7
    name: str


@fast_classes.fast_dataclass()
class Bag:
    """Each has its own."""

    things: list[int] = fast_classes.field(default_factory=list)


class Pair(fast_classes.NamedTuple):
    """A tuple."""

    first: int
    second: str = "b"

    @property
    def both(self) -> str:
        return f"{self.first}{self.second}"

    @staticmethod
    def of(first: int) -> Pair:
        return Pair(first)


def test_a_light_class_is_a_dataclass_to_its_user() -> None:
    point: Any = Point(1)
    assert (point.sum, repr(point), point == Point(1, 2), point != Point(1, 3)) == (3, "Point(x=1, y=2)", True, True)
    assert len({Point(1), Point(1, 2), Point(2)}) == 2 and point != Named(x=1, y=2, name="")
    with pytest.raises(AttributeError):
        point.x = 5
    with pytest.raises(TypeError):
        Point()  # type: ignore[call-arg]
    with pytest.raises(TypeError):
        Named(1, name="a")  # type: ignore[misc]
    assert (Named(x=1, name="a").y, Named(x=1, name="a").sum) == (7, 8)
    match point:
        case Point(1, y):
            assert y == 2
        case _:
            raise AssertionError
    one, two = Bag(), Bag()
    one.things.append(1)
    assert (one.things, two.things, one == Bag([1])) == ([1], [], True)
    with pytest.raises(TypeError):
        hash(one)


def test_a_light_tuple_is_a_named_tuple_to_its_user() -> None:
    pair = Pair(1)
    assert (pair, pair.both, pair._replace(second="c").both, Pair.of(4)) == ((1, "b"), "1b", "1c", (4, "b"))
    assert (Pair._fields, Pair._field_defaults, pair._asdict()) == (
        ("first", "second"), {"second": "b"}, {"first": 1, "second": "b"},
    )  # fmt: skip
    assert repr(pair) == "Pair(first=1, second='b')" and Pair.__module__ == __name__
