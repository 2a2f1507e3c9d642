"""The parts of a report by themselves: what is blanked, curves, the page, the recorded bytes, facts of the computer."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from handctl import report as report_private
from handctl.charts.curves import MOST_PLACES, Curve, Curves, draw
from handctl.errors import NoAnswer
from handctl.families import FAMILIES
from handctl.model.param import Param, ParamMap
from handctl.model.result import Cell, Grid, Message, Sample
from handctl.report import LONGEST, Recorded, environment, explained, port, shortened
from handctl.report.html import Report, page
from handctl.report.redaction import Privacy
from handctl.tools import port_inventory
from handctl.tools.port_inventory import Chip, Machine, Port
from tests.support.each_row import each_row
from tests.support.page import Page

OPEN: ParamMap[Param] = ParamMap("exo", [Param(name="speed", doc="", source="")])
HELD: ParamMap[Param] = ParamMap(
    "ekso", [Param(name=name, doc="", source="", private=True) for name in ("pilot_id", "serial_number")]
)


def made(**changes: Any) -> Report:
    return Report("exo", "exo report", "2026-11-20T14:05:37+00:00", **{"simulated": False, **changes})


# -- what is blanked ------------------------------------------------------------------------------------------------


def test_every_quantity_that_tells_whose_it_is_is_known() -> None:
    """Every serial number and person's number of every map is marked as private."""
    import importlib

    found = set()
    for kind, place in {
        "exo": "inspire.exo.register_map:EXO", "wrist": "inspire.wrist.register_map:WRIST", "barrett": "barrett.parameter_map:BARRETT",
        "ekso": "ekso.parameter_map:EKSO", "aidin": "aidin.parameter_map:AIDIN",
    }.items():  # fmt: skip
        assert kind in FAMILIES
        module, name = place.split(":")
        for param in getattr(importlib.import_module(f"handctl.devices.{module}"), name):
            if re.search(r"serial.?n|\bsn\b|pilot|wearer|person", f"{param.name} {param.doc}", re.IGNORECASE):
                found.add(param.name)
                assert param.private, param.name
            else:
                assert not param.private, param.name
    assert found == {"serial_number", "pilot_id"}


def test_a_private_row_keeps_its_place_only() -> None:
    row = {
        "name": "pilot_id",
        "word": 19,
        "id": None,
        "value": 4711,
        "raw": 4711,
        "unit": None,
        "label": "4711",
        "odd": 7,
    }
    (blanked,) = Privacy(HELD, False).rows([row])
    assert blanked == {
        "name": "pilot_id", "word": 19, "id": None, "value": "redacted", "raw": "redacted", "unit": None,
        "label": "redacted", "odd": "redacted",
    }  # fmt: skip
    assert Privacy(HELD, True).rows([row]) == [row]


@each_row(
    ("text", "shown"),
    [
        ("pilot 4711 walks; 14711 and 4711.5 not", "pilot redacted walks; 14711 and 4711.5 not"),
        ("serial number 7, SN=7; pilot_id is 12", "serial number redacted, SN=redacted; pilot_id is redacted"),
        ("sent 98 00 00 01, got 12 67 AA BB", "sent (left out), got (left out)"),
        ("expected 4 numbers, got '1 2 9'", "expected 4 numbers, got (left out)"),
        ("it isn't 5 and can't be 6", "it isn't 5 and can't be 6"),
    ],
)
def test_texts_of_a_device_with_private_quantities(text: str, shown: str) -> None:
    privacy = Privacy(HELD, False)
    privacy.rows([{"name": "pilot_id", "value": 4711}])
    assert privacy.text(text) == shown
    assert Privacy(HELD, True).text(text) == text


