"""`handctl completion SHELL [--install]`: print the completion script of a shell, or install it for this user.

The script is generated at once, so that it fits this version also where no data files are installed.
"""

from __future__ import annotations

from pathlib import Path

import click

from handctl.command.command_tree import Command
from handctl.command.run import Run
from handctl.errors import OutputError, UsageError
from handctl.files import atomic_write, text_lines, writing
from handctl.model.result import Column, Table
from handctl.system.user_folders import CONFIG, DATA, user_folder

PLACES = {
    "bash": (DATA, "bash-completion/completions/handctl"),
    "zsh": (DATA, "zsh/site-functions/_handctl"),
    "fish": (CONFIG, "fish/completions/handctl.fish"),
    "powershell": (DATA, "handctl/handctl.ps1"),
}
"""Shell -> the folder of what the user has for it, and the user's own file below."""
SHELLS = tuple(PLACES)
"""Those that `docgen` writes for; a test compares."""


@click.command("completion", cls=Command, writes=True, offline=True)
@click.argument("shell", type=click.Choice(SHELLS))
@click.option("--install", is_flag=True, help="Install it in your own completion directory instead of printing it.")
def cli(run: Run, shell: str, install: bool) -> Table:
    """Print the completion of a shell, or install it for this user.

    TAB then works without starting handctl: commands, options, choices and the names of quantities are in the script.
    """
    from handctl.docgen.completion_scripts import SHELLS as WRITERS
    from handctl.docgen.read_command_tree import read_tree

    text = WRITERS[shell].script(read_tree())
    if not install:
        if run.settings.dry_run:
            raise UsageError("printing changes nothing", hint="run it without -n, or add --install")
        return Table(rows=[{"shell": shell, "script": text}], text=lambda _rows: text, columns=(Column("script"),))
    path = place(shell)
    done = _state(path, text)
    if run.settings.dry_run:
        run.journal.info("dry-run", "dry run: nothing was written")
    elif done != "unchanged":
        _write(path, text)
    run.journal.info("next", next_step(shell, path))
    columns = (Column("shell", "Shell"), Column("file", "File"), Column("result", "Result"))
    return Table(rows=[{"shell": shell, "file": str(path), "result": done}], columns=columns, plain=("file",))


def place(shell: str) -> Path:
    """The user's own file for this shell."""
    folder, below = PLACES[shell]
    return Path(user_folder(folder), below)


def next_step(shell: str, path: Path) -> str:
    """What the user has to do until TAB works."""
    return {
        "bash": f"open a new shell. If the package bash-completion is not installed, add this line to ~/.bashrc: `source {path}`",
        "zsh": f"add this line to ~/.zshrc: `fpath=({path.parent} $fpath); autoload -Uz compinit; compinit`",
        "fish": "open a new fish",
        "powershell": f"add this line to the file that `$PROFILE` names: `. '{path}'`",
    }[shell]


def _state(path: Path, text: str) -> str:
    """What installing does: "installed", "replaced" or "unchanged". Raises UsageError for a file that is not ours."""
    from handctl.docgen.completion_scripts import MARK

    try:
        present = path.read_text(encoding="utf-8", errors="replace")
    except (FileNotFoundError, NotADirectoryError):  # the write says what is in the way
        return "installed"
    except OSError as exc:
        raise OutputError(
            f"{path}: cannot be read: {exc.strerror or exc}", hint="check the file and its folder"
        ) from exc
    if present == text:
        return "unchanged"
    if not any(MARK in line for line in text_lines(present)[:3]):
        raise UsageError(
            f"{path} is not a completion that handctl generated",
            hint="move the file away, or print the script and install it yourself. The file was not changed.",
            code="foreign-file",
        )
    return "replaced"


def _write(path: Path, text: str) -> None:
    """Whole or not at all."""
    with writing(path, hint="print the script and install it yourself"):
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as file:
            file.write(text)
