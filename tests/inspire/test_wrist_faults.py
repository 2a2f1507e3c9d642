"""What the messages of `handctl wrist` say at single faults of the simulator, on both wires, and what comes of them in a stream.

Every fault in every command is `tests/search/faults.py`; its exit codes are in `tests/contract/facts/outcomes/wrist.py`.
"""

from __future__ import annotations

import pytest

from tests.contract.facts.outcomes.wrist import OUTCOMES
from tests.inspire.wrist_commands import WIRES, link, power_on_truth
from tests.support.cli import run

SEED = 1


@pytest.mark.parametrize("verb", ["dump", "status"])
def test_a_module_that_does_not_answer_across_gaps(verb: str) -> None:
    """Everything between gaps is there and right; what could not be read says so beside it."""
    result = run("wrist", verb, "-p", link("serial", fault="block-silent"), "--json")
    assert (result.code, result.values) == (0, power_on_truth())
    result = run("wrist", verb, "-p", link("can", fault="block-silent"), "--json")
    errors = {name: None for name in ("error_1", "error_2") if result.code}
    assert result.values == {**power_on_truth(), **errors}
    assert [row["name"] for row in result.rows if "error" in row] == list(errors)


# -- what the message says --------------------------------------------------------------------------------------------

KINDS = [
    ("serial", "silent", "no-answer", 4), ("serial", "bad-checksum", "bad-checksum", 5),
    ("serial", "wrong-id", "wrong-id", 5), ("serial", "loopback", "echo", 5), ("serial", "disconnect", "lost", 3),
    ("can", "silent", "no-answer", 4), ("can", "deaf", "no-answer", 4), ("can", "no-ack", "no-ack", 4),
    ("can", "bus-off", "bus-off", 3), ("can", "truncate", "cut-short", 5), ("can", "wrong-id", "wrong-id", 5),
    ("can", "loopback", "echo", 5), ("can", "disconnect", "lost", 3),
]  # fmt: skip


@pytest.mark.parametrize(
    "args", [("get", "pitch_actual"), ("dump",), ("watch", "--count", "2"), ("scan", "--ids", "1-8")]
)
def test_error_names_the_kind(args: tuple[str, ...]) -> None:
    for wire, fault, code, exit_code in KINDS:
        result = run("wrist", *args, "-p", link(wire, fault=fault, seed=SEED), "--json")
        envelope = result.stream[1] if args[0] == "watch" else result.json
        (message,) = [m for m in envelope["messages"] if m["level"] == "error"]
        assert (result.code, message["code"]) == (exit_code, code), (wire, fault, result)
        assert message["hint"] and "fake://wrist" in message["text"], message
        if exit_code in (4, 5) and args[0] != "scan":
            assert ("EB 90 01 04 30" if wire == "serial" else "10FF0001 [1] 0") in message["text"]  # what was sent
        assert fault != "wrong-id" or "id 2" in message["text"], message
        if wire == "can" and exit_code == 4:
            assert "500000" in message["hint"] and "120" in message["hint"]  # dossier W14, §8


@pytest.mark.parametrize("wire", WIRES)
def test_hints_name_commands_of_this_device(wire: str) -> None:
    """A wrist's message never sends the technician to the commands or the power supply of the exoskeleton."""
    for fault in OUTCOMES.wires[wire].line:
        for args in (("get", "pitch_actual"), ("scan", "--ids", "1-8"), ("set", "yaw_set=1")):
            result = run("wrist", *args, "-p", link(wire, fault=fault, seed=SEED), "--json")
            for message in result.json["messages"]:
                assert "exo" not in message["text"] + message["hint"], (fault, args, message)
                assert "7..9 V" not in message["hint"], (fault, args, message)


@pytest.mark.parametrize(("fault", "code", "exit_code"), [("healthy", "no-answer", 4), ("garble", "garbage", 5)])
def test_a_serial_wrist_at_another_speed(fault: str, code: str, exit_code: int) -> None:
    """The manual has 115200 alone; the hand behind the wrist may have been set to another speed, and `--baud` reaches it."""
    result = run("wrist", "get", "pitch_actual", "-p", link("serial", baud=57600, fault=fault), "--json")
    if result.code == 5 and result.error["code"] == "wrong-speed":  # found and named, as for the exo
        assert "--baud 57600" in result.error["hint"]
    else:
        assert (result.code, result.error["code"]) == (exit_code, code)
        assert "baud rate" in result.error["hint"]
    right = run("wrist", "get", "pitch_actual", "-p", link("serial", baud=57600), "--json", "--baud", "57600")
    assert right.values == {"pitch_actual": -3.45}


@pytest.mark.parametrize("wire", WIRES)
def test_stream_goes_on_over_single_failures(wire: str) -> None:
    """A watch gives a row with `error` for a sample that failed, and carries on (retries off)."""
    args = ("watch", "pitch_actual", "--count", "9", "--rate", "0", "--retries", "0", "--json")
    rows, end = run("wrist", *args, "-p", link(wire, fault="silent", after=2, every=4)).stream
    assert [row.get("value") for row in rows] == [-3.45] * 5 + [None] + [-3.45] * 3
    assert "error" in rows[5] and "value" not in rows[5]
    assert (end["ok"], end["stream"]["failed"]) == (True, 1)


@pytest.mark.parametrize("wire", WIRES)
@pytest.mark.parametrize("fault", ["duplicate", "echo", "noise", "slow"])
def test_a_left_over_reply_is_never_taken_for_the_next_one(fault: str, wire: str) -> None:
    """The same request again and again while the value changes: each sample is of its own moment."""
    args = ("wrist", "watch", "temperature_1", "--rate", "0.2", "--count", "8", "--json")
    values = [row["value"] for row in run(*args, "-p", link(wire, fault="hot")).stream[0]]
    assert values[0] == 71 and values[-1] < 60 and values == sorted(values, reverse=True)
    assert [row["value"] for row in run(*args, "-p", link(wire, fault=f"hot,{fault}")).stream[0]] == values


def test_counters_tell_what_happened_on_the_wire() -> None:
    def counters(wire: str, fault: str, **options: int) -> dict[str, int]:
        return dict(
            run("wrist", "get", "pitch_actual", "-p", link(wire, fault=fault, **options), "--json").json["counters"]
        )

    clean = {"sent": 1, "received": 1, "retries": 0, "bad_frames": 0, "stray_bytes": 0}
    assert counters("serial", "healthy") == clean
    assert counters("serial", "echo") == {**clean, "stray_bytes": 9}
    assert counters("can", "healthy") == {**clean, "foreign_frames": 0}
    assert counters("can", "echo") == {**clean, "foreign_frames": 0, "stray_bytes": 1}
    assert counters("can", "silent")["sent"] == 4
    noisy = counters("can", "noise")
    assert 1 <= noisy["foreign_frames"] <= 6 and noisy["stray_bytes"] == 0
