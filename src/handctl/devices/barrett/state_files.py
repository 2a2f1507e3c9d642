"""Small JSON files about hands in the user's state folder: last baud rate, EEPROM saves, greasing, a download that was cut off.

A hand keeps no record of its care; the host does, per serial number. And the speed at which each port's hand was found
last: it saves the search, and nothing depends on it: a file that cannot be read or written is as good as none.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from handctl import files
from handctl.devices.barrett.parameter_map import SPEEDS
from handctl.errors import OutputError, UsageError
from handctl.link import ByteLink

if TYPE_CHECKING:
    from pathlib import Path

MOST_BYTES = 4_000_000
NAME = "barrett-speeds.json"
DOWNLOADS = "barrett-downloads.json"
MOST = 64
"""Ports that are remembered, the latest last."""


def load(path: Path, what: str, valid: Callable[[object], bool]) -> dict[str, Any]:
    """The object in `path`; empty when there is no file. Raises UsageError when an entry is not `valid`."""
    hint = "move the file away to start a new one"
    try:
        content = json.loads(files.read_text(path, f"the {what}", MOST_BYTES, hint=hint))
    except files.NoFile:
        return {}
    except (ValueError, RecursionError) as exc:
        raise UsageError(f"{path}: the {what} cannot be read: {exc}", hint=hint) from exc
    if not isinstance(content, dict) or not all(valid(entry) for entry in content.values()):
        raise UsageError(f"{path}: not the file of the {what}", hint=hint)
    return content


def store(path: Path, what: str, content: dict[str, Any], *, sort: bool = True) -> None:
    """Write `content`, whole or not at all. Raises OutputError."""
    with files.writing(path, f"the {what} ", hint="check the folder's permissions and its free space"):
        path.parent.mkdir(parents=True, exist_ok=True)
        with files.atomic_write(path) as file:
            json.dump(content, file, indent=1, sort_keys=sort)


def recall(link: ByteLink) -> int | None:
    """The last known speed of the hand on this link, None when there is none, or none that a hand has."""
    return speed_of(link.name) if _counts(link) else None


def speed_of(name: str) -> int | None:
    """The same of a LINK that need not be open."""
    speed = _speeds().get(name)
    return speed if speed in SPEEDS else None


def remember(link: ByteLink) -> None:
    """This link's present speed is the hand's; 9600, which is tried first anyway, is forgotten."""
    if not _counts(link):
        return
    known = _speeds()
    before = known.pop(link.name, None)
    if before == (None if link.baud == SPEEDS[0] else link.baud):
        return
    if link.baud != SPEEDS[0]:
        known[link.name] = link.baud
    with suppress(OutputError):  # the next connect looks again
        store(files.state_path(NAME), "baud rates", dict(list(known.items())[-MOST:]), sort=False)


def note_download(link: ByteLink) -> None:
    """A download into the hand on this link has begun: until it is over its firmware is incomplete, whatever becomes of this process."""
    if _lasts(link):
        _keep_download(link.name, {"told": False})


def forget_download(link: ByteLink) -> None:
    """A whole download into the hand on this link: nothing else shows that its firmware is complete."""
    if is_half_loaded(link):
        _keep_download(link.name, None)


def is_half_loaded(link: ByteLink) -> bool:
    """Whether a download into the hand on this link was begun and never ended, as far as is known."""
    return _lasts(link) and _download_at(link.name) is not None


def holds_back(name: str) -> str:
    """Why a stop of the hand at this LINK sends nothing, "" = it may. It is held back once: who asks again sees the hand move."""
    entry = _download_at(name)
    if entry is None or entry.get("told"):
        return ""
    _keep_download(name, {"told": True})
    return "a firmware download was cut off here, or is suspended: the hand does not move, and its boot monitor would take a stop for firmware. The same command again sends the stop all the same"


def downloads_path() -> Path:
    """The file that remembers the downloads that were cut off."""
    return files.state_path(DOWNLOADS)


def _download_at(name: str) -> dict[str, Any] | None:
    """What is noted of the place that this LINK leads to, by whichever of its names."""
    known = _downloads()
    if not known:
        return None
    from handctl.system import serial_ports

    place = serial_ports.place(name)
    return next((entry for other, entry in known.items() if other == name or entry.get("place") == place), None)


def _keep_download(name: str, entry: dict[str, Any] | None) -> None:
    from handctl.system import serial_ports

    place = serial_ports.place(name)
    known = {other: found for other, found in _downloads().items() if other != name and found.get("place") != place}
    known |= {name: {**entry, "place": place}} if entry is not None else {}
    with suppress(OutputError):
        store(downloads_path(), "downloads", dict(list(known.items())[-MOST:]), sort=False)


def _downloads() -> dict[str, Any]:
    return _known(downloads_path(), "downloads", lambda entry: isinstance(entry, dict))


def _speeds() -> dict[str, Any]:
    return _known(files.state_path(NAME), "baud rates", lambda _speed: True)


def _known(path: Path, what: str, valid: Callable[[object], bool]) -> dict[str, Any]:
    """What a file says that is worth no error."""
    try:
        return load(path, what, valid)
    except UsageError:
        return {}


def _lasts(link: ByteLink) -> bool:
    return not link.fake and not link.replayed


def _counts(link: ByteLink) -> bool:
    return link.can_set_baud and _lasts(link)
