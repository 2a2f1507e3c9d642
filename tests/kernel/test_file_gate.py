"""The gate for files, over the whole command tree: an output is never an input, and what is not a file is never read.

Which parameter takes a file is asked of the tree: a new command is in here by itself.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import click
import pytest

from handctl.command.command_tree import root
from handctl.command.options import InFile, OutFile
from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.leaves import LEAVES, Leaf, command_line, leaves, own

EVERYWHERE = {"--output": ("-o",), "--trace": ("--trace",)}


def link_of(how: str, path: Path) -> str:
    if how == "same":
        return str(path)
    other = path.with_name(f"{how}-{path.name}")
    if how == "symlink":
        other.symlink_to(path)
    else:
        os.link(path, other)
    return str(other)


def error_of(done: Result) -> str:
    """The code of the error in the envelope, of a stream too; nothing was sent."""
    content = json.loads(done.out)
    content = content.get("end", content)
    assert content["counters"]["sent"] == 0
    return str(content["messages"][-1]["code"])


def fake(leaf: Leaf) -> list[str]:
    return ["--fake"] if leaf.words[0] in ("exo", "wrist", "barrett", "ekso", "aidin") else []


def test_the_tree_has_files() -> None:
    found = {" ".join(leaf.words) for leaf in LEAVES}
    assert {
        "exo restore",
        "ekso log",
        "trace show",
        "barrett firmware download",
        "devices add",
        "aidin report",
    } <= found
    for leaf in leaves(root):
        for param in leaf.command.params:
            assert not isinstance(param.type, click.Path) or isinstance(param.type, InFile | OutFile), (
                leaf.words,
                param,
            )
            named = "FILE" in str(param.metavar) or param.name in ("file", "path")
            assert not named or isinstance(param.type, InFile | OutFile), (leaf.words, param)


@each_row("how", ["same", "symlink", "hardlink"])
@each_row("leaf", LEAVES, ids=lambda leaf: "-".join(leaf.words))
def test_no_output_is_an_input_or_another_output(leaf: Leaf, how: str, tmp_path: Path) -> None:
    files = own(leaf, InFile) + own(leaf, OutFile)
    outputs = {**EVERYWHERE, **{p.name or "": p for p in own(leaf, OutFile)}}
    tried = 0
    for position, param in enumerate(files):
        for output, option in outputs.items():
            if output == param.name:
                continue
            kept = tmp_path / f"{position}-{output}.json"
            kept.write_text("keep me\n")
            other = tmp_path / f"other-{position}-{output}.json"
            other.write_text("and me\n")
            twin = link_of(how, kept)
            paths = {param.name or "": str(kept), "other": str(other)}
            if isinstance(option, tuple):
                words = [*command_line(leaf, paths), option[0], twin]
            else:
                words = command_line(leaf, {**paths, output: twin})
            done = run(*words, *fake(leaf), "--json")
            assert done.code == 2, (words, done)
            assert error_of(done) == "same-file", (words, done)
            assert kept.read_text() == "keep me\n"
            assert other.read_text() == "and me\n"
            tried += 1
    assert tried


@each_row("leaf", LEAVES, ids=lambda leaf: "-".join(leaf.words))
def test_no_output_replaces_a_recording(leaf: Leaf, tmp_path: Path) -> None:
    """`log` alone does, and it asks for --force: nobody walks the same walk again."""
    walk, sidecar = tmp_path / "walk.csv", tmp_path / "walk.csv.json"
    assert run("exo", "log", str(walk), "--count", "2", "-p", "fake://exo?clock=virtual").code == 0
    before = walk.read_bytes(), sidecar.read_bytes()
    other = tmp_path / "other"
    other.write_text("and me\n")
    for output, option in {**EVERYWHERE, **{p.name or "": p for p in own(leaf, OutFile)}}.items():
        for name in map(str, (walk, sidecar)):
            if isinstance(option, tuple):
                words = [*command_line(leaf, {"other": str(other)}), option[0], name]
            else:
                words = command_line(leaf, {"other": str(other), output: name})
            done = run(*words, *fake(leaf), "--json")
            assert (done.code, error_of(done)) == (2, "file-exists"), (words, done)
            assert (walk.read_bytes(), sidecar.read_bytes()) == before, words


def test_a_transcript_that_is_played_and_the_configuration_file(tmp_path: Path) -> None:
    kept = tmp_path / "run.txt"
    kept.write_text("> EB 90\n")
    for option in ("--trace", "-o"):
        done = run("exo", "dump", "-p", f"replay:{kept}", option, str(kept), "--json")
        assert (done.code, done.json["messages"][-1]["code"]) == (2, "same-file")
    config = tmp_path / "config.toml"
    config.write_text(f'trace = "{config}"\n')
    assert run("exo", "dump", "--fake", env={"HANDCTL_CONFIG": str(config)}).code == 2
    assert (kept.read_text(), config.read_text()) == ("> EB 90\n", f'trace = "{config}"\n')


def test_the_sidecar_of_a_recording_that_is_named_by_a_link_is_no_output(tmp_path: Path) -> None:
    log, link, sidecar = (tmp_path / name for name in ("a.csv", "link.csv", "a.csv.json"))
    assert run("exo", "log", str(log), "--count", "3", "-p", "fake://exo?clock=virtual").code == 0
    link.symlink_to(log)
    before = sidecar.read_bytes()
    done = run("exo", "export", str(link), "--to", "xdf", "-o", str(sidecar), "--json")
    assert (done.code, done.json["messages"][-1]["code"]) == (2, "same-file")
    assert sidecar.read_bytes() == before


def test_what_handctl_keeps_is_no_place_for_an_output(tmp_path: Path) -> None:
    audit = tmp_path / "handctl" / "ekso-audit.jsonl"
    audit.parent.mkdir()
    audit.write_text("{}\n")
    done = run("ekso", "dump", "--fake", "--trace", str(audit), "--json", env={"XDG_STATE_HOME": str(tmp_path)})
    assert (done.code, done.json["messages"][-1]["code"]) == (2, "same-file")
    assert audit.read_text() == "{}\n"


# -- what is not a file -------------------------------------------------------------------------------------------

READERS = [(leaf, param) for leaf in LEAVES for param in own(leaf, InFile)]


def refused(leaf: Leaf, param: click.Parameter, path: str, tmp_path: Path) -> Result:
    other = tmp_path / "other.json"
    other.write_text("{}")
    done = run(*command_line(leaf, {param.name or "": path, "other": str(other)}), *fake(leaf), "--yes")
    checks = "firmware" in leaf.words and leaf.words[-1] == "check" and path.endswith("binary")  # whose finding that is
    assert done.code == (7 if checks else 2), done
    assert "Traceback" not in done.err
    return done


@each_row(("leaf", "param"), READERS, ids=lambda one: "-".join(one.words) if isinstance(one, Leaf) else one.name)
def test_only_a_file_of_bounded_size_is_read(leaf: Leaf, param: click.Parameter, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00" * 1000)
    with open(tmp_path / "huge", "wb") as huge:
        huge.truncate(70_000_000)  # sparse
    refused(leaf, param, str(tmp_path / "folder"), tmp_path)
    if param.name != "path":  # realtime --control takes a pipe
        refused(leaf, param, str(tmp_path / "pipe"), tmp_path)
    refused(leaf, param, str(tmp_path / "none"), tmp_path)
    refused(leaf, param, str(tmp_path / "binary"), tmp_path)
    refused(leaf, param, str(tmp_path / "huge"), tmp_path)
    refused(leaf, param, "/dev/zero", tmp_path)


def test_an_output_that_is_a_pipe_without_a_reader_is_an_error_now(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert run("exo", "dump", "--fake", "-o", str(tmp_path / "pipe")).code == 1
    assert run("exo", "dump", "--fake", "--trace", str(tmp_path / "pipe")).code == 1


def test_a_dash_is_stdout_for_output_and_a_file_nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    link = ("-p", "fake://exo?clock=virtual", "--format", "plain")
    assert run("exo", "status", *link, "-o", "-").out == run("exo", "status", *link).out
    for words in (
        ("report", "-"),
        ("snapshot", "-"),
        ("log", "-"),
        ("status", "--trace", "-"),
        ("restore", "a", "--backup", "-"),
    ):
        assert run("exo", *words, *link).code == 2, words
    assert not list(tmp_path.iterdir())


@pytest.mark.real
def test_a_port_is_no_file_that_is_written_or_read(tmp_path: Path) -> None:
    master, slave = os.openpty()
    port = os.ttyname(slave)
    (tmp_path / "link").symlink_to(port)
    for words in (("report", port), ("status", "-o", port), ("status", "--trace", tmp_path / "link"), ("diff", port)):
        result = run("exo", *words, "-p", "fake://exo?clock=virtual")
        assert result.code == 2 and "device" in result.err, result
    assert run("exo", "status", "-p", f"fake://exo?facts={port}").code == 2
    os.set_blocking(master, False)
    with pytest.raises(BlockingIOError):
        os.read(master, 1)
    os.close(master), os.close(slave)
