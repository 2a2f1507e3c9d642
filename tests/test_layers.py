"""Who may import whom, who may touch the world, and what the start of a command may load.

The rules are those of the house plan; what deviates stands in DEVIATIONS with its reason and is checked to be in use.
"""

from __future__ import annotations

import ast
import importlib
import json
import subprocess
import sys
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

import click
import pytest

import handctl
from handctl.families import COMMANDS, FAMILIES

ROOT = Path(handctl.__file__).parent
CODECS = ("eb90", "canreg", "language", "realtime", "download", "frames", "messages")
MAPS = ("registers", "parameters", "fields", "kinematics")
KERNEL = (
    *(
        "errors",
        "families",
        "family",
        "files",
        "foreign",
        "gate",
        "guide",
        "latency",
        "ledger",
        "param",
        "piece",
        "result",
        "render",
        "terminal",
        "live",
    ),
    *("sampling", "snapshot", "stopping", "holding", "stopkey", "emergency", "stored", "verbs"),
    *("config", "options", "console", "premises", "cause", "envelope", "run", "clikit", "mapverbs"),
    *("report", "report.facts", "report.html", "report.private", "report.svg", "report.transcript"),
)

RULES: list[tuple[str, tuple[str, ...]]] = [
    # module, what it may import of handctl (first pattern that fits; `@` is its own family)
    ("errors", ()),
    ("families", ()),
    ("family", ("errors",)),
    ("files", ("errors",)),
    ("filter", ()),
    ("filetypes", ("errors", "files")),
    ("streams", ("filter",)),
    ("guide", ()),
    ("ending", ()),
    ("ledger", ()),
    ("result", ("ledger",)),
    ("latency", ()),
    ("piece", ()),
    ("param", ("errors",)),
    ("link.fake", ("errors", "link", "sim")),
    ("link.tracefile", ("ending", "errors", "files")),
    ("link*", ("errors", "files", "link*")),
    ("render", ("ending", "files", "filter", "options", "result", "streams")),
    ("terminal", ("result",)),
    ("live", ("result", "terminal")),
    ("snapshot", ("", "errors", "files")),
    ("sampling", ("errors", "link", "result")),
    ("stopping", ("errors", "families", "link", "options", "param")),
    ("holding", ("errors", "link", "link.ear", "link.lock", "run", "stopkey", "stopping")),
    ("stopkey", ("console", "holding")),
    (
        "emergency",
        ("", "errors", "holding", "link", "link.ear", "link.lock", "options", "param", "result", "run", "stopping"),
    ),
    ("verbs", ("errors", "param", "result", "run", "sampling")),
    ("stored", ("errors", "param", "result", "run", "snapshot", "verbs")),
    ("foreign", ("errors", "families")),
    ("gate", ("errors", "link", "result")),
    ("config", ("errors", "families", "files")),
    ("options", ("config", "errors", "filetypes")),
    ("console", ("ending", "filter", "guide")),
    ("premises", ("errors", "family", "files", "filetypes", "link", "options", "run")),
    ("cause", ("errors", "foreign", "run")),
    ("envelope", ("", "errors", "result", "run")),
    (
        "run",
        (
            "",
            "cause",
            "console",
            "envelope",
            "premises",
            "ending",
            "errors",
            "families",
            "family",
            "files",
            "filetypes",
            "filter",
            "holding",
            "ledger",
            "foreign",
            "link",
            "link.lock",
            "link.tap",
            "link.tracefile",
            "options",
            "param",
            "piece",
            "render",
            "result",
        ),
    ),
    (
        "mapverbs",
        ("", "clikit", "emergency", "filetypes", "options", "param", "report", "result", "run", "stored", "verbs"),
    ),
    ("report", ("", "errors", "files", "link.tap", "param", "render", "report.*", "result", "run", "verbs")),
    ("report.facts", ("tools.machine",)),
    ("report.html", ("errors", "report.svg", "result")),
    ("report.private", ("param", "result")),
    ("report.svg", ("result",)),
    ("report.transcript", ("families", "family", "link.tap", "piece", "report.private")),
    ("clikit", ("", "console", "envelope", "errors", "families", "family", "options", "run", "streams")),
    ("cli", ("", "clikit", "ending", "errors", "streams")),
    ("__main__", ("cli",)),
    ("docgen.tree", ("clikit", "families", "options", "param")),
    ("docgen.man", ("", "docgen*", "errors", "families", "param")),
    ("docgen*", ("docgen*", "families", "param")),
    ("sim*", ("sim*",)),
    *((f"devices.*.{name}", ("errors", "@.codec")) for name in CODECS),
    *((f"devices.*.{name}", ("errors", "param", "@.map")) for name in MAPS),
    (
        "devices.*cli",
        (
            "",
            "clikit",
            "family",
            "files",
            "filetypes",
            "gate",
            "mapverbs",
            "run",
            "options",
            "stored",
            "verbs",
            "emergency",
            "stopping",
            "errors",
            "param",
            "result",
            "guide",
            "link",
            "@",
        ),
    ),
    (
        "devices.*",
        (
            "errors",
            "files",
            "foreign",
            "gate",
            "guide",
            "latency",
            "ledger",
            "link",
            "link.deadman",
            "param",
            "piece",
            "result",
            "sampling",
            "stopping",
            "@",
        ),
    ),
    ("tools.completion", ("docgen*", "clikit", "errors", "files", "result", "run")),
    ("tools.*", ("", "filetypes", *KERNEL, "link*", "tools*")),
]

