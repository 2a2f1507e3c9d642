"""`handctl doctor`: every check with a healthy and a sick subject. Links run on virtual time, machines are made of files."""

from __future__ import annotations

import re
from collections import namedtuple
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from packaging.requirements import Requirement

from handctl.errors import DeviceRefused, HandctlError, ProtocolError
from handctl.families import FAMILIES
from handctl.link import ByteLink, Deadline
from handctl.link.link_interface import Trouble
from handctl.model.check_rows import Check
from handctl.model.result import Journal
from handctl.tools import doctor, doctor_link
from handctl.tools.doctor import port_checks
from handctl.tools.doctor_link import LinkChecks
from handctl.tools.family_probe import probe_of
from handctl.tools.port_inventory import needed
from tests.support.cli import Result, Simulator, run, sent, spying, wait_until, writes
from tests.support.each_row import each_row
from tests.support.machine import System
from tests.support.places import PROJECT

LINK = ("open", "unasked", "answer", "speed", "echo", "error_rate", "round_trip", "delay")


@pytest.fixture
def system(tmp_path: Path) -> Iterator[System]:
    """A healthy machine without ports; doctor sees it instead of this one."""
    made = System(tmp_path)
    with mock.patch.object(doctor, "Machine", made.machine):
        yield made


def healthy(answer: Result) -> dict[str, tuple[str, str, str | None]]:
    """Check -> (status, evidence, remedy)."""
    return {row["check"]: (row["status"], row["evidence"], row["remedy"]) for row in answer.rows}


def link_rows(link: str, family: str, *args: str) -> tuple[Result, dict[str, tuple[str, str, str | None]]]:
    """doctor on a simulated line, in virtual time."""
    joint = "&" if "?" in link else "?"
    answer = run("doctor", "-p", f"{link}{joint}clock=virtual", "--family", family, "--json", *args)
    return answer, healthy(answer)


# -- this machine -------------------------------------------------------------------------------------------------


def test_a_healthy_machine(system: System) -> None:
    system.tty("ttyUSB0", usb=("1a86", "7523"))
    answer = run("doctor", "--json")
    assert answer.code == 0, answer
    assert [(row["check"], row["status"]) for row in answer.rows] == [
        (name, "ok")
        for name in (
            "python", "packages", "permissions", "modemmanager", "brltty", "clock", "locale", "terminal", "disk", "locks",
        )
    ]  # fmt: skip
    assert all(row["evidence"] and row["remedy"] is None for row in answer.rows)


def test_a_sick_machine(system: System) -> None:
    system.tty("ttyUSB0", usb=("1a86", "7523"))
    system.denied.add("/dev/ttyUSB0")
    system.process(812, "ModemManager")
    system.process(813, "brltty")
    system.usb("1-5", "10c4", "ea60")
    system.can("can0", "down")
    system.write("/run/lock/LCK..ttyUSB0", "999\n")
    answer = run("doctor", "--json")
    assert (answer.code, answer.error["code"]) == (7, "findings")
    rows = healthy(answer)
    for name, evidence, remedy in (
        ("permissions", "cannot be opened: /dev/ttyUSB0", "sudo usermod -aG dialout"),
        ("modemmanager", "ModemManager (pid 812) writes AT commands", "ID_MM_DEVICE_IGNORE"),
        ("brltty", "brltty (pid 813) takes adapters", "run `sudo apt remove brltty`"),
        ("adapter", "CP210x (10c4:ea60) is plugged in but has no serial port", "brltty"),
        ("can", "can0 is down", "run `sudo ip link set can0 up type can bitrate 1000000`"),
        ("locks", "/run/lock/LCK..ttyUSB0 of pid 999, which is gone", "sudo rm /run/lock/LCK..ttyUSB0"),
    ):
        assert rows[name][0] == "warning"
        assert rows[name][1].startswith(evidence)
        assert remedy in str(rows[name][2])
    assert answer.error["text"].startswith("6 of 12 checks found a problem: permissions (warning)")


def test_grabbers_without_a_port_are_no_finding(system: System) -> None:
    system.process(812, "ModemManager")
    answer = run("doctor", "--json")
    assert answer.code == 0
    assert healthy(answer)["modemmanager"][0] == "ok"
    assert healthy(answer)["permissions"][:2] == ("skipped", "no serial port is plugged in")


