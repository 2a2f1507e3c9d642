"""The text of the simulated AIDIN-hand: what its reader takes, how its feedback is spelled and spoiled, line faults."""

from __future__ import annotations

import json
import os
import random
from itertools import pairwise
from typing import Any

import pytest

from handctl.sim import create, model_class
from handctl.sim.engine.line_and_faults import LINE_FAULTS, Line
from tests.support.each_row import each_row

STOP = '{"hand_mode":3}'
TORQUE = '{"hand_mode":5,"maxtorque":700}'
KEYS = ["motor_pos", "joint_pos", "task_space_pos", "current_state", "sensor_state"]


def make(**options: object) -> Line:
    raw = {name.replace("_", "-"): str(value) for name, value in {"exchange": "poll", **options}.items()}
    line: Line = create("aidin", raw)
    line.advance(0.0)
    return line


def ask(line: Line, data: str | bytes = "{}") -> bytes:
    line.feed(data.encode() if isinstance(data, str) else data)
    return line.take()


def drain(line: Line, start: float = 0.0, seconds: float = 2.0) -> list[tuple[float, bytes]]:
    """Every read with its time, woken as a driver would be."""
    reads, now = [], start
    while not line.hung_up and (event := line.next_event()) is not None and event <= start + seconds:
        now = max(now, event)
        line.advance(now)
        if data := line.take():
            reads.append((now - start, data))
    return reads


def state(line: Line) -> str:
    return line.command("state").partition("maxtorque ")[2]


# -- objects in -------------------------------------------------------------------------------------------------------


@each_row(
    ("data", "expected"),
    [
        pytest.param(TORQUE, "700 dropped 0", id="no terminator"),
        pytest.param(TORQUE + "\n", "700 dropped 0", id="newline"),
        pytest.param(" \r\n\t" + TORQUE + "\0", "700 dropped 0", id="blanks and NUL"),
        pytest.param('{ "maxtorque" : 700.0 ,\n "hand_mode" : 5e0 }', "700 dropped 0", id="other spelling"),
        pytest.param('{"note":"} { \\" \\\\","hand_mode":5,"maxtorque":700}', "700 dropped 0", id="braces in a string"),
        pytest.param('{"more":{"a":[{}]},"hand_mode":5,"maxtorque":700}', "700 dropped 0", id="nested"),
        pytest.param(STOP + TORQUE, "700 dropped 0", id="two glued"),
        pytest.param("xyz" + TORQUE, "700 dropped 3", id="junk before"),
        pytest.param('{"hand_mode":5,"maxtorque":,}' + TORQUE, "700 dropped 1", id="no JSON, then an object"),
        pytest.param(b'{"\xff\xfe":1}' + TORQUE.encode(), "700 dropped 1", id="no UTF-8, then an object"),
        pytest.param("{" * 5000 + "}" * 5000 + TORQUE, "700 dropped", id="too deep, too long"),
        pytest.param('{"a":' * 340 + "1" + "}" * 340 + TORQUE, "700 dropped 0", id="deep"),
        pytest.param('{"a":"' + "x" * 2045 + '"}' + TORQUE, "700 dropped", id="longer than the buffer"),
        pytest.param('{"a":"' + "x" * 2045 + TORQUE, "700 dropped", id="a string never closed"),
        pytest.param('{"a":' + "[" * 1500 + TORQUE[:-1], "1000 dropped 0", id="never closed"),
        pytest.param('{"hand_mode":5,"maxtorque":' + "7" * 1900 + "}", "1000 dropped 0", id="a huge number"),
        pytest.param('{"hand_mode":5,"maxtorque":800,"maxtorque":700}', "700 dropped 0", id="the same key twice"),
        pytest.param("{“hand_mode”:5,“maxtorque”:700}", "1000 dropped 1", id="typographic quotes"),
        pytest.param('["hand_mode",5]null 3 "x"', "1000 dropped", id="JSON, but no object"),
    ],
)
def test_tolerant_reader(data: str | bytes, expected: str) -> None:
    line = make()
    ask(line, data)
    assert state(line).startswith(expected)


@each_row("size", [1, 2, 7, 15, 46])
def test_objects_may_be_cut_anywhere(size: int) -> None:
    line, text = make(), (STOP + "\n" + TORQUE).encode()
    heard = b""
    for at in range(0, len(text), size):
        heard += ask(line, text[at : at + size])
    assert line.requests == 2
    assert heard.count(b"\n") == 2
    assert state(line) == "700 dropped 0 ignored 0"


def test_half_an_object_is_forgotten() -> None:
    """A client that left may have left half an object behind."""
    line = make()
    ask(line, TORQUE[:20])
    line.advance(0.9)
    ask(line, TORQUE[20:])
    assert state(line).startswith("700")
    ask(line, STOP[:9])
    line.advance(2.0)
    assert ask(line, STOP) != b""
    assert line.command("state").startswith("mode 3 ")


