"""`handctl twin check` and the option `transcript` of a simulator: a twin answers as the recorded device did, and says where not.

The recorded device is a simulator of another configuration: facts that differ, values of its own, a reply time.
"""

from __future__ import annotations

import json
import tempfile
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest

from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.link.twin_values import values_of
from handctl.model.explainer import DEVICE, ExplainedBytes, Value
from handctl.sim import create
from handctl.sim.engine import serve
from handctl.sim.engine.facts_file import Twin
from handctl.tools import twin
from handctl.tools.twin import EQUAL, EXTRA, FORM, NONE, RATE, VALUES, Stream, simulated, verdict
from tests.support.cli import Result, run
from tests.support.each_row import each_row

ORIGINALS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    # family: what its simulator is told, the values that it shows, and what a client asks it
    "exo": (
        "fault=block-silent&turnaround=0.003",
        "set 1472 1103;set 1486 0A000B000C000D000E00;set 1546 64006500660067006800",
        ("dump", "save", "set position_set=300,300,300,300,300", "get position_set"),
    ),
    "wrist": ("fault=block-silent&turnaround=0.002", "set 1024 11002200", ("dump", "status")),
    "barrett": (
        "texts=names&prompt=bare&firmware=4.34&turnaround=0.005",
        "ram MCV F1 77;ram DP S 1000;position F2 5000;temperature 333",
        ("dump", "version", "init", "set max_close_velocity.F1=80", "close --motors 1", "status", "realtime --count 5"),
    ),
    "aidin": ("exchange=poll&objects=separate", "bend ring 100 200 300", ("dump", "status")),
    "ekso": (
        "length=frame&time-body=3",
        "set 200 1700;boot 123456789;rtc 2027-01-02T03:04:05",
        ("time", "date", "dump"),
    ),
    "hand": (
        "model=df&turnaround=0.004",
        "set 1486 0A000B000C000D000E000F00",
        ("dump", "set speed_set=100,100,100,100,100,100", "dump"),
    ),
}
ANOTHER = {
    "exo": ("status", "dump"),
    "hand": ("status", "get angle_set", "dump"),
    "barrett": ("version", "get P", "dump"),
}
"""What another client asks later."""


def link_of(family: str) -> str:
    said, values, _ = ORIGINALS[family]
    return f"fake://{family}?clock=virtual&{said}&values={quote(values)}"


@cache
def proved(family: str) -> bytes:
    """The facts of the recorded device, which are the same each time."""
    with tempfile.TemporaryDirectory() as folder:
        facts = Path(folder) / "facts.json"
        assert run("prove", family, "-p", link_of(family), "-o", facts).code == 0
        return facts.read_bytes()


def recorded(family: str, folder: Path, link: str, name: str, verbs: tuple[str, ...]) -> Path:
    """The transcript of these commands on one link; the facts are proved before."""
    facts, path, script = folder / "facts.json", folder / f"{name}.txt", folder / "script"
    if not facts.exists():
        facts.write_bytes(proved(family))
    script.write_text("".join(f"{family} {verb}\n" for verb in verbs))
    result = run("batch", script, "-p", link, "-y", "--facts", facts, "--trace", path)
    assert result.code == 0, result.err
    return path


def check(path: Path, *words: str | Path) -> Result:
    return run("twin", "check", path, *words, "--json")


def shares(result: Result) -> list[float]:
    """Of the twin, and of the manual's simulator."""
    return [row["share"] for row in result.rows[1:]]


# -- a twin answers as the recorded device did -------------------------------------------------------------------------


@each_row(
    "family,manual,median",
    [
        ("exo", 0.6852, 3.0), ("wrist", 0.8182, 2.0), ("barrett", 0.1224, 5.0),
        ("aidin", 0.0, 0.0), ("ekso", 0.0, 0.0), ("hand", 0.4706, 4.0),
    ],
)  # fmt: skip
def test_a_twin_answers_as_its_device_did_and_the_manuals_simulator_does_not(
    family: str, manual: float, median: float, tmp_path: Path
) -> None:
    path = recorded(family, tmp_path, link_of(family), "own", ORIGINALS[family][2])
    result = check(path, "--facts", tmp_path / "facts.json")
    assert (result.code, shares(result)) == (0, [1.0, manual]), result
    assert [row["median_ms"] for row in result.rows[:2]] == [median, median]
    assert result.rows[2]["median_ms"] != median or not median


