"""`handctl FAMILY report FILE.html`: one page per family, what is in it, what never is, and every way it can go wrong."""

from __future__ import annotations

import hashlib
import html
import os
import re
import subprocess
import sys
from pathlib import Path
from unittest import mock

import pytest

from handctl import report
from handctl.errors import CheckFailed, OutputError, ProtocolError
from handctl.families import FAMILIES
from handctl.link.transcript import parse
from handctl.model.device_picture import outline_of
from handctl.model.result import Column, Row, Table
from handctl.report import html as report_html
from tests.support.cli import Result, fake, run, spying
from tests.support.each_row import each_row
from tests.support.page import Page

SHOWN = {
    # what only a page about this simulated device holds: in status or dump, in the curves, in the bytes
    "exo": ("supply 558", "position_actual little", "EB 90 01 04 11 C0 05 97 72"),
    "wrist": ("movement time 700 ms", "pitch_actual -3.45", "EB 90 01 04 30 FC 03 18 4C"),
    "hand": ("Speed of the next movement: 601", "angle_actual little", "EB 90 01 04 11 FE 05 5A 73"),
    "barrett": ("104233", "strain F1 112", "46 47 45 54 20 50 20 53 47 20 53 20 4F 44 20 45 4E 0D"),
    "ekso": ("standing (0x2040)", "left_knee_angle over", "98 00 00 03 F7 FF"),
    "aidin": ("task_space_pos", "joint_pos (20 values)", "7B 22 6D 6F 74 6F 72"),
}
PRIVATE = {
    # the number, and how its device says it on the wire
    "barrett": ("1042", "31 30 34 32"),
    "ekso": ("4711", "12 67"),
}


def link(kind: str, **options: object) -> str:
    return fake(**options).replace("fake://exo", f"fake://{kind}")


def taken(kind: str, file: Path, *args: str, at: str = "") -> Result:
    return run(kind, "report", file, "--watch", "0.5", "-p", at or link(kind), "--json", *args)


def section(text: str, name: str) -> str:
    (found,) = re.findall(rf'<section id="{name}".*?</section>', text, re.DOTALL)
    return str(found)


def transcript(text: str) -> list[str]:
    (found,) = re.findall(r"<pre>(.*?)</pre>", text, re.DOTALL)
    return html.unescape(found).splitlines()


