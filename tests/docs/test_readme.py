"""README and guides against the program: every example line runs, the tables of commands and exit codes are those of the code."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from handctl import errors, guides
from handctl.command.options import lasting_options
from handctl.docgen.guide_tables import MAKERS, SECTION, filled
from handctl.docgen.read_command_tree import read_tree
from handctl.families import COMMANDS, FAMILIES
from handctl.model import write_ledger
from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.leaves import taken
from tests.support.places import README, TEXTS
from tests.support.virtual import Loop

PAGES = {name: path.read_text(encoding="utf-8") for name, path in TEXTS.items()}
TEXT = "\n".join(PAGES.values())
MOST_LINES = 160
"""Of README: what is more belongs into a guide."""
FENCED = re.compile(r"^```\w*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PROGRAM = re.compile(r"^```python.*?\n.*?^```$", re.MULTILINE | re.DOTALL)
"""Holds no command line; `test_library_guide` and `test_readme_recipes` run these."""
INDENTED = re.compile(r"^    (\S.*)$", re.MULTILINE)
SPAN = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
OPERATORS = frozenset("();<>|&")
MEANINGS = {
    0: "Done", 1: "bug", 2: "outside the documented range", 3: "link", 4: "did not reply", 5: "no valid reply", 6: "refused",
    7: "check", 8: "confirmation", 130: "Ctrl-C",
}  # fmt: skip
"""A word or two of each meaning, from the contract's table of exit codes."""
GIVEN = {
    "plan.csv": "t,velocity.F1,velocity.F2\n0,20,20\n0.5,0,-20\n",
    "firmware.S19": "S10B2000112233445566FF0070\nS9030000FC\n",
}
"""Files that a reader brings along, or copies from the guide."""
GIVEN["morning.txt"] = PAGES["scripts"].partition("# morning.txt\n")[2].partition("```")[0]
GIVEN["line.toml"] = PAGES["simulators"].partition("```toml\n")[2].partition("```")[0]
FINDS = {"gait", "diagnose", "doctor", "service"}
"""Commands whose exit code 7 is a finding, not a failure of the example."""


