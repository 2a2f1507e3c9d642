"""Snapshot files made for a test."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from tests.support.cli import fake, run


def signed(content: dict[str, Any]) -> dict[str, Any]:
    """A snapshot's content with the checksum that fits it, computed here."""
    rest = {key: value for key, value in content.items() if key != "checksum"}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"))
    return {**rest, "checksum": f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"}


def snapshot_of(tmp_path: Path, link: str = "", **values: int) -> Path:
    """A snapshot of a simulated hand, with some values replaced (`__` stands for the dot) and signed again."""
    path = tmp_path / "snap.json"
    path.unlink(missing_ok=True)
    assert run("exo", "snapshot", path, "-p", link or fake()).code == 0
    content = json.loads(path.read_text())
    content["values"].update({name.replace("__", "."): value for name, value in values.items()})
    path.write_text(json.dumps(signed(content)))
    return path
