"""What the messages of `handctl exo` say at single faults of the simulator, and what comes of faults in a stream and a scan.

Every fault in every command is `tests/search/faults.py`; its exit codes are in `tests/contract/facts/outcomes/exo.py`.
"""

from __future__ import annotations

import pytest

from tests.support.cli import check_schema, fake, run
from tests.support.each_row import each_row


def test_deadline_that_ends_a_wait_is_named() -> None:
    """Not waited for is not the same as not reported by the hand."""
    result = run("exo", "save", "-y", "--deadline", "0.25", "-p", fake(), "--json")
    assert result.code == 4, result
    assert "deadline" in result.error["text"] + result.error["hint"], result
    assert "movement" not in result.error["hint"], result
    result = run("exo", "calibrate", "-y", "--deadline", "0.25", "-p", fake(), "--json")
    assert result.code == 4, result
    assert "30 s" not in str(result.json["messages"]) and "end of the end" not in result.error["text"], result


@each_row("words", [("baud", "57600"), ("set", "baud_code=1")])
@each_row("late", ["0.35", "0.6", "0.9"])
def test_a_late_reply_to_a_read_before_the_write_is_no_read_back(words: tuple[str, ...], late: str) -> None:
    """The write arrives at each of these lines: that it was not taken would be false."""
    for after in range(10):
        result = run("exo", *words, "-y", "--json", "-p", fake(fault="late", late=late, after=after))
        assert result.code in (0, 4, 5), (after, result)


# -- what the message says --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("args", [("get", "system_voltage"), ("dump",), ("status",), ("watch", "--count", "2")])
def test_error_names_the_kind(args: tuple[str, ...]) -> None:
    for fault, code, exit_code, said in (
        ("silent", "no-answer", 4, "EB 90 01 04 11"), ("deaf", "no-answer", 4, "EB 90 01 04 11"),  # what was sent
        ("bad-checksum", "bad-checksum", 5, "90 EB 01"),  # what came
        ("wrong-id", "wrong-id", 5, "id 2"), ("loopback", "echo", 5, "EB 90 01 04 11"), ("disconnect", "lost", 3, ""),
    ):  # fmt: skip
        result = run("exo", *args, "-p", fake(fault=fault), "--json")
        envelope = result.stream[1] if args[0] == "watch" else result.json
        (message,) = [m for m in envelope["messages"] if m["level"] == "error"]
        assert (result.code, message["code"]) == (exit_code, code), result
        assert message["hint"] and "fake://exo" in message["text"] and said in message["text"], message
        assert exit_code == 3 or "EB 90 01 04 11" in message["text"], message


def test_truncated_answer_is_shown() -> None:
    seen = set()
    for seed in range(10):
        result = run("exo", "get", "system_voltage", "-p", fake(fault="truncate", seed=seed), "--json")
        assert result.code == 5
        seen.add(result.error["code"])
    assert "cut-short" in seen
    assert seen <= {"cut-short", "garbage", "bad-checksum"}


@pytest.mark.parametrize(
    "args", [("id", "2", "--yes"), ("get", "id"), ("dump",), ("raw", "EB90010512D4052C011E", "-y")]
)
def test_late_is_never_taken_for_another_speed(args: tuple[str, ...]) -> None:
    """The reply to an earlier request, come after a speed change, is no answer at that speed."""
    for late in (0.35, 0.6, 0.95, 1.3):
        result = run("exo", *args, "-p", fake(fault="late", late=late), "--json")
        assert "wrong-speed" not in result.codes(), result
        assert result.code in (0, 4, 5), result


def test_late_hand_at_another_speed_is_found_at_the_right_one() -> None:
    for speed in (57600, 19200):
        result = run("exo", "get", "id", "-p", fake(baud=speed), "--json")
        assert result.code == 5
        assert result.error["code"] == "wrong-speed"
        assert f"--baud {speed}" in result.error["hint"]
        assert run("exo", "get", "id", "-p", fake(baud=speed), "--json", "--baud", str(speed)).values == {"id": 1}


