"""`handctl exo …` where a person reads what stands there: ranges of the commands, a speed that is already set."""

from __future__ import annotations

from pathlib import Path

from tests.support.cli import fake, run, writes
from tests.support.each_row import each_row


@each_row(
    ("words", "code"),
    [
        (("position", "500", "400", "1001", "200", "100"), "out-of-range"),
        (("position", "500", "400", "-2", "200", "100"), "out-of-range"),
        (("position", "middle=1001"), "out-of-range"),
        (("position", "middle=10", "MIDDLE=20"), "twice"),
        (("position", "middle=10", "20"), "mixed"),
        (("position", "rotation=10"), "unknown-name"),
        (("position", "10", "20"), "wrong-count"),
        (("position", "-1", "-1", "-1", "-1", "-1"), "usage"),
        (("position", "middle=10", "--expect", "any"), "usage"),
        (("position", "middle=10", "--wiat=3"), "usage"),
        (("force", "0", "0", "0", "0", "-1001"), "out-of-range"),
        (("force", "middle=1.5"), "not-a-number"),
    ],
)
def test_what_is_no_command_for_the_fingers_is_refused_before_anything_is_sent(
    words: tuple[str, ...], code: str
) -> None:
    answer = run("exo", *words, "-p", fake(), "-y", "--json")
    assert (answer.code, answer.error["code"], answer.json["counters"]["sent"]) == (2, code, 0)


@each_row(
    ("words", "bytes_"),
    [
        (("position", "ring=900", "index=100"), ["EB 90 01 05 12 D0 05 84 03 74", "EB 90 01 05 12 D4 05 64 00 55"]),
        (("position", "-1", "900", "-1", "100", "-1"), ["EB 90 01 05 12 D0 05 84 03 74", "EB 90 01 05 12 D4 05 64 00 55"]),
        (("position", "little=1", "ring=2", "middle=3", "index=4", "thumb=5"), ["EB 90 01 0B 32 01 00 02 00 03 00 04 00 05 00 4D"]),
        (("force", "0", "0", "0", "0", "-1"), ["EB 90 01 0B 31 00 00 00 00 00 00 00 00 FF FF 3B"]),
        (("force", "thumb=-1"), ["EB 90 01 05 12 E2 05 FF FF FD"]),
    ],
)  # fmt: skip
def test_single_fingers_are_written_to_their_registers_alone(words: tuple[str, ...], bytes_: list[str]) -> None:
    """Nothing is written for a finger that is left alone: the command for five has no value for that (exo §2.2.2)."""
    plan = run("exo", *words, "-p", fake(), "-n", "--json")
    assert [step["bytes"] for step in plan.json["writes"]] == bytes_
    assert run("exo", *words, "-p", fake(), "--json").code == 8, "a person may wear it"
    assert run("exo", *words, "-p", fake(), "--json", "-y").code == 0


def test_a_speed_that_is_already_set_is_not_called_unsaved() -> None:
    """What lies in flash cannot be read (exo §2.3.4)."""
    answer = run("exo", "baud", "115200", "-p", fake(id=7), "--id", "7", "-y", "--json")
    texts = [message["text"] for message in answer.json["messages"]]
    assert any("was perhaps not saved" in text for text in texts)
    assert not any("is not saved" in text for text in texts)


def test_the_next_step_after_a_new_speed_reaches_the_hand() -> None:
    answer = run("exo", "baud", "57600", "-p", fake(id=7), "--id", "7", "-y", "--json")
    (unsaved,) = [message for message in answer.json["messages"] if message["code"] == "not-saved"]
    assert "57600 bit/s is not saved" in unsaved["text"]
    assert "handctl exo save --id 7" in unsaved["hint"]


@each_row("which", ["force", "position"])
def test_a_lost_answer_of_a_command_is_told_to_scripts(which: str) -> None:
    """Silence from the first write on: the look at who is there, one request that the hand takes, was answered."""
    answer = run("exo", which, "1", "2", "3", "4", "5", "-p", fake(fault="silent", after=1), "-y", "--json")
    assert answer.code == 4
    assert "ack-lost" in [message["code"] for message in answer.json["messages"]]


