"""What a run of handctl loads: its modules, and those that are too heavy for a start."""

from __future__ import annotations

import json
import subprocess
import sys

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


def back_ends(modules: set[str]) -> set[str]:
    """Modules of links of one kind; `link.link_interface` is what all of them are."""
    return {name for name in modules if name.startswith("handctl.link.")} - {"handctl.link.link_interface"}
