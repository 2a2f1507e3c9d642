"""What every family must do, tried on the registry: nothing here names one. What differs between them are their facts.

The larger products, each command with each fault and each interruption, are suites of `tests/search`; the gate replays their
pins. One family: `pytest tests/contract tests/pins -k NAME`.
"""

from __future__ import annotations

import csv
import importlib
import io
import random
import re
import signal
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from handctl.command.command_tree import HEADINGS, USUAL
from handctl.command.family import load
from handctl.docgen.read_command_tree import map_of
from handctl.errors import ProtocolError
from handctl.families import COMMANDS, FAMILIES, LISTED
from handctl.link.fake import FakeFrames, FakeLink
from handctl.model.param import SETTING, Element, ParamMap
from handctl.tools.trace_reader import explainer_of
from tests.contract.cell import CODES, judge, tried, wrote
from tests.contract.commands import ELSEWHERE, SECONDS, commands, scratch_of, writing_commands
from tests.contract.facts import Passed, Rule, facts_of, passed
from tests.fuzz.support import Chunks
from tests.search.suite import bounded
from tests.support.cli import run, spying
from tests.support.places import TESTS

MANY = "a case for each command: a new one is tried without being added to a list"
VIRTUAL_SECONDS = 900.0
ALL = [
    (family, name, command.writes, command.streams, command.stops)
    for family in FAMILIES
    for name, command in commands(family)
    if (family, name) not in ELSEWHERE
]
NAMED = [pytest.param(family, name, id=f"{family} {name}") for family, name, *_ in ALL]
WRITING = [
    pytest.param(family, name, id=f"{family} {name}") for family, name, writes, _, stops in ALL if writes and not stops
]


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    return scratch_of(tmp_path)


def words_of(family: str) -> list[str]:
    """The names of all commands of a family."""
    return [name for name, _ in commands(family)]


# -- every verb ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_the_facts_are_those_of_the_family(family: str) -> None:
    facts = facts_of(family)
    assert set(facts.writes) == set(writing_commands(family))
    assert set(facts.reads) <= set(words_of(family)) - set(facts.writes)
    assert (facts.plans | facts.unproven | set(facts.halts or ())) <= set(facts.writes) | {"set", "restore"}


@pytest.mark.parametrize(("family", "name"), NAMED)
def test_every_command_works_on_the_simulator(family: str, name: str, scratch: Path) -> None:
    """It ends as it should, its JSON is by the schema, and what only reads writes nothing."""
    result, rows, _, transcript = tried(family, name, scratch)
    assert result.code in (0, 7), result
    assert rows or result.code == 0
    if name not in facts_of(family).writes:
        assert not wrote(family, name, transcript)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("name", ["status", "dump"])
def test_every_format(family: str, name: str) -> None:
    link = facts_of(family).link(family)
    told = {
        kind: run(family, name, "-p", link, "--format", kind) for kind in ("json", "ndjson", "csv", "plain", "table")
    }
    assert {done.code for done in told.values()} == {0}
    rows = told["json"].rows
    assert len(rows) == len(told["ndjson"].stream[0]) == len(told["plain"].lines)
    table = list(csv.reader(io.StringIO(told["csv"].out)))
    assert len(table) == len(rows) + 1 and len({len(line) for line in table}) == 1


# -- faults -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_the_probe_finds_its_own_device_and_no_other(family: str, tmp_path: Path) -> None:
    """It only reads; silence, an echo, garbage and the device of another protocol are nobody."""
    for kind in FAMILIES:
        for fault in ("healthy", "silent", "loopback", "garble"):
            trace, link = tmp_path / "trace.txt", facts_of(kind).link(kind, "", f"fault={fault}")
            trace.unlink(missing_ok=True)
            done = run("scan", "--family", family, "-p", link, "--json", "--trace", trace)
            found = {row["family"] for row in done.rows if row.get("family")}
            assert done.code in CODES - {8}, (kind, fault, done)
            if done.code == 2:
                continue  # that family is on no such wire
            if kind == family:
                writing = facts_of(family).rule("scan")
                assert not [entry for entry in passed(trace) if entry.mark == ">" and writing(entry)], fault
            if fault in ("silent", "loopback"):
                assert family not in found, (kind, fault, done)
            elif kind == family:
                assert family in found, (fault, done)
            elif FAMILIES[kind].codec != FAMILIES[family].codec:
                assert family not in found, (kind, fault, done)


# -- dry run, Ctrl-C ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("family", "name"), WRITING)
def test_a_dry_run_sends_nothing_and_is_what_then_goes_out(family: str, name: str, scratch: Path) -> None:
    facts = facts_of(family)
    result, rows, _, transcript = tried(family, name, scratch, "-n")
    assert result.code == 0, result
    assert not [entry for entry in transcript if entry.mark == ">"]
    if name in facts.adapts:
        return
    same = load(family, "write_rules").words().planned
    _, _, _, transcript = tried(family, name, scratch)
    meant = [same(bytes.fromhex(row["bytes"].partition("]")[2] or row["bytes"]), None) for row in rows]
    went = [same(data, None) for data in wrote(family, name, transcript)]
    assert [one for one, _ in groupby(went)] == [one for one, _ in groupby(meant) if one is not None]


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
            if self.rule is not None and self.rule(
                Passed(">", getattr(data, "data", data), getattr(data, "can_id", None))
            ):
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