@each_row("family,manual", [("exo", 0.68), ("hand", 0.2), ("barrett", 0.0)])
def test_a_twin_answers_another_client_as_its_device_does_later(family: str, manual: float, tmp_path: Path) -> None:
    """What the twin shows comes from one conversation alone; the other one is only compared."""
    verbs = ORIGINALS[family][2][:1]
    link = f"{link_of(family)}&state={tmp_path / 'state.json'}"
    first = recorded(family, tmp_path, link, "first", verbs)
    second = recorded(family, tmp_path, link, "second", ANOTHER[family])
    result = check(second, "--facts", tmp_path / "facts.json", "--transcript", first)
    assert (result.code, shares(result)) == (0, [1.0, manual]), result
    recording, ours, _ = result.rows
    assert [ours[key] for key in ("median_ms", "p90_ms")] == [recording[key] for key in ("median_ms", "p90_ms")]


OF_ITS_STATE: list[tuple[str, str, tuple[str, ...]]] = [
    # family, what its simulator is told, what a client reads: all of it is taken from the transcript
    ("wrist", "values={}".format(quote("hand-set 1486 0A000B000C000D000E000F00;hand-set 1606 010002000400")), ("hand-read 1486 12", "hand-read 1606 6", "hand-read 1487 3", "status")),
    ("wrist", "bus=can&values={}".format(quote("hand-set 1486 0A000B000C000D000E000F00")), ("hand-read 1486 12", "status")),
    ("barrett", "values={}".format(quote("ram S F2 16;ram S F3 16384;ram S S 0")), ("dump", "status", "errors")),
    ("barrett", "fault=no-board", ("dump", "status")),
    ("barrett", "fault=unknown-codes", ("dump", "status")),
    ("barrett", "firmware=4.34&initialized=1&values={}".format(quote("ram BD F3 1;ram BP F3 1990;ram BP F1 -20")), ("dump", "get breakaway_position")),
]  # fmt: skip


@each_row("family,said,verbs", OF_ITS_STATE)
def test_a_twin_has_the_state_of_its_device_too(family: str, said: str, verbs: tuple[str, ...], tmp_path: Path) -> None:
    """A wrist's hand, of which no manual of the wrist names a register; statuses and clutches of a BarrettHand."""
    link, path, script = f"fake://{family}?clock=virtual&{said}", tmp_path / "own.txt", tmp_path / "script"
    script.write_text("".join(f"{family} {verb}\n" for verb in verbs))
    result = run("batch", script, "-p", link, "--trace", path)
    assert result.code in (0, 6, 7), result.err
    compared = check(path, "--family", family)
    assert (compared.code, shares(compared)[0], shares(compared)[1] < 1) == (0, 1.0, True), compared


def test_what_was_written_before_it_ended_is_what_a_twin_shows_as_it_was_left(tmp_path: Path) -> None:
    path = recorded("exo", tmp_path, link_of("exo"), "own", ORIGINALS["exo"][2])
    left = run("exo", "get", "position_set.ring", "-p", f"fake://exo?clock=virtual&transcript={path}", "--json")
    assert [row["value"] for row in left.rows] == [300]
    assert [word in values_of("exo", str(path), found=found) for found in (True, False) for word in ("set 1488 0B00", "set 1488 2C01")] \
        == [True, False, False, True]  # fmt: skip


@each_row("family", FAMILIES)
def test_what_the_simulator_does_not_have_is_counted(family: str, tmp_path: Path) -> None:
    path = recorded(family, tmp_path, link_of(family), "own", ("dump",))
    found = Twin(family, {"values": values_of(family, str(path))})
    taken, left = create(family, found.raw).values
    assert len(taken) > 5 and left == []
    taken, left = create(family, {"values": values_of(family, str(path)) + ";push X 1"}).values
    assert left == ["push X 1"]
    assert f"{len(taken)} values taken" in found.words((taken, left))