DEVIATIONS: dict[tuple[str, str], str] = {
    ("render", "errors"): "an unwritable output and an interrupt are errors with exit codes of their own",
    ("terminal", "errors"): "the same: a terminal that cannot be written to",
    ("render", "terminal"): "rich is used for a terminal only, so its module is imported where one is found",
    ("render", "live"): "the live view is drawn by the module that knows rich, imported on use",
}

OUTSIDE: list[tuple[str, tuple[str, ...]]] = [
    # package that is not of the standard library, or of it but a door to the world: who may import it
    ("serial", ("link.serial", "tools.ports", "tools.doctor")),
    ("can", ("link.can", "tools.ports", "tools.doctor")),
    ("rich", ("render", "terminal", "live")),
    (
        "click",
        (
            "clikit",
            "filetypes",
            "mapverbs",
            "options",
            "run",
            "cli",
            "devices.*cli",
            "tools.*",
            "sim.cli",
            "docgen.tree",
        ),
    ),
    ("crcmod", tuple(f"devices.*.{name}" for name in CODECS)),
    ("bincopy", ("devices.barrett.*",)),
    ("packaging", ("build_zipapp",)),
    ("socket", ("link.tcp", "sim.*", "tools.doctor")),
    ("_socket", ("link.ear",)),
]


class Import(NamedTuple):
    """One import statement: who, whom, and whether it is for the type checker only."""

    module: str
    target: str
    types_only: bool


