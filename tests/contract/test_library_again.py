"""A reading that is asked for again is bound to what was understood the first time; what is promised of it stays, in every family."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import handctl
from handctl.api import Device
from handctl.command.family import map_of
from handctl.errors import NoAnswer, UsageError
from handctl.families import FAMILIES
from handctl.link import Link, open_link
from tests.contract.alone import steady
from tests.contract.facts import passed
from tests.support.refused import refused

REQUEST = bytes.fromhex("EB 90 01 04 11 0A 06 02 28")
"""Another register of the exo (1546, exo §2.2.2), whose answer is as long as that for the voltage."""


def quantity(family: str) -> str:
    """The first that can be read."""
    params = map_of(family)
    assert params is not None
    return next(param.name for param in params if param.readable and not param.optional)


def link_of(device: Device) -> Link:
    (connection,) = device._line.session._open.values()
    assert connection.link is not None
    return connection.link


def calls(device: Device) -> list[object]:
    """The runs that are bound."""
    return list(device._line._bound.values())


@pytest.mark.parametrize("family", FAMILIES)
def test_it_asks_and_answers_as_the_first_time(family: str, tmp_path: Path) -> None:
    name, trace, lengths, counters = quantity(family), tmp_path / "trace.txt", [], []
    with handctl.simulate(family, trace=str(trace)) as device:
        first, known = device.get(name), device.envelope
        for _ in range(2):
            lengths.append(len(passed(trace)))
            assert steady(device.get(name)) == steady(first)
            assert device.envelope.keys() == known.keys()
            assert device.messages == known["messages"]
            counters.append(device.envelope["counters"])
        lengths.append(len(passed(trace)))
        assert len(calls(device)) == 1
    asked = lengths[2] - lengths[1]
    assert asked == lengths[1] - lengths[0] > 0, "each call asks the device, and all of it is in the trace"
    assert counters[0] == counters[1], "each has its own counters"


@pytest.mark.parametrize("family", FAMILIES)
def test_no_call_but_a_stop_opens_a_closed_link_again(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name, opened = quantity(family), list[str]()
    with handctl.simulate(family) as device:
        device.get(name)
        late = device.watch(name, count=1)

    def noted(link: str, **options: Any) -> Link:
        opened.append(link)
        return open_link(link, **options)

    monkeypatch.setattr("handctl.command.open_links.open_link", noted)
    for call in (device.__enter__, lambda: device.get(name), device.dump, lambda: list(late)):
        with refused(UsageError, "closed"):
            call()
    assert device.describe() and opened == []
    assert device.stop() and len(opened) == 1
    assert device._line.session._open == {} and device._line.session.in_motion == []
    with refused(UsageError, "closed"):
        device.get(name)


@pytest.mark.parametrize("family", FAMILIES)
def test_its_silence_is_told_and_the_next_one_asks_again(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name = quantity(family)
    with handctl.simulate(family, timeout=0.05) as device:
        first = device.get(name)
        device.get(name)
        link: Any = link_of(device)
        method = "receive" if hasattr(link, "receive") else "read"

        def nothing(deadline: Any, *_: Any) -> bytes | None:
            link.sleep(deadline.remaining)
            return None if method == "receive" else b""

        with monkeypatch.context() as patch:
            patch.setattr(link, method, nothing)
            with pytest.raises(NoAnswer):
                device.get(name)
        assert device.envelope["exit_code"] == 4
        assert steady(device.get(name)) == steady(first)
        assert device.envelope["exit_code"] == 0


def test_a_late_answer_to_something_else_is_not_believed() -> None:
    with handctl.simulate("exo") as device:
        first = device.get("system_voltage")
        device.get("system_voltage")
        link: Any = link_of(device)
        link.write(REQUEST, link.deadline(1.0))
        link.sleep(0.1)
        assert device.get("system_voltage")[0]["value"] == first[0]["value"]
        assert device.envelope["counters"]["bad_frames"] == 0


def test_other_words_are_another_reading() -> None:
    with handctl.simulate("exo") as device:
        device.get("system_voltage")
        device.get("system_voltage")
        assert [row["name"] for row in device.get("temperature", "system_voltage")][-1] == "system_voltage"
        assert len(calls(device)) == 2


def test_what_writes_streams_or_takes_values_by_name_is_not_bound(tmp_path: Path) -> None:
    with handctl.simulate("exo") as device:
        device.set("position_set.index=300", confirm=True)
        list(device.watch("system_voltage", count=1))
        device.snapshot(str(tmp_path / "a.toml"))
        device.get(names=["system_voltage"])
        device.get("system_voltage", dry_run=False, confirm=True)
        assert not calls(device)
