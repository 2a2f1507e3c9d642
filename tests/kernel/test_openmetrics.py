"""OpenMetrics, judged by the parser of another project: every family, odd values, failures, and the file of a collector."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

from handctl import files
from handctl.docgen.read_command_tree import map_of
from handctl.errors import HandctlError, Interrupted, NoAnswer, NotConfirmed, UsageError
from handctl.families import FAMILIES
from handctl.model.param import BASES, scale_of
from handctl.model.result import Journal
from handctl.screen import render
from handctl.screen.openmetrics import exposition
from tests.contract.facts import facts_of
from tests.support.cli import fake, run
from tests.support.each_row import each_row

FACTORS = {
    "°C": 1, "°": 1, "deg": 1, "s": 1, "ms": 1e-3, "A": 1, "mA": 1e-3, "mm": 1e-3, "in": 0.0254, "cts": 1, "raw counts": 1,
    "cts/sample": 1, "cts/sample²": 1, "bit/s": 1, "steps": 1, "%": 0.01, "V": 1, "mV": 1e-3, "N": 1, "g": 1, "m": 1,
}  # fmt: skip
"""Of a person's unit: how many base units one is, by this test alone."""
ODD = ('quo"te', "back\\slash", "new\nline", "tab\t", "\x1b[2J", "ünïcode 🖐", "\udcff", "", "}", "a=b,c{", "# EOF")


def both(text: str) -> dict[str, dict[frozenset[tuple[str, str]], float]]:
    """The samples by name and labels; the parser of OpenMetrics and that of the older text format read the same."""
    from prometheus_client.openmetrics.parser import text_string_to_metric_families as strict
    from prometheus_client.parser import text_string_to_metric_families as older

    assert text.endswith("\n# EOF\n") and text.count("# EOF\n") == 1

    def taken(parse: Callable[[str], Iterator[Any]]) -> dict[str, dict[frozenset[tuple[str, str]], float]]:
        found: dict[str, dict[frozenset[tuple[str, str]], float]] = {}
        for metric in parse(text):
            assert metric.type == "gauge" and metric.documentation and metric.name not in found
            samples = [(frozenset(one.labels.items()), one.value) for one in metric.samples]
            assert len({labels for labels, _ in samples}) == len(samples) and metric.samples[0].timestamp is None
            found[metric.name] = dict(samples)
        return found

    first, second = taken(strict), taken(older)
    assert {name: set(map(str, got.values())) for name, got in first.items()} == {
        name: set(map(str, got.values())) for name, got in second.items()
    }
    assert [set(got) for got in first.values()] == [set(got) for got in second.values()]
    return first


def told(family: str, *words: str, fault: str = "") -> str:
    """The exposition of a command; of a stream the last one."""
    link = facts_of(family).link(family, "", *filter(None, [fault]))
    out = run(family, *words, "-p", link, "--format", "openmetrics").out
    return out[out[: -len("# EOF\n")].rfind("# EOF\n") + 1 :].removeprefix(" EOF\n") if "watch" in words else out


@each_row("verb", ["status", "dump", "watch"])
@each_row("family", FAMILIES)
def test_every_number_is_there_in_its_base_unit(family: str, verb: str) -> None:
    params = map_of(family)
    assert params is not None
    words = (verb, "--count", "1") if verb == "watch" else (verb,)
    got = both(told(family, *words))
    link = facts_of(family).link(family)
    done = run(family, *words, "-p", link, "--format", "ndjson")
    numbers = 0
    for row in done.stream[0]:
        private = "path" in row and params.find(row["path"])[0].private
        left_out = private or row.get("doubt") or "errors" in row or isinstance(row.get("value"), str | type(None))
        if left_out:
            assert not private or not [name for name in got if row["name"] in name]
            continue
        number, _, unit = (
            ("1", "", row["unit"] or "") if not re.match(r"\d", row["unit"] or "") else row["unit"].partition(" ")
        )
        top, _, bottom = number.partition("/")
        expected = row["value"] * float(top) / float(bottom or 1) * FACTORS[unit] if unit else row["value"]
        labels = {key: row[key] for key in ("finger", "motor", "element") if row.get(key)}
        name = f"handctl_{family}_{row.get('path', row['name']).split('.')[0]}"
        found = [
            value
            for key, samples in got.items()
            if key.startswith(name.removesuffix("_ms").removesuffix("_seconds")) or row["name"] in key
            for said, value in samples.items()
            if labels.items() <= dict(said).items()
        ]
        assert any(math.isclose(value, expected, rel_tol=1e-9, abs_tol=1e-12) for value in found), (row, found)
        numbers += 1
    assert numbers
    assert list(got[f"handctl_{family}_up"].values()) == [1.0]
    assert list(got[f"handctl_{family}_unread"].values()) == [0.0]


@each_row("family", FAMILIES)
def test_the_table_of_units_is_complete(family: str) -> None:
    """Whatever a map has, and status works out: a base unit that is a name."""
    params = map_of(family)
    assert params is not None
    done = run(family, "status", "-p", facts_of(family).link(family), "--json")
    units = {param.unit for param in params.every} | {row["unit"] for row in done.rows}
    for unit in filter(None, units):
        scale = scale_of(unit)
        base = BASES[scale.unit if scale is not None else unit]
        assert re.fullmatch(r"[a-z]+(_[a-z]+)*", base.unit)
        assert math.isclose(base.of(1), FACTORS[scale.unit if scale is not None else unit])