def dotted(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


TREES = {dotted(path): ast.parse(path.read_text(encoding="utf-8"), str(path)) for path in sorted(ROOT.rglob("*.py"))}


def statements(node: ast.AST, types_only: bool = False) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, types_only
        elif isinstance(child, ast.If) and ast.unparse(child.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING"):
            for inner in child.body:
                yield from statements(ast.Module([inner], []), True)
            for inner in child.orelse:
                yield from statements(ast.Module([inner], []), types_only)
        else:
            yield from statements(child, types_only)


def imports_of(module: str) -> Iterator[Import]:
    for statement, types_only in statements(TREES[module]):
        if isinstance(statement, ast.Import):
            for alias in statement.names:
                yield Import(module, alias.name, types_only)
            continue
        assert statement.level == 0, f"{module}: relative import"
        base = statement.module or ""
        for alias in statement.names:
            inner = f"{base}.{alias.name}".removeprefix("handctl.")
            yield Import(module, f"handctl.{inner}" if inner in TREES else base, types_only)


IMPORTS = [found for module in TREES for found in imports_of(module)]
OURS = [
    found._replace(target=found.target.removeprefix("handctl").removeprefix("."))
    for found in IMPORTS
    if found.target.split(".")[0] == "handctl"
]


def family_of(module: str) -> str | None:
    parts = module.split(".")
    return ".".join(parts[:2]) if parts[0] == "devices" and len(parts) > 1 else None


def fits(found: Import, pattern: str) -> bool:
    """Whether a target fits a pattern; `@` stands for the importer's own family."""
    if not pattern.startswith("@"):
        return fnmatch(found.target, pattern)
    if family_of(found.module) is None or family_of(found.target) != family_of(found.module):
        return False
    name = found.target.rpartition(".")[2]
    return {"@": True, "@.codec": name in CODECS, "@.map": name in MAPS}[pattern]


def allowed(found: Import) -> bool:
    for pattern, targets in RULES:
        if fnmatch(found.module, pattern):
            return any(fits(found, target) for target in targets)
    return found.target == ""


# -- who imports whom -------------------------------------------------------------------------------------------------


def test_the_walk_sees_the_house() -> None:
    assert {"", "cli", "errors", "link", "link.serial", "devices.inspire.eb90", "sim", "sim.exo"} <= TREES.keys()
    assert Import("devices.inspire.eb90", "errors", False) in OURS
    assert Import("result", "errors", True) in OURS
    assert Import("link.fake", "sim", False) in OURS
    assert len(OURS) > 80


def test_who_imports_whom() -> None:
    wrong = [
        f"{found.module} imports {found.target}"
        for found in OURS
        if not found.types_only and not allowed(found) and (found.module, found.target) not in DEVIATIONS
    ]
    assert wrong == []


def test_deviations_are_few_and_in_use() -> None:
    assert len(DEVIATIONS) <= 6
    for (module, target), reason in DEVIATIONS.items():
        assert any((found.module, found.target) == (module, target) for found in OURS), (
            f"{module} -> {target}: {reason}"
        )


def test_a_rule_can_be_broken() -> None:
    """The rules refuse what they should."""
    for module, target in [
        ("devices.inspire.eb90", "link"), ("devices.inspire.registers", "devices.inspire.eb90"), ("errors", "result"),
        ("devices.inspire.bus", "clikit"), ("devices.inspire.exo", "devices.barrett.hand"), ("link", "sim"),
        ("link.fake", "sim.exo"), ("param", "result"), ("sim.exo", "devices.inspire.eb90"), ("verbs", "devices.inspire.exo"),
        ("tools.scan", "devices.inspire.exo_scan"), ("clikit", "devices.inspire.exo_cli"), ("render", "clikit"),
        ("devices.barrett.language", "link"), ("devices.barrett.hand", "sim"), ("sim.barrett", "devices.barrett.language"),
    ]:  # fmt: skip
        assert not allowed(Import(module, target, False)), f"{module} -> {target}"
    for module, target in [
        ("devices.inspire.exo", "devices.inspire.bus"), ("devices.inspire.exo_cli", "clikit"), ("link.fake", "sim"),
        ("devices.inspire.canreg", "devices.inspire.eb90"), ("cli", "clikit"),
        ("devices.barrett.hand", "devices.barrett.language"), ("devices.barrett.language", "errors"),
    ]:  # fmt: skip
        assert allowed(Import(module, target, False)), f"{module} -> {target}"


def test_no_family_imports_another_and_nobody_imports_a_family() -> None:
    """Not even for types; families are loaded by name."""
    for found in OURS:
        family = family_of(found.target)
        assert family is None or family == family_of(found.module), f"{found.module} imports {found.target}"


def test_families_are_data_and_their_modules_exist() -> None:
    assert list(imports_of("families")) in ([], [Import("families", "__future__", False)])
    for name, (module, text) in COMMANDS.items():
        command = importlib.import_module(module).cli
        assert isinstance(command, click.Command), name
        assert command.name == name
        assert text
        assert not text.endswith(".")
    assert set(FAMILIES) <= set(COMMANDS)


def test_errors_import_nothing() -> None:
    assert [found.target for found in imports_of("errors")] == ["__future__"]


def test_no_import_is_relative_and_none_takes_all() -> None:
    for module, tree in TREES.items():
        for statement, _ in statements(tree):
            if isinstance(statement, ast.ImportFrom):
                assert statement.level == 0, module
                assert [alias.name for alias in statement.names] != ["*"], module


# -- who touches the world --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("package", "modules"), OUTSIDE, ids=[package for package, _ in OUTSIDE])
def test_only_these_import(package: str, modules: tuple[str, ...]) -> None:
    users = {found.module for found in IMPORTS if found.target.split(".")[0] == package and not found.types_only}
    assert [user for user in sorted(users) if not any(fnmatch(user, module) for module in modules)] == []


def test_nothing_else_is_imported() -> None:
    known = {"handctl", *sys.stdlib_module_names, *(package for package, _ in OUTSIDE)}
    assert {found.target.split(".")[0] for found in IMPORTS} - known == set()


def test_simulators_use_the_standard_library_only() -> None:
    for found in IMPORTS:
        if found.module.split(".")[0] == "sim":
            first = found.target.split(".")[0]
            assert (
                first in sys.stdlib_module_names or first == "handctl" or (found.module, first) == ("sim.cli", "click")
            )


WORLD = {
    "asyncio", "glob", "io", "multiprocessing", "os", "pathlib", "select", "selectors", "serial", "shutil", "signal",
    "socket", "subprocess", "sys", "tempfile", "termios", "threading", "time", "tty", "urllib", "can",
}  # fmt: skip
SANS_IO = [module for module in TREES if module.rpartition(".")[2] in (*CODECS, *MAPS, "param", "result", "errors")]


@pytest.mark.parametrize("module", SANS_IO)
def test_codecs_and_maps_do_no_io(module: str) -> None:
    assert {found.target.split(".")[0] for found in imports_of(module)} & WORLD == set()
    assert calls_of(module, {"open", "print", "input", "exec", "eval", "__import__"}) == []


def calls_of(module: str, names: set[str]) -> list[str]:
    return [
        f"{module}:{node.lineno} {node.func.id}"
        for node in ast.walk(TREES[module])
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in names
    ]


def test_nobody_prints() -> None:
    """Commands return; only the renderer and the terminal's guide write."""
    quiet = [module for module in TREES if module.split(".")[0] in ("devices", "link", *KERNEL)]
    assert {module: found for module in quiet if (found := calls_of(module, {"print", "input"}))} == {}


def test_devices_never_look_at_a_clock_of_their_own() -> None:
    """The clock belongs to the link, so that tests run on virtual time."""
    for found in IMPORTS:
        if found.module.split(".")[0] == "devices":
            # A command may have a thread that waits for lines of stdin; devices have none.
            doors = ("time", "select", "socket") + (() if found.module.endswith("cli") else ("threading",))
            assert found.target.split(".")[0] not in doors, found


# -- what a start loads -----------------------------------------------------------------------------------------------

PROGRAM = """
import json, sys
from handctl.cli import main
try:
    code = main(sys.argv[1:])
except SystemExit as exc:
    code = exc.code
sys.stderr.write("\\n" + json.dumps([code, sorted(sys.modules)]))
"""
HEAVY = {
    "rich",
    "serial",
    "can",
    "crcmod",
    "bincopy",
    "jsonschema",
    "asyncio",
    "multiprocessing",
    "logging",
    "ssl",
    "yaml",
}


def loaded(*args: str) -> tuple[int, set[str]]:
    """Exit code, and the modules that a run of handctl has loaded."""
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM, *args], capture_output=True, text=True, timeout=30, check=False
    )
    code, modules = json.loads(process.stderr.rpartition("\n")[2])
    return code, set(modules)


