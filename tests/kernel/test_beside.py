"""A command with a second link: `Run.device_at`. A verb of the test alone reads the ids of two exoskeleton hands."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from handctl.command.run import Run
from handctl.devices.inspire.exo.cli import cli
from handctl.model.result import Column, Row, Table
from tests.support.cli import Simulator, fake, run

ONE, TWO = fake(id=1), fake(id=2, fault="hot")


@pytest.fixture
def _both() -> Iterator[None]:
    @cli.verb("both", "Service", writes=True)
    @click.argument("other")
    @click.argument("number", type=int)
    def both(run: Run, other: str, number: int) -> Table:
        first = run.device()
        rows: list[Row] = []
        for hand in (first, run.device_at(other, id=number)):
            rows += hand.table(hand.read([hand.map.find("id")[1][0]])).rows
        return Table(rows=rows, columns=(Column("value", "Id"),))

    yield
    del cli.commands["both"]


pytestmark = pytest.mark.usefixtures("_both")


def test_both_devices_answer_and_are_recorded_in_one_file(tmp_path: Path) -> None:
    trace = tmp_path / "both.txt"
    result = run("exo", "both", TWO, "2", "-p", ONE, "--json", "--trace", trace)
    assert result.code == 0, result
    assert [row["value"] for row in result.rows] == [1, 2]
    assert result.json["device"]["link"] == ONE
    assert result.json["counters"]["sent"] == 4
    sent = [line.split(" > ")[1] for line in trace.read_text().splitlines() if " > " in line]
    assert [frame[:8] for frame in sent] == ["EB 90 01", "EB 90 01", "EB 90 02", "EB 90 02"]


def test_what_goes_wrong_at_the_second_link_is_the_end_of_the_command() -> None:
    result = run("exo", "both", fake(id=2, fault="silent"), "2", "-p", ONE, "--json")
    assert (result.code, result.error["code"]) == (4, "no-answer")
    assert "id 2 on fake://exo" in result.error["text"]
    result = run("exo", "both", "can:slcan:/dev/null", "2", "-p", ONE, "--json")
    assert result.code == 2
    assert "no CAN interface" in result.error["text"]


@pytest.mark.real
def test_two_ports_are_held_and_let_go_of() -> None:
    """Each has its lock while the command lasts; afterwards both can be opened again."""
    with Simulator("--pty") as one, Simulator("--pty", "--set", "id=2") as two:
        for _ in range(2):
            result = run("exo", "both", two.link, "2", "-p", one.link, "--json")
            assert (result.code, [row["value"] for row in result.rows]) == (0, [1, 2])
        result = run("exo", "both", one.link, "1", "-p", one.link, "--json")
        assert (result.code, result.error["code"]) == (3, "busy")


@pytest.mark.real
def test_commands_of_a_batch_share_the_links_that_one_of_them_opened_twice(tmp_path: Path) -> None:
    script = tmp_path / "script"
    with Simulator("--pty") as one, Simulator("--pty", "--set", "id=2") as two:
        lines = [
            f"exo get id --id 2 -p {two.link}",
            f"exo both {two.link} 2 -p {one.link}",
            f"exo get id -p {one.link}",
        ]
        script.write_text("\n".join(lines), encoding="utf-8")
        result = run("batch", script, "--yes", "--format", "plain")
    assert result.code == 0, result