# -- every family ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", FAMILIES)
def test_the_page_of_a_family(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "r.html"
    result = taken(kind, file)
    assert result.code == 0, result
    text = file.read_text(encoding="utf-8")
    assert result.rows == [
        {"file": str(file), "size": len(text.encode()), "sha256": hashlib.sha256(file.read_bytes()).hexdigest()}
    ]
    assert result.json["device"]["kind"] == kind
    seen = Page(text)
    assert "service report" in seen.text
    assert "Simulated" in seen.text
    assert "Incomplete" not in seen.text
    values, curves, request = SHOWN[kind]
    assert values in seen.text
    assert curves in section(text, "watch")
    assert seen.data["schema"] == "handctl-report/1"
    assert {row["name"] for row in seen.data["watch"]} <= {
        row["name"] for row in (*seen.data["dump"], *seen.data["status"])
    }
    assert any(request in line for line in transcript(text)), transcript(text)[:5]
    assert os.listdir(tmp_path) == ["r.html"]


@pytest.mark.parametrize("kind", PRIVATE)
def test_whose_device_it_is_stays_out(kind: str, tmp_path: Path) -> None:
    number, wire = PRIVATE[kind]
    file = tmp_path / "r.html"
    assert taken(kind, file).code == 0
    text = file.read_text(encoding="utf-8")
    assert not re.search(rf"(?<!\d){number}(?!\d)", text)
    assert wire not in text
    assert not [line for line in transcript(text) if re.match(r"[\d.]+ <", line)]
    assert re.search(r"# [\d.]+ &lt; \d+ bytes left out", text)
    assert "redacted" in section(text, "dump")
    assert "The bytes of the device are left out because they hold ids." in section(text, "transcript")

    kept = tmp_path / "kept.html"
    assert taken(kind, kept, "--include-ids").code == 0
    text = kept.read_text(encoding="utf-8")
    assert number in section(text, "dump")
    assert any(wire in line for line in transcript(text))
    assert "redacted" not in text
    assert "left out" not in text


@pytest.mark.parametrize("kind", ["exo", "wrist", "aidin"])
def test_the_bytes_are_a_transcript_that_replays(kind: str, tmp_path: Path) -> None:
    file, trace = tmp_path / "r.html", tmp_path / "t.txt"
    assert taken(kind, file).code == 0
    lines = transcript(file.read_text(encoding="utf-8"))
    assert parse(lines)
    trace.write_text("\n".join(lines), encoding="utf-8")
    again = run(kind, "status", "-p", f"replay:{trace}", "--json")
    assert again.code == 0, again
    direct = run(kind, "status", "-p", link(kind), "--json")
    assert again.rows == direct.rows


def test_reading_only(tmp_path: Path) -> None:
    """Nothing but read requests goes to a hand that may be worn; --dry-run has nothing to plan."""
    file = tmp_path / "r.html"
    assert taken("exo", file).code == 0
    sent = [entry.data for entry in parse(transcript(file.read_text(encoding="utf-8"))) if entry.mark == ">"]
    assert {data[4] for data in sent} == {0x11}
    assert run("exo", "report", tmp_path / "n.html", "-n", "--fake").code == 2
    assert not (tmp_path / "n.html").exists()


def test_a_page_without_findings_is_one(tmp_path: Path) -> None:
    """What is long is shut, and not printed, where nothing is wrong; else it is open."""
    file = tmp_path / "r.html"
    assert taken("exo", file).code == 0
    seen = Page(file.read_text(encoding="utf-8"))
    assert (seen.count["details"], seen.data["messages"]) == (4, [])
    assert taken("exo", file, "--force", at=link("exo", fault="over-temperature")).code == 0
    seen = Page(file.read_text(encoding="utf-8"))
    assert "details" not in seen.count
    assert {message["code"] for message in seen.data["messages"]} == {"unhealthy"}


@pytest.mark.parametrize("kind", list(SHOWN))
def test_every_family_is_drawn(kind: str, tmp_path: Path) -> None:
    assert taken(kind, tmp_path / "r.html").code == 0
    drawn = Page(section((tmp_path / "r.html").read_text(encoding="utf-8"), "status")).count["svg"]
    assert drawn == len([by for by in outline_of(kind).measures if by != "error"])  # type: ignore[union-attr]


def test_without_a_watch(tmp_path: Path) -> None:
    file = tmp_path / "r.html"
    assert run("exo", "report", file, "--watch", "0", "-p", link("exo")).code == 0
    text = file.read_text(encoding="utf-8")
    assert "<svg" not in section(text, "watch")
    assert "none was asked for" in section(text, "watch")
    assert run("exo", "report", file, "--watch", "-1", "--fake").code == 2


def test_findings_stand_first(tmp_path: Path) -> None:
    file = tmp_path / "r.html"
    assert taken("exo", file, at=link("exo", fault="over-temperature")).code == 0
    text = file.read_text(encoding="utf-8")
    assert "over_temperature" in section(text, "findings")
    assert "over_temperature" in section(text, "watch")
    assert text.index('id="findings"') < text.index('id="status"')


def test_a_family_may_look_deeper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of further checks stand with the findings; that they judge is no failure of the report."""
    from handctl.command.command_tree import Group
    from handctl.command.common_commands import add_map_verbs
    from handctl.devices.inspire.exo.cli import cli
    from handctl.devices.inspire.exo.register_map import EXO

    def checks(_run: object) -> Table:
        rows: list[Row] = [{"check": "cable", "status": "fail"}]
        columns = (Column("check", "Check"), Column("status", "Status"))
        return Table(rows=rows, columns=columns, failure=CheckFailed("1 failed"))

    assert cli.family is not None
    group = Group("exo", family=cli.family._replace(checks=checks))
    add_map_verbs(group, EXO)
    monkeypatch.setitem(cli.commands, "report", group.commands["report"])
    file = tmp_path / "r.html"
    assert taken("exo", file).code == 0
    findings = section(file.read_text(encoding="utf-8"), "findings")
    assert "<td>cable</td><td>fail</td>" in findings
    assert "Nothing unhealthy" not in findings


# -- what goes wrong ------------------------------------------------------------------------------------------------


def test_a_file_is_not_overwritten_unless_it_is_meant(tmp_path: Path) -> None:
    file = tmp_path / "r.html"
    file.write_text("mine", encoding="utf-8")
    with spying() as spy:
        refused = taken("exo", file)
    assert refused.code == 2
    assert refused.error["code"] == "file-exists"
    assert spy.lines == []
    assert file.read_text(encoding="utf-8") == "mine"
    assert taken("exo", file, "--force").code == 0
    assert file.read_bytes().startswith(b"<!DOCTYPE html>")


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    refused = taken("exo", tmp_path / "no" / "r.html")
    assert (refused.code, refused.error["code"]) == (1, "no-folder")


@each_row("args", [(), ("--force",)])
def test_what_is_no_file_is_never_replaced(args: tuple[str, ...]) -> None:
    refused = taken("exo", Path(os.devnull), *args)
    assert (refused.code, refused.error["code"]) == (2, "no-file")
    assert not os.path.isfile(os.devnull)


def test_a_device_that_cannot_be_opened_is_not_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from handctl.devices.inspire.exo.cli import cli

    def refuse(*_: object) -> None:
        raise ProtocolError("this is something else", code="who-is-it")

    command = cli.commands["report"]
    monkeypatch.setattr(command, "family", command.family._replace(open=refuse))  # type: ignore[attr-defined]
    result = taken("exo", tmp_path / "r.html")
    assert result.code == 5
    text = Page((tmp_path / "r.html").read_text(encoding="utf-8")).text
    assert "connection: This is something else. [who-is-it]" in text
    assert "status: " not in text


def test_no_link_is_no_page(tmp_path: Path) -> None:
    refused = run("exo", "report", tmp_path / "r.html", "--json")
    assert (refused.code, refused.error["code"]) == (2, "no-link")
    assert os.listdir(tmp_path) == []


def test_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    def full(_number: int) -> None:
        raise OSError(28, "No space left on device")

    with mock.patch.object(report.os, "fsync", full):
        failed = taken("exo", tmp_path / "r.html")
    assert failed.code == OutputError.exit_code
    assert os.listdir(tmp_path) == []


def test_a_file_that_appears_meanwhile_stays(tmp_path: Path) -> None:
    file = tmp_path / "r.html"

    def appear(content: report_html.Report) -> str:
        file.write_text("theirs", encoding="utf-8")
        return report_html.page(content)

    with mock.patch.object(report, "page", appear):
        failed = taken("exo", file)
    assert failed.code == OutputError.exit_code
    assert file.read_text(encoding="utf-8") == "theirs"
    assert os.listdir(tmp_path) == ["r.html"]


@each_row(
    ("kind", "fault", "code"),
    [("exo", "silent", 4), ("wrist", "bad-checksum", 5), ("barrett", "silent", 4), ("ekso", "silent", 4)],
)
def test_a_device_that_says_nothing_valid_has_a_page_that_says_so(
    kind: str, fault: str, code: int, tmp_path: Path
) -> None:
    file = tmp_path / "r.html"
    result = taken(kind, file, "--retries", "0", at=link(kind, fault=fault))
    assert result.code == code, result
    assert [row["file"] for row in result.rows] == [str(file)]
    text = file.read_text(encoding="utf-8")
    seen = Page(text)
    assert "Incomplete" in seen.text
    told = seen.text.partition("Incomplete")[2]
    assert "status: " in told
    assert result.error["code"] in told
    assert result.error["text"] in told or kind in PRIVATE
    assert "not read, see above" in section(text, "dump")
    assert [line for line in transcript(text) if re.match(r"[\d.]+ >", line)], "what was asked is in it"
    assert not [line for line in transcript(text) if line in ("# dump", "# watch")], "nobody is asked on and on"


def test_a_port_that_cannot_be_opened_has_a_page_too(tmp_path: Path) -> None:
    file = tmp_path / "r.html"
    result = taken("exo", file, at="/dev/ttyNOTHING0")
    assert result.code == 3
    text = Page(file.read_text(encoding="utf-8")).text
    assert "connection: " in text
    assert "/dev/ttyNOTHING0: not known to the system" in text
    assert "Simulated" not in text
    assert "no byte passed" in text


def test_a_link_that_breaks_in_the_middle_keeps_what_was_read(tmp_path: Path) -> None:
    file = tmp_path / "r.html"
    result = taken("exo", file, at=link("exo", fault="disconnect", after=4))
    assert result.code == 3, result
    text = file.read_text(encoding="utf-8")
    assert "supply 558" in section(text, "status")
    assert "temperature" in section(text, "dump")
    assert "watch: " in Page(text).text


def test_an_interrupt_leaves_no_page(tmp_path: Path) -> None:
    with mock.patch.object(report, "Curves", side_effect=KeyboardInterrupt):
        result = taken("exo", tmp_path / "r.html")
    assert result.code == 130
    assert os.listdir(tmp_path) == []


def test_users_of_this_computer_stay_out(tmp_path: Path) -> None:
    state = tmp_path / "home" / "alice.json"
    state.parent.mkdir()
    file = tmp_path / "r.html"
    result = run(
        *("exo", "report", file, "--watch", "0", "--include-ids", "-p", link("exo", state=state)),
        env={"HOME": str(state.parent), "USER": "zaphod", "LOGNAME": "zaphod"},
    )
    assert result.code == 0, result
    text = file.read_text(encoding="utf-8")
    assert "state=~/alice.json" in text
    assert str(state.parent) not in text
    assert "zaphod" not in text
    assert os.uname().nodename not in re.findall(r"[\w.-]+", Page(text).text)


# -- light ----------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_nothing_of_it_is_loaded_before_it_is_used() -> None:
    program = (
        "import sys; from handctl.cli import main; codes = [main(['exo', 'report', '-h']), main(['exo', 'dump', '--fake'])];"
        "sys.exit(repr((codes, sorted(name for name in sys.modules if name.startswith('handctl.report')))))"
    )
    process = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=False)
    assert process.stderr.splitlines()[-1] == "([0, 0], [])"
