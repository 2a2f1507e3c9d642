"""The gate for text: whatever a device, a file or the environment says, no character of it acts on a terminal."""

from __future__ import annotations

import io
import json
import os
import pty
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from handctl.model.command_settings import Settings
from handctl.model.result import Cell, Column, Counters, Grid, Sample, Table
from handctl.screen import render
from handctl.screen.render import Sink, show, stream
from handctl.screen.sanitize import no_formula, shown, text_shown, value_shown
from tests.hostile.locale_cells import judge, run_in
from tests.support.cli import PATIENCE, clean_environment, fake, program, run
from tests.support.each_row import each_row

HOSTILE = {
    "clipboard": "\x1b]52;c;cm0gLXJm\x07", "title": "\x1b]0;owned\x1b\\", "clear": "\x1b[2J\x1b[H", "C1": "\x9b31m",
    "bidi": "\u202egpj.exe", "isolate": "\u2066x\u2069", "zero-width": "a\u200bb", "bell": "\x07", "carriage": "ok\rbad",
    "new line": "1\nhandctl: error: forged", "nul": "\x00", "delete": "\x7f", "byte": "\udcff", "separator": "\u2028x",
}  # fmt: skip
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
"""What rich may write: a style."""


def harmless(text: str, keep: str = "\n") -> bool:
    return all(letter.isprintable() or letter in keep for letter in COLOUR.sub("", text))


@each_row("text", HOSTILE.values(), ids=HOSTILE)
def test_each_is_spelled_out_and_nothing_is_lost(text: str) -> None:
    told = shown(text)
    assert told.isprintable()
    assert shown(told) == told
    for letter in filter(str.isprintable, text):
        assert letter in told


def test_what_is_text_stays() -> None:
    for text in ("", "index 31 °C", "Größe → 5 µm, §2.3 …", "手", "🙂"):
        assert shown(text) == text
    assert shown("a\u00a0b") == "a b"
    assert shown("\x1b[31m\x9b\u202e\udcff\t") == "\\x1b[31m\\x9b\\u202e\\xff\\t"
    assert text_shown("a\tb\r\nc\n\rd") == "a\tb\r\nc\n\\rd"
    assert value_shown({"\x07": ["\x1b", 1, None]}) == {"\\x07": ["\\x1b", 1, None]}


def test_a_formula_gets_a_quote_and_a_number_none() -> None:
    assert [no_formula(text) for text in ("=1+1", "+x", "-cmd", "@a", "-5", "+1e3", "a=b", "")] == [
        "'=1+1", "'+x", "'-cmd", "'@a", "-5", "+1e3", "a=b", ""]  # fmt: skip


# -- every way out of a table -------------------------------------------------------------------------------------


def context(how: str, **more: Any) -> Any:
    settings = Settings(format=how, **more)
    return SimpleNamespace(
        settings=settings, simulated=False, command="exo dump", streams=False,
        journal=SimpleNamespace(counters=Counters()), envelope=lambda failure, extra=None: {"messages": [], "counters": {}}, closing=lambda failure, extra=None: {"end": {}}, with_cause_named=lambda failure: failure,
    )  # fmt: skip


def told(
    monkeypatch: pytest.MonkeyPatch, how: str, color: str, write: Callable[[Sink, Any], object], **more: Any
) -> str:
    out = io.StringIO(newline="")
    monkeypatch.setattr(sys, "stdout", out)
    around = context(how, color=color, **more)
    with Sink(around.settings) as sink:
        write(sink, around)
    return out.getvalue()


COLUMNS = (Column("name", "Name"), Column("value", "Value"), Column("label", "What"))


