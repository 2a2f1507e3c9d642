"""Real interactive shells in a pseudo-terminal with the committed completion loaded, and TAB pressed in them."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pexpect

from tests.support.places import PROJECT

SCRIPTS = {
    "bash": PROJECT / "completions" / "bash" / "handctl",
    "zsh": PROJECT / "completions" / "zsh" / "_handctl",
    "fish": PROJECT / "completions" / "fish" / "handctl.fish",
    "powershell": PROJECT / "completions" / "powershell" / "handctl.ps1",
}
PRESENT = [shell for shell in SCRIPTS if shutil.which(shell)]
PROMPT = "READY> "
ESCAPES = re.compile(r"\x1b(?:\[[0-9;?<>=]*[A-Za-z]|\][^\x07]*\x07|[()][A-Z0-9]|[=>])|[\x0e\x0f\r]")

BASH = r"""PS1='{prompt}'
for setting in 'bell-style none' 'show-all-if-ambiguous on' 'page-completions off' 'completion-query-items 0' \
    'enable-bracketed-paste off'; do bind "set $setting"; done
bind -x '"\C-xp": printf "\n[[%s]]\n" "$READLINE_LINE"'
source '{script}'
"""
ZSH = r"""PROMPT='{prompt}'
fpath=({directory} $fpath)
autoload -Uz compinit
compinit -u -d {home}/dump
setopt no_beep auto_list no_list_ambiguous
unset zle_bracketed_paste
LISTMAX=0
show() {{ print; print -r -- "[[$BUFFER]]"; zle reset-prompt }}
zle -N show
bindkey '^Xp' show
"""
FISH = r"""function fish_prompt; echo -n '{prompt}'; end
function fish_greeting; end
set -g fish_autosuggestion_enabled 0
source '{script}'
bind \cxp 'printf "\n[[%s]]\n" (commandline)'
"""


class Pressed(NamedTuple):
    """What TAB did: the line then, and the words listed below it."""

    line: str
    listed: tuple[str, ...]


class Terminal:
    """One interactive shell; `press` types a line and TAB. Close it."""

    def __init__(self, shell: str, home: Path, env: Mapping[str, str] | None = None, cwd: Path | None = None) -> None:
        self.shell = shell
        home.mkdir(parents=True, exist_ok=True)
        script = SCRIPTS[shell]
        if shell == "zsh":
            functions = home / "functions"
            functions.mkdir(exist_ok=True)
            shutil.copy(script, functions / "_handctl")
        start = {"bash": BASH, "zsh": ZSH, "fish": FISH}[shell].format(
            prompt=PROMPT, script=script, directory=home / "functions", home=home
        )
        (home / {"bash": ".bashrc", "zsh": ".zshrc", "fish": "start.fish"}[shell]).write_text(start)
        arguments = {
            "bash": ["--noprofile", "--rcfile", str(home / ".bashrc"), "-i"],
            "zsh": ["-i"],
            "fish": ["--no-config", "-i", "-C", f"source {home / 'start.fish'}"],
        }[shell]
        self.child = pexpect.spawn(
            shutil.which(shell) or shell,
            arguments,
            encoding="utf-8",
            dimensions=(80, 160),
            timeout=20,
            cwd=str(cwd or home),
            env={
                "PATH": os.environ["PATH"],
                "TERM": "dumb",
                "HOME": str(home),
                "ZDOTDIR": str(home),
                "LC_ALL": "C.UTF-8",
                **(env or {}),
            },
        )
        self.child.delaybeforesend = None
        self.child.expect_exact(PROMPT)

    def run(self, command: str) -> None:
        """Type a command and wait for the next prompt."""
        self.child.sendline(command)
        self.child.expect_exact(PROMPT)

    def press(self, line: str) -> Pressed:
        """Type `line` and TAB."""
        self.child.send(f"{line}\t\x18p")
        self.child.expect(r"\[\[([^\n]*)\]\]\r*\n")
        shown = ESCAPES.sub(" ", self.child.before)
        self.child.send("\x15")
        below = shown.split("\n", 1)[-1] if "\n" in shown else ""
        return Pressed(self.child.match[1], tuple(below.split()))

    def close(self) -> None:
        """End the shell."""
        self.child.close(force=True)
