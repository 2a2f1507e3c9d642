"""README's table of symptoms: each made on the simulator for every family, then its next step."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import serial

from handctl.command.command_tree import Command
from handctl.docgen.guide_tables import SYMPTOMS
from handctl.families import FAMILIES
from handctl.link import port_users, tcp
from handctl.link.port_users import Process
from handctl.tools import doctor, ports
from tests.contract.facts import facts_of
from tests.promises import device
from tests.promises.cells import (
    Cell,
    commands_in,
    exempt,
    found_in,
    has_serial,
    link_of,
    made,
    needs,
    reached,
    row_of,
    step,
    typed,
    unless,
    wires_of,
)
from tests.support.cli import run
from tests.support.machine import System

PORT = "/dev/ttyUSB0"
READS = ("status", "dump", "get", "watch")
OPENS = ("status", "watch")
FAR = 60
"""An id that is neither the one as shipped nor among the first that a scan asks, and near enough for a quick sweep."""


def some(family: str) -> Iterator[tuple[str, Command]]:
    """What reads, the first command that writes, and the stop: the others open their link as these do."""
    wanted = (*OPENS, writing_of(family), "stop")
    yield from ((name, command) for name, command in reached(family) if name in wanted)


# -- the port -----------------------------------------------------------------------------------------------------------


def no_port() -> Iterator[Cell]:
    """Each command, whose JSON is valid all the same."""
    for family in FAMILIES:
        for name, command in some(family):

            def check(folder: Path, family: str = family, name: str = name, streams: bool = command.streams) -> None:
                result = needs(typed(family, name, made(folder), "/dev/ttyUSB99", "--json"), 3, said="not-found")
                assert (result.stream[1] if streams else result.json)["exit_code"] == 3

            yield Cell(f"{family} {name}", unless(exempt(family, "no-port", PORT), check))
    yield Cell("handctl ports", lambda folder: machine_step("no-port", folder, next(iter(FAMILIES)), ports, free))


def free(rows: list[dict[str, Any]]) -> None:
    assert [(row["link"], row["state"]) for row in rows] == [(PORT, "free")]


def not_permitted() -> Iterator[Cell]:
    for family in filter(has_serial, FAMILIES):
        yield Cell(f"{family} status", partial(_denied, family))
        yield Cell(f"{family}: handctl doctor", lambda folder, family=family: machine_step(
            "not-permitted", folder, family, doctor, group_named, denied=True))  # fmt: skip


def _denied(family: str, folder: Path) -> None:
    error = serial.SerialException(13, "could not open port")
    with mock.patch.object(serial, "serial_for_url", side_effect=error):
        assert "not permitted" in needs(run(family, "status", "-p", PORT), 3, said="not-permitted").err


def group_named(rows: list[dict[str, Any]]) -> None:
    assert any("usermod -aG dialout" in (row["remedy"] or "") for row in rows), rows


def in_use() -> Iterator[Cell]:
    """Each command but `stop`, which needs no lock: nothing is sent while somebody else has the port open."""
    for family in filter(has_serial, FAMILIES):
        for name, command in some(family):
            if not command.stops:
                yield Cell(f"{family} {name}", partial(_held, family, name))
    yield Cell(
        "handctl ports",
        lambda folder: machine_step("in-use", folder, next(iter(FAMILIES)), ports, holder_named, held=True),
    )


def _held(family: str, name: str, folder: Path) -> None:
    with (
        mock.patch.object(port_users, "held_by_name", lambda _device: True),
        mock.patch.object(port_users, "holders", lambda _device: [Process(4711, "screen")]),
        mock.patch.object(serial, "serial_for_url") as opened,
    ):
        result = needs(typed(family, name, made(folder), PORT), 3, said="busy")
    assert "in use" in result.err and "4711" in result.err and not opened.called


def holder_named(rows: list[dict[str, Any]]) -> None:
    assert [(row["state"], row["holder"]) for row in rows] == [("in use", "screen (pid 4711)")], rows


def machine_step(
    key: str, folder: Path, family: str, tool: Any, look: Callable[[list[dict[str, Any]]], None], *, denied: bool = False, held: bool = False
) -> None:  # fmt: skip
    """The next step, on a computer that has one adapter."""
    folder.mkdir(parents=True)
    system = System(folder)
    system.tty("ttyUSB0", usb=("1a86", "7523"))
    if denied:
        system.denied.add(PORT)
    if held:
        system.process(4711, "screen", opened=PORT)
    error = serial.SerialException(13 if denied else 2, "could not open port")
    with (
        mock.patch.object(tool, "Machine", system.machine),
        mock.patch.object(serial, "serial_for_url", side_effect=error),
    ):
        result = needs(run(*step(key, family, PORT), "--json"), 0, 7)
    look(result.rows)


def refused() -> Iterator[Cell]:
    for family in FAMILIES:
        for name, _ in some(family):
            yield Cell(f"{family} {name}", partial(_turned_away, family, name))
        yield Cell(f"{family}: handctl doctor", partial(_doctor_of_server, family))


def server_of(family: str) -> str:
    """A server that has the device; a serial one is behind an adapter."""
    return "tcp://192.168.0.10" + ("" if row_of(family).tcp_port is not None else ":4001")


def _turned_away(family: str, name: str, folder: Path) -> None:
    with mock.patch.object(tcp, "connect", side_effect=ConnectionRefusedError(111, "Connection refused")):
        result = needs(typed(family, name, made(folder), server_of(family)), 3, said="refused")
    assert "connection refused" in result.err.lower()


def _doctor_of_server(family: str, folder: Path) -> None:
    folder.mkdir(parents=True)
    with (
        mock.patch.object(doctor, "Machine", System(folder).machine),
        mock.patch.object(tcp, "connect", side_effect=ConnectionRefusedError(111, "Connection refused")),
    ):
        rows = needs(run(*step("refused", family, server_of(family)), "--json"), 7).rows
    assert any(row["status"] == "fail" and row["remedy"] for row in rows), rows


# -- the answer -----------------------------------------------------------------------------------------------------------


def no_answer() -> Iterator[Cell]:
    heard: set[str] = set()
    for family in FAMILIES:
        row = row_of(family)
        for wire, option in wires_of(family).items():
            silent = link_of(family, option, "fault=silent")
            yield Cell(
                f"{family} status, {wire}, no power",
                lambda _, f=family, at=silent: needs(run(f, "status", "-p", at), 4),
            )
            if wire not in heard:  # whose silence it is nobody hears
                heard.add(wire)
                yield Cell(
                    f"scan of silence, {wire}", lambda _, at=silent, f=family: needs(run(*step("no-answer", f, at)), 4)
                )
            if row.ids and wire != "modbus-tcp":
                yield from _elsewhere(family, wire, link_of(family, option, f"id={FAR}"), {"id": FAR}, f"id {FAR}")
        slower = [baud for baud in row.speeds if baud != row.baud][:1] if has_serial(family) and row.ids else []
        for baud in slower:
            yield from _elsewhere(family, "serial", link_of(family, f"baud={baud}"), {"baud": baud}, f"{baud} bit/s")


def _elsewhere(family: str, wire: str, link: str, known: dict[str, int], what: str) -> Iterator[Cell]:
    """A device of another id or speed: silence, and each way that is named leads to it."""
    yield Cell(f"{family} status, {wire}, {what}", lambda _: needs(run(family, "status", "-p", link), 4, 5))

    def finds(words: list[str], _folder: Path) -> None:
        result = needs(run(*words, "--json"), 0)
        met = [{key: row.get(key) for key in ("family", *known)} for row in found_in(result)]
        assert {"family": family, **known} in met, met

    yield Cell(f"{family}: README's step, {wire}, {what}", partial(finds, step("no-answer", family, link)))
    yield Cell(f"{family}: its own scan, {wire}, {what}", partial(finds, [family, "scan", "-p", link]))

    def hinted(folder: Path) -> None:
        text = run(family, "status", "-p", link).err
        scans = [words for words in commands_in(text) if "scan" in words]
        if not scans and f"--baud {known.get('baud')}" in text:  # it was found already
            needs(run(family, "status", "-p", link, "--baud", str(known["baud"])), 0)
            return
        assert scans, f"no scan is named: {text}"
        for words in scans:
            finds([*words, "-p", link], folder)

    yield Cell(f"{family}: the hint's step, {wire}, {what}", hinted)


def no_frame() -> Iterator[Cell]:
    for family in filter(has_serial, FAMILIES):
        link = link_of(family, "fault=garble")
        yield Cell(
            f"{family} status", lambda _, f=family, at=link: needs(run(f, "status", "--baud", "19200", "-p", at), 5)
        )
        yield Cell(f"{family}: handctl scan", partial(_scan_names, "no-frame", family, link))


def _scan_names(key: str, family: str, link: str, _folder: Path) -> None:
    """README's step finds a device of this family there."""
    rows = found_in(needs(run(*step(key, family, link), "--json"), 0))
    assert family in [row["family"] for row in rows], rows


