"""The state file of a simulated device: JSON, written atomically. Loaded only when a state file is used."""

from __future__ import annotations

import json
import os
import stat

from handctl.sim.engine.model import Model
from handctl.system import disk

FORMAT = "handctl-sim/1"
MOST = 4_000_000
"""Bytes of a state file: more than ten times the largest, that of a BarrettHand with its firmware."""


def load(path: str, device: Model) -> bool:
    """Puts the state into the device; False when there is no such file, ValueError when it cannot be used."""
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder):
        raise ValueError(f"state file {path}: there is no directory {folder}")
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # it could be without end, or never begin
            raise ValueError(f"state file {path} cannot be read: it is a folder, a device or a pipe")
        with open(path, "rb") as file:
            content = file.read(MOST + 1)
        if len(content) > MOST:
            raise ValueError(f"state file {path} cannot be read: larger than {MOST // 1_000_000} MB")
        text = content.decode("utf-8")
    except FileNotFoundError:
        return False
    except (OSError, UnicodeDecodeError) as exc:
        raise ValueError(f"state file {path} cannot be read: {exc}") from exc
    try:
        state = json.loads(text)
        if state["format"] != FORMAT or state["kind"] != device.KIND:
            raise ValueError(f"it is {state['format']!r} of {state['kind']!r}, expected {FORMAT!r} of {device.KIND!r}")
        device.restore(state)
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as exc:
        reason = f"{exc} is missing" if isinstance(exc, KeyError) else str(exc)
        raise ValueError(f"state file {path} is damaged or foreign ({reason}). Delete it to start over") from exc
    return True


def save(path: str, device: Model) -> None:
    """Whole or not at all: a temporary file beside it, synced, then renamed. A symbolic link stays one."""
    state = {"format": FORMAT, "kind": device.KIND, "simulated": True, **device.snapshot()}
    target = os.path.realpath(path)
    temporary = f"{target}.{os.getpid()}.tmp"
    try:
        with open(temporary, "w", encoding="utf-8", newline="\n") as file:
            file.write(json.dumps(state) + "\n")
            file.flush()
            disk.sync(file.fileno())
        os.replace(temporary, target)
    except BaseException as exc:
        if os.path.exists(temporary):
            os.unlink(temporary)
        if isinstance(exc, OSError):
            raise OSError(f"state file {path} cannot be written: {exc.strerror or exc}") from exc
        raise
