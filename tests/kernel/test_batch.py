"""handctl batch: one open link, one plan, one question, an end for each line and one for all."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from handctl.command import open_links
from handctl.errors import DeviceRefused, LinkError
from handctl.link.fake import FakeLink
from handctl.model.stop_on_interrupt import NOT_STOPPED
from tests.support.cli import Result, check_schema, fake, run, spying
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink

GET = "exo get system_voltage"
ID = bytes.fromhex("90EB010411E8030102")
"""The answer to `get id`."""
ITSELF = bytes.fromhex("90EB01151146060000000000000000000000001F202122230018")
"""What shows that it is no other hand."""


def batch(*lines: str, more: tuple[str | Path, ...] = (), link: str = "") -> Result:
    return run("batch", "-p", link or fake(), *more, stdin="\n".join(lines))


def ends(result: Result) -> list[dict[str, Any]]:
    """What closes the lines, and the whole."""
    found = [row for text in result.lines if "end" in (row := json.loads(text))]
    for row in found:
        check_schema(row["end"])
    return found


def test_all_lines_use_one_link() -> None:
    with spying() as spy:
        result = batch("# in the morning", GET, "", "exo status  # as always", f"{GET} id", more=("--json",))
    assert result.code == 0, result
    assert len(spy.lines) == 1
    one, two, three, whole = ends(result)
    assert [(end["line"], end["command"]) for end in (one, two, three)] == [
        (2, "exo get"),
        (4, "exo status"),
        (5, "exo get"),
    ]
    assert set(whole) == {"end"}
    assert (whole["end"]["lines"], whole["end"]["failed"], whole["end"]["exit_code"]) == (3, 0, 0)
    # The first line looks who is there as well; the last one reads two quantities.
    assert one["end"]["counters"]["sent"] == three["end"]["counters"]["sent"] == 2


def test_a_table_is_shown_as_alone(tmp_path: Path) -> None:
    alone = run(*GET.split(), "-p", fake()).out
    script = tmp_path / "script.txt"
    script.write_text(f"{GET}\n'exo' \"get\" system_voltage", encoding="utf-8")
    assert run("batch", script, "-p", fake()).out == alone * 2
    assert run("batch", script, "-p", fake(), "-o", tmp_path / "out.txt").out == ""
    assert (tmp_path / "out.txt").read_text(encoding="utf-8") == alone * 2


def test_a_line_has_the_last_word() -> None:
    result = batch(f"{GET} --format plain", f"{GET} -p {fake(after=9)} --csv")
    assert result.lines[0].startswith("558") and result.lines[1].startswith("name,"), result


def test_the_first_failure_ends_it_and_is_its_exit_code() -> None:
    link = fake(fault="silent", after=1)
    stopped = batch(GET, GET, GET, more=("--json", "--timeout", "0.1"), link=link)
    assert stopped.code == 4
    assert [end["end"]["exit_code"] for end in ends(stopped)] == [0, 4, 4]
    assert (
        "line 2 (exo get): " in stopped.err.casefold()
        and "line-failed" in stopped.said
        and "1 of 2 lines" in stopped.err
    )
    on = batch(GET, GET, GET, more=("--json", "--timeout", "0.1", "--keep-going"), link=link)
    assert on.code == 4 and ends(on)[-1]["end"]["failed"] == 2


@pytest.mark.parametrize("more", [(), ("--json",), ("--format", "csv")])
def test_with_keep_going_the_exit_code_is_that_of_the_first_line_that_failed(more: tuple[str, ...]) -> None:
    """As it is without: what ran on behind it changes nothing of that."""
    silent, damaged = (f"{GET} -p {fake(fault=fault)} --timeout 0.1" for fault in ("silent", "bad-checksum"))
    for lines, code, first in (([GET, silent, GET, damaged], 4, 2), ([damaged, silent, GET], 5, 1)):
        result = batch(*lines, more=("--keep-going", *more))
        assert result.code == code, result
        assert f"2 of {len(lines)} lines failed, the first is line {first} (exo get)" in result.err
        if "--json" in more:
            whole = ends(result)[-1]["end"]
            assert (whole["exit_code"], whole["failed"]) == (code, 2) and len(ends(result)) == len(lines) + 1


RELEASED, HELD = "90EB010D3184038E039803A203AC03F40156", "90EB010B32000000000000000000003E"
"""What a hand answers to the two commands of a stop: forces 0, then hold (exo §2.2.1, §2.2.2)."""


def test_what_came_between_two_lines_belongs_to_neither() -> None:
    """Answers of an earlier stop, late on the line: believed, they would make a success of a stop that nobody heard."""
    stale = [(0.0, bytes.fromhex(text)) for text in (RELEASED, HELD)]
    answers = {b"\x11\xe8\x03": [(0.0, ID)], b"\x11F\x06": [(0.0, ITSELF), *stale]}
    link = ScriptedLink(lambda request: answers.get(request[4:7], []))
    with mock.patch.object(open_links.Connection, "_open", lambda *_: link):
        result = batch("exo get id", "exo stop", more=("--json",))
    assert [end["end"]["exit_code"] for end in ends(result)] == [0, 4, 4], result
    assert "commanded all forces to 0, but no reply arrived" in result.err


@each_row(
    ("line", "code", "told"),
    [
        ("exo get nonsense", 2, "line 2 (exo get): exo has no quantity"),
        ("exo nonsense", 2, "line 2 (exo nonsense): no such command"),
        ("exo get 'x", 2, "line 2: no closing quotation"),
        ("exo set position_set.index=2000", 2, "line 2 (exo set): position_set.index = 2000 is out of range"),
        ("exo get --nonsense", 2, "line 2 (exo get --nonsense): no such option"),
        ("handctl exo get id", 2, "leave out the word handctl"),
        ("exo -h", 2, "line 2 asks for help"),
        ("exo", 2, "line 2 (exo): no command"),
        ("sim exo --pty", 2, "cannot be one of several commands"),
        ("batch other.txt", 2, "cannot be one of several commands"),
        ("barrett realtime --control -", 2, "standard input cannot be read here"),
        ("exo save", 8, "line 2 (exo save): this saves the present settings"),
        ("-d nobody status", 2, "no device is named 'nobody'"),
    ],
)
def test_a_line_that_cannot_be_run_ends_it_before_the_first(line: str, code: int, told: str, tmp_path: Path) -> None:
    result = run("batch", "--fake", "--trace", tmp_path / "t.txt", stdin=f"{GET}\n{line}\n")
    assert result.code == code, result
    assert told in result.err.casefold() or told in result.err, result
    assert result.out.replace("Usage", "") == result.out and not (tmp_path / "t.txt").exists(), result


def test_a_yes_runs_what_asks_and_the_next_line_sees_it() -> None:
    with spying() as spy:
        result = batch("exo set position_set.index=300", "exo get position_set.index", more=("--json", "-y"))
    assert result.code == 0 and len(spy.lines) == 1, result
    first, second, _ = ends(result)
    assert [step["state"] for step in first["end"]["writes"]] == ["confirmed"] and "writes" not in second["end"]
    rows = [row for text in result.lines if "end" not in (row := json.loads(text))]
    assert [row["value"] for row in rows] == [300, 300]


def test_a_dry_run_shows_what_is_written_and_sends_nothing(tmp_path: Path) -> None:
    result = batch(GET, "exo save", more=("-n", "--format", "plain", "--trace", tmp_path / "t.txt"))
    assert (result.code, result.lines) == (0, ["EB 90 01 04 12 ED 03 01 08"]), result
    assert not (tmp_path / "t.txt").exists()
    assert "left-out" in result.said


def test_a_stop_takes_the_open_link() -> None:
    with spying() as spy:
        result = batch(GET, "exo stop", GET, more=("--json",))
    assert result.code == 0 and len(spy.lines) == 1, result
    assert ends(result)[1]["end"]["writes"], result


def test_a_lost_link_is_opened_again() -> None:
    with spying() as spy:
        result = batch(GET, GET, GET, more=("--json", "--keep-going"), link=fake(fault="disconnect", after=2))
    assert [end["end"]["exit_code"] for end in ends(result)[:-1]] == [0, 3, 0], result
    assert len(spy.lines) == 2


def test_a_link_that_failed_once_is_opened_again_though_it_reads_on() -> None:
    read, failures = FakeLink.read, iter([LinkError("fake: hung up", code="lost")])

    def failing(link: FakeLink, *args: Any) -> bytes:
        for failure in failures:
            raise failure
        return read(link, *args)

    with spying() as spy, mock.patch.object(FakeLink, "read", failing):
        result = batch(GET, GET, more=("--json", "--keep-going"))
    assert [end["end"]["exit_code"] for end in ends(result)[:-1]] == [3, 0], result
    assert len(spy.lines) == 2


def test_one_place_is_open_once() -> None:
    """At another speed it is another link: the first one is closed before."""
    open_now: list[int] = []
    begin, close = FakeLink.__init__, FakeLink.close

    def begun(link: FakeLink, *args: Any, **more: Any) -> None:
        begin(link, *args, **more)
        open_now.append(1)

    def closed(link: FakeLink) -> None:
        close(link)
        open_now.append(-1)

    with mock.patch.object(FakeLink, "__init__", begun), mock.patch.object(FakeLink, "close", closed):
        assert batch(GET, f"{GET} --baud 57600", more=("--keep-going",)).code in (0, 4, 5)
    assert open_now == [1, -1, 1, -1]


def test_a_trace_holds_all_lines(tmp_path: Path) -> None:
    batch(GET, GET, more=("--trace", tmp_path / "t.txt"))
    lines = (tmp_path / "t.txt").read_text(encoding="utf-8").splitlines()
    assert [line.split()[1] for line in lines] == ["handctl", *[">", "<"] * 3] and lines[0].startswith("# handctl")


def test_two_devices_in_one_script() -> None:
    with spying() as spy:
        lines = (
            f"exo get id -p {fake(seed=2)}",
            f"wrist status -p {fake().replace('exo', 'wrist')}",
            f"exo get id -p {fake(seed=2)}",
        )
        result = run("batch", "--json", stdin="\n".join(lines))
    assert result.code == 0 and len(spy.lines) == 2, result


def test_no_script_is_a_usage_error(tmp_path: Path) -> None:
    assert run("batch", tmp_path / "none.txt").code == 2
    assert run("batch", stdin="# nothing\n").code == 2
    (tmp_path / "bytes").write_bytes(b"\xff\xfe")
    assert run("batch", tmp_path / "bytes").code == 2


@each_row("line", ["sleep", "sleep nan", "sleep 1 2", "sleep --none 1"])
def test_the_next_step_for_a_word_of_its_own_is_no_command_that_does_not_exist(line: str) -> None:
    result = run("batch", "--json", stdin=line)
    assert (result.code, ends(result)[-1]["end"]["messages"][-1]["hint"]) == (2, "Write it as `sleep S`."), result


def test_tools_may_stand_between() -> None:
    result = batch(GET, "devices list", "stop", "scan", GET, more=("--json",))
    assert result.code == 0, result
    assert [end["command"] for end in ends(result)[:-1]] == ["exo get", "devices list", "stop", "scan", "exo get"]


def test_a_pause_passes_on_the_clock_of_the_link() -> None:
    result = batch(f"{GET} --time", "sleep 30", f"{GET} --time", more=("--json",))
    assert result.code == 0, result
    first, second = (
        datetime.fromisoformat(row["time"].removesuffix("Z"))
        for text in result.lines
        if "value" in (row := json.loads(text))
    )
    assert 30 <= (second - first).total_seconds() <= 31
    assert [end.get("command") for end in ends(result)] == ["exo get", "sleep", "exo get", None]


@each_row(("lines", "more", "code"), [
    (("sleep 30",), ("--deadline", "5"), 2), (("sleep 30 --deadline 40",), ("--deadline", "5"), 0), (("sleep",), (), 2),
    (("sleep -1",), (), 2), ((GET, "sleep soon"), (), 2), ((f"{GET}", "sleep 1"), ("-n",), 0),
])  # fmt: skip
def test_a_pause_that_cannot_be_meant_is_refused_before_the_first_line(
    lines: tuple[str, ...], more: tuple[str, ...], code: int
) -> None:
    with spying() as spy, mock.patch("handctl.system.clock.sleep"):
        assert batch(*lines, more=more).code == code
    assert code == 0 or not spy.lines


def test_ctrl_c_ends_a_pause() -> None:
    with mock.patch.object(FakeLink, "sleep", side_effect=KeyboardInterrupt):
        result = batch(GET, "sleep 30", GET, more=("--json",))
    assert (result.code, [end["command"] for end in ends(result)[:-1]]) == (130, ["exo get", "sleep"])


RELEASE = bytes.fromhex("EB90010B31000000000000000000003D")
FRAME = "EB 90 01 0B 32 84 03 84 03 84 03 84 03 84 03 E1"
"""The same, as it is typed in `terminal` and `raw`."""
GO = "exo position 900 900 900 900 900 -y"


@each_row(("lines", "fault", "code", "stops"), [
    ((GO, "sleep 30"), "", 130, 1),
    (("exo force 300 300 300 300 300 -y", GET, "sleep 30"), "", 130, 1),
    ((GO, "wrist move --pitch 5 --time 100 -p fake://wrist?clock=virtual", "sleep 30"), "", 130, 1),
    (("exo set position_set.ring=900 -y", "sleep 30"), "", 130, 1),
    ((f"exo terminal '{FRAME}' -y", "sleep 30"), "", 130, 1), ((f"exo raw '{FRAME}' -y", "sleep 30"), "", 130, 1),
    (("exo terminal 'EB 90 01 04 11 E8 03 01 02' -y", "sleep 30"), "", 130, 0),
    ((GET, "sleep 30"), "", 130, 0),
    ((GET, f"{GO} --dry-run", "sleep 30"), "", 130, 0),
    ((GO, "sleep 30"), "silent", 4, 1),
])  # fmt: skip
def test_ctrl_c_stops_what_earlier_lines_have_set_going(
    lines: tuple[str, ...], fault: str, code: int, stops: int
) -> None:
    """As it stops the movement of a single command; and a stop that nobody acknowledges is none."""
    sent: list[bytes] = []
    write = FakeLink.write

    def pressed(link: FakeLink, seconds: float) -> None:
        sent.clear()
        raise KeyboardInterrupt

    def noted(link: FakeLink, data: bytes, deadline: Any) -> None:
        sent.append(data)
        if fault and RELEASE in sent:
            return  # nobody hears it
        write(link, data, deadline)

    with mock.patch.object(FakeLink, "sleep", pressed), mock.patch.object(FakeLink, "write", noted):
        result = batch(*lines, more=("--json", "--keep-going"))
    assert result.code == code, result
    assert bool(stops) == (RELEASE in sent), sent
    *_, last, whole = ends(result)
    assert last["command"] == next(
        word for line in lines for word in ("wrist move", "sleep") if line.startswith(word)
    ), "no further line"
    assert whole["end"]["exit_code"] == code


def test_the_stop_of_what_an_earlier_line_has_set_going_is_in_the_history() -> None:
    with mock.patch.object(FakeLink, "sleep", side_effect=KeyboardInterrupt):
        batch(GO, "sleep 30", link=fake(), more=("--history", "all"))
    *_, moved, stopped = run("history", "--json").rows
    assert [moved["exit_code"], stopped["exit_code"]] == [0, 130], "the movement, and its stop behind it"


def test_what_was_stopped_is_not_stopped_again() -> None:
    """Ctrl-C in the line that moves has stopped it; the end of the batch adds nothing."""
    sent: list[bytes] = []
    write = FakeLink.write
    with mock.patch.object(
        FakeLink, "write", lambda link, data, deadline: (sent.append(data), write(link, data, deadline))[1]
    ), mock.patch("handctl.devices.inspire.register_device.watch", side_effect=KeyboardInterrupt):  # fmt: skip
        result = batch("exo force 0 0 0 0 0 -y", f"{GO} --wait 5", GET)
    assert result.code == 130 and sent.count(RELEASE) == 2, "the line itself, and its stop"


def test_a_line_whose_stop_failed_ends_the_batch() -> None:
    """Also with --keep-going: somebody wants an end, and the hand may still move."""
    with mock.patch(
        "handctl.devices.inspire.exo.calibration.calibrate", side_effect=DeviceRefused("no", code=NOT_STOPPED)
    ):
        result = batch("exo calibrate -y", GET, more=("--json", "--keep-going"))
    assert (result.code, [end["command"] for end in ends(result)[:-1]]) == (6, ["exo calibrate"])


def test_a_pause_alone_is_no_command() -> None:
    assert run("sleep", "3").code == 2


@pytest.mark.parametrize(
    ("link", "line"),
    [
        (fake(), "exo position 900 900 900 900 900"),
        ("fake://wrist?clock=virtual", "wrist center"),
        ("fake://barrett?clock=virtual", "barrett open"),
        ("fake://hand?clock=virtual", "hand speed 500 500 500 500 500 500"),
        ("fake://ekso?clock=virtual", "ekso cancel"),
    ],
)
def test_a_write_stands_in_the_record_as_often_as_it_went_out(link: str, line: str) -> None:
    """Whatever line it is in: a link that stays open between two is observed once."""
    result = batch(line, line, line, more=("-y", "--json"), link=link)
    for one in ends(result)[:-1]:
        written = [row["bytes"] for row in one["end"]["writes"]]
        assert written and len(set(written)) == len(written), one["end"]["writes"]
        assert not [row for row in one["end"]["writes"] if "count" in row or row["state"] == "sent"]


@pytest.mark.parametrize("first", ["exo get id", "exo status", "exo set force_set.index=310"])
def test_a_write_behind_a_read_stands_in_the_record(first: str) -> None:
    """The first line of a session may have nobody to tell what passes."""
    ended = ends(batch(first, "exo set force_set.index=330", more=("-y", "--json"), link=fake()))[1]["end"]
    assert [(row["state"], row["bytes"][:2]) for row in ended["writes"]] == [("confirmed", "EB")]
