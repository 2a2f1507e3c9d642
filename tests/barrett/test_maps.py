"""The map of the BarrettHand says the same as the memory of its simulator, which was transcribed by itself."""

from __future__ import annotations

import re

import pytest

from handctl.devices.barrett.parameter_map import BARRETT, GclParam, standard
from handctl.sim import create
from tests.support.each_row import each_row


class Gcl:
    """The simulated BarrettHand, one command line at a time; the answer is taken apart by hand."""

    def __init__(self, **options: str) -> None:
        self.line = create("barrett", options)
        self.line.advance(0.0)

    def ask(self, command: str) -> tuple[list[str], int]:
        """The data lines, and the status."""
        self.line.feed(command.encode() + b"\r")
        answer = self.line.take().decode()
        assert answer.startswith(command + "\n\r"), answer
        assert answer.endswith("\n\r=> "), answer
        lines = [line for line in answer[len(command) : -3].split("\n\r") if line]
        status = [int(line[4:]) for line in lines if line.startswith("ERR ")]
        return lines[: len(lines) - len(status)], sum(status)


def gcl_named(params: list[GclParam]) -> list[object]:
    return [pytest.param(param, id=param.mnemonic) for param in params]


@each_row("firmware", ["4.33", "4.34", "4.4"])
def test_both_books_have_the_same_names(firmware: str) -> None:
    """FLISTA and PLISTA against the map, and FLIST and PLIST against what is not advanced (§5.2.5)."""
    hand = Gcl(firmware=firmware)
    names = {param.mnemonic for param in BARRETT if not param.since or float(param.since) <= float(firmware)}
    assert {*hand.ask("FLISTA")[0], *hand.ask("PLISTA")[0]} == names
    usual = {line.split()[0] for command in ("FLIST", "PLIST") for line in hand.ask(command)[0]}
    later = {param.mnemonic for param in BARRETT if param.since}
    assert usual - later == {param.mnemonic for param in standard() if not param.advanced}


@each_row("param", gcl_named(standard()))
def test_both_books_have_the_same_factory_values(param: GclParam) -> None:
    ((line,), status) = Gcl().ask(f"{'PGET' if param.is_global else 'FGET'} {param.mnemonic}")
    assert status == 0
    values = [int(word) for word in line.split()]
    assert len(values) == param.count
    if param.default is None:
        assert all(param.allowed(value) for value in values)
    else:
        assert values == [param.default_of(index) for index in range(param.count)]


STRICTER = {"LCVC", "LFVC", "LFDPC", "ACCEL"}
"""0 is documented and would stop or divide by zero: the host refuses it (dossier 3.1), the hand takes it."""


@each_row("param", gcl_named(list(BARRETT)))
def test_both_books_allow_the_same_writes(param: GclParam) -> None:
    """256 for what can only be read (§5.1.3), 128 outside the range, for every motor by itself."""
    for prefix in [""] if param.is_global else ["", "1", "2", "3", "4"]:
        verb = "PSET" if param.is_global else f"{prefix}FSET"
        if param.access == "r":
            assert Gcl(firmware="4.4").ask(f"{verb} {param.mnemonic} 1") == ([], 256)
            continue
        assert param.low is not None and param.high is not None
        edges = {int(param.low), int(param.high), *map(int, param.choices), 0}
        for value in sorted(edge + step for edge in edges for step in (-1, 0, 1)):
            wanted = 0 if param.allowed(value) or (value == 0 and param.mnemonic in STRICTER) else 128
            assert Gcl(firmware="4.4").ask(f"{verb} {param.mnemonic} {value}") == ([], wanted), value


@each_row("param", gcl_named([param for param in BARRETT if param.writable and param.mnemonic != "BAUD"]))
def test_what_is_set_can_be_got(param: GclParam) -> None:
    hand, value = Gcl(firmware="4.4"), int(param.low or 0) + 1
    if param.is_global:
        hand.ask(f"PSET {param.mnemonic} {value}")
        assert hand.ask(f"PGET {param.mnemonic}") == ([str(value)], 0)
        return
    before = hand.ask(f"FGET {param.mnemonic}")[0][0].split()
    hand.ask(f"3FSET {param.mnemonic} {value}")
    assert hand.ask(f"FGET {param.mnemonic}") == ([" ".join([*before[:2], str(value), before[3]])], 0)


def test_names_and_texts() -> None:
    for param in BARRETT:
        assert re.fullmatch(r"[a-z][a-z0-9_]*", param.name), param.name
        assert re.fullmatch(r"[A-Z]{1,6}", param.mnemonic), param.mnemonic
        assert param.doc and not param.doc.endswith("."), param.name
        assert param.since or re.fullmatch(r"barrett §5\.[34]\.[1-4]", param.source), param.source
        assert param.access in ("r", "rw")
        assert not param.trigger and not param.moves
    assert len({param.mnemonic for param in BARRETT}) == len(BARRETT)