@each_row(
    ("reader", "data", "requests"),
    [
        ("naive", TORQUE, 1), ("naive", TORQUE + "\n", 1), ("naive", TORQUE + "\0rest", 1), ("naive", STOP + TORQUE, 0),
        ("lines", TORQUE, 0), ("lines", STOP + "\r\n\n" + TORQUE + "\n", 2), ("lines", STOP + TORQUE + "\n", 0),
        ("lines", '{"a":\n1}\n', 0), ("nul", TORQUE + "\n", 0), ("nul", STOP + "\0" + TORQUE + "\0", 2),
        ("lines", " " * 2048 + STOP + "\n" + TORQUE + "\n", 1), ("tolerant", '{"a":\n1}', 1),
    ],
)  # fmt: skip
def test_other_readers(reader: str, data: str, requests: int) -> None:
    line = make(reader=reader)
    ask(line, data)
    assert line.requests == requests
    ask(line, "\n\0")
    assert ask(line, STOP + ("\0" if reader == "nul" else "\n")) != b""


def test_naive_reader_takes_one_buffer_at_a_time() -> None:
    line = make(reader="naive")
    ask(line, (TORQUE + " " * (2048 - len(TORQUE)) + STOP))
    assert line.requests == 2
    line = make(reader="naive", buffer=64)
    ask(line, TORQUE + " " * 33 + STOP)
    assert line.requests == 2 and state(line) == "700 dropped 0 ignored 0"


@pytest.mark.parametrize("reader", ["tolerant", "naive", "lines", "nul"])
def test_nothing_that_is_sent_raises(reader: str) -> None:
    dice = random.Random(7)
    pieces = [b"{", b"}", b'"', b"\\", b":", b",", b"[", b"]", b'"hand_mode"', b'"maxtorque"', b'"hand_TP_cmd"', b"1",
              b"10", b"41", b"-1e999", b"NaN", b"true", b"null", b"\n", b"\0", b"\xff", b"\xc3", STOP.encode()]  # fmt: skip
    line, now = make(reader=reader), 0.0
    for _ in range(300):
        ask(line, b"".join(dice.choices(pieces, k=dice.randint(1, 60))))
        now += dice.choice([0.0, 0.001, 1.1])
        line.advance(now)
    line.advance(now + 1.5)
    line.feed(b"\n\0")
    line.take()
    assert json.loads(ask(line, STOP + ("\0" if reader == "nul" else "\n")).splitlines()[-1])


# -- feedback out -----------------------------------------------------------------------------------------------------


@each_row(("between", "end"), [("newline", b"\n"), ("none", b"}"), ("nul", b"\0"), ("blank", b" "), ("crlf", b"\r\n")])
def test_what_follows_an_object(between: str, end: bytes) -> None:
    heard = ask(make(between=between), STOP + STOP)
    assert heard.endswith(b"]}" + end.removeprefix(b"}"))
    assert heard.count(b"{") == 2
    assert json.loads(heard[: heard.index(b"]}") + 2])


def test_spelling_of_the_feedback() -> None:
    assert ask(make(start="open")).startswith(b'{"motor_pos":[0,0,')
    assert ask(make(start="open", layout="blanks")).startswith(b'{"motor_pos": [0, 0, ')
    indented = ask(make(start="open", layout="indented"))
    assert indented.startswith(b'{\n  "motor_pos": [0,0,')
    assert indented.count(b"\n") == 7
    assert ask(make(integers=1)).startswith(b'{"motor_pos":[70110.0,61220.0,')
    compact = json.loads(ask(make()))
    assert json.loads(ask(make(layout="indented"))) == json.loads(ask(make(layout="blanks"))) == compact
    assert json.loads(ask(make(integers=1))) == compact


def test_digits() -> None:
    assert b'"joint_pos":[-0.226893,0.0,2.687807,' in ask(make(start="open"))
    assert b'"joint_pos":[-0.2269,0.0,2.6878,' in ask(make(start="open", digits=4))
    long = ask(make(digits=17))
    assert b'"joint_pos":[0.0105' in long
    assert 1100 < len(long) < 1608
    for key, row in json.loads(ask(make())).items():
        assert json.loads(long)[key] == pytest.approx(row, abs=0.001)
    assert b"-0.0," not in ask(make(start="open")) + ask(make(start="open", digits=17))


def test_one_object_for_each_key() -> None:
    rows = [json.loads(row) for row in ask(make(objects="separate")).splitlines()]
    assert [list(row) for row in rows] == [[key] for key in KEYS]
    assert {key: row[key] for row in rows for key in row} == json.loads(ask(make()))