def test_a_late_answer_to_a_write_is_not_a_reason_to_repeat_it(tmp_path: Path) -> None:
    """A line whose answers come too late is not written to at all: what became of it would not be seen."""
    trace = tmp_path / "t.txt"
    answer = run("exo", "force", "1", "2", "3", "4", "5", "-p", fake(fault="late"), "-y", "--json", "--trace", trace)
    assert (answer.code, answer.error["code"]) == (4, "late")
    assert "--timeout" in answer.error["hint"] and "Nothing was written" in answer.error["text"]
    assert writes(trace) == []
    answer = run("exo", "get", "id", "-p", fake(fault="late", late="1"), "--retries", "0", "--json")
    assert answer.error["code"] == "late" and "--timeout" in answer.error["hint"]


def test_a_line_of_fingers_has_the_address_of_its_first() -> None:
    """Element k of a 1-byte group lies at address + k (exo §2.3.13), in whatever order it is asked for."""
    lines = run("exo", "get", "temperature.thumb", "temperature", "-p", fake()).out.splitlines()
    assert lines[1].split() == ["temperature", "1618", "31", "32", "33", "34", "35", "°C"]
    lines = run("exo", "get", "temperature.thumb", "-p", fake()).out.splitlines()
    assert lines[1].split() == ["temperature", "1622", "35", "°C"]


@each_row(
    "arguments",
    [
        "exo raw EB 90 01 04 12 F1 03 01 0C",
        "exo write 1492 2C01",
        "exo set position_set.index=300",
        "exo force 1 2 3 4 5",
        "exo position 1 2 3 4 5 --wait 3",
        "exo save",
        "exo id 5",
        "exo calibrate",
        "wrist raw EB 90 01 07 31 0E 04 E8 03 18 FC 4A",
        "wrist raw 15038001#E80318FC --can",
        "wrist move --pitch 3",
        "wrist hand-write 1486 0A00",
    ],
)
def test_a_port_that_cannot_be_opened_leaves_nothing_behind(arguments: str) -> None:
    """Nothing was sent, and nothing is said to go on."""
    port = "can:slcan:/dev/no-such-port" if "--can" in arguments else "/dev/no-such-port"
    answer = run(*arguments.split(), "-y", "-p", port, "--json")
    assert (answer.code, answer.json["counters"]["sent"]) == (3, 0)
    for words in ("goes on", "may ", "was sent"):
        assert words not in answer.error["text"]


@each_row("value", ["1_0", "1e2", "1.5", "", "nan"])
@each_row("which", ["force", "position"])
def test_what_set_does_not_take_the_commands_do_not_take_either(which: str, value: str) -> None:
    assert run("exo", "set", f"{which}_set.little={value}", "-p", fake(), "-n").code == 2
    assert run("exo", which, value, "2", "3", "4", "5", "-p", fake(), "-n").code == 2


@each_row("address", ["1472", "0x5C0", "0X5c0"])
def test_an_address_may_be_hexadecimal(address: str) -> None:
    """As the manuals print them (wrist §2.2), and as `set` takes values."""
    (row,) = run("exo", "read", address, "2", "-p", fake(), "--json").rows
    assert (row["name"], row["address"]) == ("system_voltage", 1472)
    (row,) = run("wrist", "read", "0x400", "2", "-p", "fake://wrist?clock=virtual", "--json").rows
    assert row["name"] == "current_1024"
    (row,) = run("wrist", "hand-write", "0x5CE", "0A00", "-p", "fake://wrist", "-n", "--json").rows
    assert row["bytes"] == "EB 90 01 05 12 CE 05 0A 00 F5"


@each_row("address", ["65536", "0x10000", "1_0", "5CE", "0x", "", "1.5", "x"])
@each_row(
    "command", ["exo read {} 1", "exo write {} 00", "wrist read {} 1", "wrist write {} 0000", "wrist hand-read {} 1",
                "wrist hand-write {} 00"],
)  # fmt: skip
def test_what_is_no_address_is_a_usage_error(command: str, address: str) -> None:
    words = [address if word == "{}" else word for word in command.split()]
    answer = run(*words, "--fake", "-y", "--json")
    assert (answer.code, answer.json["counters"]["sent"]) == (2, 0)
    assert "65535" in answer.error["hint"]
