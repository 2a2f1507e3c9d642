"""When and what: the time of day of an envelope and of a stream, and who answered; envelopes of before stay valid."""

from __future__ import annotations

import json
from datetime import datetime, timedelta, timezone
from typing import Any

import pytest

from handctl.docgen.read_command_tree import map_of
from handctl.families import FAMILIES
from tests.contract.facts import facts_of
from tests.support.cli import check_schema, run
from tests.support.each_row import each_row
from tests.support.places import TESTS

BEFORE = json.loads((TESTS / "contract" / "envelopes.json").read_text(encoding="utf-8"))
"""Envelopes that earlier states of handctl/1 wrote, as they were: with `rows`, or the end of a stream."""


def moment(text: str) -> datetime:
    """What `time` and `started` say."""
    return datetime.fromisoformat(text.replace("Z", "+00:00"))


def link_at(family: str, when: datetime) -> str:
    """The simulator of a family on virtual time, which begins at this moment."""
    return facts_of(family).link(family).replace("clock=virtual", f"clock=virtual@{when.timestamp():.0f}")


@pytest.mark.parametrize("family", FAMILIES)
def test_a_sample_has_a_time_of_day(family: str) -> None:
    """On virtual time the clock is the test's: `started` and `t` name the moments, `time` is not before them."""
    noon = datetime(2026, 3, 29, 12, 0, 0, tzinfo=timezone.utc)
    rows, end = run(family, "watch", "--rate", "2", "--count", "3", "-p", link_at(family, noon), "--json").stream
    started = moment(end["started"])
    assert noon <= started < noon + timedelta(seconds=20)
    moments = sorted({started + timedelta(seconds=row["t"]) for row in rows})
    assert len(moments) == 3 and moments[0] - started < timedelta(seconds=2.5)
    assert moment(end["time"]) >= moments[-1].replace(microsecond=0)
    again = run(family, "watch", "--rate", "2", "--count", "3", "-p", link_at(family, noon), "--json").stream
    assert (rows, end) == again


@pytest.mark.real
@each_row("family", FAMILIES)
def test_in_real_time_it_is_the_time_of_day(family: str) -> None:
    link = facts_of(family).link(family).replace("clock=virtual", "seed=1")
    before = datetime.now(timezone.utc) - timedelta(milliseconds=1)
    _, end = run(family, "watch", "--rate", "0", "--count", "1", "-p", link, "--json").stream
    assert before <= moment(end["started"]) <= datetime.now(timezone.utc)
    assert before.replace(microsecond=0) <= moment(end["time"]) <= datetime.now(timezone.utc)


@pytest.mark.parametrize("verb", ["status", "dump"])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_serial_number_is_shown_where_it_is_asked_for(family: str, verb: str) -> None:
    """Firmware wherever it was read; neither costs a question of its own."""
    params, link = map_of(family), facts_of(family).link(family)
    plain = run(family, verb, "-p", link, "--json").json
    assert "serial" not in plain["device"]
    told = {row["path"]: row["value"] for row in plain["rows"] if "value" in row and "path" in row}
    assert plain["device"].get("firmware") == told.get("firmware")
    serial = next((param.path for param in params or () if param.tells == "serial"), None)
    if serial is None:
        assert run(family, verb, "--include-ids", "-p", link).code == 2
        return
    shown = run(family, verb, "--include-ids", "-p", link, "--json").json
    assert shown["device"] == {**plain["device"], "serial": str(told[serial])}
    assert shown["counters"] == plain["counters"]


@pytest.mark.parametrize("name", BEFORE)
def test_an_envelope_of_before_is_valid(name: str) -> None:
    envelope: dict[str, Any] = BEFORE[name]
    check_schema(envelope)
    words = {key for row in envelope.get("rows", ()) for key in row}
    assert not words & {"path", "errors"}, "this one is of after"