@each_row("fault", ["noise", "truncate", "over-temperature", "locked-rotor", "bad-checksum&after=2"])
@each_row("family", FAMILIES)
def test_it_is_valid_whatever_the_device_says(family: str, fault: str) -> None:
    text = told(family, "dump", fault=f"fault={fault}")
    assert not text or both(text)  # a simulator may not have this fault


def test_errors_are_a_gauge_a_bit() -> None:
    got = both(told("exo", "status", fault="fault=over-temperature"))["handctl_exo_error"]
    set_bits = [dict(labels) for labels, value in got.items() if value]
    assert len(got) == 5 * 5 and {labels["bit"] for labels in set_bits} == {"over_temperature"}
    assert list(both(told("exo", "status"))["handctl_exo_findings"].values()) == [0.0]
    assert list(both(told("exo", "status", fault="fault=over-temperature"))["handctl_exo_findings"].values()) != [0.0]


def test_labels_name_the_device() -> None:
    (labels,) = both(run("exo", "dump", "-p", fake(id=7), "--id", "7", "--format", "openmetrics").out)["handctl_exo_id"]
    assert dict(labels) == {"device": fake(id=7), "id": "7"}


def test_a_device_that_is_silent_is_down(tmp_path: Path) -> None:
    path = tmp_path / "hand.prom"
    for words, code in ((("dump",), 4), (("watch", "--count", "2"), 4), (("status", "--deadline", "0.1"), 4)):
        assert run("exo", *words, "-p", fake(fault="silent"), "--format", "openmetrics", "-o", path).code == code
        assert list(both(path.read_text(encoding="utf-8"))["handctl_exo_up"].values()) == [0.0]
        path.unlink()
    assert run("exo", "dump", "--nonsense", "--format", "openmetrics", "-o", path).code == 2
    assert run("exo", "dump", "-p", "nowhere://", "--format", "openmetrics", "-o", path).code in (2, 3)
    assert not path.exists() or both(path.read_text(encoding="utf-8"))


def test_the_file_of_a_collector_is_replaced_whole_at_each_sample(tmp_path: Path) -> None:
    path, seen = tmp_path / "hand.prom", list[str]()
    replace = files.os.replace

    def replaced(part: str, target: str) -> None:
        replace(part, target)
        seen.append(path.read_text(encoding="utf-8"))

    with mock.patch.object(files.os, "replace", replaced):
        words = ("watch", "temperature", "--count", "3", "-p", fake(), "--format", "openmetrics", "-o", path)
        assert run("exo", *words).code == 0
    assert len(seen) == 3 and all(len(both(text)["handctl_exo_temperature_celsius"]) == 5 for text in seen)
    assert [file.name for file in tmp_path.iterdir()] == ["hand.prom"]


def test_only_what_is_now_has_this_format(tmp_path: Path) -> None:
    for words in (("get", "id"), ("describe",), ("set", "id=3"), ("report", str(tmp_path / "a.html"))):
        done = run("exo", *words, "-p", fake(), "--format", "openmetrics")
        assert (done.code, done.out) == (2, "") and "format" in done.said and "--format" in done.err
    stopped = run("exo", "stop", "-p", fake(), env={"HANDCTL_FORMAT": "openmetrics"})
    assert stopped.code == 0 and stopped.out


def context_of(command: str = "exo dump") -> Any:
    return SimpleNamespace(
        command=command, journal=Journal(), settings=SimpleNamespace(device='my "left"\\'), opened=None,
        envelope=lambda failure: {"device": {"kind": "exo", "id": None, "link": "x"}},
    )  # fmt: skip


@each_row("value", [None, True, math.nan, math.inf, -math.inf, 10**30, -0.0, 1e-30, *ODD], ids=repr)
def test_odd_values_are_valid(value: Any) -> None:
    rows = [
        {"name": "n", "path": "n", "unit": "°C", "value": value},
        {"name": "n", "path": "n", "unit": None, "value": 3},
    ]
    got = both(exposition(rows, context_of()))
    assert json.dumps(sorted(got)).isascii()
    (labels,) = got["handctl_exo_up"]
    assert dict(labels) == {"device": 'my "left"\\'}


@each_row("name", ["a-b c", "1st", "µ", "x_total", "x_count", "x_info", "x_celsius", "ms"])
def test_odd_names_are_valid(name: str) -> None:
    rows = [{"name": name, "unit": unit, "value": 1.5, "finger": "ring"} for unit in ("°C", "ms", None, "no/such unit")]
    assert len(both(exposition([*rows, *rows, {"name": name, "error": "no", "unit": None}], context_of()))) >= 3


def test_what_says_nothing_of_the_device_writes_nothing() -> None:
    """Ctrl-C, a question without an answer, a mistake in the line: the last value stays, and is not called a failure."""
    for error in (HandctlError("a bug"), UsageError("x"), NotConfirmed("x"), Interrupted("interrupted")):
        assert not render.speaks("openmetrics", error), error
        assert render.speaks("json", error)
    assert render.speaks("openmetrics", NoAnswer("silence"))
