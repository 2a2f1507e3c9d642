"""Snapshot files: the configuration of one device as JSON, whole or not there at all. Knows no device.

    {"schema": "handctl-snapshot/1", "kind": "exo", "device": {…}, "tool": {"name": "handctl", "version": "…"},
     "time": "2026-01-31T12:00:00+00:00", "link": "…", "fake": false,
     "values": {"id": 1, "position_set.little": 151, …}, "checksum": "sha256:…"}

The checksum covers everything else in canonical form (sorted keys, no spaces), so an edited file is noticed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

from handctl import __version__
from handctl.errors import OutputError, UsageError
from handctl.files import atomic_write, read_text, why_unwritable

SCHEMA = "handctl-snapshot/1"
MOST_BYTES = 1_000_000
Values = dict[str, int | float]


def _checksum(content: Mapping[str, Any]) -> str:
    import hashlib

    text = json.dumps(
        {key: value for key, value in content.items() if key != "checksum"}, sort_keys=True, separators=(",", ":")
    )
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def make(kind: str, identity: Mapping[str, object], values: Values, *, link: str, fake: bool) -> dict[str, Any]:
    """The content of a snapshot file, with its checksum."""
    from datetime import datetime, timezone

    content: dict[str, Any] = {
        "schema": SCHEMA,
        "kind": kind,
        "device": dict(identity),
        "tool": {"name": "handctl", "version": __version__},
        "time": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "link": link,
        "fake": fake,
        "values": values,
    }
    return {**content, "checksum": _checksum(content)}


def write(path: str, content: Mapping[str, Any]) -> None:
    """Write a snapshot, whole or not at all. Raises OutputError."""
    try:
        with atomic_write(path) as file:
            json.dump(content, file, indent=2, ensure_ascii=False)
            file.write("\n")
    except OSError as exc:
        raise OutputError(f"{path}: the snapshot cannot be written: {exc.strerror or exc}") from exc


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    # Of two entries of one name the checksum would cover the last only, while a person reads the first.
    content = dict(pairs)
    if len(content) != len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{next(name for name in names if names.count(name) > 1)!r} is given twice")
    return content


def _refuse(name: str) -> None:
    raise ValueError(f"{name} is not a JSON number")


def _parsed(path: str, kind: str) -> dict[str, Any]:
    """What a file that says to be a snapshot holds. Raises UsageError."""
    text = read_text(path, "a snapshot", MOST_BYTES, hint=f"`handctl {kind} snapshot {path}` makes one")
    try:
        content = json.loads(text, parse_constant=_refuse, object_pairs_hook=_once)
    except (ValueError, RecursionError) as exc:
        raise UsageError(f"{path}: not a snapshot: {exc}", hint=UNTOUCHED) from exc
    if not isinstance(content, dict) or not str(content.get("schema", "")).startswith("handctl-snapshot/"):
        raise UsageError(f"{path}: not a handctl snapshot", hint=UNTOUCHED)
    return content


def check_target(path: str, kind: str) -> None:
    """Look at FILE before anything is sent. Raises OutputError where none can be written, UsageError for a file that is no
    older snapshot of a `kind` device: only such a one may be replaced.
    """
    if why := why_unwritable(path):
        raise OutputError(f"{path}: the snapshot cannot be written: {why}", hint=f"choose another file. {UNTOUCHED}")
    if not os.path.isfile(path):  # what else it may be is told when it is written
        return
    try:
        found = _parsed(path, kind).get("kind")
    except UsageError:
        found = None
    if found != kind:
        what = f"a snapshot of {found}" if found else "no snapshot"
        raise UsageError(
            f"{path} exists and is {what}: not replaced",
            hint=f"choose another file, or remove it first. {UNTOUCHED}",
            code="exists",
        )


def load(path: str, kind: str) -> dict[str, Any]:
    """Read and check a snapshot of a `kind` device. Raises UsageError for anything that is not whole and ours."""
    content = _parsed(path, kind)
    if content["schema"] != SCHEMA:
        raise UsageError(
            f"{path}: schema {content['schema']}, this handctl {__version__} reads {SCHEMA}",
            hint=f"use the handctl that wrote it ({content.get('tool')}). {UNTOUCHED}",
        )
    if content.get("checksum") != _checksum(content):
        raise UsageError(f"{path}: damaged: its checksum is wrong", hint=f"take a new snapshot. {UNTOUCHED}")
    if content.get("kind") != kind:
        raise UsageError(f"{path}: a snapshot of {content.get('kind')}, not of {kind}", hint=UNTOUCHED)
    values = content.get("values")
    if not isinstance(values, dict) or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < float("inf") for v in values.values()
    ):
        raise UsageError(f"{path}: damaged: its values are not pairs of name and number", hint=UNTOUCHED)
    return content


UNTOUCHED = "Nothing was sent to the device."
