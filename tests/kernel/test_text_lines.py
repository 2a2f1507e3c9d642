"""Only LF, CR LF and CR end a line of a text that handctl reads, and a byte order mark in front of one is no part of it."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from handctl.devices.barrett.gcl import passthrough
from handctl.devices.barrett.realtime import control_values
from handctl.errors import UsageError
from handctl.files import BYTE_ORDER_MARK, text_lines
from tests.support.cli import fake, run, sent
from tests.support.each_row import each_row
from tests.support.syntax import nodes_of

NO_LINE_END = "\x00\x08\x0b\x0c\x1b\x1c\x1d\x1e\x1f\x7f\x85\x9b\u2028\u2029"
"""Controls and separators: an editor or `str.splitlines` takes many of them for the end of a line."""
HAND = "fake://barrett?clock=virtual"
GET = "exo get system_voltage"


@each_row(
    ("text", "lines"),
    [
        ("", []), ("\n", [""]), ("a", ["a"]), ("a\n", ["a"]), ("a\n\nb", ["a", "", "b"]), ("a\r\nb\r\n", ["a", "b"]),
        ("a\rb\r", ["a", "b"]), ("a\r\r\nb", ["a", "", "b"]), *((f"a{one}b", [f"a{one}b"]) for one in NO_LINE_END),
    ],
)  # fmt: skip
def test_what_ends_a_line(text: str, lines: list[str]) -> None:
    assert text_lines(text) == lines


def scripts(text: str, tmp_path: Path) -> Iterator[tuple[str, tuple[str | Path, ...], str]]:
    """The commands that run a script of a hand: name, words, stdin."""
    file = tmp_path / "script"
    file.write_bytes(text.encode())
    yield "gcl --file", ("barrett", "gcl", "-p", HAND, "--file", file), ""
    yield "gcl", ("barrett", "gcl", "-p", HAND), text
    yield "terminal", ("barrett", "terminal", "-p", HAND), text


def batches(text: str, tmp_path: Path) -> Iterator[tuple[str, tuple[str | Path, ...], str]]:
    """The same of commands."""
    file = tmp_path / "batch"
    file.write_bytes(text.encode())
    yield "batch FILE", ("batch", "-p", HAND, file), ""
    yield "batch", ("batch", "-p", HAND), text


@each_row("one", NO_LINE_END)
def test_what_follows_in_a_comment_is_a_comment(one: str, tmp_path: Path) -> None:
    """`# read first`, a form feed, `C`: the hand must not close."""
    trace = tmp_path / "t"
    for _, words, stdin in scripts(f"# read first {one}C\nFGET P\n", tmp_path):
        assert run(*words, "-y", "--trace", trace, stdin=stdin).code == 0
        assert b"FGET P\r" in sent(trace) and b"C\r" not in sent(trace)
    for _, words, stdin in batches(
        f"# read first {one}barrett close\nbarrett get P # and {one}barrett close\n", tmp_path
    ):
        assert run(*words, "-y", "--trace", trace, stdin=stdin).code == 0
        assert b"FGET P\r" in sent(trace) and not [data for data in sent(trace) if data.endswith(b"C\r")]


@each_row("one", NO_LINE_END)
def test_a_line_with_one_is_refused_before_anything_is_sent(one: str, tmp_path: Path) -> None:
    trace = tmp_path / "t"
    for text in (f"FGET P\nFGET P{one}C\n", f"FGET P\nFGET P{one}\n", f"FGET P\n{one}C\n"):
        for name, words, stdin in scripts(text, tmp_path):
            result = run(*words, "-y", "--trace", trace, stdin=stdin)
            assert (result.code, result.said[-1]) == (2, "control-character"), (name, text)
            assert not trace.exists()
    for text in (f"barrett get P{one}barrett close", f"barrett get P{one}", f"{one}barrett close"):
        for name, words, stdin in batches(text, tmp_path):
            result = run(*words, "-y", "--trace", trace, stdin=stdin)
            assert (result.code, result.said[-1]) == (2, "control-character"), (name, text)
            assert not trace.exists()


def test_a_word_of_a_command_with_one_is_refused() -> None:
    for one in NO_LINE_END.replace("\x00", ""):
        with pytest.raises(UsageError):
            passthrough.line_of(f"C{one}")


# -- the mark in front ------------------------------------------------------------------------------------------------

TRANSCRIPT = "# handctl 0.1.0 exo get, fake://exo\n0.000000 > EB 90 01 04 11 E8 03 01 02\n0.004120 < 90 EB 01 04 11 E8 03 01 02\n"
CONTROL = "t,velocity.F1\n0,20\n0.1,0\n"
SCAN = json.dumps({"rows": [{"family": "exo", "link": "/dev/ttyUSB0", "baud": 115200, "id": 1}]})
BUS = '[line]\nwire = "rs485"\n[[device]]\nkind = "exo"\n'


@each_row(
    ("words", "text", "by_stdin"),
    [
        (("batch", "-p", fake()), GET, True), (("batch", "-p", fake(), "FILE"), GET, False),
        (("barrett", "gcl", "-p", HAND), "FGET P", True), (("barrett", "gcl", "-p", HAND, "--file", "FILE"), "FGET P", False),
        (("barrett", "terminal", "-p", HAND), "FGET P", True), (("exo", "terminal", "-p", fake()), "EB 90 01 04 11 E8 03 01 02", True),
        (("trace", "show", "FILE"), TRANSCRIPT, False), (("trace", "show", "-"), TRANSCRIPT, True),
        (("exo", "get", "id", "-p", "replay:FILE"), TRANSCRIPT, False),
        (("trace", "decode", "exo", "-"), "EB 90 01 04 11 E8 03 01 02", True),
        (("devices", "add", "left", "--from-scan", "FILE"), SCAN, False), (("devices", "add", "left", "--from-scan", "-"), SCAN, True),
        (("-d", "left", "get", "id"), f"[devices.left]\nkind = 'exo'\nport = '{fake()}'\n", False),
    ],
)  # fmt: skip
def test_a_byte_order_mark_changes_nothing(words: tuple[str, ...], text: str, by_stdin: bool, tmp_path: Path) -> None:
    file = tmp_path / "file"
    env = {"-d": {"HANDCTL_CONFIG": str(file)}, "devices": {"HANDCTL_CONFIG": str(tmp_path / "config")}}.get(words[0])
    ends = []
    for mark in ("", BYTE_ORDER_MARK):
        (tmp_path / "config").unlink(missing_ok=True)
        file.write_text(mark + text, encoding="utf-8")
        result = run(
            *(word.replace("FILE", str(file)) for word in words), stdin=mark + text if by_stdin else "", env=env
        )
        ends.append((result.code, result.out))
    assert ends[0] == ends[1]
    assert ends[0][0] == 0


def test_files_that_handctl_wrote_are_read_with_one(tmp_path: Path) -> None:
    snapshot, facts, state, log = (tmp_path / name for name in ("s.json", "f.json", "state.json", "log.csv"))
    assert run("exo", "snapshot", snapshot, "-p", fake()).code == 0
    assert run("prove", "exo", "-p", fake(), "--only", "set-points-at-power-on", "-y", "-o", facts).code == 0
    assert run("exo", "get", "id", "-p", fake(state=state)).code == 0
    assert run("exo", "log", log, "--count", "5", "-p", fake()).code == 0
    for file in (snapshot, facts, state, log, Path(f"{log}.json")):
        file.write_bytes(BYTE_ORDER_MARK.encode() + file.read_bytes())
    assert run("exo", "diff", snapshot, "-p", fake()).code == 0
    assert run("exo", "get", "id", "-p", fake(state=state)).code == 0
    assert run("exo", "get", "id", "-p", fake(facts=facts)).code == 0
    assert run("exo", "get", "id", "-p", fake(), "--facts", facts).code == 0
    assert run("exo", "log", "--check", log).code == 0
    assert run("plot", log, "-o", tmp_path / "p.svg").code == 0


@each_row("text", [CONTROL, f"# a\x0b3,4\u20285,6\n{CONTROL}", CONTROL.replace("\n", "\r\n"), CONTROL.replace("\n", "\r")])  # fmt: skip
def test_control_values_have_these_lines(text: str, tmp_path: Path) -> None:
    file = tmp_path / "c.csv"
    found = []
    for mark in ("", BYTE_ORDER_MARK):
        file.write_text(mark + text, encoding="utf-8", newline="")
        controls = control_values._from_file(str(file), [0], {}, None, ())
        found.append(controls.__dict__)
    assert repr(found[0]) == repr(found[1])


# -- one home ---------------------------------------------------------------------------------------------------------

OWN_TEXTS = {
    "docgen/man_pages.py", "docgen/roff.py", "guides/__init__.py", "newfamily/__main__.py", "sim/cli.py", "tools/help.py",
    "devices/inspire/hand/pairing.py",  # texts of ours
    "link/port_users.py", "system/serial_ports.py",  # what the system says
    "tools/plot.py",  # bytes, which have no other line ends
}  # fmt: skip


def test_no_text_of_others_is_split_in_another_way() -> None:
    """`str.splitlines` stands only where the text is of handctl itself or of the system."""
    top = Path(passthrough.__file__).parents[3]
    found = {
        file.relative_to(top).as_posix()
        for file in top.rglob("*.py")
        if "splitlines" in file.read_text(encoding="utf-8")
        and any(isinstance(node, ast.Attribute) and node.attr == "splitlines" for node in nodes_of(file))
    }
    assert found <= OWN_TEXTS, found - OWN_TEXTS
