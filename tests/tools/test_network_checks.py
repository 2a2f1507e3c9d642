"""The checks of doctor for a device on a network: our own address towards it, and whether one device answers there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from handctl.tools import doctor
from handctl.tools.doctor_link import host_in, is_local, subnet
from tests.support.cli import Result, Simulator, run
from tests.support.machine import System

ANYWHERE = "127.0.0.1:0"


@pytest.fixture
def system(tmp_path: Path) -> Iterator[System]:
    made = System(tmp_path)
    with mock.patch.object(doctor, "Machine", made.machine):
        yield made


def rows_of(answer: Result) -> dict[str, tuple[str, str, str | None]]:
    return {row["check"]: (row["status"], row["evidence"], row["remedy"]) for row in answer.rows}


# -- our own address ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ours", "reached", "status", "evidence"),
    [
        ("192.168.11.10", False, "ok", "this computer has 192.168.11.10, in the network of 192.168.11.210"),
        ("10.0.0.5", False, "fail", "this computer has 10.0.0.5 towards 192.168.11.210, and no address in its network 192.168.11.0"),
        ("", False, "fail", "this computer has no way to 192.168.11.210, and no address in its network 192.168.11.0"),
        ("10.0.0.5", None, "skipped", "this computer has 10.0.0.5 towards 192.168.11.210, and no address in its network 192.168.11.0"),
        ("10.0.0.5", True, "ok", "this computer has 10.0.0.5 towards 192.168.11.210, and no address in its network 192.168.11.0. A router leads there"),
    ],
)  # fmt: skip
def test_the_network_of_this_computer(
    system: System, ours: str, reached: bool | None, status: str, evidence: str
) -> None:
    system.source = ours
    (check,) = subnet(system.machine(), "192.168.11.210", reached=reached)
    assert (check.name, check.status, check.evidence) == ("subnet", status, evidence)
    wanted = "give this computer an address such as 192.168.11.1, mask 255.255.255.0"
    assert check.remedy == (wanted if status in ("fail", "skipped") else "")


def test_the_own_computer_and_names_have_no_network_to_check(system: System) -> None:
    assert [*subnet(system.machine(), "127.0.0.1", reached=True), *subnet(system.machine(), "hand", reached=True)] == []
    assert [host_in(link) for link in ("tcp://10.0.0.5:6000", "tcp://hand", "/dev/ttyUSB0")] == ["10.0.0.5", "hand", ""]
    assert is_local("localhost") and is_local("127.0.0.9") and not is_local("10.0.0.5")


def test_a_hand_that_cannot_be_reached_names_the_network(system: System) -> None:
    """192.0.2.0/24 is nobody's (RFC 5737)."""
    system.source = "10.0.0.5"
    from handctl.errors import LinkError

    with mock.patch("handctl.command.run.Run.open_link", side_effect=LinkError("no way", hint="look")):
        answer = run("doctor", "-p", "tcp://192.0.2.7", "--family", "hand", "--json")
    assert answer.code == 7
    found = rows_of(answer)
    assert found["open"][0] == found["subnet"][0] == "fail"
    assert found["subnet"][2] == "give this computer an address such as 192.0.2.1, mask 255.255.255.0"


# -- who answers --------------------------------------------------------------------------------------------------------


def examined(*arguments: str) -> tuple[Result, dict[str, tuple[str, str, str | None]]]:
    with Simulator("--model", "tp", "--modbus-tcp", ANYWHERE, *arguments, kind="hand") as served:
        answer = run("doctor", "-p", served.link, "--family", "hand", "--count", "3", "--json")
    return answer, rows_of(answer)


@pytest.mark.real
def test_one_hand_at_an_address(system: System) -> None:
    _, found = examined()
    assert found["same_address"][:2] == ("ok", "4 connections read the same: one device has this address")
    assert found["clients"][0] == "ok"


@pytest.mark.real
def test_two_hands_with_one_address(system: System) -> None:
    answer, found = examined("--fault", "twin-ip")
    status, evidence, remedy = found["same_address"]
    assert (status, answer.code) == ("fail", 7)
    assert evidence == (
        "2 devices reply at 127.0.0.1: connections read 211 322 433 544 655 766 and 214 325 436 547 658 769"
    )
    assert remedy is not None and "`handctl hand network` or `handctl hand pair`" in remedy


@pytest.mark.real
def test_a_hand_that_serves_one_client_only(system: System) -> None:
    _, found = examined("--fault", "two-clients-drop")
    assert found["same_address"][0] == "ok"
    assert found["clients"][:2] == ("warning", "another connection ended the first one")
    assert found["clients"][2]


def test_a_moving_hand_proves_nothing(system: System) -> None:
    from handctl.model.result import Journal
    from handctl.tools.doctor_link import same_address

    numbers = iter(range(0, 1000, 10))
    with mock.patch("handctl.tools.doctor_link.open_link") as opened:
        opened.return_value.close = lambda: None
        found = list(same_address("tcp://10.0.0.5:6000", Journal(), lambda _: None, lambda _: [next(numbers)]))
    assert (found[0].name, found[0].status) == ("same_address", "skipped")
