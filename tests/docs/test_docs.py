"""The man pages against the program: regenerated they are the committed ones, nothing is missing, every example works.

The pages are checked by what this machine has of mandoc and groff, and by the rules below everywhere.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import click
import pytest

import handctl
import handctl.docgen.__main__ as program
from handctl import __version__, errors, guides
from handctl.command.command_tree import root
from handctl.command.options import SharedOption
from handctl.devices.barrett.maintenance import lubrication
from handctl.docgen.__main__ import generate
from handctl.docgen.read_command_tree import map_of
from handctl.docgen.roff import Page, escape, marked
from handctl.families import COMMANDS, FAMILIES, WIRES
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.leaves import taken
from tests.support.places import PROJECT

MACROS = {".TH", ".SH", ".SS", ".PP", ".TP", ".IP", ".RS", ".RE", ".nf", ".fi", ".nh", ".ad"}
SECTIONS = ("NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "EXAMPLES", "SEE ALSO")


@cache
def generated() -> dict[str, str]:
    """What is generated, by its file: when it is wanted first, not when tests are collected."""
    return generate()


@cache
def pages() -> dict[str, str]:
    return {Path(name).stem: text for name, text in generated().items() if name.startswith("man/man1/")}


@cache
def manual_guides() -> dict[str, str]:
    return {Path(name).stem: text for name, text in generated().items() if name.startswith("man/man7/")}


@cache
def section_of() -> dict[str, int]:
    return dict.fromkeys(pages(), 1) | dict.fromkeys(manual_guides(), 7)


def plain(page: str) -> str:
    """The words of a page without roff, on one line."""
    text = re.sub(r"^\.(?:SH|SS|TH|TP|PP|IP|RS|RE|nf|fi|nh|ad).*$", "", page, flags=re.MULTILINE)
    text = re.sub(r"\\f[BIR]|\\[&%]", "", text)
    text = re.sub(r"\\\[u([0-9A-F]+)\]", lambda found: chr(int(found[1], 16)), text)
    for coded, char in ((r"\-", "-"), (r"\(aq", "'"), (r"\(ga", "`"), (r"\(ha", "^"), (r"\(ti", "~"), (r"\e", "\\")):
        text = text.replace(coded, char)
    return " ".join(text.split())


def section(page: str, title: str) -> str:
    """The source of one section."""
    found = re.search(rf"^\.SH {re.escape(title)}\n(.*?)(?=^\.SH|\Z)", page, re.MULTILINE | re.DOTALL)
    assert found, title
    return found[1]


def leaves(
    command: click.Command, path: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], click.Command, click.Context]]:
    ctx = click.Context(command, info_name=path[-1], help_option_names=["-h", "--help"])
    if isinstance(command, click.Group):
        for name in command.list_commands(ctx):
            child = command.get_command(ctx, name)
            assert child is not None
            yield from leaves(child, (*path, name))
    else:
        yield path, command, ctx


def top(name: str) -> click.Command:
    command = root.get_command(click.Context(root), name)
    assert command is not None
    return command


# -- committed ----------------------------------------------------------------------------------------------------


@each_row("name", generated)
def test_regenerated_is_committed(name: str) -> None:
    assert (PROJECT / name).read_text(encoding="utf-8") == generated()[name], "run `python -m handctl.docgen`"


def test_nothing_else_is_committed() -> None:
    present = {
        str(path.relative_to(PROJECT)) for top in ("man", "completions") for path in (PROJECT / top).rglob("*.*")
    }
    assert {name for name in present if "__pycache__" not in name} <= set(generated())


def test_generating_tells_nothing_of_the_machine_and_is_repeatable(tmp_path: Path) -> None:
    assert generate() == generated()
    for name, text in generated().items():
        assert str(Path.home()) not in text and str(PROJECT) not in text, name


def test_docgen_writes_what_differs_and_removes_what_is_gone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(program, "generate", generated)
    assert program.main([str(tmp_path)]) == 0
    assert capsys.readouterr().out.count("wrote ") == len(generated())
    (tmp_path / "man/man7" / "handctl-gone.7").touch()
    (tmp_path / "man/handctl-gone.1").touch()
    (tmp_path / "man/man1" / "handctl.1").write_text("old")
    assert program.main([str(tmp_path)]) == 0
    assert capsys.readouterr().out == (
        f"wrote {tmp_path}/man/man1/handctl.1\nremoved {tmp_path}/man/handctl-gone.1\n"
        f"removed {tmp_path}/man/man7/handctl-gone.7\n"
    )
    assert {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()} == set(generated())
    assert program.main(["--what"]) == 2


# -- content ------------------------------------------------------------------------------------------------------


def test_there_is_a_page_for_every_command() -> None:
    assert set(pages()) == {"handctl", *(f"handctl-{name}" for name in COMMANDS)}
    for name in COMMANDS:
        assert f"handctl-{name}(1)" in plain(section(pages()["handctl"], "COMMANDS"))
    for name in manual_guides():
        assert f"{name}(7)" in plain(section(pages()["handctl"], "GUIDES"))


@each_row("name", pages)
def test_every_page_has_its_sections_in_order(name: str) -> None:
    titles = re.findall(r"^\.SH (.*)$", pages()[name], re.MULTILINE)
    assert [title for title in titles if title in SECTIONS] == list(SECTIONS)
    assert all(section(pages()[name], title).strip() for title in titles)
    head = rf'\.TH {name.upper()} 1 \d{{4}}-\d\d-\d\d "handctl {re.escape(__version__)}" "handctl manual"'
    assert re.fullmatch(head, pages()[name].replace("\\-", "-").splitlines()[0])
    assert plain(section(pages()[name], "NAME")).startswith(f"{name} - ")
    others = plain(section(pages()[name], "SEE ALSO"))
    family = name.removeprefix("handctl-")
    foreign = {f"handctl-{one}{more}" for one in FAMILIES if one != family for more in ("", "-guide")}
    hidden = {name, *(foreign if name != "handctl" else ())}
    assert others == ", ".join(f"{other}({number})" for other, number in section_of().items() if other not in hidden)


@each_row("name", manual_guides)
def test_every_guide_is_a_page_of_section_7(name: str) -> None:
    """With all of its source's words, in order."""
    page = manual_guides()[name]
    stem = next(stem for stem in guides.names() if guides.title(guides.source(stem))[0] == name)
    head = rf'\.TH {name.upper()} 7 \d{{4}}-\d\d-\d\d "handctl {re.escape(__version__)}" "handctl manual"'
    assert re.fullmatch(head, page.replace("\\-", "-").splitlines()[0])
    assert plain(section(page, "NAME")) == f"{name} - {guides.title(guides.source(stem))[1]}"
    assert plain(section(page, "SEE ALSO")) == ", ".join(
        [
            "handctl(1)",
            *([f"handctl-{stem}(1)"] if stem in FAMILIES else []),
            *(f"{other}(7)" for other in manual_guides() if other != name and not other.endswith("-guide")),
        ]
    )
    words, place = plain(page), 0
    for block in guides.blocks(guides.source(stem)):
        if isinstance(block, guides.Para | guides.Item):
            place = words.index(" ".join(re.sub(r"\*\*|`", "", block.text).split()), place)
        elif isinstance(block, guides.Code):
            for line in filter(str.strip, block.lines):
                assert " ".join(line.split()) in words, line
        elif isinstance(block, guides.Table):
            assert all(re.sub(r"\*\*|`", "", cell) in words for row in block.rows[1:] for cell in row), block
        else:
            assert f".SH {escape(block.text.upper())}\n" in page or f".SS {escape(block.text)}\n" in page