@each_row("text", HOSTILE.values(), ids=HOSTILE)
@each_row("color", ["auto", "always"])
@each_row("how", ["table", "plain", "csv"])
def test_no_way_out_lets_it_pass(monkeypatch: pytest.MonkeyPatch, how: str, color: str, text: str) -> None:
    rows = [{"name": text, "value": text, "label": None}, {"name": "b", "error": text}]
    grid = Grid((text, "b"), ((text, Cell(text, "bad")),), text, notes=(text,))
    for table in (
        Table(rows=rows, columns=COLUMNS, title=text),
        Table(rows=rows, columns=COLUMNS, view=lambda _: [grid]),
        Table(rows=rows, columns=COLUMNS, text=lambda _: text),
    ):
        out = told(monkeypatch, how, color, lambda sink, around, table=table: show(table, None, sink, around))
        assert harmless(out, {"csv": "\n\r", "plain": "\n\t"}.get(how, "\n")), repr(out)
        assert "\r" not in out.replace("\r\n", "")
    streamed = Table(columns=COLUMNS, samples=[Sample(0.0, tuple(rows))])
    out = told(monkeypatch, how, color, lambda sink, around: stream(streamed, sink, around))
    assert harmless(out, "\n\r\t" if how == "plain" else "\n\r"), repr(out)


