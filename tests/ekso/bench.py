"""The EksoNR on a bench: a scripted DataPort, the settings it holds, and what was sent to it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from handctl.command.terminal_prompts import TerminalPrompts
from handctl.devices.ekso.audit_log import AuditLog
from handctl.devices.ekso.device import Ekso, one_setting
from handctl.devices.ekso.parameter_map import EKSO
from handctl.devices.ekso.setting_change import Change
from handctl.devices.ekso.setting_writer import Writer
from handctl.errors import (
    HandctlError,
)
from tests.ekso.support import (
    Unit,
    port_on,
)


class Bench:
    """A unit with a writer in front of it."""

    def __init__(self, folder: Path, *, override: bool = False) -> None:
        self.unit = Unit()
        self.port = port_on(self.unit)
        self.log = folder / "audit.jsonl"
        self.asked: list[tuple[str, str]] = []
        self.ekso = Ekso(self.port)
        audit = AuditLog(self.log, {"operator": "me", "port": "unit"})
        self.ekso.writer = Writer(self.port, audit, self._ask, override=override, prompts=TerminalPrompts(quiet=True))

    def _ask(self, question: str, word: str) -> None:
        self.asked.append((question, word))

    def set(self, *texts: str) -> list[Any]:
        """Write settings; the values that are read back."""
        self.ekso.words("settings")
        return [reading.value for reading in self.ekso.write([one_setting([text]) for text in texts])]

    def failing(self, kind: type[HandctlError], text: str) -> HandctlError:
        """The error of writing `text`."""
        with pytest.raises(kind) as caught:
            self.set(text)
        assert type(caught.value) is kind
        return caught.value

    @property
    def entries(self) -> list[dict[str, Any]]:
        """The audit log."""
        return (
            [json.loads(line) for line in self.log.read_text(encoding="utf-8").splitlines()]
            if self.log.exists()
            else []
        )


def change(name: str, old: int, new: int) -> Change:
    return Change(EKSO[name], old, new)
