"""Who may import whom, who may touch the world, what the start of a command may load, and what keeps the house plain.

The rules are those of the house plan; what deviates stands in DEVIATIONS with its reason and is checked to be in use.
"""

from __future__ import annotations

import ast
import importlib
import re
import sys
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import click
import pytest

import handctl
from handctl.families import COMMANDS, FAMILIES
from handctl.sim import kinds
from tests.support import syntax
from tests.support.each_row import each_row
from tests.support.loading import back_ends, heavy, loaded, ours

ROOT = Path(handctl.__file__).parent
GROUND = (
    "",
    "number_parsing",
    "errors",
    "families",
    "files",
    "interrupts",
    "fast_classes",
    "misspellings",
    "wording",
    "system.*",
)
"""What any room may import: they know nothing of handctl, or each other at most."""
PURE = ("errors", "families", "fast_classes", "model.device_clock", "model.frame_decoder", "model.param", "@.pure")

RULES: list[tuple[str, tuple[str, ...]]] = [
    # room or module, what it may import of handctl (first pattern that fits; `@` is its own family, @.pure what is sans I/O there)
    ("number_parsing", ()),
    ("errors", ()),
    ("families", ("fast_classes",)),
    ("system*", ("system.*",)),
    ("interrupts", ("system.*",)),
    ("files", ("errors", "system.*")),
    ("misspellings", ()),
    ("wording", ("errors", "families")),
    (
        "cli",
        (
            *GROUND,
            "command.command_tree",
            "command.report_errors",
            "command.several_devices",
            "lazy_stdlib",
            "screen.sanitize",
        ),
    ),
    ("__main__", ("cli",)),
    ("model.device", (*GROUND, "link.deadman", "model.*")),
    ("model.sampling", (*GROUND, "link", "model.*")),
    ("model.stop_sequence", (*GROUND, "link", "model.*")),
    ("model*", (*GROUND, "model.*")),
    ("link.fake", ("number_parsing", "errors", "link.link_interface", "link.twin_values", "sim", "system.*")),
    ("link*", (*GROUND, "link*")),
    ("screen*", (*GROUND, "model.reading_limits", "model.command_settings", "model.result", "model.param", "screen.*")),
    (
        "stop*",
        (
            *GROUND,
            "command.terminal_prompts",
            "command.family",
            "command.options",
            "command.run",
            "link*",
            "model.*",
            "stop.*",
        ),
    ),
    ("command.terminal_prompts", (*GROUND, "model.prompts", "screen.sanitize")),
    ("record.exports", (*GROUND, "lazy_stdlib", "model.*", "record.*")),
    ("record*", (*GROUND, "model.*", "record.*")),
    (
        "command*",
        (
            *GROUND,
            "command.*",
            "link*",
            "model.*",
            "record.*",
            "report",
            "screen.*",
            "stop.*",
            "tools.doctor",
            "tools.listen",
            "tools.terminal",
        ),
    ),
    ("charts*", (*GROUND, "model.*", "charts.*")),
    (
        "report*",
        (
            *GROUND,
            "charts.*",
            "command.*",
            "link.link_interface",
            "link.transcript",
            "model.*",
            "report.*",
            "screen.render",
            "tools.port_inventory",
        ),
    ),
    ("api", (*GROUND, "command.*", "model.result", "model.command_settings")),
    ("hands", ("api", "families", "command.library_call", "model.result")),
    ("docgen.library_stub", ("api", "families")),
    (
        "docgen*",
        (
            *GROUND,
            "guides",
            "docgen*",
            "command.command_tree",
            "command.help_text",
            "command.family",
            "command.options",
            "model.param",
            "model.device_picture",
        ),
    ),
    ("guides", ()),
    ("newfamily*", ("newfamily",)),
    ("sim*", ("number_parsing", "sim*", "system.*")),
    ("devices.*page", (*GROUND, "charts.*", "model.result", "report.*", "@")),
    ("devices.*cli", (*GROUND, "command.*", "link", "model.*", "record.*", "stop.*", "@")),
    ("devices.*", (*GROUND[1:], "link", "link.deadman", "model.*", "record.*", "@")),
    ("tools.completion", (*GROUND, "docgen*", "command.*", "model.*")),
    ("tools.sim", ("families", "link.fake", "link.twin_values", "sim.cli")),
    ("tools.help", (*GROUND, "docgen*", "command.*", "guides", "model.*")),
    (
        "tools.*",
        (
            *GROUND,
            "guides",
            "command.*",
            "link*",
            "model.*",
            "record.csv_and_sidecar",
            "charts*",
            "report*",
            "screen.*",
            "stop.*",
            "tools*",
        ),
    ),
]

