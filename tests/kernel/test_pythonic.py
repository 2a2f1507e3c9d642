"""The library's own words: no option of the command line reaches a program, and an error is short there."""

from __future__ import annotations

import re
import sys
import traceback
from pathlib import Path
from types import SimpleNamespace

import pytest

import handctl
from handctl.api import in_python, methods
from handctl.errors import HandctlError, LinkError, NoAnswer, UsageError
from handctl.families import FAMILIES
from handctl.wording import sentence
from tests.support.each_row import each_row
from tests.support.refused import refused

SOURCES = Path(__file__).parents[1] / "messages" / "sources.txt"


def command_line(text: str, kind: str) -> str:
    return in_python(text, kind, {name: method.command for name, method in methods(kind).items()})


@each_row(("kind", "text", "told"), [
    ("exo", "`handctl exo describe` lists them all", "`describe()` lists them all"),
    ("exo", "give a longer --deadline", "give a longer deadline"),
    ("exo", "`handctl exo get force_set position_actual`", '`get("force_set", "position_actual")`'),
    ("exo", "`handctl exo set id=3 --yes`", '`set("id=3", confirm=True)`'),
    ("exo", "`handctl exo factory-reset -n`", "`factory_reset(dry_run=True)`"),
    ("barrett", "`handctl barrett firmware check FILE`", '`firmware_check("FILE")`'),
    ("barrett", "`handctl barrett close --motors G`", '`close(motors="G")`'),
    ("barrett", "`handctl -d left barrett strain --open`", "`strain(open=True)`"),
    ("wrist", "`handctl scan -p LINK --ids 1-20`, and -0.5 or x-y", "`handctl scan -p LINK --ids 1-20`, and -0.5 or x-y"),
    ("ekso", "`handctl barrett status` fits", "`handctl barrett status` fits"),
    ("aidin", "`home` and `initial --assume-homed`", "`home` and `initial(assume_homed=True)`"),
    ("ekso", "use `--length-mode auto`", "use `length_mode auto`"),
])  # fmt: skip
def test_commands_become_calls_and_options_arguments(kind: str, text: str, told: str) -> None:
    assert command_line(text, kind) == told


@pytest.mark.parametrize("kind", list(FAMILIES))
def test_no_message_of_handctl_keeps_an_option(kind: str) -> None:
    """But in a command that is typed at a terminal, which no method replaces."""
    kept = []
    for line in SOURCES.read_text(encoding="utf-8").splitlines():
        told = command_line(line.replace("{self.kind}", kind).replace("{params.kind}", kind), kind)
        kept += [told] if re.search(r"(?<![\w-])--[a-z]", re.sub("`handctl [^`]*`", "", told)) else []
    assert kept == []


def test_an_error_is_one_frame_with_its_hint() -> None:
    with refused(LinkError, "not-found") as found:
        handctl.connect("exo", "/dev/ttyNOTHING0")
    with handctl.simulate("exo", fault="silent") as hand:
        with refused(NoAnswer, "no-answer") as silent:
            hand.get("id")
        with refused(NoAnswer, "no-answer") as ended:
            for _ in hand.watch("id"):
                pass
    for one in (found, silent, ended):
        error: HandctlError = one.value
        way = [Path(frame.filename) for frame in traceback.extract_tb(error.__traceback__)]
        assert [path.name for path in way if path.is_relative_to(Path(handctl.__file__).parent)] == ["api.py"]
        assert error.__cause__ is None and "--" not in error.hint
        assert sys.version_info < (3, 11) or sentence(error.hint) in "".join(traceback.format_exception(error))


def test_tab_finds_the_names() -> None:
    assert {"connect", "simulate", "errors", "hands", "HandctlError"} <= set(dir(handctl))


def test_a_device_is_found_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "config.toml"
    path.write_text('[devices.left]\nkind = "exo"\nport = "fake://exo?clock=virtual&id=2"\nid = 2\n')
    monkeypatch.setenv("HANDCTL_CONFIG", str(path))
    with handctl.connect("left") as hand:
        assert (hand.kind, hand.get("id")[0]["value"]) == ("exo", 2)
    with handctl.connect("left", id=1) as other, pytest.raises(NoAnswer):
        other.get("id")
    with refused(UsageError, "unknown-device"):
        handctl.connect("right")


def test_rows_become_a_frame_where_pandas_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=lambda rows: {"rows": rows}))
    with handctl.simulate("exo") as hand:
        assert len(hand.get("temperature").frame()["rows"]) == 5
        frame = hand.watch("temperature", count=3).frame()
        assert len(frame["rows"]) == 15 and all(row["time"].endswith("Z") for row in frame["rows"])
    monkeypatch.setitem(sys.modules, "pandas", None)
    with handctl.simulate("exo") as hand, pytest.raises(ImportError):
        hand.get("id").frame()
