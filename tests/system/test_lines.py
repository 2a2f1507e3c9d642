"""TAB at a prompt, under the two libraries that Python's readline may be."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from handctl.system import terminal
from tests.support.each_row import each_row


@each_row(
    ("library", "binding"),
    [("GNU readline", "tab: complete"), ("Importing this module enables libedit", "bind ^I rl_complete")],
)
def test_tab_is_bound_as_the_library_wants_it(
    library: str, binding: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """macOS has libedit in place of readline, which takes no line of an inputrc."""
    told: list[Any] = []
    kept: list[Any] = []
    fake = ModuleType("readline", library)
    for name in ("read_history_file", "set_history_length", "set_completer_delims", "set_completer"):
        setattr(fake, name, lambda *_: None)
    fake.parse_and_bind, fake.write_history_file = told.append, kept.append  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "readline", fake)
    with terminal.edited_lines(tmp_path / "history", lambda _line, _word: []):
        assert (told, kept) == ([binding], [])
    assert kept == [tmp_path / "history"]