def echo() -> Iterator[Cell]:
    for family in FAMILIES:
        for wire, option in wires_of(family).items():
            link = link_of(family, option, "fault=loopback")
            yield Cell(f"{family} status, {wire}", lambda _, f=family, at=link: needs(run(f, "status", "-p", at), 5))
            yield Cell(f"{family}: handctl doctor, {wire}", partial(_doctor_fails, family, link))


def _doctor_fails(family: str, link: str, _folder: Path) -> None:
    rows = needs(run(*step("echo", family, link), "--json"), 7).rows
    assert [
        row
        for row in rows
        if row["status"] == "fail" and re.search(r"own (bytes|frame)", f"{row['evidence']} {row['remedy']}")
    ], rows


def other_family() -> Iterator[Cell]:
    """A command of one family on a device of another. Where both speak one protocol it says so; else nobody answers."""
    for family in FAMILIES:
        for there in FAMILIES:
            wires = wires_of(family).keys() & wires_of(there).keys()
            if family == there:
                continue
            for wire in [wire for wire in wires_of(family) if wire in wires]:
                link = link_of(there, wires_of(there)[wire])
                alike = FAMILIES[family].codec == FAMILIES[there].codec
                for name in READS if alike else READS[:1]:
                    excused = exempt(family, "other-family", there)
                    yield Cell(
                        f"{family} {name} on {there}, {wire}",
                        unless(excused, partial(_strange, family, name, link, alike)),
                    )
                if not exempt(family, "other-family", there):
                    yield Cell(
                        f"{family} {writing_of(family)} on {there}, {wire}",
                        partial(_strange, family, writing_of(family), link, alike),
                    )
                yield Cell(f"{family} typed, {there} found, {wire}", partial(_scan_names, "other-family", there, link))