@each_row("text", HOSTILE.values(), ids=HOSTILE)
def test_json_is_utf8_and_lossless(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    table = Table(rows=[{"name": text}], columns=COLUMNS)
    out = told(monkeypatch, "json", "auto", lambda sink, around: show(table, None, sink, around))
    found = json.loads(out.encode("utf-8"))
    assert found["rows"] == [{"name": text if text != HOSTILE["byte"] else "\\xff"}]
    assert json.dumps(found, ensure_ascii=False).encode("utf-8"), "half a character is no text"


def test_csv_without_formulas(monkeypatch: pytest.MonkeyPatch) -> None:
    table = Table(rows=[{"name": "=HYPERLINK(1)", "value": -5, "label": "@x"}], columns=COLUMNS)
    plain = told(monkeypatch, "csv", "auto", lambda sink, around: show(table, None, sink, around))
    safe = told(monkeypatch, "csv", "auto", lambda sink, around: show(table, None, sink, around), no_formulas=True)
    assert plain.splitlines()[1] == "=HYPERLINK(1),-5,@x"
    assert safe.splitlines()[1] == "'=HYPERLINK(1),-5,'@x"


# -- messages, and what a user can type ---------------------------------------------------------------------------


@each_row("text", [text for text in HOSTILE.values() if "\0" not in text and "\n" not in text])
def test_messages_spell_it_out(text: str) -> None:
    for words in (
        ["exo", "get", text, "--fake"],
        ["exo", "set", f"id={text}", "--fake"],
        [text],
        ["exo", "dump", "-p", f"fake://exo?{text}=1"],
    ):
        done = run(*words)
        assert done.code == 2
        assert harmless(done.err), repr(done.err)
        assert len([line for line in done.err.splitlines() if line.startswith("handctl:")]) == 1


def test_a_variable_and_a_key_of_the_configuration(tmp_path: Path) -> None:
    done = run("exo", "dump", "--fake", env={"HANDCTL_TIMEOUT": "\x1b]0;x\x07"})
    assert (done.code, harmless(done.err)) == (2, True)
    (tmp_path / "c.toml").write_text('"\\u001b]0;x\\u0007" = 1\n')
    done = run("exo", "dump", "--fake", env={"HANDCTL_CONFIG": str(tmp_path / "c.toml")})
    assert (done.code, harmless(done.err)) == (2, True)


AT = ("-p", fake())

# -- encodings ----------------------------------------------------------------------------------------------------


@each_row("encoding", ["ascii", "latin-1", "gbk"])
@each_row("words", [
    ("-h",), ("barrett", "-h"), ("doctor",), ("exo", "describe"), ("exo", "dump", *AT), ("exo", "watch", "--count", "2", *AT),
    ("exo", "describe", "--json"), ("exo", "dump", "--color", "always", *AT),
])  # fmt: skip
def test_a_stdout_that_lacks_a_character_gets_a_substitute(
    tmp_path: Path, encoding: str, words: tuple[str, ...]
) -> None:
    """Programs in locales of the system are in tests/hostile/test_locales."""
    code, out, err = run_in(encoding, words, tmp_path)
    assert code == (7 if words == ("doctor",) else 0), err
    how = "json" if "--json" in words else "table"
    assert not judge(code, out, err, encoding, how)
    if how == "json":
        assert any("°C" in str(row["unit"]) for row in json.loads(out.decode("utf-8"))["rows"])
    elif words[-1] == "describe" and encoding == "ascii":
        assert b"deg C" in out


@pytest.mark.real
def test_a_live_view_in_ascii() -> None:
    """Bars on a terminal that has no block characters."""
    main, side = pty.openpty()
    env = clean_environment() | {"PYTHONIOENCODING": "ascii", "TERM": "xterm", "COLUMNS": "80", "LINES": "24"}
    child = subprocess.Popen(
        program("exo", "watch", "--fake", "--count", "3"), stdout=side, stderr=side, stdin=side, env=env
    )
    os.close(side)
    seen = b""
    while True:
        try:
            chunk = os.read(main, 65536)
        except OSError:
            break
        if not chunk:
            break
        seen += chunk
    os.close(main)
    assert child.wait(PATIENCE) == 0, seen
    assert seen.isascii()
    assert b"deg C" in seen
    assert b"##" in seen


@pytest.mark.real
def test_json_of_a_path_that_is_not_utf8(tmp_path: Path) -> None:
    odd = os.fsencode(tmp_path) + b"/\xff.json"
    command = [*(os.fsencode(word) for word in program("exo", "diff")), odd, b"--fake", b"--json"]
    done = subprocess.run(command, capture_output=True, env=clean_environment(), timeout=30, check=False)
    content = json.loads(done.stdout.decode("utf-8"))
    assert content["exit_code"] == done.returncode == 2
    assert "\\xff.json" in content["messages"][0]["text"] and "\\ud" not in json.dumps(content)
    assert b"\\xff.json" in done.stderr


NO_UTF8: dict[str, tuple[tuple[str, ...], dict[str, str]]] = {
    "an argument": (("exo", "get", "caf\udce9", "--fake"), {}),
    "an option": (("exo", "--\udcff"), {}),
    "a command": (("\udcff",), {}),
    "a port": (("exo", "get", "id", "-p", "/dev/x\udcff"), {}),
    "a variable": (("exo", "get", "id"), {"HANDCTL_PORT": "/dev/x\udcff"}),
    "a transcript": (("exo", "get", "id", "-p", "{link}", "--trace", "{new}.txt"), {}),
    "a snapshot": (("exo", "snapshot", "{new}.json", "-p", "{link}"), {}),
    "a report": (("exo", "report", "{new}.html", "-p", "{link}"), {}),
    "facts": (("prove", "exo", "-o", "{new}.json", "-p", "{link}", "--yes"), {}),
    "a recording": (("exo", "log", "{new}.csv", "temperature", "--count", "2", "-p", "{link}"), {}),
    "a CSV": (("exo", "watch", "--count", "2", "-o", "{new}.csv", "-p", "{link}"), {}),
}


@each_row(("words", "env"), NO_UTF8.values(), ids=NO_UTF8)
def test_what_is_no_utf8_is_text_in_each_output(tmp_path: Path, words: tuple[str, ...], env: dict[str, str]) -> None:
    """Half a character is no text: neither as a byte nor as an escape. Then the same from the file."""
    state, new = tmp_path / "s\udcff.json", tmp_path / "new\udcfe"
    link = f"fake://exo?clock=virtual&state={state}"
    done = run(*(word.format(new=new, link=link) for word in words), "--json", env=env)
    assert done.code in (0, 2, 3) and ("{link}" not in words or not done.code), done
    made = [one.read_bytes() for one in tmp_path.iterdir() if one.name.startswith("new")]
    for data in (done.raw, *made):
        assert not re.search(r"(?<!\\)\\ud[89a-f]", data.decode("utf-8")), data
    if "snapshot" in words:
        assert run("exo", "diff", f"{new}.json", "-p", link).code == 0


def test_json_has_no_number_that_json_does_not_have() -> None:
    """NaN and Infinity are no JSON: a reader other than Python's stops at them."""
    for number in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="JSON compliant"):
            render.dumps({"value": [number]})
