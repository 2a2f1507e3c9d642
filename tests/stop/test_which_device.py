"""A stop reaches the device that is meant: the one that was typed or named, or else each that handctl has set going on that line.

What a running command reads, and what an earlier one met last, is no answer to which one moves.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from handctl.command import open_links, several_devices
from handctl.command.config_file import read_config
from handctl.command.family import load
from handctl.command.settings_and_checks import Invocation
from handctl.devices.barrett import state_files
from handctl.errors import STOPPED, UsageError
from handctl.families import FAMILIES
from handctl.link import ByteLink, Deadline, Link, open_link, port_users
from handctl.link.device_lock import MOST_MOVING, Lock, Reached, hold, remembered
from handctl.link.port_users import handctl_commands, option_in
from handctl.model.command_settings import Settings
from handctl.model.prompts import Prompts
from handctl.model.result import Journal
from handctl.stop import stop_command, stop_listener
from handctl.stop.device_access import DeviceAccess, lock_for
from handctl.stop.stop_listener import is_meant
from tests.stop.bench import PORT, Bench, lock_file, noting
from tests.support.cli import PATIENCE, Result, run
from tests.support.each_row import each_row
from tests.support.stop import RELEASE, Stand

EXO = ("exo", "position", "0", "0", "0", "0", "0", "-y")
HAND = ("hand", "angle", "0", "0", "0", "0", "1000", "1000", "-y")
WRIST = ("wrist", "set", "yaw_set=12", "move_time=5000", "-y")


class Line(ByteLink):
    """Simulated devices on one line, by the id in the third byte of a request; at another id there is none."""

    def __init__(self, **devices: str) -> None:
        self.devices: dict[int, Any] = {
            int(key[1:]): open_link(f"fake://{what}clock=virtual") for key, what in devices.items()
        }
        self.nobody: Any = open_link("fake://exo?fault=silent&clock=virtual")
        self.asked: Any = self.nobody
        self.baud = 115200

    def now(self) -> float:
        """All their clocks together: only that of the one that is asked goes on."""
        return sum(one.now() for one in (self.nobody, *self.devices.values()))

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.asked = self.devices.get(data[2] if len(data) > 2 else 0, self.nobody)
        self.asked.write(data, self.asked.deadline(deadline.remaining))

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        data: bytes = self.asked.read(self.asked.deadline(deadline.remaining), size)
        return data

    def sleep(self, seconds: float) -> None:
        self.asked.sleep(seconds)

    def close(self) -> None:
        """Simulators hold nothing."""


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    monkeypatch.setattr(port_users, "handctl_commands", lambda *_: iter(()))
    return Bench(monkeypatch)


def on_line(bench: Bench, monkeypatch: pytest.MonkeyPatch, **devices: str) -> None:
    """From now on these devices are behind PORT."""

    def opened(name: str, **_options: Any) -> Link:
        link = Line(**devices)
        link.name = name
        return link

    monkeypatch.setattr("handctl.command.open_links.open_link", opened)
    monkeypatch.setattr("handctl.tools.stop.open_link", opened)


def stopped_ids(result: Result) -> list[int]:
    """The ids that writes were sent to, in their order."""
    ids = [int(row["bytes"].split()[2], 16) for row in result.rows if not row["reads"]]
    return list(dict.fromkeys(ids))


def going() -> list[tuple[str, int]]:
    return [one.key for one in remembered(PORT)[1]]


# -- what handctl has set going ----------------------------------------------------------------------------------------


@each_row(
    "words, there",
    [((*EXO, "--id", "2"), "exo?id=2&"), ((*HAND, "--id", "7"), "hand?id=7&"), ((*WRIST, "--id", "3"), "wrist?id=3&")],
)
def test_stop_goes_to_the_id_that_handctl_has_set_going(words: tuple[str, ...], there: str, bench: Bench) -> None:
    bench.there, number = there, int(words[-1])
    assert run(*words, "-p", PORT).code == 0 and going() == [(words[0], number)]
    result = run("stop", "-p", PORT, "--json")
    assert result.code == 0 and stopped_ids(result) == [number] and bench.asked == [], result
    assert result.json["device"]["id"] == number and going() == []


def test_a_hand_that_is_read_later_does_not_take_the_stop_from_a_wrist_that_moves(bench: Bench) -> None:
    bench.there = "wrist?"
    assert run(*WRIST, "-p", PORT).code == 0 and run("hand", "status", "-p", PORT).code == 0
    result = run("stop", "-p", PORT, "--json")
    flags = [row["bytes"].split()[4] for row in result.rows if not row["reads"]]
    assert result.code == 0 and flags == ["31", "12"], "the wrist first: it moves"
    assert going() == []


@each_row(
    "last, missing, code, ids",
    [("2", 0, 0, [2, 1]), ("1", 0, 0, [1, 2]), ("1", 2, 4, [1, 2]), ("1", 1, 4, [1, 2])],
)
def test_each_that_moves_is_stopped_the_last_one_first(
    last: str, missing: int, code: int, ids: list[int], bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And one that does not acknowledge it decides on the exit code, and stays in memory."""
    there = {"d1": "exo?", "d2": "exo?id=2&"}
    on_line(bench, monkeypatch, **there)
    for number in ("1", "2") if last == "2" else ("2", "1"):
        assert run(*EXO, "--id", number, "-p", PORT).code == 0
    on_line(bench, monkeypatch, **{key: what for key, what in there.items() if key != f"d{missing}"})
    result = run("stop", "-p", PORT, "--json")
    assert (result.code, stopped_ids(result)) == (code, ids), result
    assert going() == [("exo", number) for number in ids if number == missing]
    assert [row["step"] for row in result.rows] == list(range(1, len(result.rows) + 1))