def test_reply_times_are_handed_on_as_often_as_they_came(tmp_path: Path) -> None:
    link = "fake://exo?clock=virtual&reply-times=0.002,0.002,0.002,0.009"
    path = recorded("exo", tmp_path, link, "own", ("watch id --rate 0 --count 200",))
    times = values_of("exo", str(path)).split(";")[0].removeprefix("reply-times=").split(",")
    assert (len(times), set(times)) == (20, {"0.002000", "0.009000"})
    assert 13 <= times.count("0.002000") <= 17


def test_reply_times_are_those_that_were_recorded_and_keep_the_order_of_the_replies() -> None:
    line = create("exo", {"reply-times": "0.002,0.030", "seed": "3"})
    line.advance(0.0)
    waits = []
    for number in range(40):
        asked = float(number)
        line.advance(asked)
        line.feed(bytes.fromhex("EB 90 01 04 11 E8 03 01 02"))
        when = line.next_event()
        assert when is not None
        waits.append(round(when - asked, 6))
        line.advance(when)
        assert line.take()
    assert set(waits) == {0.002, 0.03}
    both = [bytes.fromhex("EB 90 01 04 11 E8 03 01 02"), bytes.fromhex("EB 90 01 04 11 C0 05 02 DD")]
    for request in 9 * both:
        line.feed(request)
    line.advance(100.0)
    first, second = (came := line.take()).split(b"\x90\xeb")[1:3]
    assert first[3:5] == b"\xe8\x03"
    assert came == 9 * (b"\x90\xeb" + first + b"\x90\xeb" + second)


@each_row("wire", ["can", "modbus-tcp"])
def test_a_recording_of_another_wire_is_played_there_and_its_twin_can_be_on_any(wire: str, tmp_path: Path) -> None:
    path, values = tmp_path / "own.txt", quote("set 1486 0A000B000C000D000E000F00")
    dumped = run("hand", "dump", "-p", f"fake://hand?clock=virtual&bus={wire}&values={values}", "--trace", path)
    assert dumped.code == 0, dumped.err
    result = check(path, "--family", "hand")
    assert (result.code, shares(result)[0], shares(result)[1] < 1) == (0, 1.0, True)
    serial = run("hand", "get", "angle_set.middle", "-p", f"fake://hand?clock=virtual&transcript={path}", "--json")
    assert [row["value"] for row in serial.rows] == [12]


@each_row("family", ["exo", "wrist", "hand"])
def test_a_twin_has_the_id_of_its_device(family: str, tmp_path: Path) -> None:
    path = tmp_path / "own.txt"
    assert run(family, "dump", "--id", "7", "-p", f"fake://{family}?clock=virtual&id=7", "--trace", path).code == 0
    assert run(family, "dump", "--id", "7", "-p", f"fake://{family}?clock=virtual&transcript={path}").code == 0


def test_bytes_of_no_register_are_values_too(tmp_path: Path) -> None:
    path, other = tmp_path / "own.txt", quote("set 1474 0102;set 1010 00FF00")
    assert run("exo", "dump", "-p", f"fake://exo?clock=virtual&values={other}", "--trace", path).code == 0
    assert shares(check(path)) == [1.0, 0.5]


def test_a_state_that_was_kept_counts_more_than_the_transcript(tmp_path: Path) -> None:
    path = recorded("exo", tmp_path, link_of("exo"), "own", ("dump",))
    link = f"fake://exo?clock=virtual&transcript={path}&state={tmp_path / 'state.json'}"
    assert run("exo", "set", "force_set.ring=7", "-y", "-p", link).code == 0
    assert [
        row["value"] for row in run("exo", "get", "force_set.ring", "position_set.ring", "-p", link, "--json").rows
    ] == [7, 11]


# -- nothing ever reaches a device -------------------------------------------------------------------------------------

LINKS = (
    "/dev/ttyUSB0", "COM3", "usb:0403:6001", "tcp://127.0.0.1:9", "socket://127.0.0.1:9", "can:socketcan:can0", "replay:own.txt",
    "fake://hand", "fake://bus?file=x", "fake:exo", "FAKE://exo", " fake://exo",
)  # fmt: skip


