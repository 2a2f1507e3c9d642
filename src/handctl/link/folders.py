"""Folders for what is a user's until log-out: locks, and what is kept of simulated devices. Small: every --fake loads it."""

from __future__ import annotations

import os


def private_folders() -> list[str]:
    """Where what is this user's until log-out may lie, the best first; the second for a job without a login's environment."""
    if os.name != "posix":
        return [os.path.join(os.environ["TEMP"], "handctl")] if "TEMP" in os.environ else []
    user = os.getuid()
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    found = [os.path.join(runtime, "handctl")] if os.path.isabs(runtime) else [f"/run/user/{user}/handctl"]
    return [*found, os.path.join(os.environ.get("TMPDIR") or "/tmp", f"handctl-{user}")]  # noqa: S108 - made 0700, checked


def own_folder(folder: str, *, make: bool = False) -> bool:
    """Whether a folder is this user's, not to be trusted otherwise; with `make` a missing one is made. Raises OSError."""
    if make and not os.path.isdir(folder):
        os.mkdir(folder, 0o700)
    return os.name != "posix" or os.stat(folder).st_uid == os.getuid()