def test_small_writes() -> None:
    line = make(chunk=100)
    assert ask(line) == ask(make())[:100]
    reads = drain(line)
    assert [len(data) for _, data in reads[:-1]] == [100] * (len(reads) - 1)
    assert len(reads) == 7
    assert reads[-1][0] == pytest.approx(7 * 0.0002)


def test_small_writes_with_nagle() -> None:
    line = make(chunk=100, nagle=1)
    whole = ask(make())
    assert ask(line) == whole[:100]
    assert drain(line) == [(pytest.approx(0.04), whole[100:])]


def test_the_stream_waits_for_its_writes() -> None:
    line = make(exchange="stream", chunk=100, nagle=1)
    reads = drain(line, seconds=1.0)
    assert b"".join(data for _, data in reads).count(b"\n") == pytest.approx(25, abs=1)
    line = make(exchange="stream", wire=9600)
    text = b"".join(data for _, data in drain(line, seconds=5.0))
    assert len(text) == pytest.approx(4800, abs=50)


# -- faults of the device ---------------------------------------------------------------------------------------------


def seen(fault: str, **options: object) -> dict[str, Any]:
    return dict(json.loads(ask(make(fault=fault, **options))))


def test_faults_of_keys_and_lengths() -> None:
    healthy = json.loads(ask(make()))
    assert seen("missing-key") == {key: row for key, row in healthy.items() if key != "current_state"}
    assert seen("extra-key") == {
        **healthy,
        "battery": 87,
        "status": {"text": 'a } and a " in a string', "list": [1, {}]},
    }
    assert seen("wrong-length") == {
        **healthy, "motor_pos": healthy["motor_pos"][:14], "task_space_pos": [*healthy["task_space_pos"], 0.0]
    }  # fmt: skip
    wrong = seen("wrong-type")
    assert (wrong["current_state"], wrong["sensor_state"], wrong["motor_pos"][7]) == (None, 0.5, "open")
    both = seen("missing-key,wrong-type,wrong-length,extra-key,nan,stuck,swapped")
    assert "current_state" not in both
    assert len(both["motor_pos"]) == 14


def test_faults_of_values() -> None:
    healthy = json.loads(ask(make()))
    text = ask(make(fault="nan"))
    assert text.count(b"NaN") == text.count(b"Infinity") == 1
    swapped = seen("swapped")
    for key, row in swapped.items():
        size = len(row) // 5
        assert row[size : 3 * size] == healthy[key][2 * size : 3 * size] + healthy[key][size : 2 * size]
        assert row[:size] + row[3 * size :] == healthy[key][:size] + healthy[key][3 * size :]
    assert seen("degrees", start="open")["joint_pos"][:4] == [-13.0, 0.0, 154.0, 154.0]


def test_faults_of_motion() -> None:
    target = '{"hand_mode":10,"hand_TP_cmd":' + str([100000] * 15) + "}"
    for fault, moving in (("stuck", 1), ("frozen", 0)):
        line = make(start="homed", fault=fault)
        before = json.loads(ask(line, target))
        line.advance(3.0)
        after = json.loads(ask(line))
        assert before["motor_pos"][4] == after["motor_pos"][4] == 100550
        assert (before["motor_pos"][3] != after["motor_pos"][3]) == bool(moving)
        assert (before["joint_pos"] != after["joint_pos"]) == bool(moving)


def test_faults_that_are_no_json() -> None:
    assert ask(make(fault="not-json")) == b"AIDIN-hand: sensor bus timeout, retrying\n"
    assert ask(make(fault="braces")).startswith(b'{"motor_pos":{70110,61220,')
    unclosed = ask(make(fault="unclosed"))
    assert unclosed.startswith(b'{"motor_pos":[0,0,')
    assert unclosed.index(b"}") > 71680
    assert json.loads(unclosed[unclosed.rindex(b"{") :]) == json.loads(ask(make()))


# -- faults of the line -----------------------------------------------------------------------------------------------


def test_lost_and_refused() -> None:
    line = make(fault="silent")
    assert ask(line, TORQUE) == b""
    assert state(line) == "700 dropped 0 ignored 0"
    line = make(fault="deaf")
    assert ask(line, TORQUE) == b""
    assert state(line) == "1000 dropped 0 ignored 0"
    line = make(fault="refuse")
    assert json.loads(ask(line, TORQUE))
    assert state(line) == "1000 dropped 0 ignored 1"


def test_after_and_every_count_requests() -> None:
    line = make(fault="silent", after=2, every=2)
    assert [ask(line) != b"" for _ in range(7)] == [True, True, True, False, True, False, True]