def commands_in(line: str) -> Iterator[list[str]]:
    """The words behind each `handctl` of a shell line, up to the next operator; comments are none of it."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    words = list(lexer)
    for position, word in enumerate(words):
        if word.rpartition("/")[2] != "handctl":
            continue
        rest = words[position + 1 :]
        end = next((i for i, text in enumerate(rest) if text and set(text) <= OPERATORS), len(rest))
        yield rest[:end]


def examples(text: str) -> list[tuple[str, ...]]:
    """Every handctl command line of a text in order: code blocks, then spans in the text."""
    text = PROGRAM.sub("", text)
    lines = [line for block in FENCED.findall(text) for line in block.replace("\\\n", " ").splitlines()]
    lines += INDENTED.findall(FENCED.sub("", text))
    lines += [
        span for span in SPAN.findall(FENCED.sub("", text)) if re.search(r"\bhandctl .", span) and "…" not in span
    ]
    return list(dict.fromkeys(tuple(words) for line in lines for words in commands_in(line)))


def bench_version(words: tuple[str, ...]) -> tuple[str, ...]:
    """The same command on a simulated device in virtual time, whatever port the example names."""
    kind = next((word for word in words if word in FAMILIES), "")
    kept: list[str] = []
    on_can = False
    rest = iter(words)
    for word in rest:
        if word in ("-p", "--port"):
            on_can = next(rest).startswith("can:")
        elif word == "--can":
            on_can = True
        elif word == "--mark-udp":  # any port: another test may have this one
            next(rest)
            kept += [word, "0"]
        elif word not in (
            "--fake",
            "--serial",
            "--lsl",
        ):  # --lsl needs what may not be installed: tests/ekso/test_lsl.py
            kept.append(word)
    if "log" in kept and not {"-h", "--check"} & set(kept):  # a few rows are enough
        place = kept.index("--duration") if "--duration" in kept else len(kept)
        kept[place : place + 2] = ["--count", "5"]
    streams = {"watch", "--live"} & set(kept) or {"tactile", "--watch"} <= set(kept)
    if streams and not {"--count", "--duration"} & set(kept):
        kept += ["--count", "2"]
    elif streams and "--duration" in kept:  # so are a few samples
        kept[kept.index("--duration") + 1] = "1"
    elif streams:
        kept[kept.index("--count") + 1] = "2"
    kept += ["--force"] if "pair" in kept else []  # other examples have given these names
    if any("/" in word for word in kept) and "pair" in kept:  # its LINKs are arguments, and differ
        return tuple(second_link(word, place) for place, word in enumerate(kept))
    return (*kept, "-p", f"fake://{kind}?clock=virtual{'&bus=can' if on_can else ''}")


def second_link(word: str, number: int) -> str:
    """A LINK that is an argument, as a simulated hand of its own."""
    bus = "&bus=modbus-tcp" if word.startswith("tcp:") else ""
    return f"fake://hand?clock=virtual&seed={number}{bus}" if "/" in word else word


def at_home() -> dict[str, str]:
    """An environment whose user folders are below the present directory."""
    return {"HOME": str(Path.cwd()), "XDG_CONFIG_HOME": str(Path.cwd() / "config")}


def on_a_bench(words: tuple[str, ...]) -> tuple[str, ...]:
    """`scan` or `doctor` of a simulated device in place of the link that the example names."""
    kind = words[words.index("--family") + 1] if "--family" in words else ""

    def link(word: str) -> str:
        for start, usual in (("/dev/", "exo"), ("tcp:", "aidin"), ("can:", "wrist")):
            if word.startswith(start):
                return f"fake://{kind or usual}?clock=virtual{'&bus=can' if start == 'can:' else ''}"
        return word

    found = tuple(map(link, words))
    return found if words[0] != "scan" or "-p" in words or "-h" in words else (*found, "-p", link("/dev/"))


def served(words: tuple[str, ...]) -> Result:
    """A server that ends by itself, in this process and on virtual time."""
    loop = Loop(*words, "--duration", "0.1")
    try:
        with loop:
            assert loop.until(lambda: loop.ended)
    except AssertionError:
        assert loop.complained, words
    return Result(loop.code or 0, b"", "\n".join(loop.complained).encode())


def tried(words: tuple[str, ...]) -> Result:
    """Run one example as far as is sensible without a device: a dry run, the simulator, a short server, its help."""
    group = len(words) == 1 and not words[0].startswith("-")  # named as a whole
    group = group or words[0] == "shell"  # needs a person
    if group or "replay:FILE" in words or words[:2] == ("sim", "control"):
        return run(*words, "-h")
    if words[:1] == ("sim",):
        ends = words[-1] in ("-h", "--help") or words[1] == "forget"  # by itself
        return run(*words) if ends else served(words[1:])
    if words[0] in ("scan", "doctor", "batch", "service"):
        return run(*on_a_bench(words))
    if not any(word in FAMILIES for word in words) or {"-h", "--help", "describe"} & set(words) or "devices" in words:
        return run(*words, env=at_home())
    if any(word.startswith("replay:") for word in words):
        return run(*words)
    simulated = bench_version(words)
    planned = run(*simulated, "-n", env=at_home())
    return run(*simulated, env=at_home()) if planned.code == 2 and "only reads" in planned.err else planned


def test_examples_of_every_family() -> None:
    assert len(examples(PAGES["README"])) >= 15
    for kind in FAMILIES:
        assert any(kind in words for text in PAGES.values() for words in examples(text)), (
            f"no example of handctl {kind}"
        )


@each_row("name", PAGES)
def test_every_example_is_a_line_that_handctl_takes(name: str) -> None:
    for words in examples(PAGES[name]):
        assert words[0] in COMMANDS or words[0].startswith("-"), words
        if len(words) > 1 and words[-1] != "-h" and "-d" not in words:  # else a group, its help, or a named device
            assert taken(words), words


@each_row("name", PAGES)
def test_every_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In order and in one directory, as a reader would: one example's file is the next one's input."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "handctl.tools.port_inventory.source", lambda _address: ""
    )  # `doctor` asks which address is its own
    for file, text in GIVEN.items():
        (tmp_path / file).write_text(text, encoding="ascii")
    if "devices add left" not in PAGES[name]:
        for device in ("left", "right"):
            assert run("devices", "add", device, "exo", "-p", "fake://exo?clock=virtual", env=at_home()).code == 0
    failed = {}
    for words in examples(PAGES[name]):
        result = tried(words)
        if result.code not in ((0, 7) if set(words) & FINDS else (0,)) or "Traceback" in result.err:
            failed[shlex.join(words)] = result
    assert not failed, failed


def test_the_states_of_a_write_are_those_of_the_schema() -> None:
    schema = (README.parent / "src/handctl/schema/envelope-1.json").read_text(encoding="utf-8")
    states = [cells[0].strip("`") for cells in rows("state")]
    assert states == list(write_ledger.IN_WORDS)
    assert all(f'"{state}"' in schema for state in states)


def test_readme_stays_short() -> None:
    assert len(PAGES["README"].splitlines()) <= MOST_LINES


@pytest.mark.real
def test_handctl_is_found_behind_the_line_that_readme_has_for_it(tmp_path: Path) -> None:
    """README's lines for a checkout in order: the program is in .venv, and later lines say `handctl` alone."""
    lines = INDENTED.findall(PAGES["README"])
    (path,) = [line for line in lines if line.startswith("export PATH=")]
    place = next(i for i, line in enumerate(lines) if ".venv/bin/pip install" in line)
    assert place < lines.index(path) < next(i for i, line in enumerate(lines) if line.startswith("handctl "))
    program = tmp_path / ".venv" / "bin" / "handctl"
    program.parent.mkdir(parents=True)
    program.write_text("#!/bin/sh\necho it is this one\n", encoding="ascii")
    program.chmod(0o755)
    done = subprocess.run(
        ["sh", "-c", f"{path}; handctl"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=20
    )
    assert (done.returncode, done.stdout) == (0, "it is this one\n")


@pytest.mark.real
@pytest.mark.skipif(shutil.which("man") is None, reason="no man")
def test_a_guide_is_shown_in_a_checkout() -> None:
    (line,) = [line for line in INDENTED.findall(PAGES["README"]) if line.startswith("man ")]
    done = subprocess.run(
        ["sh", "-c", line], cwd=README.parent, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done
    assert "unit of the forces is not documented" in " ".join(done.stdout.split())


def test_every_family_has_a_guide() -> None:
    assert set(FAMILIES) <= set(PAGES)
    for kind in FAMILIES:
        assert guides.title(PAGES[kind])[0] == f"handctl-{kind}-guide"


def test_every_guide_that_is_named_is_there() -> None:
    pages = {f"{guides.title(text)[0]}(7)" for name, text in PAGES.items() if name != "README"}
    named = set(re.findall(r"handctl-[a-z-]+\(7\)", TEXT))
    assert named == pages


def test_the_examples_are_really_tried() -> None:
    assert list(commands_in("v=$(handctl exo get x --format plain)  # handctl no")) == [
        ["exo", "get", "x", "--format", "plain"]
    ]
    assert list(commands_in(".venv/bin/handctl -h >/dev/null || handctl sim exo --pty &")) == [
        ["-h"], ["sim", "exo", "--pty"],
    ]  # fmt: skip
    assert tried(("exo", "nosuch", "--fake")).code == 2
    assert tried(("exo", "dump", "--nosuch", "-p", "/dev/ttyUSB0")).code == 2
    assert tried(("exo", "set", "position_set.index=1001", "-p", "/dev/ttyUSB0")).code == 2
    assert tried(("sim", "exo", "--nosuch")).code == 2


def rows(heading: str) -> list[list[str]]:
    """The cells of the table whose first heading is this."""
    lines = TEXT.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"| {heading} |"))
    found = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        found.append([cell.strip() for cell in line.strip("|").split("|")])
    return found