@each_row("name", COMMANDS)
def test_every_command_option_and_help_text_is_in_its_page(name: str) -> None:
    page = pages()[f"handctl-{name}"]
    words, synopsis = plain(page), plain(section(page, "SYNOPSIS"))
    for path, command, ctx in leaves(top(name), (name,)):
        assert f"handctl {' '.join(path)} [OPTIONS]" in synopsis, path
        for text in re.split(r"\n\s*\n", command.help or ""):
            assert " ".join(text.replace("`", "").replace("\b", "").split()) in words, path
        for param in command.get_params(ctx):
            if isinstance(param, click.Argument):
                assert param.get_usage_pieces(ctx)[0] in synopsis, path
            elif isinstance(param, click.Option) and not param.hidden:
                assert all(option in words for option in param.opts), path
                assert " ".join((param.help or "").replace("`", "").split()) in words, (path, param.opts)


@each_row("name", FAMILIES)
def test_every_quantity_is_in_its_page(name: str) -> None:
    text = plain(section(pages()[f"handctl-{name}"], "QUANTITIES"))
    for param in map_of(name) or ():
        assert f"{param.name}" in text and param.source in text and param.doc[1:] in text, param.name
        assert param.range_text in text, param.name


@each_row("name", pages)
def test_exit_status_is_that_of_the_error_tree(name: str) -> None:
    text = section(pages()[name], "EXIT STATUS")
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, errors.HandctlError)]
    codes = {0, *(kind.exit_code for kind in kinds)}
    assert [int(code) for code in re.findall(r"^\.TP\n\\fB(\d+)\\fR$", text, re.MULTILINE)] == sorted(codes)
    assert "Exit code" not in text


def test_every_file_that_is_kept_for_the_user_is_named() -> None:
    sources = [path.read_text("utf-8") for path in Path(handctl.__file__).parent.rglob("*.py")]
    kept = {name for text in sources for name in re.findall(r'state_path\("(.+)"\)', text)} | {lubrication.FILE}
    assert len(kept) > 3
    text = plain(section(pages()["handctl"], "FILES"))
    assert not {name for name in kept if name not in text}


def test_every_shared_option_has_its_variable() -> None:
    text = plain(section(pages()["handctl"], "ENVIRONMENT"))
    shared = [param for param in root.get_params(click.Context(root)) if isinstance(param, SharedOption)]
    assert len(shared) > 15
    for option in shared:
        assert (f"HANDCTL_{str(option.name).upper()} " in text) is not option.typed
    assert "NO_COLOR" in text
    assert "HANDCTL_CONFIG" in text
    wrist = plain(section(pages()["handctl-wrist"], "ENVIRONMENT"))
    assert "HANDCTL_CAN 1 is the same as --can." in wrist