OUTSIDE: list[tuple[str, tuple[str, ...]]] = [
    # package that is not of the standard library, or of it but a door to the world: who may import it
    ("serial", ("link.serial", "tools.ports", "tools.doctor")),
    ("can", ("link.can", "link.slcan", "tools.ports", "tools.doctor")),
    ("rich", ("screen.*",)),
    (
        "click",
        (
            "cli",
            "api",
            "command.*",
            "devices.*cli",
            "tools.*",
            "sim.cli",
            "docgen.read_command_tree",
            "docgen.library_stub",
        ),
    ),
    ("crcmod", ("devices.*",)),
    ("bincopy", ("devices.barrett.*",)),
    ("pylsl", ("record.lsl",)),
    ("pyarrow", ("record.exports.parquet",)),
    ("mcap", ("record.exports.mcap",)),
    ("zstandard", ("record.exports.mcap",)),  # it comes with mcap
    ("packaging", ("build_zipapp",)),
    ("tomllib", ("command.config_file", "sim.bus.bus_file")),
    ("tomli", ("command.config_file", "sim.bus.bus_file")),
    ("socket", ("link.tcp", "record.marks", "sim.*", "system.*", "tools.port_inventory")),
    ("_socket", ("system.local_socket",)),
]


class Import(NamedTuple):
    """One import statement: who, whom, and whether it is for the type checker only."""

    module: str
    target: str
    types_only: bool