@each_row("words, missing", [(("stop",), 0), (("stop",), 2), (("exo", "stop"), 0), (("exo", "stop"), 1)])
def test_each_gets_its_stop_before_one_of_them_is_checked(
    words: tuple[str, ...], missing: int, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who is silent has one short try until then."""
    there = {"d1": "exo?", "d2": "exo?id=2&", "d3": "exo?id=3&"}
    on_line(bench, monkeypatch, **there)
    for number in ("1", "3", "2"):
        assert run(*EXO, "--id", number, "-p", PORT).code == 0
    on_line(bench, monkeypatch, **{key: what for key, what in there.items() if key != f"d{missing}"})
    sent, write = list[bytes](), Line.write

    def noted(line: Line, data: bytes, deadline: Deadline) -> None:
        sent.append(data)
        write(line, data, deadline)

    monkeypatch.setattr(Line, "write", noted)
    result = run(*words, "-p", PORT, "--json")
    forces_and_checks = [(data[4], data[2]) for data in sent if data[4] in (0x31, 0x11)]
    assert sorted(forces_and_checks[:3]) == [(0x31, 1), (0x31, 2), (0x31, 3)], forces_and_checks
    assert result.code == (4 if missing else 0) and set(stopped_ids(result)) == {1, 2, 3}


def test_an_id_that_is_typed_is_the_only_one(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    on_line(bench, monkeypatch, d1="exo?", d2="exo?id=2&")
    for number in ("1", "2"):
        run(*EXO, "--id", number, "-p", PORT)
    assert stopped_ids(run("stop", "-p", PORT, "--id", "1", "--json")) == [1] and going() == [("exo", 2)]
    run(*EXO, "--id", "1", "-p", PORT)
    assert stopped_ids(run("exo", "stop", "-p", PORT, "--id", "1", "--json")) == [1] and going() == [("exo", 2)]
    assert stopped_ids(run("exo", "stop", "-p", PORT, "--json")) == [1, 2], "without one each of the family that moves"
    assert going() == []


def test_an_id_that_a_variable_gives_is_not_the_only_one(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    on_line(bench, monkeypatch, d1="exo?", d2="exo?id=2&")
    for words in (("exo", "stop"), ("stop",)):
        run(*EXO, "--id", "2", "-p", PORT)
        result = run(*words, "-p", PORT, "--json", env={"HANDCTL_ID": "1"})
        assert (result.code, 2 in stopped_ids(result), going()) == (0, True, []), words


def test_only_what_moves_is_remembered_as_going(bench: Bench) -> None:
    """And it is in the file as soon as the bytes are out: the command may be killed then."""
    for words, there, left in (
        (("exo", "status"), "exo?", []),
        (("hand", "speed", "200", "200", "200", "200", "200", "200"), "hand?", []),
        (EXO, "exo?", [("exo", 1)]),
        (("exo", "stop"), "exo?fault=silent&", [("exo", 1)]),
        (("exo", "stop"), "exo?", []),
        ((*EXO, "--wait", "20"), "exo?", [("exo", 1)]),
    ):
        bench.there = there
        run(*words, "-p", PORT)
        assert going() == left, words


RAW = ("eb 90 02 05 12 ce 05 84 03 73", "eb 90 02 05 12 ce 05 84 03 74")
"""position_set.little = 900 for id 2; of the second one the checksum is wrong, which a device may let pass."""
RELEASED = ("hand", "speed", "500", "500", "500", "500", "500", "500", "-y")


@each_row(
    "words, left",
    [
        (("exo", "raw", RAW[0], "-y"), [2]),
        (("exo", "raw", RAW[1], "-y", "--force-ambiguous"), [2]),
        (("exo", "raw", "eb 90 02 04 11 e8 03 01 03"), []),
        (("exo", "raw", RAW[0] + RAW[0].replace("02", "01", 1)[:-2] + "72", "-y"), [1, 2]),
        (("exo", "terminal", RAW[0], "-y"), [2]),
    ],
)
def test_what_moves_is_told_by_the_bytes_that_went_out(
    words: tuple[str, ...], left: list[int], bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The id of the command is another one."""
    on_line(bench, monkeypatch, d1="exo?", d2="exo?id=2&")
    run(*words, "-p", PORT)
    assert going() == [("exo", number) for number in left]
    assert not left or stopped_ids(run("stop", "-p", PORT, "--json"))[0] == left[0]


@each_row("can, number", [("15038002 [2] D0 07", 2), ("05038002 [2] D0 07", 2)])
def test_on_can_it_is_told_by_the_identifier(can: str, number: int, bench: Bench) -> None:
    """Of a hand that is attached to a wrist module, too."""
    bench.there = "wrist?bus=can&id=2&"
    run("wrist", "raw", can, "-y", "-p", "can:slcan:" + PORT, "--force-ambiguous")
    assert going() == [("wrist" if can[0] == "1" else "hand", number)]


def test_a_frame_that_comes_in_two_pieces_is_for_the_id_in_the_first() -> None:
    words = load("exo", "write_rules").words()
    data = bytes.fromhex(RAW[0])
    found = [frame.to for part in (data[:4], data[4:], data) for frame in words.sent(part, None)]
    assert found == [None, ("exo", 2), ("exo", 2)] and words.addressed(data + data, None) == [("exo", 2)] * 2


def test_what_goes_on_to_a_target_that_it_holds_is_moving_again(bench: Bench, tmp_path: Path) -> None:
    """That is in no frame: the command has read both, and asked."""
    bench.there = f"hand?state={tmp_path}/hand.json&"
    for words, left in ((HAND, [("hand", 1)]), (("stop",), []), (RELEASED, [("hand", 1)])):
        run(*words, "-p", PORT)
        assert going() == left, words


@each_row(
    "words, now",
    [(("exo", "id", "5", "-y"), 5), (("exo", "raw", "eb 90 01 04 12 e8 03 05 07", "-y", "--force-ambiguous"), 5)],
)
def test_what_moves_is_stopped_at_its_new_id(words: tuple[str, ...], now: int, bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "config.toml"
    file.write_text(f"[devices.left]\nkind = 'exo'\nport = '{PORT}'\nid = 1\n")
    for where in (("-p", PORT), ("-d", "left")):
        bench.there = f"exo?state={tmp_path}/{where[0]}.json&"
        run(*EXO, "-p", PORT)
        run(*words, "-p", PORT)
        assert going() == [("exo", now)]
        result = run("exo", "stop", *where, "--json", env={"HANDCTL_CONFIG": str(file)})
        assert (result.code, stopped_ids(result), going()) == (0, [now], []), result


@each_row("stop", ["stop", "exo stop"])
def test_a_line_stops_what_moves_at_its_new_id_alone(stop: str, bench: Bench) -> None:
    """The id of before is not even that of the device that was talked to last."""
    bench.there = "exo?"
    lines = "\n".join((" ".join(EXO), "exo id 5 -y", stop))
    with noting() as sent:
        result = run("batch", "-p", PORT, "--json", stdin=lines)
    assert result.code == 0, result
    assert {data[2] for data in sent if data[4:5] == b"\x31"} == {5}


@each_row("family, moves", [("exo", EXO), ("hand", HAND)])
def test_what_has_its_former_id_again_is_stopped(
    family: str, moves: tuple[str, ...], bench: Bench, tmp_path: Path
) -> None:
    """An id that was not saved lasts until power-off (exo §2.3.4). One that was typed stands."""
    file = tmp_path / "config.toml"
    file.write_text(f"[devices.left]\nkind = '{family}'\nport = '{PORT}'\nid = 1\n")
    for words, env, now in (
        ((family, "stop", "-p", PORT), {}, 1),
        ((family, "stop", "-p", PORT), {}, 3),
        ((family, "stop", "-p", PORT), {"HANDCTL_ID": "7"}, 7),
        (("stop", "-p", PORT), {}, 1),
        (("stop", "-p", PORT), {}, 3),
        ((family, "stop", "-d", "left"), {"HANDCTL_CONFIG": str(file)}, 1),
        (("stop", "-d", "left"), {"HANDCTL_CONFIG": str(file)}, 1),
    ):
        bench.there = f"{family}?id={now}&"  # begun afresh by each command
        for before in (moves, (family, "id", "5", "-y")):
            assert run(*before, "--id", str(now), "-p", PORT).code == 0
        result = run(*words, "--json", env=env)
        assert stopped_ids(result)[-1] == now and "former-id" in result.codes(), (words, result)
        assert result.code == 4, "that this one replies does not show that it is the one that was set going"
        typed = run(family, "stop", "--id", "5", "-p", PORT, "--json")
        assert typed.code == 4 and set(stopped_ids(typed)) == {5}, typed


@each_row(
    "moved, met, stays",
    [
        ((WRIST, "wrist?"), ("exo", "exo?"), False),
        ((WRIST, "wrist?"), ("barrett", "barrett?"), False),
        ((WRIST, "wrist?"), ("hand", "wrist?"), True),
        (((*EXO, "--id", "2"), "exo?id=2&"), ("exo", "exo?"), True),
        (((*EXO, "--id", "2"), "exo?id=2&"), ("hand", "hand?"), True),
        ((EXO, "exo?"), ("hand", "exo?"), True),
        ((EXO, "exo?"), ("hand", "hand?fault=silent&"), True),
    ],
)
def test_what_cannot_be_beside_a_device_that_replies_is_no_longer_there(
    moved: tuple[tuple[str, ...], str], met: tuple[str, str], stays: bool, bench: Bench
) -> None:
    """Two devices of one line have two ids, but a wrist and the hand on it."""
    words, bench.there = moved
    assert run(*words, "-p", PORT).code == 0
    (before,) = going()
    family, bench.there = met
    run(family, "status", "-p", PORT)
    assert going() == ([before] if stays else [])


def test_a_reading_that_is_asked_again_notes_its_device_after_another_was_met(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    on_line(bench, monkeypatch, d1="exo?", d2="exo?id=2&")
    first, second = "exo get id", "exo get id --id 2"
    for lines, last in (
        ((first, first, second), 2),
        ((first, second, first, second, first), 1),
        ((first, second, first, first, second, second), 2),
    ):
        script = tmp_path / "script"
        script.write_text("\n".join(lines))
        assert run("batch", str(script), "-p", PORT).code == 0
        met, _ = remembered(PORT)
        assert met is not None and met.key == ("exo", last)


def test_the_note_is_bounded_and_what_is_damaged_in_it_is_nothing() -> None:
    lock = cast(Lock, hold(PORT, "handctl exo position", family="exo"))
    last = Reached("exo", {"id": 2, "baud": 9600, "model": "dftp"})
    for number in range(30, 60):
        lock.set_going(Reached("hand", {"id": number}))
    lock.set_going(last)
    _, found = remembered(PORT)
    assert found[0] == last and len(found) == MOST_MOVING and found[1].key == ("hand", 59)
    lock.set_going(Reached("exo", {"id": 2}))
    assert [one.key for one in remembered(PORT)[1]].count(("exo", 2)) == 1
    lock.at_rest(Reached("exo", {"id": 2, "baud": 115200}))
    assert ("exo", 2) not in going()
    lock.release()
    assert lock_file().read_text().startswith("\n") and len(going()) == MOST_MOVING - 1
    for text, wanted in (
        ("\nexo\n\nexo\tid=x\n", [("exo", 1)]),
        ("\nexo\n\nexo\tid=2\tbaud\n", [("exo", 2)]),
        ("\n\n\n\n\n", []),
        ("\nexo\n\n" + "exo\tid=99999999999999999999\n", [("exo", 1)]),
    ):
        lock_file().write_text(text)
        assert going() == wanted, text


def test_what_is_gone_from_the_line_is_tried_twice(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each time that is a failure: it may move elsewhere. Then a stop is that of what is there, at once."""
    on_line(bench, monkeypatch, d1="exo?", d2="exo?id=2&")
    run(*EXO, "--id", "2", "-p", PORT)
    on_line(bench, monkeypatch, d1="exo?")
    for code, left, said in ((4, [("exo", 2)], False), (4, [], True), (0, [], False)):
        result = run("exo", "stop", "-p", PORT, "--json")
        assert (result.code, going(), "gone" in result.codes()) == (code, left, said), result


def test_what_was_driven_through_an_adapter_is_stopped_through_it(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.there, opened = "wrist?bus=can&id=3&", list[str]()
    can, opens = f"can:slcan:{PORT}", open_links.open_link
    monkeypatch.setattr(open_links, "open_link", lambda name, **options: opened.append(name) or opens(name, **options))
    for words in (("stop",), ("wrist", "stop")):
        assert run(*WRIST, "--id", "3", "-p", can).code == 0
        opened.clear()
        result = run(*words, "-p", PORT, "--json", "--id", "3")
        assert (result.code, set(opened), going()) == (0, {can}, []), result


@each_row("family", ["exo", "barrett"])
def test_what_was_met_at_an_adapter_does_not_keep_the_stop_from_its_bus(family: str, bench: Bench) -> None:
    """Behind that port was something else before: a family that has no CAN interface."""
    bench.there = f"{family}?"
    assert run(family, "status", "-p", PORT).code == 0
    bench.there = "wrist?bus=can&"
    result = run("stop", "-p", f"can:slcan:{PORT}", "--json")
    assert (result.code, result.json["device"]["kind"]) == (0, "wrist"), result
    assert any(not row["reads"] for row in result.rows), result


# -- who holds the line ------------------------------------------------------------------------------------------------


def held(monkeypatch: pytest.MonkeyPatch, family: str, *devices: tuple[str, int], **more: Any) -> list[str]:
    """A holder of PORT that stops these devices, and lets go then; what it is told is meant."""
    lock = cast(Lock, hold(PORT, f"handctl {family} watch", family=family))
    said: list[str] = []

    def ask(_lock: str, _until: float, _seconds: float, meant: str) -> tuple[bool, dict[str, Any]]:
        said.append(meant)
        lock.release()
        told = {
            "id": devices[0][1] if devices else None,
            "devices": [list(one) for one in devices],
            "rows": [],
            "wire": [],
        }
        return True, {
            **told,
            "evidence": "",
            "text": "",
            "hint": "",
            "error": "",
            "stranger": False,
            "open": True,
            "refused": False,
            **more,
        }

    monkeypatch.setattr(stop_listener, "ask", ask)
    return said


@each_row(
    "words, family, devices, said, ids",
    [
        (("exo", "stop", "--id", "1"), "exo", [("exo", 2)], "exo 1", [1]),
        (("exo", "stop", "--id", "1"), "exo", [], "exo 1", [1]),
        (("exo", "stop", "--id", "2"), "exo", [("exo", 2)], "exo 2", []),
        (("exo", "stop"), "exo", [("exo", 2)], "exo", []),
        (("exo", "stop"), "hand", [("hand", 1)], "exo", [1]),
        (("exo", "stop", "--id", "1"), "", [("exo", 2), ("exo", 1)], "exo 1", []),
        (("stop",), "exo", [("exo", 2)], "exo", []),
    ],
)
def test_a_holder_that_has_another_device_does_not_have_the_one_that_is_meant(
    words: tuple[str, ...], family: str, devices: list[tuple[str, int]], said: str, ids: list[int],
    bench: Bench, monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    bench.there = "exo?"
    heard = held(monkeypatch, family, *devices)
    result = run(*words, "-p", PORT, "--json")
    assert (result.code, stopped_ids(result), heard) == (0, ids, [said]), result


@each_row("error, state", [("NoAnswer", "sent"), ("", "confirmed")])
def test_what_a_holder_has_sent_on_can_is_confirmed_by_its_word_alone(
    error: str, state: str, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An acknowledgement there may have no data, and silence has none."""
    bench.there = "wrist?bus=can&"
    step = {"data": "6504a7fe", "can_id": 0x15038001, "meaning": "stay there", "times": 7, "came": ""}
    row = {"step": 1, "bytes": "15038001 [4] 65 04 A7 FE", "meaning": "", "reads": False, "times": 7, "answer": None}
    held(monkeypatch, "wrist", ("wrist", 1), wire=[step], rows=[row], text="not acknowledged", error=error)
    result = run("wrist", "stop", "-p", f"can:slcan:{PORT}", "--json")
    assert [one["state"] for one in result.json["writes"]] == [state], result


def test_a_named_device_is_not_the_other_one_on_its_line(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Whether its id is in its entry or the usual one."""
    path = tmp_path / "config.toml"
    for text in ("id = 1\n", ""):
        path.write_text(f"[devices.left]\nkind = 'exo'\nport = '{PORT}'\n{text}[devices.right]\nkind = 'exo'\nport = '{PORT}'\nid = 2\n")  # fmt: skip
        bench.there = "exo?"
        heard = held(monkeypatch, "exo", ("exo", 2))
        result = run("stop", "-d", "left", "--json", env={"HANDCTL_CONFIG": str(path)})
        assert (result.code, stopped_ids(result), heard) == (0, [1], ["exo 1"]), result


def test_what_moves_is_stopped_besides_what_the_holder_reads(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.there = "wrist?"
    assert run(*WRIST, "-p", PORT).code == 0
    heard = held(monkeypatch, "hand", ("hand", 1))
    result = run("stop", "-p", PORT, "--json")
    assert result.code == 0 and heard == ["wrist 1"] and going() == []
    assert {row["bytes"].split()[4] for row in result.rows if not row["reads"]} == {"31"}


def test_a_stop_does_not_end_another_stop(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """It waits for it: ended in the middle, that one would tell nobody what it has stopped."""
    bench.there = "exo?"
    lock = cast(Lock, hold(PORT, "handctl stop", family="exo", use="stops"))
    looked: list[str] = []

    def again(run: Invocation, name: str, patience: float | None = None) -> Lock | None:
        looked.append(name)
        if len(looked) == 5:
            lock.release()
        return lock_for(run, name, patience)

    ended: list[object] = []
    monkeypatch.setattr(stop_listener, "ask", lambda *_: (True, None))
    monkeypatch.setattr(stop_command, "lock_for", again)
    monkeypatch.setattr(stop_command.clock, "sleep", lambda _seconds: None)
    monkeypatch.setattr(stop_command, "_end", lambda _run, who: ended.append(who))
    result = run("exo", "stop", "-p", PORT, "--json")
    assert (result.code, stopped_ids(result), ended, len(looked)) == (0, [1], [], 5), result


def test_a_holder_that_must_not_be_stopped_is_left_alone(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """A download of firmware: it has stopped no device, and what is sent would be taken for firmware."""
    bench.there = "exo?"
    held(monkeypatch, "barrett", refused=True, text="firmware")
    result = run("exo", "stop", "--id", "1", "-p", PORT, "--json")
    assert (result.code, result.error["code"], result.rows) == (6, "not-now", []), result


def test_a_download_that_does_not_hear_is_not_ended(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Suspended, or on a machine that is busy: without its process the hand has half a firmware. Who asks again means it."""
    state_files._keep_download(PORT, {"told": False})
    ended: list[Any] = []
    monkeypatch.setattr(stop_listener, "ask", lambda *_: (False, None))
    monkeypatch.setattr(stop_command.clock, "sleep", lambda _seconds: None)
    monkeypatch.setattr(stop_command, "HEARD_SECONDS", 0.0)
    monkeypatch.setattr(stop_command, "_end", lambda _run, who: (ended.append(who), lock.release()))
    lock = cast(Lock, hold(PORT, "handctl batch", family="barrett"))
    bench.there = "exo?"
    for words in (("exo", "stop"), ("stop",)):
        state_files._keep_download(PORT, {"told": False})
        result = run(*words, "-p", PORT, "--json")
        assert (result.code, result.error["code"], result.rows, ended) == (6, "not-now", [], []), result
    assert run("exo", "stop", "-p", PORT, "--json").code == 0 and len(ended) == 1


@each_row(
    "words",
    [
        ["-p", PORT, "barrett", "--id", "1", "firmware", "--yes", "download", "new.s19"],
        ["barrett", "firmware", "download", "new.s19", "-p", PORT],
    ],
)
def test_no_stop_reaches_a_download_of_another_user(
    words: list[str], bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No lock of ours tells of it, and each byte would be taken for firmware: that of any family, and each question."""
    monkeypatch.setattr(port_users, "handctl_commands", lambda *_: iter([(77, words)]))
    for stop in (("stop",), *((family, "stop") for family in FAMILIES if family != "aidin")):
        result = run(*stop, "-p", PORT, "--json")
        assert (result.code, result.error["code"], result.rows, bench.asked) == (6, "not-now", [], []), (stop, result)
        assert "pid 77" in result.error["text"], result
    monkeypatch.setattr(port_users, "handctl_commands", lambda *_: iter([(77, ["barrett", "firmware", "check"])]))
    bench.there = "barrett?"
    assert run("stop", "-p", PORT, "--json").code == 0


@each_row(
    "writes, said, sends",
    [
        (False, ["exo 1"], False),
        (False, ["wrist"], False),
        (False, ["exo 2"], True),
        (False, ["exo"], True),
        (False, ["exo 1", ""], True),
        (False, [], True),
        (True, ["exo 1"], True),
    ],
)
def test_who_only_reads_another_device_lets_go_at_once(writes: bool, said: list[str], sends: bool) -> None:
    """Who has set something going stops it first."""
    link = open_link("fake://exo?id=2&clock=virtual")
    settings, journal = Settings(id=2), Journal()
    holder = SimpleNamespace(
        family=SimpleNamespace(kind="exo"), opened=None, journal=journal, ledger=journal.ledger, writes=writes, may_write=writes,
        settings=settings, prompts=Prompts(), shows=False, stops=False, place="", session=None,
    )  # fmt: skip
    access = DeviceAccess(cast(Invocation, holder), None)
    access.around(link)
    told = access.stop("asked", said)
    assert access.stopped is not None and access.stopped.code == STOPPED and access.stopped.exit_code == 130
    assert bool(told["rows"]) == sends and told["open"] and not told["error"]
    assert ["exo", 2] in told["devices"] if sends else told["devices"] == []
    assert json.loads(json.dumps(told)) == told
    with pytest.raises(KeyboardInterrupt):
        cast(ByteLink, link).write(b"\x00", link.deadline(1.0))


def test_which_requests_are_for_a_device() -> None:
    for said, wanted in (
        ([], False),
        ([""], True),
        (["exo"], True),
        (["exo 2"], True),
        (["exo 1"], False),
        (["exo 1", "exo 2"], True),
    ):
        assert is_meant("exo", 2, said) is wanted, said


@pytest.mark.real
def test_a_command_that_reads_another_device_ends_without_a_stop(tmp_path: Path) -> None:
    """And the stop that was typed goes out over the link that it has let go of."""
    place = Stand("exo", tmp_path)
    try:
        holder = place.hold()
        place.heard()
        result = run("exo", "stop", "--id", "9", "-p", place.link, "--json", env=place.environment)
        assert (result.code, stopped_ids(result)) == (4, [9]) and "asked" in result.codes(), result
        assert holder.wait(PATIENCE) == 130
        came = b"".join(data for _, data in place.heard())
        assert RELEASE not in came and bytes.fromhex("EB90090B31") in came
    finally:
        place.close()


# -- commands of others ------------------------------------------------------------------------------------------------


def process(root: Path, pid: int, *words: str, opened: str = "") -> None:
    folder = root / "proc" / str(pid)
    (folder / "fd").mkdir(parents=True)
    (folder / "cmdline").write_bytes(b"".join(word.encode() + b"\0" for word in words))
    if opened:
        (folder / "fd" / "3").symlink_to(opened)


def test_the_handctl_commands_at_a_port_by_what_they_have_open_or_say(tmp_path: Path) -> None:
    python = "/usr/bin/python3"
    process(tmp_path, 1, python, "/opt/bin/handctl", "exo", "watch", "-p", "/dev/ttyUSB0")
    process(tmp_path, 2, python, "/opt/bin/handctl", "hand", "log", "x.csv", "-d", "left", opened="/dev/ttyUSB0")
    process(tmp_path, 3, python, "/lib/handctl/__main__.py", "--port=/dev/ttyUSB0", "wrist", "watch")
    process(tmp_path, 4, python, "/opt/bin/handctl", "exo", "watch", "-p", "/dev/ttyUSB1")
    process(tmp_path, 5, "screen", "/dev/ttyUSB0", opened="/dev/ttyUSB0")
    process(tmp_path, 6, "vi", "handctl.txt", "-p", "/dev/ttyUSB0")
    process(tmp_path, 7, "/opt/bin/handctl", "-p/dev/ttyUSB0", "exo", "get", "x")
    found = dict(handctl_commands("/dev/ttyUSB0".__eq__, tmp_path))
    assert sorted(found) == [1, 2, 3, 7] and found[2] == ["hand", "log", "x.csv", "-d", "left"]


def test_an_option_among_words() -> None:
    for words, wanted in (
        (["exo", "watch", "--id", "2"], "2"),
        (["exo", "--id=2", "watch", "--id=3"], "3"),
        (["exo", "watch", "--ids", "2"], ""),
        (["exo", "--id"], ""),
    ):
        assert option_in(words, "", "--id") == wanted, words


@each_row(
    "words, there, ids",
    [
        (["exo", "position", "--wait", "60"], "exo?", [1]),
        (["exo", "position", "--id", "4"], "exo?id=4&", [4]),
        (["-d", "exo", "hand", "watch"], "hand?", [1]),
    ],
)
def test_a_command_that_no_lock_of_ours_tells_of_is_known_by_its_words(
    words: list[str], there: str, ids: list[int], bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of another user, or with other folders: its device is stopped before anything is asked."""
    monkeypatch.setattr(port_users, "handctl_commands", lambda *_: iter([(77, words)]))
    bench.there = there
    result = run("stop", "-p", PORT, "--json")
    assert (result.code, stopped_ids(result), bench.asked) == (0, ids, []), result
    assert "others" in result.codes()


@each_row("open_there, code", [(True, 6), (False, 0)])
def test_a_batch_of_which_nothing_is_known_is_no_success(
    open_there: bool, code: int, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it has set in motion may have any id. One that only waits, and has the port not open, moves nothing."""
    monkeypatch.setattr(port_users, "handctl_commands", lambda *_: iter([(77, ["batch", "-p", PORT])]))
    monkeypatch.setattr(port_users, "has_open", lambda *_, **_more: open_there)
    bench.there = "exo?"
    assert run("exo", "status", "-p", PORT).code == 0
    result = run("stop", "-p", PORT, "--json")
    assert (result.code, stopped_ids(result)) == (code, [1]), result


def test_what_another_user_drives_is_stopped_besides_what_we_met(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    on_line(bench, monkeypatch, d1="exo?", d2="hand?id=2&")
    assert run("exo", "status", "-p", PORT).code == 0
    monkeypatch.setattr(port_users, "handctl_commands", lambda *_: iter([(77, ["hand", "angle", "--id", "2"])]))
    result = run("stop", "-p", PORT, "--json")
    assert (result.code, stopped_ids(result)) == (0, [1, 2]), result


def test_what_we_met_before_does_not_decide_on_what_another_user_drives(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.there = "hand?"
    assert run("hand", "status", "-p", PORT).code == 0
    bench.there = "exo?"
    monkeypatch.setattr(port_users, "handctl_commands", lambda *_: iter([(77, ["exo", "position"])]))
    result = run("stop", "-p", PORT, "--json")
    assert (result.code, result.json["device"]["kind"], bench.asked) == (0, "exo", []), result
    assert "other-device" in result.codes()


def test_a_port_in_use_by_another_user_gets_no_stop_of_other_families(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That one takes the replies, so that silence shows nothing."""
    monkeypatch.setattr(port_users, "handctl_commands", lambda *_: iter([(77, ["exo", "position"])]))
    bench.there = "exo?fault=silent&"
    result = run("stop", "-p", PORT, "--json")
    assert result.code == 4 and "03" not in [row["bytes"] for row in result.rows] and bench.asked == []


def test_who_uses_the_port_and_was_asked_already_acknowledges_nothing(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The holder is among the commands at the port: what nobody has acknowledged is no success."""
    bench.there = "exo?fault=silent&"
    for kind in ("exo", "wrist"):
        step = {"step": 1, "bytes": "00", "meaning": "", "reads": kind == "wrist", "times": 1, "answer": None}
        held(monkeypatch, kind, (kind, 1), rows=[step], text="sent, but no reply arrived", error="NoAnswer")
        monkeypatch.setattr(port_users, "handctl_commands", lambda *_, kind=kind: iter([(77, [kind, "watch"])]))
        assert run("stop", "-p", PORT, "--json").code == 4, kind


# -- names -------------------------------------------------------------------------------------------------------------


def test_two_names_of_one_port_are_stopped_one_after_the_other(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    on_line(bench, monkeypatch, d1="exo?", d2="exo?id=2&")
    path = tmp_path / "config.toml"
    path.write_text("".join(f"[devices.{name}]\nkind = 'exo'\nport = '{PORT}'\nid = {number}\n" for name, number in (("left", 1), ("right", 2))))  # fmt: skip
    grouped: list[int] = []
    lines = several_devices._lines

    def noted(every: Sequence[several_devices.EachDevice]) -> list[list[several_devices.EachDevice]]:
        found = lines(every)
        grouped.extend(map(len, found))
        return found

    monkeypatch.setattr(several_devices, "_lines", noted)
    result = run("stop", "-d", "left,right", "--json", env={"HANDCTL_CONFIG": str(path)})
    assert grouped == [2], "at once they would fight for the port, and only by luck get out of each other's way"
    assert result.code == 0 and [one["exit_code"] for one in result.json["results"]] == [0, 0], result
    messages = [message["code"] for one in result.json["results"] for message in one["messages"]]
    assert messages == ["stopped", "stopped"], "neither was in the way of the other"


@each_row("kind", ["", "family = 'exo'\n", "kind = 'exoo'\n", "kind = 3\n"])
def test_a_name_whose_family_is_wrong_is_stopped_at_its_port(kind: str, bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(f"[devices.left]\n{kind}port = '{PORT}'\nid = 6\nretries = 'x'\n")
    env = {"HANDCTL_CONFIG": str(path)}
    bench.there = "exo?id=6&"
    for words in (("stop",), ("exo", "stop")):
        result = run(*words, "-d", "left", "--json", env=env)
        assert (result.code, stopped_ids(result)) == (0, [6]) and "passed-over" in result.codes(), result
    assert run("exo", "status", "-d", "left", env=env).code == 2, "what may wait is refused"
    with pytest.raises(UsageError):
        read_config(str(path))


def test_the_id_of_a_name_without_a_family_is_the_only_one(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    on_line(bench, monkeypatch, d1="exo?", d2="exo?id=2&")
    for number in ("1", "2"):
        assert run(*EXO, "--id", number, "-p", PORT).code == 0
    path = tmp_path / "config.toml"
    path.write_text(f"[devices.left]\nport = '{PORT}'\nid = 1\n")
    result = run("stop", "-d", "left", "--json", env={"HANDCTL_CONFIG": str(path)})
    assert (result.code, stopped_ids(result), going()) == (0, [1], [("exo", 2)]), result


def test_a_name_without_a_port_is_none(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    for text in ("", "port = 3\n"):
        path.write_text(f"[devices.left]\n{text}")
        assert run("stop", "-d", "left", env={"HANDCTL_CONFIG": str(path)}).code == 2
        passed: list[UsageError] = []
        assert read_config(str(path), passed).devices == {} and len(passed) == 1
