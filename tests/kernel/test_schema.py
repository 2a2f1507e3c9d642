"""JSON output: the envelope by its packaged schema, the rows of a dump, success, failure and partial success."""

from __future__ import annotations

import copy
import json
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from tests.inspire.exo_commands import COMMANDS, Command, prepare
from tests.support.cli import ENVELOPE_KEYS, FINGERS, POWER_ON, check_schema, elements, fake, run, schema
from tests.support.each_row import each_row

UNITS = {"current": "mA", "temperature": "°C"}


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    prepare(tmp_path)
    return tmp_path


def good() -> dict[str, Any]:
    return copy.deepcopy(run("exo", "get", "id", "error", "--json", "-p", fake()).json)


# -- the schema itself ------------------------------------------------------------------------------------------------


def test_the_schema_is_in_the_package_and_names_itself() -> None:
    content = json.loads(resources.files("handctl").joinpath("schema", "envelope-1.json").read_text(encoding="utf-8"))
    assert content["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert content["properties"]["schema"] == {"const": "handctl/1"}
    assert set(ENVELOPE_KEYS) - {"rows"} <= set(content["required"])


@each_row(
    ("path", "value"),
    [
        ("schema", "handctl/2"), ("version", 1), ("ok", "yes"), ("exit_code", 9), ("exit_code", 4), ("ok", False),
        ("rows", {}), ("rows", [1]), ("messages", None), ("messages", ["text"]), ("counters", {}),
        ("counters", {"sent": -1, "received": 0, "retries": 0, "bad_frames": 0, "stray_bytes": 0}),
        ("device", "exo"), ("device", {"kind": "exo"}), ("surprise", 1),
        ("messages", [{"level": "fatal", "code": "x", "text": "x", "hint": ""}]),
        ("rows", [{"name": "id", "value": 1, "error": "both"}]),
        ("rows", [{"name": "id", "value": {"nested": 1}}]),
        ("rows", [{"name": "id", "value": [1]}]),
    ],
)  # fmt: skip
def test_the_schema_refuses(path: str, value: object) -> None:
    envelope = good()
    check_schema(envelope)
    envelope[path] = value
    assert list(schema().iter_errors(envelope)), f"{path} = {value} passes"


@each_row("key", [key for key in ENVELOPE_KEYS if key != "rows"])
def test_the_schema_requires(key: str) -> None:
    envelope = good()
    del envelope[key]
    assert list(schema().iter_errors(envelope))


# -- success ----------------------------------------------------------------------------------------------------------


def test_dump_is_exactly_the_42_documented_values() -> None:
    result = run("exo", "dump", "--fake", "--json")
    envelope = result.json
    assert [key for key in envelope if key in ENVELOPE_KEYS] == ENVELOPE_KEYS
    assert (envelope["schema"], envelope["version"], envelope["command"]) == ("handctl/1", "0.1.0", "exo dump")
    assert envelope["device"] == {"kind": "exo", "link": "fake://exo", "fake": True, "id": 1, "model": "EH55BF1"}
    assert envelope["counters"] == {"sent": 2, "received": 2, "retries": 0, "bad_frames": 0, "stray_bytes": 0}
    expected = []
    for name, (address, size, values) in POWER_ON.items():
        for index, (part, value) in enumerate(zip(elements(name), values, strict=True)):
            raw = value.to_bytes(size, "little", signed=True).hex(" ").upper()
            expected.append((name, part, address + size * index, value, UNITS.get(name), raw))
    rows = [tuple(row[key] for key in ("name", "finger", "address", "value", "unit", "raw")) for row in result.rows]
    assert rows == expected
    assert len(rows) == 42
    assert '"fake": true' in result.out


def test_dump_keeps_the_gap_bytes() -> None:
    blocks = run("exo", "dump", "--fake", "--json").json["blocks"]
    assert [(block["address"], len(block["raw"].split())) for block in blocks] == [(1000, 10), (1472, 151)]
    assert blocks[0]["raw"] == "01 00 00 00 00 00 00 00 00 00"
    assert blocks[1]["raw"].startswith("2E 02 00 00")
    assert blocks[1]["raw"].endswith("1F 20 21 22 23")


@each_row("command", COMMANDS, ids=lambda command: command.name)
@each_row("fault", ["healthy", "silent", "refuse"])
def test_every_command_is_valid(scratch: Path, command: Command, fault: str) -> None:
    """json: one object with rows; ndjson: rows, then the envelope without them. Success and failure alike."""
    for form in ("json", "ndjson"):
        (scratch / "backup.json").unlink(missing_ok=True)
        yes = ["-y"] if command.asks else []
        result = run("exo", *command.words(scratch), *yes, "-p", fake(fault=fault), "--format", form)
        if form == "ndjson" or command.kind == "stream":
            rows, envelope = result.stream
        else:
            rows, envelope = result.rows, result.json
            assert [key for key in envelope if key in ENVELOPE_KEYS] == ENVELOPE_KEYS
        assert envelope["command"] == f"exo {command.args[0]}"
        assert envelope["device"]["fake"] is True
        assert envelope["ok"] is (result.code == 0)
        errors = [message for message in envelope["messages"] if message["level"] == "error"]
        assert len(errors) == (0 if result.code == 0 else 1)
        for row in rows:
            assert all(not (isinstance(v, str) and "<" in v and " object" in v) for v in row.values()), row


def test_what_went_wrong_is_the_same_on_stderr_and_in_json() -> None:
    result = run("exo", "dump", "--json", "-p", fake(fault="silent"))
    assert result.code == 4
    assert result.err == f"handctl: error: {result.error['text']}\n  Next: {result.error['hint']}\n"
    assert result.rows == []


def test_not_confirmed_and_dry_run_are_valid(scratch: Path) -> None:
    for command in COMMANDS:
        if command.asks:
            refused = run("exo", *command.words(scratch), "-p", fake(), "--json")
            assert (refused.code, refused.json["ok"]) == (8, False)
            planned = run("exo", *command.words(scratch), "-n", "--json")
            assert (planned.code, planned.json["ok"]) == (0, True)
            assert planned.codes() == ["dry-run"] or "dry-run" in planned.codes()


def test_describe_is_the_map() -> None:
    result = run("exo", "describe", "--json")
    assert result.json["device"] is None or result.json["device"]["link"] is None
    rows = {row["name"]: row for row in result.rows}
    assert list(rows) == [*list(POWER_ON)[:4], "factory_reset", *list(POWER_ON)[4:]]
    for name, (address, size, values) in POWER_ON.items():
        assert rows[name]["address"] == address
        assert rows[name]["type"] == {("u", 1): "u8", ("s", 2): "s16"}["u" if size == 1 else "s", size]
        assert len(rows[name]["elements"]) == (len(values) if len(values) > 1 else 0)
        assert rows[name]["source"].startswith("exo §2.3")
    assert rows["position_set"]["range"] == "-1, 0..1000"
    assert rows["baud_code"]["range"] == "0 = 115200 baud, 1 = 57600 baud, 2 = 19200 baud"
    assert [name for name, row in rows.items() if row["access"] == "r"] == [
        "system_voltage", "position_actual", "force_actual", "current", "error", "temperature",
    ]  # fmt: skip
    assert run("exo", "describe", "force_set", "error.index", "--json").rows == [rows["force_set"], rows["error"]]


# -- partial success --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("fault", "codes"), [("bad-checksum", {5}), ("silent", {4, 5}), ("truncate", {5})])
def test_partial_dump_keeps_what_could_be_read(fault: str, codes: set[int]) -> None:
    """The second block fails: its rows say why, the first block's rows are still there."""
    result = run("exo", "dump", "--json", "-p", fake(fault=fault, after=1))
    assert result.code in codes
    assert len(result.rows) == 42
    good_rows = [row for row in result.rows if "error" not in row]
    assert [(row["name"], row["value"]) for row in good_rows] == [
        ("id", 1), ("baud_code", 0), ("clear_errors", 0), ("save", 0), ("calibrate", 0),
    ]  # fmt: skip
    assert all("value" not in row and row["error"] for row in result.rows[5:])


def test_partial_group_reads() -> None:
    """A hand that does not answer across gaps, and then falls silent after some groups."""
    result = run("exo", "dump", "--json", "-p", fake(fault="block-silent,silent", after=12))
    assert result.code in (4, 5)
    assert len(result.rows) == 42
    with_value = {row["name"] for row in result.rows if "value" in row}
    assert {"id", "baud_code", "clear_errors", "save", "calibrate"} <= with_value
    assert "temperature" not in with_value
    for row in result.rows:
        assert ("value" in row) != ("error" in row)
        if "value" in row:
            index = list(elements(row["name"])).index(row["finger"])
            assert row["value"] == POWER_ON[row["name"]][2][index]


def test_partial_rows_in_the_other_formats() -> None:
    link = fake(fault="block-silent,silent", after=12)
    plain = run("exo", "dump", "--format", "plain", "-p", link)
    assert len(plain.lines) == 42
    assert len({line.count("\t") for line in plain.lines}) == 1
    table = run("exo", "dump", "-p", link)
    assert "?" in table.out and "no reply" in table.out
    csv = run("exo", "dump", "--csv", "-p", link)
    assert csv.lines[0].endswith(",error")
    assert "no reply" in csv.lines[-1]
    for result in (plain, table, csv):
        assert result.code in (4, 5)
        assert result.err.startswith("handctl: error: ") or "handctl: error: " in result.err


def test_status_check_is_a_failure_with_rows() -> None:
    result = run("exo", "status", "--check", "--json", "-p", fake(fault="faults"))
    assert (result.code, result.error["code"]) == (7, "unhealthy")
    errors = {row["finger"]: (row["value"], row["label"]) for row in result.rows if row["name"] == "error"}
    assert errors == dict(
        zip(
            FINGERS,
            [
                (1, "locked_rotor"), (2, "over_temperature"), (4, "over_current"),
                (6, "over_temperature, over_current"), (24, "motor_abnormal, communication"),
            ],
            strict=True,
        )
    )  # fmt: skip
    healthy = run("exo", "status", "--check", "--json", "-p", fake())
    assert (healthy.code, len(healthy.rows)) == (0, 39)
    unknown = run("exo", "get", "error.index", "--json", "-p", fake(fault="unknown-bits"))
    assert unknown.rows[0]["label"] == "unknown_bit_5, unknown_bit_7"
    assert unknown.rows[0]["raw"] == "A0"


def test_the_meta_schema_accepts_the_schema() -> None:
    assert Draft202012Validator(Draft202012Validator.META_SCHEMA).is_valid(schema().schema)