def test_a_ctrl_c_keeps_what_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def ended(*_args: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(probe_of("exo"), "ping", ended)
    answer = run("doctor", "--json", "-p", "fake://exo?clock=virtual", "--family", "exo")
    assert (answer.code, answer.error["code"]) == (130, "interrupted")
    assert [row["check"] for row in answer.rows][-2:] == ["open", "unasked"]


def test_old_and_missing_packages() -> None:
    versions = {
        "click": "8.0.4",
        "pyserial": "3.5",
        "rich": "13.10.1",
        "python-can": "4.3.0",
        "crcmod": "1.7",
        "tomli": "2.0.1",
    }

    def version(name: str) -> str:
        if name not in versions:
            raise metadata.PackageNotFoundError(name)
        return versions[name]

    with mock.patch.object(metadata, "version", version):
        check = doctor.packages()
    assert check.status == "fail"
    assert check.evidence.startswith("bincopy is missing, click 8.0.4 (needs 8.1). Installed: ")
    assert check.remedy.endswith(" -m pip install 'bincopy>=20.0' 'click>=8.1'`")  # handctl itself is in no registry
    with mock.patch.dict(versions, {"click": "8.10", "bincopy": "20"}), mock.patch.object(metadata, "version", version):
        assert doctor.packages().status == "ok"
    with mock.patch.object(metadata, "version", mock.Mock(side_effect=metadata.PackageNotFoundError)):
        assert doctor.packages().status == "skipped"


@each_row("python", ["3.10", "3.11", "3.13"])
def test_packages_are_those_of_the_package(python: str) -> None:
    text = (PROJECT / "pyproject.toml").read_text(encoding="utf-8")
    block = text.partition("dependencies = [")[2].partition("]")[0]
    every = [Requirement(line) for line in re.findall(r'"(.+)",', block)]
    there = [each for each in every if each.marker is None or each.marker.evaluate({"python_version": python})]
    version = tuple(map(int, python.split(".")))
    assert {each.name: str(each.specifier).removeprefix(">=") for each in there} == needed(version)


def test_an_old_python() -> None:
    with mock.patch.object(doctor.sys, "version_info", (3, 9, 1)):
        assert (doctor.python().status, doctor.python().evidence) == ("fail", "3.9.1 is too old")


@each_row(("now", "status"), [(1_000_000.0, "warning"), (2_000_000_000.0, "ok"), (1_999_950_000.0, "ok")])
def test_a_clock_before_the_installation(now: float, status: str) -> None:
    assert doctor.clock(now, 2_000_000_000.0).status == status


@each_row(("encoding", "status"), [("utf-8", "ok"), ("UTF8", "ok"), ("ascii", "warning"), (None, "warning")])
def test_locale(encoding: str | None, status: str) -> None:
    with mock.patch.object(doctor.sys, "stdout", mock.Mock(encoding=encoding)):
        assert doctor.locale().status == status


@each_row(("columns", "term", "status"), [(80, "xterm", "ok"), (79, "xterm", "warning"), (120, "dumb", "warning")])
def test_terminal(columns: int, term: str, status: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", term)
    size = mock.Mock(columns=columns)
    with (
        mock.patch.object(doctor.sys, "stdout", mock.Mock(isatty=lambda: True)),
        mock.patch.object(doctor.shutil, "get_terminal_size", lambda: size),
    ):
        assert doctor.terminal().status == status


@each_row(("free", "status"), [(10**9, "ok"), (10**8 - 1, "warning"), (10**6, "fail")])
def test_room(free: int, status: str, tmp_path: Path) -> None:
    usage = namedtuple("usage", "free")(free)
    with mock.patch.object(doctor.shutil, "disk_usage", lambda _folder: usage):
        assert doctor.room(tmp_path).status == status


# -- a link -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", list(FAMILIES))
def test_a_healthy_device(system: System, family: str) -> None:
    answer, rows = link_rows(f"fake://{family}", family, "--count", "20")
    assert answer.code == 0, answer
    # Some understand the same questions: who it is gets a row of its own.
    expected = [*LINK[:3], "identity", *LINK[3:]] if hasattr(probe_of(family), "identify") else list(LINK)
    if hasattr(probe_of(family), "measure"):  # what a family can measure of its line
        place = expected.index("echo") + 1
        expected[place:place] = ["first_byte", "half_duplex", "packets", "others"]
    found = [row["check"] for row in answer.rows]
    assert found[found.index("open") :][: len(expected)] == expected
    own = found[found.index("open") + len(expected) :]  # what a family checks beside
    assert bool(own) is hasattr(probe_of(family), "further")
    assert {status for status, _, _ in rows.values()} <= {"ok", "skipped"}
    assert rows["error_rate"][1] == "0 of 20 reads failed"
    assert answer.json["device"]["kind"] == family
    assert answer.json["device"]["fake"] is True


def test_round_trips_are_numbers_too(system: System) -> None:
    answer, rows = link_rows("fake://exo?turnaround=0.004", "exo", "--count", "10")
    (row,) = [row for row in answer.rows if row["check"] == "round_trip"]
    assert row["count"] == 10
    assert row["median_ms"] == pytest.approx(4.0, abs=0.1)
    assert sum(count for _, count in row["histogram"]) == 10
    assert rows["round_trip"][1].startswith("force_actual: median 4.0 ms, p95 4.0, max 4.0 over 10. Histogram in ms: ≤")


def test_a_wrong_speed_is_named_with_the_right_one(system: System) -> None:
    answer, rows = link_rows("fake://exo?baud=57600", "exo")
    assert answer.code == 7
    assert rows["answer"][0] == "fail"
    assert rows["speed"] == (
        "fail", "the device replies at 57600 bit/s, not at 115200",
        "give --baud 57600, or set the device back to 115200 bit/s",
    )  # fmt: skip
    assert answer.error["hint"] == "Give --baud 57600, or set the device back to 115200 bit/s."


def test_a_hand_that_finds_its_speed_by_itself(system: System) -> None:
    answer, rows = link_rows("fake://barrett?baud=38400", "barrett", "--count", "5")
    assert answer.code == 0
    assert rows["speed"] == (
        "ok", "the device replies at 38400 bit/s, not at 9600. Other speeds were tried",
        "give --baud 38400",
    )  # fmt: skip


@each_row("speed", [9600, 38400])
def test_a_barrett_hand_without_an_echo_has_replied(speed: int) -> None:
    """Its prompt shows the baud rate: no other one is tried, and no row says that there was no reply."""
    link = f"fake://barrett?fault=no-echo&baud={speed}"
    answer, rows = link_rows(link, "barrett")
    assert answer.code == 7
    assert [rows[name][0] for name in ("answer", "speed", "echo")] == ["fail", "ok", "fail"]
    assert f"at {speed} bit/s" in rows["answer"][1] and f"at {speed} bit/s" in rows["speed"][1], rows
    assert "no reply" not in " ".join(rows[name][1] for name in ("answer", "speed", "echo"))
    for words in (("barrett", "status"), ("barrett", "scan"), ("scan", "--id", "1")):
        found = run(*words, "-p", f"{link}&clock=virtual", "--json")
        assert (found.code, found.error["code"], f"at {speed} bit/s" in found.error["text"]) == (5, "no-echo", True), (
            found
        )


@each_row("fault, either", [("silent", True), ("wrong-id", False)])
def test_no_reply_either_follows_silence_alone(fault: str, either: bool) -> None:
    _, rows = link_rows(f"fake://exo?fault={fault}", "exo", "--count", "5")
    assert "no reply at 57600, 19200" in rows["speed"][1] and rows["speed"][1].endswith("either") is either, rows


@pytest.mark.parametrize("family", ["exo", "wrist", "barrett", "ekso"])
def test_silence_is_a_row_and_7(system: System, family: str) -> None:
    answer, rows = link_rows(f"fake://{family}?fault=silent", family)
    assert answer.code == 7
    assert rows["answer"][0] == "fail"
    assert "no reply" in rows["answer"][1]
    assert rows["answer"][2]
    assert "error_rate" not in rows


def test_bad_checksums_are_a_rate(system: System) -> None:
    _, rows = link_rows("fake://exo?fault=bad-checksum&every=20", "exo", "--timeout", "0.05")
    status, evidence, remedy = rows["error_rate"]
    assert status == "warning"
    assert re.fullmatch(
        r"5 of \d+ reads failed \(\d\.\d %\): 5 bad-checksum\. 50 bytes in between outside of any reply", evidence
    )
    assert "cable" in str(remedy)


def test_lost_answers_are_a_rate(system: System) -> None:
    _, rows = link_rows("fake://exo?fault=silent&every=4&after=1", "exo", "--timeout", "0.05")
    assert rows["error_rate"][0] == "fail"
    assert re.search(r"\(2\d\.\d %\): \d+ no-answer$", rows["error_rate"][1])
    assert "lost" in str(rows["error_rate"][2])


def test_noise_between_good_answers_is_seen(system: System) -> None:
    answer, rows = link_rows("fake://exo?fault=noise&every=5", "exo")
    assert answer.code == 7
    assert rows["error_rate"][0] == "warning"
    assert re.fullmatch(r"0 of 100 reads failed\. \d+ bytes in between outside of any reply", rows["error_rate"][1])


def test_an_echo_with_answers_is_an_adapter(system: System) -> None:
    _, rows = link_rows("fake://exo?fault=echo", "exo", "--count", "10")
    assert rows["echo"][:2] == ("warning", "our own bytes came back in 10 of 10 reads, before the reply")
    assert rows["error_rate"][0] == "ok"


def test_a_device_that_hangs_up_is_a_row(system: System) -> None:
    answer, rows = link_rows("fake://exo?fault=disconnect&after=20", "exo")
    assert answer.code == 7
    assert rows["connection"][0] == "fail"


def test_can(system: System) -> None:
    answer, rows = link_rows("fake://wrist?bus=can", "wrist", "--count", "10")
    assert answer.code == 0
    assert rows["echo"][0] == "skipped"
    assert rows["unasked"][1] == "0 frames of others within 0.3 s"


@each_row("answered", [True, False])
def test_an_adapter_that_is_error_passive_next_to_a_device_that_replies(answered: bool) -> None:
    """That nobody acknowledges and that 0 of 5 reads failed cannot both be so: what the flags mean is told by the replies."""
    seen = mock.Mock(answered=answered, series=mock.Mock(failed={}))
    seen.link.trouble.return_value = Trouble("no-ack", "Its status flags are 24")
    status, evidence, remedy = doctor_link._bus(seen)
    assert status == ("warning" if answered else "fail")
    assert evidence.startswith(doctor_link.BUS["repeats" if answered else "no-ack"][0])
    assert remedy == doctor_link.BUS["repeats" if answered else "no-ack"][1]


@each_row("family", list(FAMILIES))
def test_it_finds_out_who_is_there(system: System, family: str) -> None:
    """By itself, and as the family's own command: the same checks of the same device."""
    link = f"fake://{family}?clock=virtual"
    found = run("doctor", "-p", link, "--count", "5", "--json")
    own = run(family, "doctor", "-p", link, "--count", "5", "--json")
    rows, named = healthy(found), healthy(own)
    assert (found.code, own.code) == (0, 0), (found, own)
    assert rows.pop("device")[0] == "ok" and rows["answer"][0] == "ok"
    assert list(rows) == list(named)
    assert found.json["device"]["kind"] == own.json["device"]["kind"] == family


def test_nobody_there_is_a_row_and_7(system: System) -> None:
    answer = run("doctor", "-p", "fake://exo?clock=virtual&fault=silent", "--json")
    assert (answer.code, answer.json["device"]["kind"]) == (7, "unknown")
    assert (healthy(answer)["device"][0], healthy(answer)["answer"][0]) == ("fail", "skipped")


@each_row("command", [("doctor",), ("exo", "doctor")])
def test_it_only_reads(system: System, command: tuple[str, ...], tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    run(*command, "-p", "fake://exo?clock=virtual", "--trace", trace)
    assert sent(trace) and writes(trace) == []


def test_a_port_that_is_not_there_is_a_row_and_7(system: System) -> None:
    answer = run("doctor", "-p", "/dev/ttyNOTHING0", "--family", "ekso", "--json")
    rows = healthy(answer)
    assert answer.code == 7
    assert rows["open"][:2] == ("fail", "/dev/ttyNOTHING0: no such port")
    assert rows["answer"][:2] == ("skipped", "the link is not open")


def test_a_known_port_tells_permission_holder_and_timer(system: System) -> None:
    system.tty("ttyUSB0", usb=("0403", "6001", "A1"), latency=16)
    system.denied.add("/dev/ttyUSB0")
    system.process(4711, "screen", opened="/dev/ttyUSB0")
    for link in ("/dev/ttyUSB0", "usb:0403:6001", "usb:403:6001", "usb:0403:6001:A1"):
        checks = {check.name: check for check in port_checks(system.machine(), link)}
        assert {name: check.status for name, check in checks.items()} == {
            "permission": "fail", "holder": "fail", "latency_timer": "warning",
        }  # fmt: skip
        assert checks["holder"].evidence == "/dev/ttyUSB0 is in use by screen (pid 4711)"
        assert "up to 16 ms" in checks["latency_timer"].evidence
        assert "latency_timer" in checks["latency_timer"].remedy
    for link in ("usb:1a86:7523", "usb:0403:6001:A", "usb:0403:600"):
        assert port_checks(system.machine(), link) == []
    assert port_checks(system.machine(), "fake://exo") == []


@pytest.mark.parametrize(
    ("args", "code"),
    [(("--family", "exo"), "no-link"), (("--fake",), "no-family"), (("--family", "nobody"), "usage")],
)
def test_what_cannot_be_examined(args: tuple[str, ...], code: str) -> None:
    answer = run("doctor", "--json", *args)
    assert (answer.code, answer.error["code"]) == (2, code)


def test_the_wrong_wire_is_a_usage_error(system: System) -> None:
    assert run("doctor", "-p", "can:socketcan:can0", "--family", "ekso").code == 2


# -- delays -------------------------------------------------------------------------------------------------------


class Slow(ByteLink):
    """Answers every byte after `seconds`; no device family is needed for that."""

    def __init__(self, name: str, seconds: float) -> None:
        self.name = name
        self.seconds = seconds
        self.time = 0.0
        self.due: list[float] = []

    def now(self) -> float:
        return self.time

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.due.append(self.time + self.seconds)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        if self.due and self.due[0] <= deadline.at:
            self.time = max(self.time, self.due.pop(0))
            return b"!"
        self.time = max(self.time, deadline.at)
        return b""

    def close(self) -> None:
        pass


class OneByte:
    """A family whose cheapest question is one byte."""

    WIRES, SPEEDS, PING = ("serial", "tcp"), (9600,), "byte"

    def probe(self, link: Any, journal: Any, deadline: Deadline, ids: Any = (1,)) -> list[dict[str, Any]]:
        return []

    def ping(self, device: Any) -> None:
        device.write(b"?", device.deadline(1))
        assert device.read(device.deadline(1)) == b"!"


class Garbled(Slow):
    """Has a speed to set, and answers something at all of them."""

    can_set_baud = True

    def __init__(self) -> None:
        super().__init__("/dev/x", 0.001)
        self.baud = 9600

    def set_baud(self, baud: int) -> None:
        self.baud = baud


class Complaining(OneByte):
    """Its device answers, but never as it should: with `error`."""

    SPEEDS = (9600, 19200)

    def __init__(self, error: HandctlError) -> None:
        self.error = error

    def ping(self, device: Any) -> None:
        super().ping(device)
        raise self.error

    def probe(self, link: Any, journal: Any, deadline: Deadline, ids: Any = (1,)) -> list[dict[str, Any]]:
        raise ProtocolError("garbage here too", code="garbage")


def complained(error: HandctlError) -> tuple[Garbled, dict[str, Check]]:
    link = Garbled()
    checks = LinkChecks(link, Complaining(error), lambda on: on, 20, link.deadline(8), Journal()).run()
    return link, {check.name: check for check in checks}


def test_garbage_is_a_wrong_speed_suspected() -> None:
    link, checks = complained(ProtocolError("garbage", code="garbage"))
    assert checks["answer"].status == "fail"
    assert checks["speed"].status == "warning"
    assert checks["speed"].evidence == "the data at 9600 bit/s is garbage, no reply at 19200"
    assert link.baud == 9600
    assert "error_rate" not in checks


def test_a_refusal_is_an_answer() -> None:
    _, checks = complained(DeviceRefused("ERR 64"))
    assert checks["answer"].status == "ok"
    assert checks["error_rate"].evidence == "0 of 20 reads failed"


def test_garbage_at_a_speed_that_another_would_heal(system: System) -> None:
    _, rows = link_rows("fake://exo?baud=57600&fault=noise", "exo", "--timeout", "0.05")
    assert rows["speed"][:2] == ("fail", "the device replies at 57600 bit/s, not at 115200")


def delay(name: str, seconds: float) -> Check:
    link = Slow(name, seconds)
    checks = LinkChecks(link, OneByte(), lambda on: on, 20, link.deadline(8), Journal()).run()
    return next(check for check in checks if check.name == "delay")


@each_row(
    ("name", "seconds", "status"),
    [
        ("tcp://h:1", 0.044, "warning"), ("tcp://h:1", 0.034, "ok"), ("tcp://h:1", 0.061, "ok"),
        ("tcp://h:1", 0.016, "ok"), ("/dev/x", 0.016, "warning"), ("/dev/x", 0.014, "ok"), ("/dev/x", 0.044, "ok"),
    ],
)  # fmt: skip
def test_the_two_plateaus(name: str, seconds: float, status: str) -> None:
    check = delay(name, seconds)
    assert check.status == status
    assert f"median {seconds * 1000:.0f}" in check.evidence
    assert bool(check.remedy) == (status == "warning")


def test_a_slow_wire_is_no_latency_timer(system: System) -> None:
    """19 bytes at 19200 bit/s are 9.9 ms: of 15.9 ms a timer cannot be the cause; at 115200 it can."""
    _, rows = link_rows("fake://exo?baud=19200&wire=auto&turnaround=0.006", "exo", "--baud", "19200", "--count", "5")
    assert rows["delay"][:2] == ("ok", "median 15.9 ms is not the 16 ms of a latency timer")
    _, rows = link_rows("fake://exo?wire=auto&turnaround=0.0145", "exo", "--count", "5")
    assert rows["delay"][:2] == ("warning", "median 16 ms: looks like an adapter's latency timer of 16 ms")
    assert delay("/dev/rfcomm0", 0.016).status == "ok"


def test_a_series_is_bounded_in_time() -> None:
    link = Slow("/dev/x", 0.5)
    checks = {
        check.name: check
        for check in LinkChecks(link, OneByte(), lambda on: on, 10000, link.deadline(8), Journal()).run()
    }
    assert checks["error_rate"].evidence == "0 of 5 reads failed"
    assert link.time == pytest.approx(doctor_link.LISTEN + 3.0)


def test_a_stream_has_no_round_trip(system: System) -> None:
    _, rows = link_rows("fake://aidin", "aidin", "--count", "10")
    assert rows["delay"][:2] == ("skipped", "the device sends data unasked: no round trip is measured")
    assert rows["round_trip"][1].startswith("feedback arrives unasked, interval: median 10.0 ms")


@pytest.mark.real
def test_the_plateau_of_a_served_hand(system: System) -> None:
    """A server that writes in pieces without TCP_NODELAY, as the manual's hand may be."""
    options = ("--set", "exchange=poll", "--set", "chunk=200", "--set", "nagle=1")
    with Simulator("--tcp", "127.0.0.1:0", *options, kind="aidin") as simulator:
        delay: list[Any] = []

        def seen() -> bool:
            words = ("-p", simulator.link, "--family", "aidin", "--json", "--count", "10")
            delay[:] = healthy(run("doctor", *words))["delay"]
            return delay[0] == "warning"

        wait_until(seen)  # a busy machine is later still
    assert "TCP_NODELAY" in str(delay[2])


# -- how it looks -------------------------------------------------------------------------------------------------


def test_the_table(system: System) -> None:
    system.process(813, "brltty")
    system.tty("ttyUSB0", usb=("1a86", "7523"))
    answer = run("doctor")
    assert answer.code == 7
    assert answer.lines[0].split() == ["Check", "Status", "Evidence"]
    assert any(
        line.startswith("brltty         warning") or line.split()[:2] == ["brltty", "warning"] for line in answer.lines
    )
    assert any(line.startswith("brltty: ") and "`sudo apt remove brltty`" in line for line in answer.lines)
    assert "1 of 10 checks found a problem: brltty (warning)." in answer.err


def test_plain_and_csv(system: System) -> None:
    assert run("doctor", "--format", "plain").lines[0] == "python\tok"
    assert run("doctor", "--csv").lines[0] == "check,status,evidence,remedy"


@each_row("device", ["exo?fault=bad-checksum", "wrist?fault=bad-checksum", "exo?fault=truncate"])
def test_the_search_and_the_checks_have_one_deadline(device: str) -> None:
    with spying() as spy:
        answer = run("doctor", "-p", f"fake://{device}&clock=virtual", "--deadline", "2", "--json")
    assert answer.code == 7
    assert spy.now == pytest.approx(2.0, abs=0.01)