@each_row(
    ("text", "shown"),
    [
        ("/home/alice/x.txt, C:\\Users\\Bob\\y", "/home/(user)/x.txt, C:\\Users\\(user)\\y"),
        ("fake://exo?state=/Users/carol/s.json", "fake://exo?state=/Users/(user)/s.json"),
        ("/opt/bench/me/log.txt /opt/bench/meadow", "~/log.txt /opt/bench/meadow"),
    ],
)
@each_row("keep_ids", [False, True])
def test_users_and_homes_never_appear(text: str, shown: str, keep_ids: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/opt/bench/me")
    assert Privacy(OPEN, keep_ids).text(text) == shown


@each_row(
    ("link", "shown"),
    [
        ("usb:0403:6001:A50285BI: busy", "usb:0403:6001:(redacted) busy"),
        ("usb:0403:6001 is busy", "usb:0403:6001 is busy"),
        ("/dev/serial/by-id/usb-FTDI_A50285BI-if00-port0", "/dev/serial/by-id/(redacted)"),
        (
            "/dev/cu.usbserial-A50285BI, /dev/tty.usbmodem14",
            "/dev/cu.usbserial-(redacted), /dev/tty.usbmodem(redacted)",
        ),
        ("got EB 90 01 04 from '5'", "got EB 90 01 04 from '5'"),
    ],
)
def test_serial_numbers_of_adapters(link: str, shown: str) -> None:
    assert Privacy(OPEN, False).text(link) == shown
    assert Privacy(OPEN, True).text(link) == link


def test_identity() -> None:
    facts = {"kind": "barrett", "serial_number": 1042, "firmware": "4.33", "model": None}
    privacy = Privacy(HELD, False)
    assert privacy.identity(facts) == {"kind": "barrett", "serial_number": "redacted", "firmware": "4.33"}
    assert Privacy(HELD, True).identity(facts)["serial_number"] == "1042"


# -- recorded bytes -------------------------------------------------------------------------------------------------


def test_received_bytes_are_counted_where_they_may_hold_a_person() -> None:
    privacy = Privacy(HELD, False)
    assert privacy.transcript("0.1 < 12 67") == "# 0.1 < 2 bytes left out"
    assert privacy.transcript("0.1 < can 15038001 [1] 12") == "# 0.1 < 1 byte left out"
    for line in ("0.1 > 98 00", "# status", "0.2 ! baud 9600"):
        assert privacy.transcript(line) == line
    assert Privacy(HELD, True).transcript("0.1 < 12 67") == "0.1 < 12 67"
    assert Privacy(OPEN, False).transcript("0.1 < 12 67") == "0.1 < 12 67"


def test_frames_are_explained_behind_the_line_that_completes_them() -> None:
    lines = ["# status", "0.0 > EB 90 01 04 11 E8 03", "0.1 > 02 03", "0.2 < 90 EB 01 05 11 E8 03 01 00 03"]
    told = list(explained(lines, "exo", Privacy(OPEN, False)))
    assert [line for line in told if not line.startswith("#   ")] == lines
    assert told[3].startswith("#   host: read id to baud_code")
    assert told[5].startswith("#   device: id = 1, baud_code = 0")


def test_what_a_device_said_is_not_explained_where_it_is_left_out() -> None:
    """A reply to GetSettings, whole and damaged: neither its bytes nor its words appear."""
    lines = ["0.0 > 98 00 00 01 D7 BD", "0.1 < 98 02 00 01 12 67 00 00", "0.2 < 12 67"]
    told = list(explained(lines, "ekso", Privacy(HELD, False)))
    assert told[0] == lines[0]
    assert told[1].startswith("#   host: ")
    assert not [line for line in told if "12 67" in line or "4711" in line]
    assert "# 0.1 < 8 bytes left out" in told
    assert {line.partition(" [")[0] for line in told if line.startswith("#   device")} <= {
        "#   device: a whole frame", "#   device: no frame",
    }  # fmt: skip


def test_a_long_recording_loses_its_middle() -> None:
    lines = [f"{number:06d} {'x' * 93}" for number in range(3000)]
    kept = list(shortened(lines))
    (gap,) = [number for number, line in enumerate(kept) if line.startswith("#")]
    assert kept[0] == lines[0]
    assert kept[-1] == lines[-1]
    assert kept[gap] == f"# {3000 - (len(kept) - 1)} lines left out: --trace FILE keeps them all"
    assert 0.95 * LONGEST < sum(map(len, kept)) < 1.01 * LONGEST
    assert list(shortened(lines[:100])) == lines[:100]


def test_a_recording_of_any_length_takes_no_more_memory_and_ends_the_same() -> None:
    """What is no longer there would have been left out."""
    lines = [f"{number:06d} {'x' * 93}" if number % 3 else "#   a remark" for number in range(9000)]
    recorded = Recorded(LONGEST)
    for line in lines:
        recorded.append(line)
    assert sum(map(len, recorded)) < 2 * LONGEST + 200 < sum(map(len, lines))
    assert list(shortened(list(recorded), LONGEST, recorded.left_out)) == list(shortened(lines))


# -- curves ---------------------------------------------------------------------------------------------------------


def curves(samples: Iterable[Sample], decimals: dict[str, int]) -> dict[str, list[Curve]]:
    found = Curves(decimals)
    for sample in samples:
        found.take(sample)
    return found.groups


def sampled(*values: object, **more: object) -> list[Sample]:
    return [
        Sample(number * 0.1, ({"name": "p", "finger": "index", "value": value, **more},))
        for number, value in enumerate(values)
    ]


def test_a_long_watch_keeps_the_lowest_and_the_highest_of_some_moments_at_once() -> None:
    """However long it is; a hole that nobody would see is none, one that is seen stays."""
    found, values = Curve("p"), [number * 7919 % 1000 for number in range(100_000)]
    for number, value in enumerate(values):
        found.add(number, value, value, value)
        if number % 2:
            found.hole()
    (places, _) = found.runs
    starts = [*(int(t) for t, _, _ in places), len(values)]
    assert len(places) <= MOST_PLACES < 2.1 * len(places)
    assert [place[1:] for place in places] == [
        (min(some), max(some)) for some in (values[start:end] for start, end in pairwise(starts))
    ]
    found.add(200_000, 5, 5, 5)
    assert [len(run) for run in found.runs] == [len(places), 1]


def curve(*values: object, decimals: int = 0) -> Curve:
    ((found,),) = curves(sampled(*values), {"p": decimals}).values()
    return found


@each_row(
    ("values", "decimals", "text"),
    [
        ((12, 15, 14), 0, "min 12, max 15, last 14"),
        ((12.0, 12.0), 2, "12.00 all the time"),
        ((7345678, 7345679), 0, "min 7345678, max 7345679, last 7345679"),
        ((0.5, None, 0.25), 0, "min 0.25, max 0.5, last 0.25, 1 of 3 not read"),
        ((None, None), 0, "not read"),
        ((True, "x"), 0, "not read"),
    ],
)
def test_a_curve_in_words(values: tuple[object, ...], decimals: int, text: str) -> None:
    assert curve(*values, decimals=decimals).summary == text


def test_elements_have_curves_of_their_own_in_the_order_of_the_rows() -> None:
    rows = tuple(
        {"name": name, "finger": finger, "element": element, "value": 1}
        for name in ("a", "b") for finger in ("thumb", "index") for element in ("m1", "m2")
    )  # fmt: skip
    groups = curves([Sample(0, rows)], {})
    assert list(groups) == ["a", "b"]
    assert [found.part for found in groups["a"]] == ["thumb m1", "thumb m2", "index m1", "index m2"]


def places(found: Curve, seconds: float) -> list[list[tuple[float, float]]]:
    return [
        [(float(x), float(y)) for x, y in (pair.split(",") for pair in points.split())]
        for points in re.findall(r'points="([^"]+)"', draw(found, seconds))
    ]


def test_a_curve_fills_its_picture_and_stays_in_it() -> None:
    ((first, *_, last),) = places(curve(*range(0, 1000, 10)), 9.9)
    assert first == (4.0, 43.0)
    assert last == (176.0, 5.0)


def test_one_step_of_the_last_digit_is_small() -> None:
    ((low, high),) = places(curve(100, 101), 0.1)
    assert 0 < low[1] - high[1] < 6
    ((low, high),) = places(curve(100.01, 100.02, decimals=2), 0.1)
    assert 0 < low[1] - high[1] < 6
    ((low, high),) = places(curve(0.25, 0.5), 0.1)
    assert low[1] - high[1] == 38


def test_a_failed_read_is_a_gap_and_a_single_value_a_dot() -> None:
    picture = draw(curve(1, 2, None, 3), 0.3)
    assert picture.count("<polyline") == 1
    assert picture.count("<circle") == 1
    assert "<circle" not in draw(curve(None), 0.0)
    assert '<svg viewBox="0 0 180 48" role="img" aria-label="p index over 0.3 s: min 1' in picture


def test_a_name_cannot_break_out_of_the_picture() -> None:
    (found,) = curves([Sample(0, ({"name": '"><script>', "value": 1},))], {}).popitem()[1]
    assert "<script" not in draw(found, 1.0)


# -- the page -------------------------------------------------------------------------------------------------------


def test_an_empty_report_is_a_whole_page() -> None:
    text = page(made())
    seen = Page(text)
    assert text.startswith('<!DOCTYPE html>\n<html lang="en">')
    assert seen.count["section"] == 7
    assert seen.count["h1"] == 1
    assert "Simulated" not in seen.text
    assert "Nothing unhealthy was found" in seen.text
    assert "http://" not in text and "https://" not in text and "url(" not in text and "@import" not in text


def test_the_mark_of_a_simulator() -> None:
    assert "Simulated" in Page(page(made(simulated=True))).text


NASTY = "</pre></style><script>alert(1)</script>&lt;\"'\x00\x1b[31m\udc80é"
SAFE = "</pre></style><script>alert(1)</script>&lt;\"'\N{REPLACEMENT CHARACTER}\N{REPLACEMENT CHARACTER}[31m\N{REPLACEMENT CHARACTER}é"


def test_everything_is_escaped() -> None:
    grid = Grid((NASTY, "n"), ((NASTY, Cell(NASTY, "bad")),), NASTY, frozenset({1}), (NASTY,))
    content = made(
        facts=[(NASTY, NASTY)], problems=[(NASTY, NoAnswer(NASTY, hint=NASTY, code=NASTY))],
        findings=[Message("warning", NASTY, NASTY, NASTY)], checks=[grid], status=[grid], dump=[grid],
        curves=curves([Sample(0, ({"name": NASTY, "finger": NASTY, "value": 1, "unit": NASTY, "label": NASTY},))], {}),
        watched=NASTY, counters=[(NASTY, NASTY)], environment=[(NASTY, NASTY)], transcript=[NASTY], privacy=NASTY,
    )  # fmt: skip
    content.kind = content.command = content.made = NASTY
    text = page(content)
    text.encode("utf-8")
    seen = Page(text)
    assert seen.text.count(SAFE) >= 25
    assert "<script" not in text
    content.words = frozenset({NASTY})
    Page(page(content))


def test_quantities_that_are_codes_are_words() -> None:
    ((found,),) = (curves(sampled(0, 4, 0, label="stuck"), {}).values(),)
    content = made(curves={"p": found}, words=frozenset({"p"}), seconds=0.2)
    seen = Page(page(content))
    assert "svg" not in seen.count
    assert "stuck" in seen.text
    content.words = frozenset()
    assert Page(page(content)).count["svg"] == 1


def test_only_what_moved_is_drawn() -> None:
    samples = [
        Sample(
            t, tuple({"name": "p", "finger": f, "value": v, "unit": "mA"} for f, v in (("a", t), ("b", 3), ("c", None)))
        )
        for t in (0, 1)
    ]
    text = page(made(curves=curves(samples, {}), seconds=1.0, words=frozenset({"e"})))
    assert text.count("<polyline") == 1
    assert "Unchanged: p b 3 mA, c not read." in Page(text).text


def test_the_data_of_a_page_cannot_end_it() -> None:
    seen = Page(page(made(data={"a": "</script><b>&"})))
    assert seen.data == {"a": "</script><b>&"}
    assert "b" not in seen.count


def test_the_data_of_a_page_act_on_no_terminal() -> None:
    acting = {"\x9b31m": "\u202eexe.gpj\x7f", "k": ["\u2028", "\U000e0041é手", "\udc80"]}
    text = page(made(data=acting))
    assert text.replace("\n", "").isprintable()
    assert Page(text).data == {**acting, "k": ["\u2028", "\U000e0041é手", "\\x80"]}


def test_an_incomplete_page_says_so_first() -> None:
    content = made(problems=[("dump", NoAnswer("no answer", hint="look at the cable"))], missing={"Status": "not read"})
    text = Page(page(content)).text
    assert (
        text.index("Incomplete") < text.index("dump: No answer. [no-answer]") < text.index("Next: Look at the cable.")
    )
    assert "not read" in text


# -- the computer ---------------------------------------------------------------------------------------------------


def test_the_environment_names_versions_and_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    facts = dict(environment())
    assert set(facts) == {"system", "Python", *port_inventory.needed()}
    assert re.fullmatch(r"\d+\.\d+.*", facts["click"])
    assert os.uname().nodename not in " ".join(facts.values()).split()
    monkeypatch.setattr(report_private, "needed", lambda: ("no-such-package",))
    assert dict(environment())["no-such-package"] == "not installed as a package"


def test_a_port_is_told_without_its_serial_number(monkeypatch: pytest.MonkeyPatch) -> None:
    found = Port(
        "/dev/ttyUSB3", "/dev/serial/by-id/usb-FTDI_A50285BI", "0403:6001:A50285BI", "ftdi_sio", "FT232R",
        Chip("FTDI FT232R", "exo"), group="dialout", latency_ms=16,
    )  # fmt: skip
    monkeypatch.setattr(Machine, "ports", lambda _machine: [found])
    told = [
        ("port", "/dev/ttyUSB3"), ("adapter", "FTDI FT232R"), ("USB", "0403:6001"), ("driver", "ftdi_sio"),
        ("product", "FT232R"), ("state", "free"), ("group", "dialout"), ("latency timer", "16 ms"),
    ]  # fmt: skip
    for link in ("/dev/ttyUSB3", "spy:///dev/ttyUSB3?file=x", "usb:0403:6001", "usb:0403:6001:A50285BI"):
        assert port(link) == told, link
    assert port("usb:10C4:EA60") == [("port", "none: not known to the system")]
    assert port("/dev/ttyNOTHING") == [("port", "/dev/ttyNOTHING: not known to the system")]
    assert port("tcp://192.168.0.10:8000") == port("fake://exo") == port("replay:x") == []


def test_no_module_of_a_report_names_a_family() -> None:
    root = Path(report_private.__file__).parent
    paths = list(root.glob("*.py"))
    assert len(paths) >= 2, "all modules of the package"
    for path in paths:
        words = set(re.findall(r"\w+", path.read_text(encoding="utf-8")))
        assert not words & {"inspire", "exo", "wrist", "barrett", "ekso", "aidin"}, path.name
