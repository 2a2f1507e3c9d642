"""The user's folders: configuration, state, and what lasts until log-out. Small: every --fake loads it."""

from __future__ import annotations

import os
import sys

HINT = "set TEMP to a folder that you may write to" if sys.platform == "win32" else "set XDG_RUNTIME_DIR or TMPDIR to a directory that you may write to"  # fmt: skip
"""Where there is no private folder."""


CONFIG = ("XDG_CONFIG_HOME", "APPDATA", ".config")
"""$XDG_CONFIG_HOME, by default ~/.config; on Windows %APPDATA%."""
STATE = ("XDG_STATE_HOME", "LOCALAPPDATA", ".local", "state")
"""$XDG_STATE_HOME, by default ~/.local/state; on Windows %LOCALAPPDATA%: what this machine keeps for this user."""
DATA = ("XDG_DATA_HOME", "LOCALAPPDATA", ".local", "share")
"""$XDG_DATA_HOME, by default ~/.local/share; on Windows %LOCALAPPDATA%."""


def config_path() -> str:
    """The configuration file: HANDCTL_CONFIG, or handctl/config.toml in the user's configuration folder."""
    return os.environ.get("HANDCTL_CONFIG") or os.path.join(user_folder(CONFIG), "handctl", "config.toml")


def user_folder(of: tuple[str, ...]) -> str:
    """CONFIG, STATE or DATA of this user."""
    variable, on_windows, *below = of
    base = os.environ.get(variable, "")
    if sys.platform == "win32" and not os.path.isabs(base):
        base = os.environ.get(on_windows, "")
    if not os.path.isabs(base):  # so says the XDG specification
        base = os.path.join(os.path.expanduser("~"), *below)
    return base


def private_folders() -> list[str]:
    """Where what is this user's until log-out may lie, the best first; the second for a job without a login's environment."""
    if sys.platform == "win32":
        bases = (os.environ.get(name, "") for name in ("TEMP", "TMP", "LOCALAPPDATA"))
        return [os.path.join(base, "handctl") for base in dict.fromkeys(bases) if os.path.isabs(base)]
    user = os.getuid()
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    found = [os.path.join(runtime, "handctl")] if os.path.isabs(runtime) else [f"/run/user/{user}/handctl"]
    return [*found, os.path.join(os.environ.get("TMPDIR") or "/tmp", f"handctl-{user}")]  # noqa: S108 - made 0700, checked


def shared_folder() -> str:
    """Where each user of this machine may put a file that the others read. On POSIX no variable moves it."""
    return os.environ.get("PROGRAMDATA", "C:\\ProgramData") if sys.platform == "win32" else "/tmp"  # noqa: S108 - the owner is checked


def shared_file(name: str) -> str:
    """The file of this user there: `name` and whose it is."""
    if sys.platform == "win32":
        return os.path.join(shared_folder(), name + os.environ.get("USERNAME", ""))
    return os.path.join(shared_folder(), f"{name}{os.getuid()}")


def let_all_read(descriptor: int) -> None:
    """Let the other users read a file, whatever the umask. Raises OSError."""
    if sys.platform != "win32":
        os.fchmod(descriptor, 0o644)


def own_folder(folder: str, *, make: bool = False) -> bool:
    """Whether a folder is this user's, not to be trusted otherwise; with `make` a missing one is made. Raises OSError."""
    if make and not os.path.isdir(folder):
        os.mkdir(folder, 0o700)
    return own(os.stat(folder))


def own(found: os.stat_result) -> bool:
    """Whether a file is this user's; on Windows what lies in the user's own folders is."""
    return sys.platform == "win32" or found.st_uid == os.getuid()