def dotted(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


def path_of(module: str) -> Path:
    path = ROOT.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


MODULES = {dotted(path): path for path in sorted(ROOT.rglob("*.py"))}


def tree_of(module: str) -> ast.Module:
    """Parsed when a test asks for it, not where this file is collected."""
    return syntax.tree_of(MODULES[module])


def statements(node: ast.AST, types_only: bool = False) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    for child in syntax.below(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, types_only
        elif isinstance(child, ast.If) and types_alone(child.test):
            yield from statements(ast.Module(child.body, []), True)
            yield from statements(ast.Module(child.orelse, []), types_only)
        else:
            yield from statements(child, types_only)


def types_alone(test: ast.expr) -> bool:
    return isinstance(test, ast.Name | ast.Attribute) and ast.unparse(test) in (
        "TYPE_CHECKING",
        "typing.TYPE_CHECKING",
    )


def imports_of(module: str) -> Iterator[Import]:
    for statement, types_only in statements(tree_of(module)):
        if isinstance(statement, ast.Import):
            for alias in statement.names:
                yield Import(module, alias.name, types_only)
            continue
        assert statement.level == 0, f"{module}: relative import"
        base = statement.module or ""
        for alias in statement.names:
            inner = f"{base}.{alias.name}".removeprefix("handctl.")
            yield Import(module, f"handctl.{inner}" if inner in MODULES else base, types_only)


TESTS = Path(__file__).parent.parent


@cache
def imports() -> tuple[Import, ...]:
    """All of the package."""
    return tuple(found for module in MODULES for found in imports_of(module))


@cache
def internal() -> tuple[Import, ...]:
    """Those of the package's own modules, by their names in it."""
    return tuple(
        found._replace(target=found.target.removeprefix("handctl").removeprefix("."))
        for found in imports()
        if found.target.split(".")[0] == "handctl"
    )


def family_of(module: str) -> str | None:
    parts = module.split(".")
    return ".".join(parts[:2]) if parts[0] == "devices" and len(parts) > 1 else None


def fits(found: Import, pattern: str) -> bool:
    """Whether a target fits a pattern; `@` stands for the importer's own family."""
    if not pattern.startswith("@"):
        return fnmatchcase(found.target, pattern)
    if family_of(found.module) is None or family_of(found.target) != family_of(found.module):
        return False
    return pattern == "@" or sans_io(found.target)


@cache
def sans_io(module: str) -> bool:
    """A map, or a module that says so of itself."""
    if module.rpartition(".")[2] in ("parameter_map", "register_map"):
        return True
    if module not in MODULES or "sans i/o" not in MODULES[module].read_text(encoding="utf-8").lower():
        return False
    return "sans i/o" in (ast.get_docstring(tree_of(module)) or "").lower()


def allowed(found: Import) -> bool:
    if family_of(found.module) and sans_io(found.module):
        return any(fits(found, target) for target in PURE)
    for pattern, targets in RULES:
        if fnmatchcase(found.module, pattern):
            return any(fits(found, target) for target in targets)
    return found.target == ""


# -- who imports whom -------------------------------------------------------------------------------------------------


def test_the_walk_sees_the_house() -> None:
    assert {
        "",
        "cli",
        "errors",
        "link",
        "link.serial",
        "devices.inspire.eb90",
        "sim",
        "sim.engine.line_and_faults",
    } <= MODULES.keys()
    assert Import("devices.inspire.eb90", "errors", False) in internal()
    assert Import("model.result", "errors", True) in internal()
    assert Import("link.fake", "sim", False) in internal()
    assert len(internal()) > 80


def test_who_imports_whom() -> None:
    wrong = [
        f"{found.module} imports {found.target}" for found in internal() if not found.types_only and not allowed(found)
    ]
    assert wrong == []


def test_every_family_has_a_codec_and_a_map() -> None:
    homes = {family_of(f"{row.package}.cli".removeprefix("handctl.")) for row in FAMILIES.values()}
    for home in homes:
        pure = {module.rpartition(".")[2] for module in without_io() if family_of(module) == home}
        assert pure & {"parameter_map", "register_map"} and len(pure) > 1, home


def circles(imports: list[Import]) -> list[str]:
    """Modules that import each other, and who imports those: all but who, by turns, imports nobody of the rest."""
    targets: dict[str, set[str]] = {module: set() for module in MODULES}
    for found in imports:
        targets[found.module].add(found.target)
    rest = set(targets)
    while free := {module for module in rest if not (targets[module] - {module}) & rest}:
        rest -= free
    return sorted(rest)


def test_nobody_imports_round_about() -> None:
    """At the top or within a function; of types nobody but the simulators must take care."""
    real = [found for found in internal() if not found.types_only]
    assert circles(real) == []
    assert circles([*real, Import("errors", "link", False)]) != []
    assert circles([found for found in internal() if found.module.startswith("sim")]) == []


def test_a_rule_can_be_broken() -> None:
    """The rules refuse what they should."""
    for module, target in [
        ("devices.inspire.eb90", "link"), ("devices.inspire.register_map", "devices.inspire.serial_bus"), ("errors", "model.result"),
        ("devices.inspire.serial_bus", "command.command_tree"), ("devices.inspire.exo.device", "devices.barrett.device"), ("link", "sim"),
        ("link.fake", "sim.barrett.device"), ("model.param", "command.run"), ("sim.ekso.device", "devices.ekso.frames"),
        ("command.get_set_watch", "devices.inspire.exo.device"), ("tools.scan", "devices.inspire.exo.scan"),
        ("command.command_tree", "devices.inspire.exo.cli"), ("screen.render", "command.command_tree"), ("link.can", "sim"),
        ("devices.barrett.gcl.codec", "link"), ("devices.barrett.device", "sim"), ("model.result", "link"),
        ("devices.inspire.can_frames", "link"), ("devices.inspire.can_frames", "devices.inspire.can_bus"),
        ("devices.barrett.realtime.blocks", "link"), ("sim.wrist.device", "devices.inspire.can_frames"),
    ]:  # fmt: skip
        assert not allowed(Import(module, target, False)), f"{module} -> {target}"
    for module, target in [
        ("devices.inspire.exo.device", "devices.inspire.serial_bus"), ("devices.inspire.exo.cli", "command.command_tree"),
        ("link.fake", "sim"), ("devices.inspire.can_frames", "devices.inspire.eb90"), ("cli", "command.command_tree"),
        ("devices.barrett.device", "devices.barrett.gcl.codec"), ("devices.barrett.gcl.codec", "errors"),
        ("devices.inspire.can_bus", "link"),
    ]:  # fmt: skip
        assert allowed(Import(module, target, False)), f"{module} -> {target}"


def test_no_family_imports_another_and_nobody_imports_a_family() -> None:
    """Not even for types; families are loaded by name."""
    for found in internal():
        family = family_of(found.target)
        assert family is None or family == family_of(found.module), f"{found.module} imports {found.target}"


def test_what_devices_share_knows_none_of_them() -> None:
    """The modules of a family's own folder know none of the rooms of one device: exo and wrist, GCL and RealTime have a face."""
    homes = {row.package.removeprefix("handctl.") for row in FAMILIES.values()}
    single = {home for home in homes if home.count(".") > 1}
    assert single == {"devices.inspire.exo", "devices.inspire.wrist", "devices.inspire.hand"}
    for found in internal():
        home = found.module.rpartition(".")[0]
        if any(device.startswith(f"{home}.") for device in single):
            assert not found.target.startswith(tuple(single)), found


def test_families_are_data_and_their_modules_exist() -> None:
    assert {found.target for found in imports_of("families")} <= {"__future__", "fast_classes", "handctl.fast_classes"}
    for name, (module, text) in COMMANDS.items():
        command = importlib.import_module(module).cli
        assert isinstance(command, click.Command), name
        assert command.name == name
        assert text
        assert not text.endswith(".")
    assert set(FAMILIES) <= set(COMMANDS)


def names_of_families(module: str) -> set[str]:
    """The families that a module names as a whole string, docstrings and sentences aside."""
    return {node.value for node in syntax.nodes_of_kind(MODULES[module], ast.Constant)} & set(FAMILIES)


@each_row("module", [name for name in MODULES if not name.startswith("devices.") and name != "families"])
def test_a_family_is_named_by_its_row_its_folder_and_its_simulator_only(module: str) -> None:
    """One more needs no change in what finds, names, opens, stops, simulates, documents and tells devices."""
    parts = module.split(".")
    own = {parts[1]} if parts[0] == "sim" and len(parts) > 1 else set()
    assert names_of_families(module) <= own


@each_row("module", [name for name in MODULES if name.startswith("devices.")])
def test_a_family_names_no_other(module: str) -> None:
    """What two devices of one maker share may name both."""
    folder = f"handctl.{family_of(module)}."
    assert names_of_families(module) <= {name for name, row in FAMILIES.items() if f"{row.package}.".startswith(folder)}


def test_a_simulator_has_the_name_of_its_family() -> None:
    """Without a word of the host: its folder is all that makes it known."""
    assert set(kinds()) == set(FAMILIES)


ROLES = {"cli": "cli", "probe": "probe", "stopper": "stop_steps", "explain_bytes": "explainer", "write_rules": "words"}


@each_row("name", FAMILIES)
def test_the_row_of_a_family_is_enough_to_find_its_roles(name: str) -> None:
    row = FAMILIES[name]
    for role, found in ROLES.items():
        assert callable(getattr(importlib.import_module(row.module(role)), found)), role
    assert importlib.import_module(row.codec).sign(b"") == ""
    assert importlib.import_module(row.module("cli")).cli.family.kind == name


def test_errors_import_nothing() -> None:
    assert [found.target for found in imports_of("errors")] == ["__future__"]


def test_no_import_is_relative_and_none_takes_all() -> None:
    for module in MODULES:
        tree = tree_of(module)
        for statement, _ in statements(tree):
            if isinstance(statement, ast.ImportFrom):
                assert statement.level == 0, module
                assert [alias.name for alias in statement.names] != ["*"], module


# -- who touches the world --------------------------------------------------------------------------------------------


@each_row(("package", "modules"), OUTSIDE)
def test_only_these_import(package: str, modules: tuple[str, ...]) -> None:
    users = {found.module for found in imports() if found.target.split(".")[0] == package and not found.types_only}
    assert [user for user in sorted(users) if not any(fnmatchcase(user, module) for module in modules)] == []


def test_nothing_else_is_imported() -> None:
    known = {"handctl", *sys.stdlib_module_names, *(package for package, _ in OUTSIDE)}
    assert {found.target.split(".")[0] for found in imports()} - known == set()


def test_simulators_use_the_standard_library_only() -> None:
    for found in imports():
        if found.module.split(".")[0] == "sim":
            first = found.target.split(".")[0]
            exception = (found.module, first) in (
                ("sim.cli", "click"),
                ("sim.bus.bus_file", "tomllib"),
                ("sim.bus.bus_file", "tomli"),
            )
            assert first in sys.stdlib_module_names or first == "handctl" or exception


WORLD = {
    "asyncio", "glob", "io", "multiprocessing", "os", "pathlib", "select", "selectors", "serial", "shutil", "signal",
    "socket", "subprocess", "sys", "tempfile", "termios", "threading", "time", "tty", "urllib", "can",
}  # fmt: skip


@cache
def without_io() -> tuple[str, ...]:
    return (*filter(sans_io, MODULES), "model.param", "model.result", "errors")


@each_row("module", without_io)
def test_codecs_and_maps_do_no_io(module: str) -> None:
    assert {found.target.split(".")[0] for found in imports_of(module)} & WORLD == set()
    assert calls_of(module, {"open", "print", "input", "exec", "eval", "__import__"}) == []


def calls_of(module: str, names: set[str]) -> list[str]:
    return [
        f"{module}:{node.lineno} {node.func.id}"
        for node in syntax.nodes_of_kind(MODULES[module], ast.Call)
        if isinstance(node.func, ast.Name) and node.func.id in names
    ]


OF_ONE_SYSTEM = {
    "ctypes", "fcntl", "grp", "msvcrt", "pty", "pwd", "readline", "resource", "signal", "syslog", "termios", "tty", "winreg",
    "_winapi",
}  # fmt: skip
"""Modules that not every system has, or that differ there."""
NOT_EVERYWHERE = {
    "os": {
        "chown", "fchmod", "fchown", "fork", "forkpty", "getegid", "geteuid", "getgid", "getgroups", "getpgid", "getpgrp",
        "getsid", "getuid", "kill", "killpg", "lchown", "linesep", "major", "minor", "mkfifo", "mknod", "name", "openpty",
        "pidfd_open", "pipe2", "posix_fadvise", "posix_spawn", "pread", "pwrite", "sendfile", "set_blocking", "setpgid",
        "setsid", "statvfs", "sync", "sysconf", "tcgetpgrp", "tcsetpgrp", "ttyname", "uname", "wait", "waitpid", "startfile",
        "fsync", "fdatasync", "O_ASYNC", "O_BINARY", "O_CLOEXEC", "O_DIRECTORY", "O_NOCTTY", "O_NOFOLLOW", "O_NOINHERIT",
        "O_NONBLOCK", "O_SYNC",
    },
    "sys": {"platform", "getwindowsversion"},
    "platform": {"system", "release", "uname", "win32_ver", "mac_ver", "libc_ver"},
    "select": {"poll", "epoll", "kqueue"},
    "socket": {"AF_UNIX", "AF_CAN", "fromfd"},
    "time": {"monotonic", "monotonic_ns", "perf_counter", "clock_gettime"},
}  # fmt: skip
"""Names of the others, and the clock, which differs too."""


def asks_for_the_system(tree: ast.AST, nodes: Iterable[ast.AST]) -> list[str]:
    """What of a module is for one system only, or asks which one it is."""
    found = [
        name
        for statement, _ in statements(tree)
        for name in (
            [alias.name for alias in statement.names] if isinstance(statement, ast.Import) else [statement.module]
        )
        if name is not None and name.split(".")[0] in OF_ONE_SYSTEM
    ]
    for node in nodes:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            asked, name = node.value.id, node.attr
        elif (
            isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("getattr", "hasattr") and len(node.args) > 1
        ):
            asked, name = ast.unparse(node.args[0]), getattr(node.args[1], "value", "")
        elif isinstance(node, ast.ImportFrom) and node.module in NOT_EVERYWHERE:
            found += [f"{node.module}.{a.name}" for a in node.names if a.name in NOT_EVERYWHERE[node.module]]
            continue
        else:
            continue
        if name in NOT_EVERYWHERE.get(asked, ()):
            found.append(f"{asked}.{name}")
    return sorted(found)


def test_only_one_room_knows_which_system_it_is() -> None:
    asks = (ast.Attribute, ast.Call, ast.ImportFrom)
    asking = {
        module
        for module, path in MODULES.items()
        if asks_for_the_system(tree_of(module), syntax.nodes_of_kind(path, *asks))
    }
    assert {module for module in asking if module.split(".")[0] != "system"} == {"build_zipapp"} & asking
    assert {"system.clock", "system.file_locks", "system.serial_ports", "system.signals"} <= asking


@each_row(
    "text",
    [
        "import sys\nif sys.platform == 'win32': pass", "import os\nos.name", "import fcntl", "from termios import tcgetattr",
        "import platform\nplatform.system()", "import os\nhasattr(os, 'fork')", "from sys import platform",
        "import time\ntime.monotonic()", "import os\ngetattr(os, 'O_BINARY', 0)", "def f():\n    import signal",
    ],
)  # fmt: skip
def test_what_asks_for_the_system_is_seen(text: str) -> None:
    tree = ast.parse(text)
    assert asks_for_the_system(tree, ast.walk(tree))


PRINTERS = ("command.terminal_prompts",)


def test_nobody_prints() -> None:
    """Commands return; only the renderer and the terminal's guide write."""
    quiet = [
        module
        for module in MODULES
        if module.split(".")[0] not in ("sim", "docgen", "build_zipapp", "cli") and module not in PRINTERS
    ]
    assert {module: found for module in quiet if (found := calls_of(module, {"print", "input"}))} == {}


def test_devices_never_look_at_a_clock_of_their_own() -> None:
    """The clock belongs to the link, so that tests run on virtual time."""
    for found in imports():
        if found.module.split(".")[0] == "devices":
            # A command may have a thread that waits for lines of stdin; devices have none.
            doors = ("time", "select", "socket") + (() if found.module.endswith("cli") else ("threading",))
            assert found.target.split(".")[0] not in doors, found


# -- what a start loads -----------------------------------------------------------------------------------------------


@pytest.mark.real
@each_row("option", ["--version", "-V"])
def test_version_loads_nothing(option: str) -> None:
    code, modules = loaded(option)
    assert code == 0
    assert ours(modules) == {"handctl", "handctl.cli"}
    assert "click" not in modules
    assert heavy(modules) == set()


@pytest.mark.real
def test_root_help_loads_click_and_data() -> None:
    code, modules = loaded("-h")
    assert code == 0
    assert "click" in modules
    assert heavy(modules) == set()
    assert not any(
        name.startswith(("handctl.devices", "handctl.sim", "handctl.link", "handctl.tools")) for name in modules
    )


@pytest.mark.real
def test_exo_help_loads_no_link_and_no_simulator() -> None:
    code, modules = loaded("exo", "-h")
    assert code == 0
    assert heavy(modules) == set()
    assert "socket" not in modules
    assert back_ends(modules) == set()
    assert not any(name.startswith(("handctl.sim", "handctl.tools")) for name in modules)
    assert all(name.startswith("handctl.devices.inspire") for name in modules if name.startswith("handctl.devices."))


@pytest.mark.real
def test_completion_of_the_root_loads_no_family(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_HANDCTL_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", "handctl e")
    monkeypatch.setenv("COMP_CWORD", "1")
    _, modules = loaded()
    assert heavy(modules) == set()
    assert not any(name.startswith(("handctl.devices.", "handctl.sim", "handctl.link")) for name in modules)


@pytest.mark.real
def test_describe_needs_no_device() -> None:
    code, modules = loaded("exo", "describe", "position_set", "--json")
    assert code == 0
    assert heavy(modules) == set()
    assert back_ends(modules) == set()
    assert not any(name.startswith("handctl.sim") for name in modules)


@pytest.mark.real
@each_row("output", ["--csv", "--format=table"])
def test_a_dump_from_the_simulator_loads_neither_rich_nor_pyserial(output: str) -> None:
    """A pipe is no terminal: rich stays away also from the table."""
    code, modules = loaded("exo", "dump", "--fake", output)
    assert code == 0
    assert heavy(modules) == set()
    assert "socket" not in modules
    simulators = {name for name in modules if name.startswith("handctl.sim.")}
    assert "handctl.sim.exo.device" in simulators
    assert not simulators & {
        f"handctl.sim.{name}" for name in ("serve", "cli", "wrist", "barrett", "ekso", "aidin", "slcan")
    }
    assert all(name.startswith("handctl.devices.inspire") for name in modules if name.startswith("handctl.devices."))


@pytest.mark.real
def test_a_serial_port_loads_pyserial_only() -> None:
    code, modules = loaded("exo", "dump", "-p", "/dev/ttyNOTHING0", "--json")
    assert code == 3
    assert {name.split(".")[0] for name in heavy(modules)} == {"serial"}
    assert "handctl.sim" not in modules


@pytest.mark.real
def test_tcp_loads_no_pyserial() -> None:
    code, modules = loaded("exo", "dump", "-p", "tcp://127.0.0.1:1", "--json")
    assert code == 3
    assert heavy(modules) == set()


def test_no_test_is_imported() -> None:
    """What tests share stands in a module of its own beside them, so that a test can change or go without another."""
    imported = re.compile(r"^ *(?:from +\S+ +)?import +(?:\([^)]*\)|[^(\n]+)", re.MULTILINE)
    taken = {
        f"{path.relative_to(TESTS)}: {statement}"
        for path in TESTS.rglob("*.py")
        for statement in imported.findall(path.read_text(encoding="utf-8"))
        if re.search(r"\btest_", statement)
        and path.parent.name != "search"  # suites run the helpers of short tests without a bound
    }
    assert not taken


# -- what keeps the house plain ---------------------------------------------------------------------------------------


KERNEL = {"", "command", "link", "model", "record", "stop"}
CIRCLES = {
    "screen.live_view", "screen.render", "devices.barrett.gcl.session_start", "devices.inspire.identity", "devices.inspire.duplicate_id",
    "devices.ekso.status", "devices.barrett.realtime.loop_rows",
    "devices.inspire.hand.device", "devices.inspire.id_baud_save_reset",
}  # fmt: skip
"""Without these no modules import each other, for types or otherwise. Only names may go from here."""


def test_no_circle_of_types() -> None:
    """The package itself names its interface, which is no part of the house."""
    left = set(MODULES) - CIRCLES - {""}
    targets = {
        module: {found.target for found in internal() if found.module == module} & left - {module} for module in left
    }
    assert {*TopologicalSorter(targets).static_order()} == left  # CycleError tells a circle


def passes_on(function: ast.FunctionDef) -> bool:
    """Whether it only calls another one with what it was given."""
    body = [one for one in function.body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))]
    call = getattr(body[0], "value", None) if len(body) == 1 else None
    given = [argument.arg for argument in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]
    return isinstance(call, ast.Call) and [*map(ast.unparse, call.args)] == given and not call.keywords


def test_no_function_only_passes_on() -> None:
    found = [
        f"{module}.{node.name}"
        for module in MODULES
        if module.split(".")[0] in KERNEL
        for node in tree_of(module).body
        if isinstance(node, ast.FunctionDef) and not node.decorator_list and passes_on(node)
    ]
    assert found == []


def test_who_passes_on_is_seen() -> None:
    (one,) = ast.parse("def f(a, b):\n    '''Doc.'''\n    return g(a, b)").body
    assert isinstance(one, ast.FunctionDef) and passes_on(one)