def test_after_and_every_count_the_objects_of_a_stream() -> None:
    line = make(exchange="stream", fault="silent", after=2, every=3)
    heard = []
    for number in range(1, 10):
        line.advance(number / 100 + 0.0001)
        heard.append(line.take() != b"")
    assert heard == [True, True, True, True, False, True, True, False, True]
    assert line.requests == 0


def test_spoiled_text() -> None:
    whole = ask(make())
    spoiled = ask(make(fault="bad-checksum"))
    assert len(spoiled) == len(whole)
    assert sum(one != other for one, other in zip(spoiled, whole, strict=True)) == 1
    with pytest.raises(UnicodeDecodeError):
        spoiled.decode()
    cut = ask(make(fault="truncate"))
    assert whole.startswith(cut)
    assert 0 < len(cut) < len(whole)
    assert ask(make(fault="duplicate")) == whole * 2
    assert ask(make(fault="echo")) == b"{}" + whole
    assert ask(make(fault="loopback")) == b"{}"


def test_stale_and_late() -> None:
    line = make(fault="stale", start="homed")
    first = ask(line, '{"hand_mode":2}')
    line.advance(1.0)
    second = ask(line)
    assert second.startswith(first)
    assert json.loads(second[len(first) :])["motor_pos"] != json.loads(first)["motor_pos"]
    line = make(fault="late")
    assert ask(line) == b""
    assert drain(line) == [(pytest.approx(0.6), ask(make()))]


@each_row("seed", range(20))
def test_noise_leaves_the_object_whole(seed: int) -> None:
    heard = ask(make(fault="noise", seed=seed, between="none"))
    whole = ask(make(between="none"))
    assert whole in heard
    assert 2 <= len(heard) - len(whole) <= 12


@each_row("fault", ["dribble", "split"])
@each_row("exchange", ["poll", "stream"])
def test_pieces_make_up_the_object_and_the_stream_does_not_pile_up(fault: str, exchange: str) -> None:
    line, whole = make(fault=fault, exchange=exchange), ask(make())
    first = ask(line)
    reads = [(0.0, first), *drain(line, seconds=10.0)]
    assert len(reads) > 8
    text = b"".join(data for _, data in reads)
    assert text.startswith(whole)
    assert all(row == whole.strip() for row in text.split(b"\n")[:-1])
    if fault == "dribble":
        assert all(later - sooner < 0.02 for (sooner, _), (later, _) in pairwise(reads[1:]))


@each_row("exchange", ["poll", "stream"])
def test_disconnect_and_a_new_client(exchange: str) -> None:
    line = make(fault="disconnect", exchange=exchange, after=1)
    whole = ask(make())
    ask(line)
    ask(line)
    line.advance(0.011)
    line.advance(0.021)
    assert whole.startswith(line.take()[len(whole) if exchange == "stream" else 0 :])
    assert line.hung_up
    line.reconnect()
    line.command("fault none")
    line.advance(0.031)
    assert ask(line).count(b"\n") == 1


@each_row("fault", ["wrong-id", "twin-id", "garble"])
def test_faults_that_mean_nothing_without_id_and_speed(fault: str) -> None:
    assert ask(make(fault=fault)) == ask(make())


@each_row("exchange", ["poll", "stream"])
@each_row("fault", [*LINE_FAULTS, *model_class("aidin").FAULTS])
def test_every_fault_runs_and_ends(fault: str, exchange: str) -> None:
    line = make(fault=fault, exchange=exchange)
    ask(line, STOP)
    drain(line, seconds=0.2)
    line.reconnect()
    line.command("fault none")
    line.advance(30.0)
    line.take()
    ask(line)
    line.advance(31.0)
    line.command("power-cycle")
    line.advance(31.05)
    heard = line.take() + ask(line)
    assert list(json.loads(heard.splitlines()[-1] if heard else ask(line).splitlines()[-1])) == KEYS


@each_row(
    "options",
    [{"rate": "0"}, {"exchange": "push"}, {"start": "shut"}, {"digits": "5"}, {"buffer": "10"}, {"chunk": "-1"},
     {"merge": "0"}, {"reader": "strict"}, {"q4": "1"}, {"colour": "red"}, {"fault": "locked-rotor"}, {"drift": "x"}],
)  # fmt: skip
def test_options_are_checked(options: dict[str, str]) -> None:
    with pytest.raises(ValueError, match=next(iter(options)) if "fault" not in options else "unknown fault"):
        create("aidin", options)


@pytest.mark.real
def test_no_clock_and_no_json_before_a_device_is_made() -> None:
    import subprocess
    import sys

    code = "import sys, handctl.sim.aidin.device; print(sorted({'json', 're', 'typing', 'random', 'socket'} & set(sys.modules)))"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-S", "-c", code], capture_output=True, text=True, timeout=20, env=environment, check=False
    )
    assert done.stdout.strip() == "[]", done.stderr