@each_row("link", LINKS)
def test_a_recording_is_sent_to_no_device(link: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = recorded("exo", tmp_path, link_of("exo"), "own", ("dump",))
    monkeypatch.setattr(twin, "open_link", lambda *_, **__: pytest.fail("it was opened"))
    result = check(path, "--against", link)
    assert (result.code, result.error["code"]) == (2, "not-simulated")


@each_row("words,env", [(("-p", "/dev/ttyUSB0"), {}), ((), {"HANDCTL_PORT": "/dev/ttyUSB0"})])
def test_a_port_that_is_set_is_not_used(words: tuple[str, ...], env: dict[str, str], tmp_path: Path) -> None:
    path = recorded("exo", tmp_path, link_of("exo"), "own", ("dump",))
    result = run("twin", "check", path, "--facts", tmp_path / "facts.json", "--json", *words, env=env)
    assert (result.code, [row["link"][:10] for row in result.rows[1:]]) == (0, ["fake://exo"] * 2)


def test_the_state_of_a_simulator_is_read_and_not_written(tmp_path: Path) -> None:
    state = tmp_path / "state.json"
    path = recorded("exo", tmp_path, f"{link_of('exo')}&state={state}", "own", ("dump", "id 5"))
    run("exo", "id", "1", "--id", "5", "-y", "-p", f"fake://exo?clock=virtual&state={state}")
    before = state.read_bytes()
    assert check(path, "--against", f"fake://exo?state={state}").code in (0, 7)
    assert state.read_bytes() == before
    assert simulated("fake://exo?clock=real", "exo", "") == "fake://exo?clock=virtual"


# -- how answers compare ------------------------------------------------------------------------------------------------


def answer(raw: bytes, *values: float, title: str = "reply", problem: str = "") -> ExplainedBytes:
    found = tuple(Value(f"v{place}", value) for place, value in enumerate(values))
    return ExplainedBytes(direction=DEVICE, raw=raw, meaning="", title=title, problem=problem, values=found)


@each_row(
    "recorded,here,said",
    [
        (answer(b"\x01\x02", 2), answer(b"\x01\x02", 2), EQUAL),
        (answer(b"\x01\x02", 2), answer(b"\x01\x03", 3), VALUES),
        (answer(b"\x01\x02", 2), answer(b"\x01\x02\x00", 2), FORM),
        (answer(b"\x01\x02", 2), answer(b"\x01\x03", 2), FORM),
        (answer(b"P 10\r\n=> ", 10), answer(b"P 9\r\n=> ", 9), VALUES),
        (answer(b"P 10\r\n=> ", 10), answer(b"P 9\r\n=>", 9), FORM),
        (answer(b"P 10\r\n=> ", 10), answer(b"P 10\n\r=> ", 10), FORM),
        (answer(b"4.3.3"), answer(b"4.3.4"), FORM),
        (answer(b"\x01\x02", 2), answer(b"\x01\x03", 3, problem="refused"), FORM),
        (answer(b"\x01\x02", 2), None, NONE),
        (None, answer(b"\x01\x02", 2), EXTRA),
        (None, None, ""),
    ],
)
def test_only_the_same_bytes_are_equal(recorded: ExplainedBytes | None, here: ExplainedBytes | None, said: str) -> None:
    assert verdict(recorded, here) == said


@each_row(
    "one,other,said",
    [
        (Stream(100, {"a"}, 0.0, 1.0), Stream(105, {"a", "b"}, 2.0, 3.0), EQUAL),
        (Stream(100, {"a"}, 0.0, 1.0), Stream(50, {"a"}, 0.0, 1.0), RATE),
        (Stream(100, {"a"}, 0.0, 1.0), Stream(100, {"b"}, 0.0, 1.0), FORM),
        (Stream(1, {"a"}, 0.0, 0.0), Stream(1, {"a"}, 5.0, 5.0), EQUAL),
        (Stream(1, {"a"}, 0.0, 0.0), Stream(2, {"a"}, 0.0, 5.0), RATE),
        (Stream(3, {"a"}, 0.0, 1.0), Stream(), NONE),
        (Stream(), Stream(3, {"a"}, 0.0, 1.0), EXTRA),
    ],
)
def test_a_stream_is_compared_by_form_and_rate(one: Stream, other: Stream, said: str) -> None:
    assert one.verdict(other) == said


def test_a_later_answer_is_waited_for_and_an_answer_that_never_comes_costs_one_wait(tmp_path: Path) -> None:
    path = recorded("exo", tmp_path, link_of("exo"), "own", ("dump", "dump"))
    late = check(path, "--against", "fake://exo?fault=block-silent&turnaround=0.9")
    assert (late.rows[1]["no_answer"], late.rows[1]["median_ms"]) == (0, 900)
    silent = check(path, "--against", "fake://exo?fault=silent")
    asked = silent.rows[1]["no_answer"]
    assert (silent.code, silent.error["code"], shares(silent)) == (7, "differ", [0.0, 0.0])
    assert asked == late.rows[1]["equal"] + late.rows[1]["values"]
    gone = check(path, "--against", "fake://exo?fault=disconnect&after=3")
    assert (gone.code, gone.rows[1]["equal"]) == (7, 3)


def test_what_happened_to_the_recorded_line_happens_here(tmp_path: Path) -> None:
    path, link = tmp_path / "own.txt", "fake://barrett?clock=virtual&wire=auto"
    assert run("barrett", "baud", "19200", "-y", "-p", link, "--trace", path).code == 0
    assert "! baud 19200" in path.read_text()
    assert shares(check(path, "--against", link))[1] == 1.0
    path.write_text(path.read_text().replace("! baud 19200", "! baud 38400"))
    assert shares(check(path, "--against", link))[1] < 1


def test_differences_are_told_by_their_values(tmp_path: Path) -> None:
    path = recorded("exo", tmp_path, link_of("exo"), "own", ("dump",))
    other = recorded("exo", tmp_path, "fake://exo?clock=virtual&fault=block-silent", "other", ("dump",))
    result = check(path, "--transcript", other, "--against", "fake://exo?fault=block-silent")
    (found,) = [row for row in result.rows[1]["differences"] if "voltage" in row["name"]]
    assert (found["verdict"], found["changes"]) == (
        VALUES, [{"name": "system_voltage", "recorded": "785", "here": "558"}],
    )  # fmt: skip
    assert "785" in run("twin", "check", path, "--transcript", other).out


# -- files --------------------------------------------------------------------------------------------------------------


def test_a_file_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    path = recorded("exo", tmp_path, link_of("exo"), "own", ("dump",))
    assert run("twin", "check", "-", "--family", "exo").code == 2
    assert check(tmp_path / "none").code == 2
    foreign = run("ekso", "get", "step_length", "-p", f"fake://ekso?transcript={path}", "--json")
    assert (foreign.code, foreign.error["code"]) == (2, "no-values")
    assert run("exo", "get", "id", "-p", f"fake://exo?transcript={tmp_path / 'none'}", "--json").code == 2
    (tmp_path / "facts.json").write_text(json.dumps({"schema": "handctl/facts-1", "family": "hand", "facts": {}}))
    assert check(path, "--facts", tmp_path / "facts.json", "--family", "exo").code == 2
    several = tmp_path / "several.txt"
    several.write_text(
        "! family exo on a\n> EB 90 01 04 11 E8 03 01 02\n! family wrist on b\n> EB 90 01 04 30 FC 03 02 36\n"
    )
    assert check(several).error["code"] == "several-devices"
    with pytest.raises(UsageError):
        values_of("exo", str(several))


def test_sim_takes_a_transcript_and_says_what_it_took(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    served: list[Any] = []

    class Server:
        def __init__(self, place: Any) -> None:
            served.append(place)

        def behind(self, *_: Any) -> None: ...

        def run(self, *_: Any) -> None: ...

    path = recorded("exo", tmp_path, link_of("exo"), "own", ("dump",))
    monkeypatch.setattr(serve, "Server", Server)
    monkeypatch.setattr(serve, "TcpDoor", lambda *_: None)
    result = run("sim", "exo", "--tcp", "127.0.0.1:0", "--transcript", path, "--facts", tmp_path / "facts.json")
    assert result.code == 0, result.err
    assert " facts taken; " in result.err
    assert " values taken" in result.err
    assert served[0].line.device.space.peek(["1472", "2"]) == "11 03"
    assert run("sim", "exo", "--tcp", "127.0.0.1:0", "--transcript", tmp_path / "none").code == 2
