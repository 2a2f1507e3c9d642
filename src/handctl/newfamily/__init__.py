"""A new device family, as files that run: a codec, a map, a device, its commands, a simulator, a guide, a transcript, its facts.

`plan` makes the texts of all of them from the templates beside this file, `carry_out` writes them into a source tree: all,
or none. The protocol is an example, to be replaced line by line with what a manual says. Imports nothing of handctl.
"""

from __future__ import annotations

import keyword
import re
from importlib import resources
from pathlib import Path

PLACES = {
    "device": "src/handctl/devices/{name}/{file}",
    "sim": "src/handctl/sim/{name}/{file}",
    "guide": "src/handctl/guides/{name}.md",
    "tests/facts.py": "tests/contract/facts/{name}.py",
    "tests/outcomes.py": "tests/contract/facts/outcomes/{name}.py",
    "tests/transcript": "tests/transcripts/{name}-lines.txt",
}
"""Template, or folder of templates -> where it goes in the tree."""
REGISTRY = "src/handctl/families.py"
LAST_ROW = '}\n"""Command name -> its row'
ROW = """    "{{name}}": FamilyRow("{{Name}} (serial)", "handctl.devices.{{name}}", codec="handctl.devices.{{name}}.codec"),
"""


class Refused(Exception):
    """Why nothing was written."""


def plan(top: Path, name: str) -> dict[Path, str]:
    """File -> text of a family called `name` in the source tree `top`. Raises Refused; writes nothing."""
    if not re.fullmatch(r"[a-z][a-z0-9]*", name) or keyword.iskeyword(name):
        raise Refused(f"{name}: a family is called by small letters and digits, such as gripper")
    registry = top / REGISTRY
    if not registry.is_file() or LAST_ROW not in (table := registry.read_text(encoding="utf-8")):
        raise Refused(f"{top}: no source tree of handctl; start this in the folder that has {REGISTRY}")
    files = {top / path: filled(text, name) for path, text in _templates(name)}
    taken = [path for path in files if path.exists()] + [path.parent for path in files if (path.parent / name).exists()]
    if taken or re.search(rf'^ +"{name}": ', table, re.MULTILINE):
        raise Refused(f"{name} exists: {', '.join(map(str, dict.fromkeys(taken))) or REGISTRY}")
    return {**files, registry: table.replace(LAST_ROW, filled(ROW, name) + LAST_ROW, 1)}


def _templates(name: str) -> list[tuple[str, str]]:
    """Path in the tree, and text."""
    folder = resources.files(__name__).joinpath("templates")
    found = []
    for place, path in PLACES.items():
        source = folder.joinpath(place)
        files = source.iterdir() if source.is_dir() else [folder.joinpath(f"{place}.txt")]
        named = [(path.format(name=name, file=file.name.removesuffix(".txt")), file) for file in files]
        found += [(target, file.read_text(encoding="utf-8")) for target, file in named]
    return sorted(found)


def filled(text: str, name: str) -> str:
    """A template with this name in its places."""
    for key, word in (("name", name), ("Name", name.capitalize()), ("NAME", name.upper())):
        text = text.replace(f"{{{{{key}}}}}", word)
    return text


def carry_out(files: dict[Path, str]) -> None:
    """Write all of them; where one cannot be written, none is left. Raises OSError."""
    before = {path: path.read_text(encoding="utf-8") for path in files if path.exists()}
    made: list[Path] = []
    try:
        for path, text in files.items():
            for folder in reversed([one for one in path.parents if not one.exists()]):
                folder.mkdir()
                made.append(folder)
            made.append(path)
            path.write_text(text, encoding="utf-8")
    except BaseException:
        undo(made, before)
        raise


def undo(made: list[Path], before: dict[Path, str]) -> None:
    """Take back what was made, and put back what was there before."""
    for path in reversed(made):
        if path in before:
            path.write_text(before[path], encoding="utf-8")
        elif path.is_dir():
            path.rmdir()
        else:
            path.unlink(missing_ok=True)
