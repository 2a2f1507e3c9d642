"""Snapshot files made for a test."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.support.cli import fake, run


def signed(content: dict[str, Any]) -> dict[str, Any]:
    """A snapshot's content with the checksum that fits it, computed here."""
    rest = {key: value for key, value in content.items() if key != "checksum"}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"))
    return {**rest, "checksum": f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"}


@cache
def _taken() -> str:
    """That of a simulated hand, taken once."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "snap.json"
        assert run("exo", "snapshot", path, "-p", fake()).code == 0
        return path.read_text()


def snapshot_of(tmp_path: Path, **values: int) -> Path:
    """A snapshot of a simulated hand, with some values replaced (`__` stands for the dot) and signed again."""
    path = tmp_path / "snap.json"
    content = json.loads(_taken())
    content["values"].update({name.replace("__", "."): value for name, value in values.items()})
    path.write_text(json.dumps(signed(content)))
    return path
