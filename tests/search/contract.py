"""The products of the contract: what holds of every command of every family with every fault, and wherever Ctrl-C comes.

What differs between families are their facts, `tests/contract/facts`.
"""

from __future__ import annotations

import json
import signal
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

from handctl.docgen.read_command_tree import map_of
from handctl.families import FAMILIES
from handctl.link.fake import FakeFrames, FakeLink
from handctl.model.param import SETTING
from handctl.model.stop_on_interrupt import NOT_STOPPED
from handctl.sim import model_class
from handctl.sim.engine.line_and_faults import LINE_FAULTS
from tests.contract.cell import CODES, go, judge, stops, tried, wrote
from tests.contract.commands import ELSEWHERE, SECONDS, commands, scratch_of, writing_commands
from tests.contract.facts import Passed, Rule, facts_of
from tests.search.suite import Listed, bounded, parts
from tests.support.cli import Result, run, spying

VIRTUAL_SECONDS = 900.0


@cache
def named() -> tuple[tuple[str, str], ...]:
    """Family and command, without those that have tests of their own."""
    return tuple(
        (family, name) for family in FAMILIES for name, _ in commands(family) if (family, name) not in ELSEWHERE
    )


@cache
def moving() -> tuple[tuple[str, str], ...]:
    """Those that write, and are no stop."""
    return tuple(
        (family, name)
        for family in FAMILIES
        for name, command in commands(family)
        if command.writes and not command.stops and (family, name) not in ELSEWHERE
    )


def ended(result: Result, *more: object) -> str:
    """How a command ended: its code, its messages, what else tells."""
    last = json.loads(result.lines[-1])
    codes = [message["code"] for message in last["end"]["messages"] if message["level"] != "info"]
    return " ".join(map(str, (f"exit {result.code}", *sorted(set(codes)), *more)))


def steps(envelope: dict[str, Any]) -> str:
    """The states in the ledger, in order, each once."""
    return ",".join(dict.fromkeys(step["state"] for step in envelope.get("writes", ())))


class Product(Listed):
    """Every command needs a pin, and every fault; one of the device in each family that has it."""

    def shows(self, cell: str) -> Iterable[str]:
        _, family, name, rest = parts(cell)
        fault = rest.partition("&")[0]
        return f"{family} {name}", f"{family}, {fault}" if fault in model_class(family).FAULTS else fault

    def wanted(self) -> Iterable[str]:
        return {what for cell in self.table for what in self.shows(cell)}


class Faults(Product):
    """A documented exit code, an end, JSON by the schema, a ledger that is true, and no byte that writes from what reads."""

    name = "contract-faults"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family, name in named():
            for fault in (*LINE_FAULTS, *model_class(family).FAULTS):
                for after in (0, 3):
                    yield (family, name, f"{fault}&after={after}"), (family, name, f"{fault}&after={after}")

    def tried(self, row: tuple[str, str, str], folder: Path) -> str:
        family, name, fault = row
        facts = facts_of(family)
        with bounded(SECONDS), spying() as spy:
            result, rows, envelope, transcript = tried(family, name, scratch_of(folder), options=(f"fault={fault}",))
        assert result.code in CODES, result
        assert not spy.lines or spy.now < VIRTUAL_SECONDS, f"it took {spy.now} s"
        errors = [message for message in envelope["messages"] if message["level"] == "error"]
        ends = [
            error for error in errors if error["code"] != "leaving"
        ]  # a RealTime loop that cannot be left is told besides
        assert len(ends) == (result.code != 0), result
        assert not [row for row in rows if "error" in row and "value" in row], rows
        if name in facts.writes and fault.partition("&")[0] not in facts.confusing:
            judge(family, name, envelope["writes"], transcript)
        elif name not in facts.writes:
            assert not wrote(family, name, transcript), "it only reads, and has written"
        return ended(result, steps(envelope))


@cache
def settled(family: str) -> tuple[str, ...]:
    """Names whose value stays as it is: settings, as their map says."""
    params = map_of(family) or ()
    return tuple(param.name for param in params if param.kind == SETTING and param.readable and not param.optional)


@cache
def truth(family: str) -> list[dict[str, Any]]:
    """Their rows on a healthy line."""
    return run(family, "get", *settled(family), "-p", facts_of(family).link(family), "--format", "ndjson").stream[0]


class Values(Product):
    """What holds still is read as it is or not at all, whatever the line does to it."""

    name = "contract-values"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family in filter(settled, FAMILIES):
            for fault in LINE_FAULTS:
                yield (family, "get", fault), (family, fault)

    def tried(self, row: tuple[str, str], folder: Path) -> str:
        family, fault = row
        link = facts_of(family).link(family, "", f"fault={fault}")
        done, right = run(family, "get", *settled(family), "-p", link, "--format", "ndjson"), truth(family)
        rows, _ = done.stream
        for told, real in zip(rows, right, strict=len(rows) == len(right)):
            assert "error" in told or told["value"] == real["value"], (told, real)
        return ended(done)


