"""What is shipped: the single file without any installed package, and the contents of wheel and source distribution."""

from __future__ import annotations

import ast
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import pexpect
import pytest

from handctl import __version__, build_zipapp, guides
from handctl.command.config_file import from_toml
from tests.support.cli import Result, run
from tests.support.places import PROJECT
from tests.support.shell import SCRIPTS

SHARED = {
    "share/bash-completion/completions": ["handctl"],
    "share/zsh/site-functions": ["_handctl"],
    "share/fish/vendor_completions.d": ["handctl.fish"],
    "share/handctl": ["70-handctl.rules", "handctl.ps1"],
    "share/man/man1": sorted(path.name for path in (PROJECT / "man/man1").glob("*.1")),
    "share/man/man7": sorted(path.name for path in (PROJECT / "man/man7").glob("*.7")),
}
BARE = [sys.executable, "-I", "-S"]
"""An interpreter that sees its standard library only: no site-packages, no environment, not the present directory."""


@pytest.fixture(scope="module")
def pyz(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("single") / "handctl.pyz"
    assert build_zipapp.main(["-o", str(path)]) == 0
    return path


def start(pyz: Path, *args: str, cwd: Path | None = None) -> Result:
    done = subprocess.run(
        [*BARE, str(pyz), *args], cwd=cwd or pyz.parent, env={"PATH": os.environ["PATH"]}, capture_output=True,
        check=False, timeout=60,
    )  # fmt: skip
    return Result(done.returncode, done.stdout, done.stderr)


# -- the single file ----------------------------------------------------------------------------------------------


@pytest.mark.real
def test_it_runs_without_any_installed_package(pyz: Path, tmp_path: Path) -> None:
    without = subprocess.run([*BARE, "-c", "import click"], capture_output=True, check=False)
    assert without.returncode == 1
    done = start(pyz, "exo", "dump", "-p", "fake://exo?clock=virtual", "--json", cwd=tmp_path)
    assert done.rows == run("exo", "dump", "-p", "fake://exo?clock=virtual", "--json").rows
    assert start(pyz, "--version").out == f"handctl {__version__}\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.real
def test_the_guides_are_in_it(pyz: Path) -> None:
    with zipfile.ZipFile(pyz) as archive:
        inside = {name for name in archive.namelist() if name.endswith(".md")}
    assert inside == {f"handctl/guides/{name}.md" for name in guides.names()}
    code = f"import sys; sys.path.insert(0, {str(pyz)!r}); from handctl import guides; print(*guides.names())"
    done = subprocess.run([*BARE, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout.split()) == (0, list(guides.names())), done


@pytest.mark.real
def test_an_old_python_says_in_one_sentence_which_version_is_needed(pyz: Path) -> None:
    """Its grammar is that of any Python: the question stands before everything that is newer."""
    ast.parse(zipfile.ZipFile(pyz).read("__main__.py"), feature_version=(3, 4))
    code = "import runpy, sys; sys.version_info = (3, 9, 2); runpy.run_path(sys.argv[1], run_name='__main__')"
    done = subprocess.run([*BARE, "-c", code, str(pyz)], capture_output=True, text=True, check=False)
    needed = ".".join(map(str, build_zipapp.oldest_here()))
    assert (done.returncode, done.stdout) == (1, "")
    first, step = done.stderr.splitlines()
    assert first == f"handctl: error: handctl needs Python {needed} or newer, and this is Python 3.9."
    assert step == f"  Next: Run this file with a newer Python, for example `python{needed} handctl.pyz`."
    asked = from_toml((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["requires-python"]
    assert asked == ">=" + ".".join(map(str, build_zipapp.OLDEST))


def test_without_what_old_pythons_need_it_asks_for_a_newer_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    present = metadata.distribution

    def missing(name: str) -> metadata.Distribution:
        if name == "tomli":
            raise metadata.PackageNotFoundError(name)
        return present(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    if sys.version_info < (3, 11):
        assert build_zipapp.main(["-o", str(tmp_path / "x.pyz")]) == 1
        assert capsys.readouterr().err == "build_zipapp: error: tomli is not installed. Run `pip install tomli`\n"
        return
    assert build_zipapp.oldest_here() == (3, 11)
    monkeypatch.setattr(build_zipapp, "build", lambda target: target.touch() or (3, 11))
    assert build_zipapp.main(["-o", str(tmp_path / "x.pyz")]) == 0
    assert capsys.readouterr().out.endswith(
        ": 0.0 MB, for Python 3.11 and newer\nFor Python 3.10, run `pip install tomli` and build it again.\n"
    )


@pytest.mark.real
def test_python_can_and_every_tool_are_inside(pyz: Path) -> None:
    silent = start(pyz, "wrist", "get", "pitch_actual", "-p", "can:virtual:x", "--timeout", "0.05", "--json")
    assert (silent.code, silent.error["code"]) == (4, "no-answer")
    assert start(pyz, "completion", "bash").out == SCRIPTS["bash"].read_text(encoding="utf-8")
    assert start(pyz, "exo", "dump", "-p", "/dev/no-such-port").code == 3


@pytest.mark.real
def test_a_terminal_gets_its_table(pyz: Path) -> None:
    child = pexpect.spawn(
        BARE[0], [*BARE[1:], str(pyz), "exo", "status", "-p", "fake://exo?clock=virtual"], encoding="utf-8",
        dimensions=(40, 100), timeout=30, env={"PATH": os.environ["PATH"], "TERM": "xterm", "LC_ALL": "C.UTF-8"},
    )  # fmt: skip
    child.expect(pexpect.EOF)
    child.close()
    assert child.exitstatus == 0 and "Finger" in child.before and "─" in child.before


@pytest.mark.real
def test_every_module_loads_from_the_file(pyz: Path) -> None:
    own = sorted(
        name[:-3].replace("/", ".").removesuffix(".__init__")
        for name in zipfile.ZipFile(pyz).namelist()
        if name.startswith("handctl/") and name.endswith(".py") and not name.endswith("__main__.py")
    )
    assert len(own) > 80
    outside = [
        "can",
        "can.interfaces.slcan",
        "rich.live",
        "rich.table",
        "serial",
        "serial.tools.list_ports",
        "crcmod",
        "bincopy",
    ]
    code = (
        "import sys, json, importlib\n"
        "from importlib import resources\n"
        "place, names = sys.argv[1], json.loads(sys.argv[2])\n"
        "sys.path.insert(0, place)\n"
        "files = [importlib.import_module(name).__file__ for name in names]\n"
        "schema = resources.files('handctl').joinpath('schema', 'envelope-1.json').read_text(encoding='utf-8')\n"
        "print(json.dumps([[f for f in files if not f.startswith(place)], json.loads(schema)]))\n"
    )
    done = subprocess.run(
        [*BARE, "-c", code, str(pyz), json.dumps([*own, *outside])], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    elsewhere, schema = json.loads(done.stdout)
    assert elsewhere == []
    assert schema == json.loads((PROJECT / "src/handctl/schema/envelope-1.json").read_text(encoding="utf-8"))


@pytest.mark.real  # with those that run the file: making it takes longer than any ordinary test
def test_what_is_in_the_file(pyz: Path) -> None:
    assert pyz.read_bytes().startswith(b"#!/usr/bin/env python3\n")
    assert pyz.stat().st_mode & 0o777 == 0o755
    with zipfile.ZipFile(pyz) as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        assert len(set(names)) == len(names)
        assert not [name for name in names if name.endswith((".so", ".pyd", ".pyi")) or "__pycache__" in name]
        assert {name for name in names if name.endswith(".py")} == {
            name[:-1] for name in names if name.endswith(".pyc")
        } | {"__main__.py"}
        for requirement in ("click", "rich", "pyserial", "python-can", "crcmod", "bincopy"):
            notes = [name for name in names if name.lower().replace("_", "-").startswith(f"{requirement}-")]
            assert any(name.endswith(("/METADATA", "/PKG-INFO")) for name in notes), requirement
        content = b"".join(archive.read(name) for name in names)
    for place in (str(PROJECT), str(Path.home()), sys.prefix):
        assert place.encode() not in content, place


def test_what_an_old_pip_installed_is_found(tmp_path: Path) -> None:
    """It lists files from the folder of its notes; Python before 3.12 takes the names of the sources instead."""
    notes = tmp_path / "old-1.0-py3.10.egg-info"
    notes.mkdir()
    (notes / "PKG-INFO").write_text("Metadata-Version: 1.1\nName: old\nVersion: 1.0\n")
    (notes / "SOURCES.txt").write_text("src/old.py\n")
    (notes / "installed-files.txt").write_text("../old.py\nPKG-INFO\n")
    found = list(build_zipapp._files_of(metadata.Distribution.at(notes), tmp_path))
    assert found == ["old.py", "old-1.0-py3.10.egg-info/PKG-INFO"]


@pytest.mark.real
def test_the_same_input_gives_the_same_file(pyz: Path, tmp_path: Path) -> None:
    build_zipapp.build(tmp_path / "again.pyz")
    again, first = (hashlib.sha256(path.read_bytes()).hexdigest() for path in (tmp_path / "again.pyz", pyz))
    assert again == first  # not the bytes: pytest would look for what differs in a megabyte, for hours
    assert [path.name for path in tmp_path.iterdir()] == ["again.pyz"]


def test_a_file_that_cannot_be_built(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert build_zipapp.main(["-o", str(tmp_path / "nowhere" / "x.pyz")]) == 1
    assert build_zipapp.main(["--what"]) == 2
    assert build_zipapp.main(["-h"]) == 0
    present = metadata.distribution

    def missing(name: str) -> metadata.Distribution:
        if name == "bincopy":
            raise metadata.PackageNotFoundError(name)
        return present(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    capsys.readouterr()
    assert build_zipapp.main(["-o", str(tmp_path / "x.pyz")]) == 1
    assert capsys.readouterr().err == "build_zipapp: error: bincopy is not installed. Run `pip install bincopy`\n"
    assert not list(tmp_path.iterdir())


# -- wheel and source distribution --------------------------------------------------------------------------------


def test_the_project_names_every_generated_file() -> None:
    content = from_toml((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    data = content["tool"]["hatch"]["build"]["targets"]["wheel"]["shared-data"]
    found: dict[str, list[str]] = {}
    for source, place in data.items():
        if (PROJECT / source).is_dir():
            found.setdefault(place, []).extend(path.name for path in (PROJECT / source).iterdir())
        else:
            found.setdefault(str(Path(place).parent), []).append(Path(place).name)
    assert {place: sorted(names) for place, names in found.items()} == SHARED


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A source distribution of a copy of the project, and the wheel built from that."""
    copy = tmp_path_factory.mktemp("project")
    unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info", ".*cache", ".hypothesis")
    for name in ("src", "tests", "man", "completions", ".ci", ".packaging"):
        shutil.copytree(PROJECT / name, copy / name, ignore=unwanted)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(PROJECT / name, copy / name)
    subprocess.run([sys.executable, "-m", "build", "-o", "dist", "."], cwd=copy, check=True, capture_output=True)
    return copy


def sources(top: Path) -> set[str]:
    return {
        str(path.relative_to(top))
        for folder in ("src", "tests", "man", "completions", ".ci", ".packaging")
        for path in (top / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and ".egg-info" not in str(path)
    }


@pytest.mark.real
def test_the_source_distribution_holds_everything(built: Path) -> None:
    with tarfile.open(built / "dist" / f"handctl-{__version__}.tar.gz") as archive:
        names = {name.partition("/")[2] for name in archive.getnames() if not archive.getmember(name).isdir()}
    assert names - {"PKG-INFO"} == sources(built) | {"pyproject.toml", "README.md"}


@pytest.mark.real
def test_the_wheel_brings_pages_and_completions(built: Path, tmp_path: Path) -> None:
    wheel = built / "dist" / f"handctl-{__version__}-py3-none-any.whl"
    names = zipfile.ZipFile(wheel).namelist()
    package = {name.removeprefix("src/") for name in sources(built) if name.startswith("src/")}
    assert {name for name in names if name.startswith("handctl/")} == package
    assert not [name for name in names if name.startswith(("tests/", "man/", "completions/"))]
    venv.create(tmp_path, with_pip=False)  # never the environment that the tests run in
    into = ["--python", str(tmp_path / "bin" / "python"), "install", "-q", "--no-deps", "--no-index", str(wheel)]
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    subprocess.run([sys.executable, "-m", "pip", *into], env=environment, check=True, capture_output=True)
    assert {place: sorted(path.name for path in (tmp_path / place).iterdir()) for place in SHARED} == SHARED
    assert (tmp_path / "share/zsh/site-functions/_handctl").read_bytes() == SCRIPTS["zsh"].read_bytes()
