"""The package for Debian: its lists against what is there. Built and proved it is by `.packaging/debian/build`."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from handctl.command.config_file import from_toml
from handctl.families import FAMILIES
from handctl.tools.port_inventory import CHIPS
from tests.support.each_row import each_row
from tests.support.places import PROJECT

sys.path.insert(0, str(PROJECT / ".packaging" / "windows"))
import onefile

DEBIAN = PROJECT / ".packaging/debian"
PLACES = [line.split() for line in (DEBIAN / "places").read_text(encoding="utf-8").splitlines() if line[:1] != "#"]


def test_every_manual_page_and_completion_has_its_place() -> None:
    """Where the wheel puts it; what zsh of Debian reads is elsewhere, and the rules move it there."""
    folders = {str(path.relative_to(PROJECT)) for top in ("man", "completions") for path in (PROJECT / top).iterdir()}
    wheel = from_toml((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]["targets"][
        "wheel"
    ]
    places = {folder: place for folder, place, *_ in PLACES}
    assert {folder for folder in folders if any((PROJECT / folder).iterdir())} == set(places)
    moved = {"usr/share/zsh/site-functions": "usr/share/zsh/vendor-completions"}
    assert places == {
        folder: moved.get(f"usr/{place}", f"usr/{place}")
        for folder, place in wheel["shared-data"].items()
        if (PROJECT / folder).is_dir()  # debhelper installs the udev rule
    }
    rules = (DEBIAN / "rules").read_text(encoding="utf-8")
    assert "\tmv $(share)/zsh/site-functions $(share)/zsh/vendor-completions\n" in rules


def test_the_udev_rule_knows_the_adapters_that_handctl_knows() -> None:
    text = (DEBIAN / "handctl.udev").read_text(encoding="utf-8")
    found = re.findall(
        r'^ATTRS\{idVendor\}=="(\w+)", ATTRS\{idProduct\}=="([\w|]+)", TAG\+="uaccess"$', text, re.MULTILINE
    )
    assert len(found) == text.count("TAG+=")
    listed = [(vendor, product) for vendor, products in found for product in products.split("|")]
    assert sorted(listed) == sorted(usb for usb, chip in CHIPS.items() if chip.serial)


def test_the_descriptions_name_every_family() -> None:
    control = " ".join((DEBIAN / "control").read_text(encoding="utf-8").partition("Description:")[2].split())
    exe = onefile.description()
    ast.parse(exe.strip(), mode="eval")
    for name, row in FAMILIES.items():
        assert row.help in exe
        for product in (name, *re.findall(r"\b\w*[A-Z]\w*", row.help.partition(" (")[0])):
            assert product.lower() in control.lower(), product


def test_the_metadata_names_no_person_and_no_place() -> None:
    project = from_toml((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    shared = project["tool"]["hatch"]["build"]["targets"]["wheel"]["shared-data"]
    assert shared[".packaging/debian/handctl.udev"] == "share/handctl/70-handctl.rules"
    assert not {"authors", "maintainers", "urls"} & set(project["project"])


def test_it_asks_for_the_python_of_the_project() -> None:
    project = from_toml((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    control = (DEBIAN / "control").read_text(encoding="utf-8")
    assert re.findall(r"^X-Python3-Version: >= (.*)$", control, re.MULTILINE) == [
        project["requires-python"].strip(">=")
    ]
    assert f"Description: {project['description'].partition(' from ')[0].lower()}\n" in control


@pytest.mark.real
@each_row(("user", "reason"), [("1000", "a chroot needs root"), ("0", "debootstrap is not installed")])
def test_without_its_tools_it_says_so(user: str, reason: str, tmp_path: Path) -> None:
    for name in ("bash", "dirname"):
        (tmp_path / name).symlink_to(str(shutil.which(name)))
    (tmp_path / "id").write_text(f"#!{shutil.which('bash')}\necho {user}\n")
    (tmp_path / "id").chmod(0o755)
    done = subprocess.run(
        [str(shutil.which("bash")), str(DEBIAN / "build")], env={**os.environ, "PATH": str(tmp_path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"debian: skipped, {reason}")