def test_scan_suspects_two_hands_with_one_id() -> None:
    result = run("exo", "scan", "--ids", "1-8", "-p", fake(fault="twin-id"), "--json")
    text = " ".join(m["text"] + m["hint"] for m in result.json["messages"]) + str(result.rows)
    text = text.lower()
    assert "two hands" in text or "two devices" in text, result


def test_scan_suspects_a_twin_that_shows_now_and_then() -> None:
    result = run("exo", "scan", "--ids", "1-8", "-p", fake(fault="twin-id", every=2), "--json")
    assert result.code == 0
    assert [(row["id"], row["suspicion"]) for row in result.rows] == [(1, "are there two devices with this id?")]
    assert "twin-id" in result.codes()


@pytest.mark.parametrize("fault", ["loopback", "noise,deaf", "loopback,noise", "garble,deaf"])
def test_scan_finds_no_hand_in_echo_or_noise(fault: str) -> None:
    for seed in range(2):
        result = run("exo", "scan", "-p", fake(fault=fault, seed=seed), "--json")
        assert result.code == 5, result
        assert result.rows == []


def test_stream_goes_on_over_single_failures() -> None:
    """A watch gives a row with `error` for a sample that failed, and carries on (retries off)."""
    link = fake(fault="silent", after=3, every=4)  # the second answer shows which device it is
    result = run(
        "exo", "watch", "system_voltage", "--count", "9", "--rate", "0", "--retries", "0", "--json", "-p", link
    )
    rows, end = result.stream
    assert result.code == 0
    assert [row.get("value") for row in rows] == [558, 558, 558, 558, 558, None, 558, 558, 558]
    assert "error" in rows[5] and "value" not in rows[5]
    assert end["stream"]["failed"] == 1
    check_schema(end)


@pytest.mark.parametrize("fault", ["duplicate", "echo", "noise", "slow"])
def test_a_left_over_reply_is_never_taken_for_the_next_one(fault: str) -> None:
    """The same request again and again while the value changes: each sample is of its own moment.

    (A stale reply that comes after an equal request cannot be told: frames have no numbers.)
    """
    args = ("exo", "watch", "temperature.thumb", "--rate", "0.2", "--count", "8", "--json")
    clean = run(*args, "-p", fake(fault="hot")).stream[0]
    values = [row["value"] for row in clean]
    assert values[0] == 75 and values[-1] < 60 and values == sorted(values, reverse=True)
    assert [row["value"] for row in run(*args, "-p", fake(fault=f"hot,{fault}")).stream[0]] == values


def test_a_late_reply_is_not_kept_for_the_next_sample() -> None:
    """Each read is asked twice and answered twice; the second answer comes when nobody waits any more."""
    args = ("exo", "watch", "temperature.thumb", "--rate", "0.2", "--count", "8", "--json")
    clean = [row["value"] for row in run(*args, "-p", fake(fault="hot")).stream[0]]
    rows, end = run(*args, "-p", fake(fault="hot,late", late=0.35)).stream
    assert end["counters"]["retries"] >= 8
    assert all(abs(row["value"] - value) <= 1 for row, value in zip(rows, clean, strict=True)), (rows, clean)


def test_counters_tell_what_happened_on_the_line() -> None:
    """Two exchanges: the id, and what shows which device it is."""

    def counters(fault: str, *more: str, **options: int) -> dict[str, int]:
        return dict(run("exo", "get", "id", "-p", fake(fault=fault, **options), "--json", *more).json["counters"])

    clean = {"sent": 2, "received": 2, "retries": 0, "bad_frames": 0, "stray_bytes": 0}
    assert counters("healthy") == clean
    assert counters("echo") == {**clean, "stray_bytes": 18}
    noisy = counters("noise")
    assert (noisy["sent"], noisy["received"]) == (2, 2) and 1 <= noisy["stray_bytes"] <= 24
    spoiled = counters("bad-checksum", "--baud", "115200")
    assert spoiled == {"sent": 3, "received": 0, "retries": 2, "bad_frames": 3, "stray_bytes": 27}
    assert counters("bad-checksum", every=3) == clean
    again = counters("silent", "--retries", "4", "--baud", "115200")
    assert again == {"sent": 5, "received": 0, "retries": 4, "bad_frames": 0, "stray_bytes": 0}