HALTS = [(family, name) for family in FAMILIES for name in facts_of(family).halts or ()]


@pytest.mark.parametrize(("family", "name"), HALTS)
def test_ctrl_c_in_a_movement_sends_its_stop(family: str, name: str, scratch: Path) -> None:
    facts = facts_of(family)
    result, _, envelope, transcript = Pressed(0, facts.rule(name)).run(family, name, scratch)
    assert result.code == 130, result
    judge(family, name, envelope["writes"], transcript)
    first, *_, last = wrote(family, name, transcript)
    assert last.startswith((facts.halts or {})[name]) and last != first, transcript[-6:]


# -- bytes ----------------------------------------------------------------------------------------------------------------


def codec_of(family: str) -> Any:
    """The module `codec` of a family; None where the manual has another word for it, which then has tests of its own."""
    try:
        return importlib.import_module(FAMILIES[family].module("codec"))
    except ModuleNotFoundError:
        return None


def of_those(families: Sequence[str]) -> Callable[[Any], Any]:
    """A test of these families, and none where there are none: that of today's have tests of their own, that of a new one has not."""
    return pytest.mark.parametrize("family", families) if families else lambda _test: None


def taken(decoder: Any, chunks: list[bytes]) -> list[Any]:
    """Everything that a decoder makes of these chunks: frames, and "refused"."""
    found: list[Any] = []
    for chunk in chunks:
        decoder.feed(chunk)
        while True:
            try:
                if (frame := decoder.next()) is None:
                    break
                found.append(frame)
            except ProtocolError:
                found.append("refused")
    return found


@of_those([family for family in FAMILIES if codec_of(family) is not None])
def test_the_codec_refuses_what_is_no_frame(family: str) -> None:
    """Only ProtocolError is raised, pieces do not matter, and what is taken encodes to the bytes that came."""
    decoder, facts, source = codec_of(family).Decoder, facts_of(family), random.Random(5)
    assert facts.refuses
    for line in facts.refuses:
        found = taken(decoder(), [line])
        assert found and set(found) == {"refused"}, (line, found)
    chunks = Chunks(facts.goods, facts.likely)
    for _ in range(60):
        stream = b"".join(chunks.next(source) for _ in range(30))
        whole = taken(decoder(), [stream])
        place, encoded = 0, [frame.encode() for frame in whole if frame != "refused"]
        for frame in encoded:
            place = stream.index(frame, place) + len(frame)
        pieces = taken(decoder(), [stream[at : at + 7] for at in range(0, len(stream), 7)])
        assert [frame.encode() for frame in pieces if frame != "refused"] == encoded
        single = taken(decoder(), [stream[at : at + 1] for at in range(len(stream))])
        assert [frame.encode() for frame in single if frame != "refused"] == encoded


def cases(family: str) -> Iterator[tuple[str, list[str], list[str]]]:
    """The cases of a family's transcripts: name, comments, lines."""
    for path in sorted((TESTS / "transcripts").glob(f"{family}-*.txt")):
        for text in path.read_text(encoding="utf-8").split("\n# case ")[1:]:
            head, *lines = text.splitlines()
            yield (
                f"{path.name}: {head}",
                [line[2:] for line in lines if line.startswith("# ")],
                [line for line in lines if line[:1] in "<>" and line],
            )


@pytest.mark.parametrize("family", FAMILIES)
def test_the_transcripts_are_what_host_and_simulator_say(family: str, tmp_path: Path) -> None:
    """The third book: host and simulator against bytes that neither has made. Cases with `# handctl WORDS` are run here."""
    found = list(cases(family))
    assert found, f"no transcript tests/transcripts/{family}-*.txt"
    for name, comments, lines in found:
        words = next((text.removeprefix("handctl ").split() for text in comments if text.startswith("handctl ")), None)
        if words is None:
            continue
        path = tmp_path / "case.txt"
        path.write_text("".join(f"0.0 {line}\n" for line in lines), encoding="utf-8")
        done = run(family, *words, "-p", f"replay:{path}", "--json", "--trace", tmp_path / "trace.txt")
        assert done.code == 0, (name, done)
        sent = [line for line in lines if line[0] == ">"]
        assert [entry.data for entry in passed(tmp_path / "trace.txt") if entry.mark == ">"] == [
            bytes.fromhex(line[2:]) for line in sent
        ], name
        given = next((text.split()[1:] for text in comments if text.startswith("gives ")), [])
        assert [str(row["value"]) for row in done.rows] == given, name
        (tmp_path / "trace.txt").unlink()
        _answered(family, name, lines)
        explainer = explainer_of(family)
        pieces = [
            piece
            for line in lines
            for piece in explainer.feed("host" if line[0] == ">" else "device", bytes.fromhex(line[2:]))
        ]
        assert pieces and not [piece for piece in pieces if piece.problem or not piece.frame], name