def writing_of(family: str) -> str:
    """The first command of a family that asks and writes."""
    return next(name for name in facts_of(family).writes if name != "stop")


def _strange(family: str, name: str, link: str, alike: bool, folder: Path) -> None:
    result = needs(typed(family, name, made(folder), link), *((4, 6) if alike else (4, 5, 6)))
    if result.code != 6 or name not in READS:
        return
    assumed = typed(family, name, folder, link, "--assume-identity")
    assert assumed.code not in (2, 6), f"--assume-identity: exit code {assumed.code}"


TABLES: dict[str, Callable[[], Iterator[Cell]]] = {
    "no-port": no_port, "not-permitted": not_permitted, "in-use": in_use, "refused": refused, "no-answer": no_answer,
    "no-frame": no_frame, "echo": echo, "other-family": other_family, "not-initialized": device.not_initialized,
    "not-reached": device.not_reached, "hot": device.hot, "not-saved": device.not_saved, "out-of-range": device.out_of_range, "wrong-values": device.wrong_values,
}  # fmt: skip
"""Symptom -> its cells."""
COVERED = {"not-confirmed": ("tests/docs/test_asking.py", "test_a_command_asks_or_begins_as_the_table_says")}
"""Symptoms that another test holds against every family and command."""


SAID = {
    "no-port": ("exo", "status", "-p", "/dev/ttyUSB99"),
    "no-answer": ("exo", "status", "-p", "fake://exo?clock=virtual&fault=silent"),
    "no-frame": ("exo", "status", "-p", "fake://exo?clock=virtual&fault=garble", "--baud", "19200"),
    "echo": ("exo", "status", "-p", "fake://exo?clock=virtual&fault=loopback"),
    "other-family": ("exo", "force", *"00000", "-y", "-p", "fake://wrist?clock=virtual"),
    "not-initialized": ("barrett", "close", "-y", "-p", "fake://barrett?clock=virtual"),
    "not-reached": ("aidin", "joints", "index.q3=160", "-y", "-p", "fake://aidin?clock=virtual&start=cold"),
    "hot": ("exo", "clear-errors", "-p", "fake://exo?clock=virtual&fault=hot"),
    "out-of-range": ("exo", "position", "2000", *"0000", "-p", "fake://exo?clock=virtual"),
}
"""Symptom -> a command that says the very words. Those of a port are in the cells, and in `link/test_links.py`."""


def words() -> Iterator[Cell]:
    """A reader finds the row by what handctl says."""
    for row in SYMPTOMS:
        if row.key in SAID:
            yield Cell(
                f"words of {row.key}", partial(_says, row.key, row.said.partition("`")[2].partition("`")[0], row.code)
            )


def _says(key: str, text: str, code: int | None, _folder: Path) -> None:
    assert text and text in needs(run(*SAID[key]), *([0, 7] if code is None else [code])).err


def _all_rows(_folder: Path) -> None:
    assert {row.key for row in SYMPTOMS} == {*TABLES, *COVERED}


def cells() -> Iterator[Cell]:
    yield from words()
    yield Cell("each row of README is tried", _all_rows)
    for row in SYMPTOMS:
        for cell in TABLES[row.key]() if row.key in TABLES else ():
            yield Cell(f"{row.key}: {cell.name}", cell.check)