class Unseen(Product):
    """Nothing is written before a device of the family is seen."""

    name = "contract-unseen"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family, name in moving():
            for fault in ("silent", "loopback", "disconnect"):
                yield (family, name, fault), (family, name, fault)

    def tried(self, row: tuple[str, str, str], folder: Path) -> str:
        family, name, fault = row
        result, _, envelope, transcript = tried(family, name, scratch_of(folder), options=(f"fault={fault}",))
        assert result.code in (3, 4, 5, 6, 7), result
        assert wrote(family, name, transcript) == []
        assert {step["state"] for step in envelope["writes"]} <= {"not-sent"}, envelope["writes"]
        return ended(result)


class Ledger(Product):
    """On a line that fails, `writes` is what the transcript shows, and nothing is sent behind what nobody confirmed."""

    name = "contract-ledger"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family in FAMILIES:
            for name in writing_commands(family):
                for fault in ("silent", "disconnect"):
                    for after in (0, 2, 4, 6):
                        yield (family, name, f"{fault}&after={after}"), (family, name, f"{fault}&after={after}")

    def tried(self, row: tuple[str, str, str], folder: Path) -> str:
        family, name, fault = row
        result, writes, transcript = go(family, name, scratch_of(folder), fault)
        judge(family, name, writes, transcript)
        said = result.out + result.err
        envelope = json.loads(result.lines[-1])["end"]
        if any(step["state"] != "not-sent" for step in writes):
            assert "othing was sent" not in said and "othing was written" not in said, said
        else:
            assert not {"ack-lost", "answer-lost"} & {message["code"] for message in envelope["messages"]}, said
        if name in facts_of(family).plans:
            states = [step["state"] for step in writes if not stops(step)]
            rest = states[states.index("sent") + 1 :] if "sent" in states else []
            assert set(rest) <= {"not-sent"}, "went on behind a write that nothing confirmed"
        return ended(result, steps(envelope))


class Pressed:
    """Ctrl-C at the n-th time that a command listens; with `rule` at the first time behind a frame that writes."""

    def __init__(self, at: int, rule: Rule | None = None) -> None:
        self.at, self.rule, self.count = at, rule, 0

    def listening(self, listen: Any) -> Any:
        def listened(link: Any, *args: Any, **more: Any) -> Any:
            self.count += 1
            if self.count == self.at:
                signal.raise_signal(signal.SIGINT)
            return listen(link, *args, **more)

        return listened

    def speaking(self, speak: Any) -> Any:
        def spoken(link: Any, data: Any, *args: Any) -> Any:
            entry = Passed(">", getattr(data, "data", data), getattr(data, "can_id", None))
            if self.rule is not None and self.rule(entry):
                self.rule, self.at = None, self.count + 1
            return speak(link, data, *args)

        return spoken

    def run(self, family: str, name: str, folder: Path) -> Any:
        """Run the command with it."""
        handler = signal.getsignal(signal.SIGINT)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        (folder / "b.json").unlink(missing_ok=True)
        try:
            with (
                mock.patch.object(FakeLink, "read", self.listening(FakeLink.read)),
                mock.patch.object(FakeLink, "write", self.speaking(FakeLink.write)),
                mock.patch.object(FakeFrames, "receive", self.listening(FakeFrames.receive)),
                mock.patch.object(FakeFrames, "send", self.speaking(FakeFrames.send)),
                bounded(SECONDS, f"{family} {name}"),
            ):
                return tried(family, name, folder)
        finally:
            signal.signal(signal.SIGINT, handler)


class Interrupted(Product):
    """Ctrl-C where a command listens leaves a true ledger: at the first three times, at the last two, at sevenths between."""

    name = "contract-ctrl-c"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family, name in moving():
            for place in (
                *(f"wait {n}" for n in (1, 2, 3)),
                *(f"{n} of 7" for n in range(1, 7)),
                "last but one",
                "last",
            ):
                yield (family, name, place), (family, name, place)

    def tried(self, row: tuple[str, str, str], folder: Path) -> str:
        family, name, place = row
        scratch_of(folder)
        counting = Pressed(0)
        if not place.startswith("wait"):
            counting.run(family, name, folder)
        words, last = place.split(), counting.count
        number = {
            "wait": lambda: int(words[1]),
            "of": lambda: last * int(words[0]) // 7,
            "but": lambda: last - 1,
            "last": lambda: last,
        }[next(word for word in ("wait", "of", "but", "last") if word in words)]()
        result, _, envelope, transcript = Pressed(number).run(family, name, folder)
        goes_on = name == "calibrate" and result.code == 6 and envelope["messages"][-1]["code"] == NOT_STOPPED
        assert result.code in (130, 0, 7) or goes_on, result
        judge(family, name, envelope["writes"], transcript)
        return ended(result, steps(envelope))


SUITES = (Faults(), Values(), Unseen(), Ledger(), Interrupted())