# -- lint ---------------------------------------------------------------------------------------------------------


@each_row("name", section_of)
def test_the_roff_is_sound(name: str) -> None:
    """What mandoc and groff would complain of, also where neither is installed."""
    page = {**pages(), **manual_guides()}[name]
    assert page.isascii() and page.endswith("\n") and "\n\n" not in page and "\t" not in page
    depth = 0
    for number, line in enumerate(page.splitlines(), 1):
        where = f"{name}:{number}: {line}"
        assert line == line.rstrip() and len(line) <= 250, where
        if line.startswith((".", "'")):
            assert line.split()[0] in MACROS, where
        depth += line.startswith(".RS") - line.startswith(".RE")
        assert depth >= 0, where
        assert re.fullmatch(r"(?:[^\\]|\\(?:[e&%-]|f[BIR]|\((?:aq|bu|ga|ha|ti)|\[u[0-9A-F]{4,6}\]))*", line), where
    assert depth == 0
    assert page.count(".nf\n") == page.count(".fi\n")
    assert page.count("\\fR") == page.count("\\fB") + page.count("\\fI")
    assert not re.search(r"^\.(?:PP|IP|TP)\n\.(?:PP|IP|TP|SH|RS)", page, re.MULTILINE), "an empty paragraph"
    assert not re.search(r"^\.TP\n.*\n\.", page, re.MULTILINE), "a tag without a text"


@pytest.mark.real
@pytest.mark.parametrize(
    "linter", [["mandoc", "-T", "lint"], ["groff", "-man", "-ww", "-z"], ["lexgrog"]], ids=lambda words: words[0]
)
def test_the_linters_of_this_machine_find_nothing(linter: list[str], tmp_path: Path) -> None:
    if not shutil.which(linter[0]):
        pytest.skip(f"no {linter[0]}")
    paths = [tmp_path / f"{name}.{number}" for name, number in section_of().items()]
    for path in paths:
        path.write_text({**pages(), **manual_guides()}[path.stem], encoding="ascii")
    done = subprocess.run([*linter, *paths], capture_output=True, text=True, check=False)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    if linter == ["lexgrog"]:
        assert said.count("\n") == len(paths) and all(said.count(f'"{name} - ') == 1 for name in section_of()), said
    else:
        assert said == ""


def test_page_escapes_what_roff_would_take_for_its_own() -> None:
    assert escape(r"a\b -n 'x' `y` ^ ~ °") == r"a\eb \-n \(aqx\(aq \(gay\(ga \(ha \(ti \[u00B0]"
    assert marked("see `-n` twice `x`") == r"see \fB\-n\fR twice \fBx\fR"
    page = Page("a-b", "2026-01-01", "a 1", "manual")
    page.section("NAME")
    page.para("a \\- b")
    page.para(".dot first. Then more")
    page.item("tag", "text")
    assert page.text == (
        '.TH A\\-B 1 2026-01-01 "a 1" "manual"\n.nh\n.ad l\n.SH NAME\na \\- b\n.PP\n\\&.dot first.\nThen more\n'
        ".TP\ntag\ntext\n"
    )


# -- examples -----------------------------------------------------------------------------------------------------


def lines_of(page: str) -> list[str]:
    """The command lines of EXAMPLES."""
    return [plain(tag) for tag in re.findall(r"^\.TP\n(.*)$", section(page, "EXAMPLES"), re.MULTILINE)]


def all_examples() -> list[str]:
    return list(dict.fromkeys(line for page in pages().values() for line in lines_of(page)))


@each_row("name", pages)
def test_every_page_has_examples_of_its_own(name: str) -> None:
    lines = lines_of(pages()[name])
    assert lines and all(f"{line} ".startswith(name.replace("-", " ", 1) + " ") for line in lines)


@each_row("line", all_examples)
def test_every_example_is_a_line_that_handctl_takes(line: str) -> None:
    program_name, *words = shlex.split(line)
    assert program_name == "handctl"
    assert taken(words)


def test_the_examples_that_need_no_device_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runnable = [line for line in all_examples() if "--fake" in line or " -n " in line]
    assert {word for line in runnable for word in line.split()} >= set(FAMILIES)
    for line in runnable:
        words = shlex.split(line)[1:]
        kind = next(word for word in words if word in FAMILIES)
        bus = "".join(f"&bus={wire}" for wire in WIRES if f"--{wire}" in words)
        model = f"&model={words[words.index('--model') + 1]}" if "--model" in words else ""
        virtual = ["-p", f"fake://{kind}?clock=virtual{bus}{model}"]
        left_out = ("--fake", *(f"--{wire}" for wire in WIRES))
        done = run(*(virtual if "--fake" in words else []), *(w for w in words if w not in left_out))
        assert done.code == 0, (line, done)
    assert (tmp_path / "exo-before.json").is_file()