def test_exit_codes() -> None:
    def leaves(kind: type[errors.HandctlError]) -> set[int]:
        return {kind.exit_code}.union(
            *(leaves(sub) for sub in kind.__subclasses__() if sub.__module__ == errors.__name__)
        )

    table = {int(code): meaning for code, meaning in rows("exit code")}
    assert set(table) == {0} | leaves(errors.HandctlError) == set(MEANINGS)
    assert list(table) == sorted(table)
    for code, words in MEANINGS.items():
        assert words in table[code], (code, table[code])


def test_commands() -> None:
    tables = [line.split("|")[1].strip() for line in PAGES["README"].splitlines() if line.startswith("| `handctl ")]
    assert sorted(tables) == sorted(f"`handctl {name}`" for name in FAMILIES)
    assert tables[: len(FAMILIES)] == [f"`handctl {name}`" for name in FAMILIES]


def test_generated_sections_are_as_generated() -> None:
    for text in PAGES.values():
        assert filled(text, read_tree()) == text, "run `python -m handctl.docgen`"
    assert {found["name"] for found in SECTION.finditer(TEXT)} == set(MAKERS)


def test_environment_variables() -> None:
    known = {f"HANDCTL_{str(option.name).upper()}" for option in lasting_options(("serial", "can"))}
    named = set(re.findall(r"\bHANDCTL_[A-Z_]+\b", TEXT))
    assert named and named <= known


def test_files_that_are_named_exist() -> None:
    root = README.parent
    assert (root / "src/handctl/schema/envelope-1.json").exists()
    for path in set(re.findall(r"`((?:src|tests|handctl)/(?!\d)[\w./-]+)`", TEXT)):
        assert (root / path).exists() or (root / "src" / path).exists(), path
