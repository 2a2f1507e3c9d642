"""Man pages, shell completions and the tables of README and guides, from the command tree and the parameter maps.

`python -m handctl.docgen` writes them into `man/`, `completions/`, README and guides; `handctl completion` prints the one of a shell.
`tree` reads the click commands into plain data, `man` and `bash`, `zsh`, `fish`, `powershell` write text from that. Only `tree`
knows click; nothing here talks to a device.
"""

from __future__ import annotations

from handctl.docgen.tree import Node, read_tree

SHELLS = ("bash", "zsh", "fish", "powershell")
COMPLETIONS = {
    "bash": "bash/handctl",
    "zsh": "zsh/_handctl",
    "fish": "fish/handctl.fish",
    "powershell": "powershell/handctl.ps1",
}
"""Where each completion lies under `completions/`; the file name is the one that the shell looks for."""


def completion(shell: str, tree: Node | None = None) -> str:
    """The completion script of one of SHELLS."""
    from handctl.docgen import bash, fish, powershell, zsh

    writers = {"bash": bash.script, "zsh": zsh.script, "fish": fish.script, "powershell": powershell.script}
    return writers[shell](tree or read_tree())


def generate() -> dict[str, str]:
    """Every generated file: path below the project -> text. A guide is one where it holds generated tables."""
    from handctl import guides
    from handctl.docgen.guides import page
    from handctl.docgen.library import stub
    from handctl.docgen.man import EDITION, pages
    from handctl.docgen.readme import filled

    tree = read_tree()
    files = {f"completions/{path}": completion(shell, tree) for shell, path in COMPLETIONS.items()}
    files |= {f"man/man1/{name}": text for name, text in pages(tree).items()}
    files["src/handctl/hands.pyi"] = stub()
    for name in guides.names():
        text = filled(guides.source(name), tree)
        files[f"src/handctl/guides/{name}.md"] = text
        files[f"man/man7/{guides.title(text)[0]}.7"] = page(text, EDITION)
    return files
