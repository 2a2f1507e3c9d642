"""README's lines of installation, as printed and in their order, in a copy of the project and an empty home."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from handctl import __version__
from tests.support.places import PROJECT, README

TEXT = re.sub(r"^```.*?^```$", "", README.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
LINES = re.findall(r"^    (\S.*)$", TEXT, re.MULTILINE)
OPTIONAL = ("pipx", "uv", "man")
"""Programs that this machine may lack."""


@pytest.mark.real
def test_the_lines_of_install_work_as_printed(tmp_path: Path) -> None:
    copy = tmp_path / "handctl"
    unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info", ".*cache", ".hypothesis", "tests")
    for name in ("src", "man", "completions"):
        shutil.copytree(PROJECT / name, copy / name, ignore=unwanted)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(PROJECT / name, copy / name)
    kept = [line for line in LINES if "pytest" not in line]
    assert len(LINES) == 8 and len(kept) == 7
    kept = [line for line in kept if line.split()[0] not in OPTIONAL or shutil.which(line.split()[0])]
    home = tmp_path / "home"
    home.mkdir()
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "HANDCTL_", "XDG_"))},
        "HOME": str(home),
    }
    done = subprocess.run(
        ["sh", "-e"], input="\n".join([*kept, "command -v handctl", "python3 handctl.pyz --version"]),
        cwd=copy, env=environment, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done
    assert done.stdout.splitlines()[-2:] == [str(copy / ".venv/bin/handctl"), f"handctl {__version__}"]
    assert list(home.rglob("bash-completion/completions/handctl"))
