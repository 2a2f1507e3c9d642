"""Two devices with one id on one line: told, and no id, speed or save reaches them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.bus_file import text
from tests.support.cli import Result, run, writes
from tests.support.each_row import each_row

KINDS = {"exo": {"kind": "exo"}, "hand": {"kind": "hand", "model": "df"}}
LINES = ("clean", "half-duplex", "bluetooth", "serial-server")
STRANDING = {
    "exo": [("id", "5"), ("baud", "57600"), ("baud", "57600", "--save"), ("save",), ("set", "id=5"), ("set", "baud_code=1")],
    "hand": [("id", "5"), ("baud", "57600"), ("baud", "57600", "--save"), ("save",)],
}  # fmt: skip


def bus(tmp_path: Path, kind: str, model: str, *ids: int, apart: float = 0.0) -> str:
    """Devices of one kind on a line; the second one answers `apart` seconds later."""
    devices = [{**KINDS[kind], "id": number} for number in ids]
    if apart:
        devices[1]["turnaround"] = apart
    path = tmp_path / "bus.toml"
    path.write_text(text(model, devices), encoding="utf-8")
    return f"fake://bus?clock=virtual&file={path}"


def try_(folder: Path, kind: str, words: tuple[str, ...], link: str) -> tuple[Result, list[bytes]]:
    trace = folder / "trace.txt"
    result = run(kind, *words, "-p", link, "-y", "--json", "--timeout", "1", "--trace", trace)
    return result, writes(trace)


@pytest.mark.parametrize("kind", STRANDING)
@pytest.mark.parametrize("apart", [0.0, 0.004])
def test_nothing_that_strands_reaches_two_devices_with_one_id(kind: str, apart: float, tmp_path: Path) -> None:
    for model in LINES[:2]:
        for words in STRANDING[kind]:
            result, written = try_(tmp_path, kind, words, bus(tmp_path, kind, model, 1, 1, apart=apart))
            assert (result.code, result.error["code"], written) == (6, "twin-id", []), (model, words, result)


@each_row("verb", ["angle 0 0 0 0 0 0", "speed 9 9 9 9 9 9", "calibrate", "clear-errors", "set speed_set.ring=500"])
def test_nothing_at_all_is_written_where_a_read_got_two_replies(verb: str, tmp_path: Path) -> None:
    """But a stop is sent."""
    link = bus(tmp_path, "hand", "serial-server", 1, 1, apart=0.03)
    result, written = try_(tmp_path, "hand", tuple(verb.split()), link)
    assert (result.code, result.error["code"], written) == (6, "twin-id", []), result
    assert try_(tmp_path, "hand", ("stop",), link)[1]


@each_row("kind", list(STRANDING))
@each_row("model", LINES)
def test_one_device_among_others_is_no_pair(kind: str, model: str, tmp_path: Path) -> None:
    result, _ = try_(tmp_path, kind, ("id", "5"), bus(tmp_path, kind, model, 1, 2))
    assert (result.code, [row["value"] for row in result.rows]) == (0, [5]), result


@each_row("fault", ["duplicate", "echo", "noise", "slow"])
def test_a_bad_line_is_no_second_device(fault: str) -> None:
    result = run("exo", "id", "5", "-y", "--json", "-p", f"fake://exo?clock=virtual&fault={fault}&jitter=1")
    assert result.code == 0, result


@each_row("words", [("exo", "id", "2"), ("hand", "save")])
@each_row("every", range(2, 8))
def test_a_line_that_damages_every_nth_reply_is_no_second_device(words: tuple[str, ...], every: int) -> None:
    """Asking both kinds in one fixed order would put all the damage on one of them, at some first reply."""
    for after in range(every):
        link = f"fake://{words[0]}?clock=virtual&every={every}&after={after}&fault=truncate&seed=1"
        result = run(*words, "-y", "--json", "-p", link)
        assert result.code == 0 or result.error["code"] != "twin-id", (after, result)


@each_row("kind", list(STRANDING))
@each_row("apart", [0.0, 0.004])
def test_doctor_names_them(kind: str, apart: float, tmp_path: Path) -> None:
    link = bus(tmp_path, kind, "half-duplex", 1, 1, apart=apart)
    for words in (("doctor", "--family", kind), (kind, "doctor"), ("doctor",)):
        result = run(*words, "-p", link, "--json", "--count", "2")
        rows = {row["check"]: row["status"] for row in result.rows}
        assert result.code == 7 and "fail" in (rows.get("same_id"), rows.get("device")), (words, result)