def _answered(family: str, name: str, lines: list[str]) -> None:
    """The simulator answers each > with its <."""
    import handctl.sim

    line = handctl.sim.create(family, dict(item.split("=") for item in facts_of(family).state.split("&") if item))
    now = 0.0
    line.advance(now)
    for text in lines:
        if text[0] == ">":
            line.feed(bytes.fromhex(text[2:]))
            now += 0.05
            line.advance(now)
        else:
            assert line.take() == bytes.fromhex(text[2:]), (name, text)


# -- the map ----------------------------------------------------------------------------------------------------------------


def settable(params: ParamMap[Any] | None) -> list[Element]:
    """Elements that `set` may write and that hold still: settings."""
    return [
        element
        for param in params or ()
        if param.kind == SETTING and param.writable and param.readable and not param.strands and not param.optional
        for element in param.each
    ]


@of_those([family for family in FAMILIES if facts_of(family).memory is not None])
def test_the_map_is_the_memory_of_the_simulator(family: str) -> None:
    """Values at power-on as the manual prints them, and both ends of every range in the memory, in its own scale."""
    facts, params = facts_of(family), map_of(family)
    assert facts.memory is not None and facts.power_on and params is not None
    with spying() as spy:
        rows = run(family, "dump", "-p", facts.link(family), "--json").rows
    assert {row["name"]: row["value"] for row in rows} == dict(facts.power_on)
    held = {name: facts.memory(spy.lines[-1].device, name) for name in facts.power_on}
    for element in settable(params):
        name, param = element.full_name, element.param
        scale = held[name] / facts.power_on[name]
        for end in (param.low, param.high):
            assert end is not None
            with spying() as spy:
                done = run(family, "set", f"{name}={param.text(end)}", "-y", "-p", facts.link(family), "--json")
            assert done.code == 0, done
            assert facts.memory(spy.lines[-1].device, name) == round(end * scale), name


@pytest.mark.parametrize("family", [family for family in FAMILIES if "set" in words_of(family)])
def test_what_is_out_of_range_is_refused_before_a_byte_is_sent(family: str) -> None:
    """Settings and what moves: all that `set` may write."""
    written = [element for param in map_of(family) or () if param.writable for element in param.each]
    assert written
    for element in written:
        param = element.param
        if param.low is None or param.high is None or param.choices:
            continue
        step = 10**-param.decimals
        for beyond in (param.low - step, param.high + step):
            if beyond in param.special:
                continue
            with spying() as spy:
                done = run(
                    family,
                    "set",
                    f"{element.full_name}={param.text(beyond)}",
                    "-y",
                    "-p",
                    facts_of(family).link(family),
                )
            assert done.code == 2, done
            assert not spy.lines, element


# -- the books ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_a_person_finds_it(family: str) -> None:
    """In the man page, in three shells' completions, in README, in the help of the root and of the simulators."""
    top = TESTS.parent
    page = (top / "man/man1" / f"handctl-{family}.1").read_text(encoding="utf-8").replace("\\-", "-")
    for name in words_of(family):
        assert f"handctl {family} {name}" in page, name
    for path in (top / "completions").rglob("*handctl*"):
        assert family in path.read_text(encoding="utf-8"), path
    assert f"| `handctl {family}` |" in (top / "README.md").read_text(encoding="utf-8")
    assert f" {family} " in run("-h").out and f" {family} " in run("sim", "-h").out
    assert LISTED["Devices"] == tuple(FAMILIES) and sum(map(len, LISTED.values())) == len(COMMANDS)


@pytest.mark.parametrize("family", FAMILIES)
def test_each_command_is_listed_below_a_heading(family: str) -> None:
    """In the order of HEADINGS, with what every device has first; none is left over below "Commands"."""
    group = importlib.import_module(FAMILIES[family].module("cli")).cli
    shown = re.findall(r"^(\w+):$|^  ([a-z][\w-]*)  ", run(family, "-h").out.partition("\nOptions:")[0], re.MULTILINE)
    headings = [heading for heading, _ in shown if heading]
    assert headings == [heading for heading in HEADINGS if heading in headings]
    place, below = "", {}
    for heading, name in shown:
        place = heading or place
        if name:
            below[name] = place
    assert below == {name: command.heading for name, command in group.commands.items()}
    assert set(group.first) - set(USUAL) <= set(group.commands)
    for heading in headings:
        names = [name for name, at in below.items() if at == heading]
        usual = [name for name in USUAL if name in names]
        assert names[: len(usual)] == usual
