"""`python -m handctl.docgen [DIRECTORY]`: write `completions/`, `man/` and README's tables there, by default here."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from handctl import guides
from handctl.docgen.completion_scripts import SHELLS
from handctl.docgen.guide_tables import filled
from handctl.docgen.library_stub import stub
from handctl.docgen.man_pages import guide, pages
from handctl.docgen.read_command_tree import read_tree


def generate() -> dict[str, str]:
    """Every generated file: path below the project -> text. A guide is one where it holds generated tables."""
    tree = read_tree()
    files = {f"completions/{shell.path}": shell.script(tree) for shell in SHELLS.values()}
    files |= {f"man/man1/{name}": text for name, text in pages(tree).items()}
    files["src/handctl/hands.pyi"] = stub()
    for name in guides.names():
        text = filled(guides.source(name), tree)
        files[f"src/handctl/guides/{name}.md"] = text
        files[f"man/man7/{guides.title(text)[0]}.7"] = guide(text)
    return files


def main(argv: Sequence[str]) -> int:
    """Write changed files and remove man pages of commands that no longer exist; print each."""
    if len(argv) > 1 or any(word.startswith("-") for word in argv):
        sys.stderr.write("usage: python -m handctl.docgen [DIRECTORY]\n")
        return 2
    top = Path(argv[0] if argv else ".")
    files = generate()
    readme = top / "README.md"
    if readme.is_file():
        files["README.md"] = filled(readme.read_text(encoding="utf-8"), read_tree())
    for name, text in files.items():
        path = top / name
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        sys.stdout.write(f"wrote {path}\n")
    for path in sorted(top.glob("man/**/handctl*.[17]")):
        if path.relative_to(top).as_posix() not in files:
            path.unlink()
            sys.stdout.write(f"removed {path}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