def ours(modules: set[str]) -> set[str]:
    return {module for module in modules if module.split(".")[0] == "handctl"}


def heavy(modules: set[str]) -> set[str]:
    return {module for module in modules if module.split(".")[0] in HEAVY}


@pytest.mark.parametrize("option", ["--version", "-V"])
def test_version_loads_nothing(option: str) -> None:
    code, modules = loaded(option)
    assert code == 0
    assert ours(modules) == {"handctl", "handctl.cli"}
    assert "click" not in modules
    assert heavy(modules) == set()


def test_root_help_loads_click_and_data() -> None:
    code, modules = loaded("-h")
    assert code == 0
    assert "click" in modules
    assert heavy(modules) == set()
    assert not any(
        name.startswith(("handctl.devices", "handctl.sim", "handctl.link", "handctl.tools")) for name in modules
    )


def test_exo_help_loads_no_link_and_no_simulator() -> None:
    code, modules = loaded("exo", "-h")
    assert code == 0
    assert heavy(modules) == set()
    assert "socket" not in modules
    assert not any(name.startswith(("handctl.sim", "handctl.link.", "handctl.tools")) for name in modules)
    assert all(name.startswith("handctl.devices.inspire") for name in modules if name.startswith("handctl.devices."))


def test_completion_of_the_root_loads_no_family(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_HANDCTL_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", "handctl e")
    monkeypatch.setenv("COMP_CWORD", "1")
    _, modules = loaded()
    assert heavy(modules) == set()
    assert not any(name.startswith(("handctl.devices.", "handctl.sim", "handctl.link")) for name in modules)


def test_describe_needs_no_device() -> None:
    code, modules = loaded("exo", "describe", "position_set", "--json")
    assert code == 0
    assert heavy(modules) == set()
    assert not any(name.startswith(("handctl.sim", "handctl.link.")) for name in modules)


@pytest.mark.parametrize("output", ["--json", "--csv", "--format=plain", "--format=table"])
def test_a_dump_from_the_simulator_loads_neither_rich_nor_pyserial(output: str) -> None:
    """A pipe is no terminal: rich stays away also from the table."""
    code, modules = loaded("exo", "dump", "--fake", output)
    assert code == 0
    assert heavy(modules) == set()
    assert "socket" not in modules
    simulators = {name for name in modules if name.startswith("handctl.sim.")}
    assert "handctl.sim.exo" in simulators
    assert not simulators & {
        f"handctl.sim.{name}" for name in ("serve", "cli", "wrist", "barrett", "ekso", "aidin", "slcan")
    }
    assert all(name.startswith("handctl.devices.inspire") for name in modules if name.startswith("handctl.devices."))


def test_a_serial_port_loads_pyserial_only() -> None:
    code, modules = loaded("exo", "dump", "-p", "/dev/ttyNOTHING0", "--json")
    assert code == 3
    assert {name.split(".")[0] for name in heavy(modules)} == {"serial"}
    assert "handctl.sim" not in modules


def test_tcp_loads_no_pyserial() -> None:
    code, modules = loaded("exo", "dump", "-p", "tcp://127.0.0.1:1", "--json")
    assert code == 3
    assert heavy(modules) == set()
