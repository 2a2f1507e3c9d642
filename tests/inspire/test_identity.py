"""Before any write: who is there? Every writing command of exo and wrist against devices that are something else.

The commands are those of the command tree: one that is new and not in the tables here fails. The strangers are written
from tests.support.each_row import each_row
from the dossiers (`foreign_devices`); what reached them is judged by their own memory and by the bytes on the line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import click
import pytest

from handctl.command import open_links
from handctl.devices.inspire import identity
from handctl.devices.inspire.exo.cli import cli as exo_cli
from handctl.devices.inspire.wrist.cli import cli as wrist_cli
from handctl.link import CanFrame, open_link
from handctl.tools import scan
from tests.inspire import exo_commands, wrist_commands
from tests.support.cli import Result, fake, run, sent, spying, writes
from tests.support.each_row import each_row
from tests.support.foreign_devices import DF, SPACES, STRANGERS, CanLine, Line, Memory, reply, requests
from tests.support.scripted import RecordedLink

EXO = {command.name: command for command in exo_commands.WRITING}
WRIST = {command.name: command for command in wrist_commands.WRITING}
GROUPS: dict[str, click.Group] = {"exo": exo_cli, "wrist": wrist_cli}
ELSEWHERE = {"stop"}
"""Must never wait for anything long: it has its own quick look, and tests of its own."""
RAW_MORE = {
    "raw-junk": ("exo", "raw", "01 02 03"),
    "raw-force": ("exo", "raw", "EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B"),
    "raw-bad-sum": ("exo", "raw", "EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 00"),
}
WORDS: dict[str, tuple[str, ...]] = {
    **{f"exo {name}": ("exo", *command.args) for name, command in EXO.items()},
    **{f"wrist {name}": ("wrist", *command.args) for name, command in WRIST.items()},
    **{f"exo {name}": words for name, words in RAW_MORE.items()},
    "exo terminal": ("exo", "terminal", exo_commands.SET),
    "wrist terminal": ("wrist", "terminal", "EB 90 01 05 31 0E 04 05 00 4E"),
}


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("identity")
    for family, module in (("exo", exo_commands), ("wrist", wrist_commands)):
        (path / family).mkdir()
        module.prepare(path / family)
    return path


@contextmanager
def on(link: Any) -> Iterator[Any]:
    """Every link that is opened meanwhile is this one."""
    with ExitStack() as opening:
        for module in (open_links, scan):
            opening.enter_context(mock.patch.object(module, "open_link", lambda *_args, **_more: link))
        yield link


def try_(scratch: Path, words: tuple[str, ...], link: Any, *more: str) -> Result:
    folder = scratch / words[0]
    (folder / "backup.json").unlink(missing_ok=True)
    args = [word.replace("{dir}", str(folder)) for word in words]
    can = isinstance(link, CanLine)
    with on(link):
        return run(*args, "-p", f"fake://{words[0]}{'?bus=can' if can else ''}", "-y", "--json", *more)


def harmless_to_others(sent_bytes: Any) -> bool:
    """By the dossier alone: nothing but read requests (flags 11 and 30, CAN flags 0 and 4 with one byte)."""
    if isinstance(sent_bytes, CanFrame):
        return sent_bytes.can_id >> 26 in (0, 4) and len(sent_bytes.data) == 1
    found = list(requests(sent_bytes))
    return sum(len(body) + 6 for _, _, body in found) == len(sent_bytes.lstrip(b"\0")) and all(
        flag in (0x11, 0x30) and len(body) == 3 for _, flag, body in found
    )


# -- the strangers themselves -----------------------------------------------------------------------------------------


@each_row(
    ("device", "request_", "answer"),
    [
        # vectors of dossier rh56 §4
        ("rh56", "EB 90 01 04 11 C0 05 02 DD", "90 EB 01 05 11 C0 05 2E 02 0C"),  # V11
        ("rh56", "EB 90 01 04 11 4C 06 06 6E", "90 EB 01 09 11 4C 06 02 01 02 03 02 00 77"),  # V15
        ("rh56", "EB 90 01 04 11 52 06 06 74", "90 EB 01 09 11 52 06 1F 20 21 22 23 24 3C"),  # V16
        ("rh56", "EB 90 01 04 11 3A 06 0C 62", "90 EB 01 0F 11 3A 06 15 00 EA FF 17 00 18 00 19 00 1A 00 C1"),  # V18
        ("rh56", "EB 90 01 05 12 D4 05 2C 01 1E", "90 EB 01 04 12 D4 05 01 F1"),  # V19, moves
        ("rh56-tactile", "EB 90 01 04 11 A4 06 04 C4", "90 EB 01 07 11 A4 06 C0 A8 0B D2 08"),  # V22
        ("rh56f1", "EB 90 01 04 11 28 04 0C 4E", "90 EB 01 0F 11 28 04 E8 03 E8 03 E8 03 E8 03 78 05 E8 03 61"),  # V25
        ("rh5dg2", "EB 90 01 04 11 70 04 02 8C", "90 EB 01 05 11 70 04 B0 04 3F"),  # V28
        # inspire §5
        ("wrist-only", "EB 90 01 04 30 00 04 04 3D", "90 EB 01 07 30 00 04 6F 00 DE 00 89"),
    ],
)  # fmt: skip
def test_strangers_answer_the_vectors_of_the_dossiers(device: str, request_: str, answer: str) -> None:
    line = Line(device, latency=0.0)
    line.write(bytes.fromhex(request_), line.deadline(1))
    assert line.read(line.deadline(1)).hex(" ").upper() == answer
    assert (line.written == []) == (request_[12:14] in ("11", "30"))


def test_every_writing_command_of_the_tree_is_tried() -> None:
    for family, group in GROUPS.items():
        tried = {words[1] for words in WORDS.values() if words[0] == family}
        writing = {name for name, command in group.commands.items() if getattr(command, "writes", False)}
        assert writing - ELSEWHERE == tried, family


# -- the strangers, every command -------------------------------------------------------------------------------------


COMMANDS_OF = {family: [name for name in WORDS if name.startswith(family)] for family in GROUPS}
HANDS = [name for name in SPACES if name.startswith("rh")]
WRISTS = [name for name in STRANGERS if name.startswith("wrist")]


@pytest.mark.parametrize("family", GROUPS)
def test_no_writing_frame_reaches_a_stranger(scratch: Path, family: str) -> None:
    for device, stranger in STRANGERS.items():
        for name in COMMANDS_OF[family] if family != "wrist" or device not in WRISTS else ():
            link = stranger()
            result = try_(scratch, WORDS[name], link)
            assert getattr(link, "written", []) == [], (device, name, result)
            assert all(harmless_to_others(data) for data in link.sent), (device, name, link.sent)
            assert result.code in ({6} if device in (*WRISTS, *HANDS) else {4, 5, 6}), (device, name, result)


@each_row(
    ("device", "family", "code", "words", "command"),
    [
        *((name, "exo", 6, "a wrist module", "handctl wrist") for name in WRISTS),
        *((name, family, 6, "RH", "`handctl hand`, the command for it") for name in HANDS for family in GROUPS),
        ("rh56 with echo", "exo", 6, "an RH56 hand", "`handctl hand`, the command for it"),
        *(("json", family, 6, "JSON", "handctl aidin") for family in GROUPS),
        *(("prompt", family, 6, "BarrettHand", "handctl barrett") for family in GROUPS),
        *(("dataport", family, 6, "DataPort", "handctl ekso") for family in GROUPS),
        *(("silence", family, 4, "no reply", "") for family in GROUPS),
        *(("echo", family, 5, "only our own bytes", "") for family in GROUPS),
        *(("garbage", family, 5, "instead of a valid frame", "") for family in GROUPS),
    ],
)  # fmt: skip
def test_a_stranger_is_named_with_the_command_that_fits(
    scratch: Path, device: str, family: str, code: int, words: str, command: str
) -> None:
    link = STRANGERS[device]()
    result = try_(scratch, WORDS["exo force" if family == "exo" else "wrist set"], link)
    assert result.code == code, result
    assert words in result.error["text"] and "Nothing was written" in result.error["text"], result
    assert command in result.error["hint"], result


ON_CAN = {**{name: command.on_can for name, command in WRIST.items()}, "terminal": ("terminal", "15038001#E80318FC")}


@each_row("name", COMMANDS_OF["wrist"])
@each_row("device", ["rh56", "rh56-opening", "rh56-silent-gaps"])
def test_on_can_no_writing_frame_reaches_a_hand_without_a_wrist(scratch: Path, name: str, device: str) -> None:
    link = CanLine(device)
    own = ON_CAN.get(name.removeprefix("wrist "))
    result = try_(scratch, ("wrist", *own) if own else WORDS[name], link)
    assert result.code == 6, result
    assert link.written == [] and all(harmless_to_others(frame) for frame in link.sent), link.sent


@pytest.mark.parametrize(("kind", "baud"), [("barrett", "9600"), ("barrett", "115200"), ("ekso", "115200")])
@pytest.mark.parametrize("family", GROUPS)
def test_no_writing_frame_reaches_the_simulators_of_other_families(
    scratch: Path, family: str, kind: str, baud: str
) -> None:
    for name in COMMANDS_OF[family]:
        link = RecordedLink(open_link(f"fake://{kind}?clock=virtual", baud=int(baud)))  # type: ignore[arg-type]
        result = try_(scratch, WORDS[name], link, "--timeout", "0.1")
        assert result.code in (4, 5, 6), (name, result)
        assert all(harmless_to_others(data) for data in link.sent), (name, link.sent)


def test_the_right_device_is_written_to(scratch: Path) -> None:
    """The same commands on an exo and on a wrist with its hand: their writing frames go out, each once."""
    for name, command in {**EXO, **{f"w {key}": one for key, one in WRIST.items()}}.items():
        wrist = name.startswith("w ")
        words = WORDS[f"{'wrist' if wrist else 'exo'} {command.name}"]
        with spying():
            trace = scratch / "trace.txt"
            args = [word.replace("{dir}", str(scratch / words[0])) for word in words]
            (scratch / words[0] / "backup.json").unlink(missing_ok=True)
            result = run(*args, "-p", f"fake://{words[0]}?clock=virtual", "-y", "--json", "--trace", trace)
        assert result.code == 0, result
        frames = command.serial if wrist else command.frames
        assert [data.hex(" ").upper() for data in writes(trace)] == list(frames), name


# -- what it costs, when it is done -----------------------------------------------------------------------------------


OWN, SIBLING, WRISTS_OWN = "EB 90 01 04 11 46 06 12 74", "EB 90 01 04 30 00 04 02 3B", "EB 90 01 04 30 00 04 02 3B"


def test_two_questions_once_a_command_and_one_where_it_only_reads(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert (
        run("exo", "set", "position_set=1,2,3,4,5", "force_set.index=5", "-y", "-p", fake(), "--trace", trace).code == 0
    )
    shown = [data.hex(" ").upper() for data in sent(trace)]
    assert shown[:2] == [OWN, SIBLING]
    assert shown.count(OWN) == shown.count(SIBLING) == 1
    wrist = "fake://wrist?clock=virtual"
    assert run("wrist", "set", "yaw_set=1", "-p", wrist, "--trace", trace).code == 0
    assert next(data.hex(" ").upper() for data in sent(trace)) == WRISTS_OWN
    assert len(sent(trace)) == 5, "a look, what is there, where the other axis stands, the write, the read-back"
    assert run("exo", "get", "id", "-p", fake(), "--trace", trace).code == 0
    assert [data.hex(" ").upper() for data in sent(trace)][1:] == [OWN]
    assert run("exo", "raw", OWN, "-p", fake(), "--trace", trace).code == 0
    assert len(sent(trace)) == 1, "a raw read is a read"


@each_row(("latency", "most"), [(0.0, 0.012), (0.004, 0.02), (0.06, 0.3)])
def test_a_siblings_silence_is_waited_for_by_the_latency_of_this_link(latency: float, most: float) -> None:
    """Three round trips, 10 ms at least, and never longer than a reply may take."""
    link = Line("rh56", latency=latency)
    look = identity.IdentityCheck(_bus(link))
    link.spaces = [Memory(*(row for row in DF if row[0] not in (1612, 1618)), (1618, "<5B", (31, 32, 33, 34, 35)))]
    assert look.who(identity.EXO) is identity.EXO
    assert link.clock - link.sent_at[1] <= most


def _bus(link: Line) -> Any:
    from tests.support.scripted import hand_on

    return hand_on(link).bus


def test_a_slow_wrist_answers_in_the_window_of_a_slow_line(scratch: Path) -> None:
    """Its hand shows nothing of its own: flag 30 alone tells, and comes as late as everything on this line."""
    link = Line("wrist-with-opening-hand", latency=0.15)
    link.spaces[0] = Memory((1606, "<5B", (0,) * 5), (1618, "<5B", (31, 32, 33, 34, 35)))
    result = try_(scratch, WORDS["exo force"], link)
    assert result.code == 6 and "a wrist module" in result.error["text"], result
    assert link.written == []


def test_a_damaged_answer_to_the_siblings_question_is_no_silence(scratch: Path) -> None:
    """Somebody answers what an exo does not: asked again, and refused when that stays unclear."""
    right = Line("rh56")
    right.spaces = [Memory((1606, "<5B", (0,) * 5), (1618, "<5B", (31, 32, 33, 34, 35)))]
    answer = right.answer

    def damaged(data: bytes) -> Any:
        if data[4] == 0x30:
            frame = reply(1, 0x30, data[5:7] + b"\xa7\xfe")
            return [(0.002, frame[:-1] + bytes([frame[-1] ^ 1]))]
        return answer(data)

    right.answer = damaged
    result = try_(scratch, WORDS["exo force"], right)
    assert (result.code, result.error["code"]) == (5, "bad-checksum"), result
    assert right.written == []


def test_a_raw_frame_is_looked_at_by_the_id_that_it_names(scratch: Path) -> None:
    """--id 1 is an exo; what is sent to id 2 is for somebody else."""
    link = Line("rh56")
    link.spaces = [Memory((1606, "<5B", (0,) * 5), (1618, "<5B", (31, 32, 33, 34, 35)))]
    result = try_(scratch, ("exo", "raw", "EB 90 02 05 12 D4 05 2C 01 1F"), link)
    assert result.code == 4 and "id 2" in result.error["text"], result
    assert link.written == [] and all(harmless_to_others(data) for data in link.sent)


def test_nothing_is_sent_before_the_confirmation(scratch: Path) -> None:
    for name, words in WORDS.items():
        link = Line("rh56")
        asks = (EXO if words[0] == "exo" else WRIST).get(name.partition(" ")[2])
        if asks is None or not asks.asks:
            continue
        with on(link):
            args = [word.replace("{dir}", str(scratch / words[0])) for word in words]
            result = run(*args, "-p", f"fake://{words[0]}", "--json")
        assert result.code == 8, (name, result)
        assert link.sent == [], name


def test_a_dry_run_says_that_a_look_comes_first() -> None:
    result = run("exo", "force", "1", "2", "3", "4", "5", "-n", "--json")
    assert [row["bytes"] for row in result.rows] == ["EB 90 01 0B 31 01 00 02 00 03 00 04 00 05 00 4C"]
    assert "dry-run" in result.codes()


# -- the way around it ------------------------------------------------------------------------------------------------


def test_assume_identity_writes_without_a_look_and_says_so(scratch: Path) -> None:
    link = Line("rh56")
    result = try_(scratch, WORDS["exo set"], link, "--assume-identity")
    assert link.written == ["1492: 2C 01"], result
    assert len(link.sent) == 3, "what is there, the write and its read-back"
    assert result.json["device"]["identity"] == "assumed"
    assert "identity-assumed" in result.codes()
    assert result.code == 0


def test_assume_identity_must_be_typed(scratch: Path, tmp_path: Path) -> None:
    link, folder = Line("rh56"), scratch / "exo"
    with on(link):
        result = run("exo", *EXO["set"].words(folder), "-p", "fake://exo", "-y", "--json",
                     env={"HANDCTL_ASSUME_IDENTITY": "1"})  # fmt: skip
    assert result.code == 6 and link.written == []
    for text in (
        "assume_identity = true\n",
        '[device.left]\nkind = "exo"\nport = "fake://exo"\nassume_identity = true\n',
    ):
        path = tmp_path / "config.toml"
        path.write_text(text)
        with on(link):
            result = run("exo", *EXO["set"].words(folder), "-p", "fake://exo", "-y", env={"HANDCTL_CONFIG": str(path)})
        assert result.code == 2 and link.written == [], result
    reading = run("exo", "describe", "id", "--assume-identity")
    assert reading.code == 2 and "does not check" in reading.err


# -- played back ------------------------------------------------------------------------------------------------------


def test_a_replay_takes_the_look_from_the_transcript_or_leaves_it_out(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    args = ("exo", "force", "1", "2", "3", "4", "5", "-y", "--json")
    assert run(*args, "-p", fake(), "--trace", trace).code == 0
    again = run(*args, "-p", f"replay:{trace}")
    assert again.code == 0 and "not-recorded" not in again.codes()
    old = tmp_path / "old.txt"
    lines = trace.read_text().splitlines()
    first = next(number for number, line in enumerate(lines) if "> EB 90 01 0B 31" in line)
    old.write_text("\n".join([*(line for line in lines[:first] if line.startswith("#")), *lines[first:]]) + "\n")
    without = run(*args, "-p", f"replay:{old}")
    assert without.code == 0 and "not-recorded" in without.codes(), without


def test_a_recorded_stranger_is_refused_in_a_replay_too(scratch: Path, tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert try_(scratch, WORDS["exo force"], Line("rh56"), "--trace", str(trace)).code == 6
    again = run(*WORDS["exo force"], "-y", "--json", "-p", f"replay:{trace}")
    assert again.code == 6 and again.error["code"] == "other-device" and "RH56" in again.error["text"]


def test_interrupted_while_it_looks_nothing_is_written_and_nothing_is_stopped(scratch: Path) -> None:
    link = Line("rh56", latency=0.2)
    link.interrupt_at = 0.1
    result = try_(scratch, WORDS["exo force"], link)
    assert result.code == 130 and "Nothing was written" in result.error["text"], result
    assert all(harmless_to_others(data) for data in link.sent)


# -- commands that read -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("verb", ["status", "dump"])
@pytest.mark.parametrize("device", ["rh56", "rh56-fresh", "wrist-with-hand"])
def test_status_and_dump_call_a_hand_that(device: str, verb: str) -> None:
    """By the bytes they read anyway; the questions behind them find its name. The table is for who insists."""
    link = Line(device)
    with on(link):
        result = run("exo", verb, "-p", "fake://exo", "--json")
    (message,) = [message for message in result.json["messages"] if message["code"] == "other-device"]
    assert (result.code, result.rows, message["level"]) == (6, [], "error")
    assert f"`handctl {'wrist' if device in WRISTS else 'hand'}`" in message["hint"]
    assert len(link.sent) <= 5
    with on(link):
        assumed = run("exo", verb, "-p", "fake://exo", "--assume-identity", "--json")
    assert assumed.code == 0 and assumed.rows and {"identity-assumed", "other-device"} <= set(assumed.codes())
    healthy = run("exo", verb, "-p", fake(), "--json")
    assert "other-device" not in healthy.codes()


class Lossy(Line):
    """The first question is lost on the way."""

    lost = False

    def _answer(self, data: bytes) -> list[Any]:
        if not self.lost:
            self.lost = True
            return []
        return super()._answer(data)


def test_a_wrist_whose_first_answer_is_lost_is_no_hand() -> None:
    """Its hand answers, and so does the wrist when it is asked again: silence, not another device."""
    with on(Lossy("wrist-with-hand")):
        result = run("wrist", "get", "pitch_actual", "-p", "fake://wrist", "--retries", "0", "--json")
    assert (result.code, result.error["code"]) == (4, "no-answer"), result


def test_a_dead_thumb_rotation_is_not_healthy() -> None:
    for books, said, more in ((DF, "RH56", ("--assume-identity",)), ((), "1611", ())):
        link = Line("rh56")
        link.spaces = [Memory(*books, (1611, "<B", (1,)), (1472, "<h", (558,)), (1000, "<B", (1,)))]
        with on(link):
            result = run("exo", "status", "--check", "-p", "fake://exo", "--json", *more)
        assert result.code == 7 and said in result.error["text"], result
        assert "locked_rotor (0x01)" in result.error["text"], result


@pytest.mark.parametrize(
    ("device", "family", "words"),
    [
        ("rh56", "hand", "an RH56 hand"), ("rh56-fresh", "hand", "an RH56 hand"), ("rh56f1", "hand", "RH56F1"),
        ("rh5dg2", "hand", "RH5DG2"), ("wrist-with-hand", "wrist", "flag (30, on CAN 4) gets a reply"),
        ("wrist-only", "wrist", "pitch_raw reads -345"),
    ],
)  # fmt: skip
def test_scan_calls_a_hand_that(device: str, family: str, words: str) -> None:
    link = Line(device, latency=0.001)
    with on(link):
        found = run("scan", "-p", "fake://exo", "--family", "wrist", "--family", "exo", "--json")
    assert [row["family"] for row in found.rows] == [family], found
    assert words in found.rows[0]["evidence"], found
    assert link.written == [] and found.code == (0 if family == "wrist" else 6)
    with on(Line(device, latency=0.001)):
        own = run("exo", "scan", "--ids", "1", "--json", "-p", "fake://exo")
    if device != "wrist-only":
        assert [row["family"] for row in own.rows] == [family] and own.code == 6, own


def test_scan_of_an_exo_and_of_something_unknown() -> None:
    link = Line("rh56", latency=0.001)
    link.spaces = [Memory((1606, "<5B", (0,) * 5), (1618, "<5B", (31, 32, 33, 34, 35)), (1472, "<h", (558,)))]
    with on(link):
        exo = run("exo", "scan", "--ids", "1", "--json", "-p", "fake://exo")
    assert ([row["family"] for row in exo.rows], exo.code) == (["exo"], 0)
    link.spaces = [Memory()]
    with on(link):
        unknown = run("scan", "-p", "fake://exo", "--family", "exo", "--json")
    assert [row["family"] for row in unknown.rows] == [None] and "not like a known Inspire device" in unknown.rows[0][
        "evidence"
    ]


@pytest.mark.parametrize(("device", "status"), [("rh56", "fail"), ("wrist-with-hand", "fail"), ("exo", "ok")])
def test_doctor_says_who_it_is(device: str, status: str) -> None:
    link = Line("rh56") if device == "exo" else Line(device)
    if device == "exo":
        link.spaces = [Memory((1606, "<5B", (0,) * 5), (1618, "<5B", (31, 32, 33, 34, 35)), (1472, "<h", (558,)))]
    with on(link):
        result = run("doctor", "--family", "exo", "-p", "fake://exo", "--json")
    (row,) = [row for row in result.rows if row["check"] == "identity"]
    assert row["status"] == status and bool(row["remedy"]) == (status != "ok"), row
    assert link.written == []


# -- the other families: what they read at connect is their look -------------------------------------------------------


OTHERS: dict[str, dict[str, tuple[str, ...]]] = {
    "barrett": {
        "init": (), "open": (), "close": (), "move": ("1000",), "step-open": (), "step-close": (), "home": (),
        "torque-open": (), "torque-close": (), "load": (), "save": (), "defaults": (), "reset": (), "baud": ("38400",),
        "set": ("MOV=50",), "gcl": ("C",), "fingertips": (), "realtime": ("--count", "3"),
    },
    "ekso": {"cancel": (), "set": ("step_length=16", "--operator", "test")},
    "aidin": {
        "home": (), "initial": ("--assume-homed",), "bias": (), "max-torque": ("800",),
        "currents": ("index.m1=100",), "joints": ("index.q3=160",), "encoders": ("index.m1=100",),
    },
}  # fmt: skip
QUESTIONS = {
    "barrett": lambda data: (
        set(data) <= set(b"\x00\x03\x7f!\r")
    ),  # what it looks for a prompt with, and carries nothing out
    "ekso": lambda data: data[0] in range(150, 155) and len(data) == 6,  # GetTime to GetFeedback
    "aidin": lambda data: data.strip() == b"{}",
}
"""What a family may ask before it knows who is there (its dossier): everything else would be a write to a stranger."""
FOREIGN = {"barrett": ["exo", "json", "echo", "silence", "garbage"], "ekso": ["exo", "prompt", "json", "silence"],
           "aidin": ["exo", "prompt", "echo", "silence", "garbage"]}  # fmt: skip


@each_row(("family", "device"), [(family, one) for family, found in FOREIGN.items() for one in found])
def test_the_other_families_write_to_nobody_they_do_not_know(tmp_path: Path, family: str, device: str) -> None:
    for verb, words in OTHERS[family].items():
        link = STRANGERS["rh56" if device == "exo" else device]()
        with on(link):
            result = run(family, verb, *words, "-p", f"fake://{family}", "-y", "--json",
                         env={"XDG_STATE_HOME": str(tmp_path)})  # fmt: skip
        assert result.code in (4, 5, 6), (verb, result)
        assert all(QUESTIONS[family](data) for data in link.sent), (verb, link.sent, result)
        wanted = {"json": "handctl aidin", "prompt": "handctl barrett"}.get(device)
        if wanted:  # to a BarrettHand's connect a ':' is its boot monitor, which ends there and then
            assert result.code == 6 and (wanted in result.out or family == "barrett"), result


def test_a_hand_that_answers_commands_only_is_the_users_word(tmp_path: Path) -> None:
    """Nothing can be asked; but what it says unasked must not be somebody else's."""
    link = STRANGERS["silence"]()
    with on(link):
        result = run("aidin", "max-torque", "800", "-y", "-p", "fake://aidin", "--exchange", "command", "--json")
    assert link.sent and "not-asked" in result.codes()
    link = STRANGERS["silence"]()
    link.put(0.0, b"\r\nBarrettHand ready\r\n=> ")
    with on(link):
        result = run("aidin", "max-torque", "800", "-y", "-p", "fake://aidin", "--exchange", "command", "--json")
    assert (result.code, link.sent) == (6, []), result


def test_nothing_but_the_buses_and_the_scanners_touches_the_link() -> None:
    """The gate stands in the buses: a frame that went around them would not meet it. Scanners send reads only."""
    folder = Path(identity.__file__).parent
    users = {
        str(path.relative_to(folder).with_suffix(""))
        for path in folder.rglob("*.py")
        if re.search(r"link\.(write|send)\(", path.read_text())
    }
    assert users == {"serial_bus", "can_bus", "modbus_bus", "id_search", "hand/raw"}


@pytest.mark.parametrize("family", ["exo", "wrist", "ekso", "barrett"])
@pytest.mark.parametrize("device", ["silence", "garbage", "json"])
def test_what_a_family_cannot_name_is_left_to_scan(family: str, device: str) -> None:
    """Only what was not understood: JSON is named by itself. A simulation is no port to look at."""
    port = "/dev/ttyUSB0"
    with on(STRANGERS[device]()):
        result = run(family, "status", "-p", port, "--timeout", "0.05", "--json")
    error = result.error
    assert result.code == (6 if device == "json" else 4 if device == "silence" else 5), result
    if device == "json":
        assert error["hint"] == "Use `handctl aidin`.", error
        return
    assert error["hint"].endswith(f" `handctl scan -p {port}` shows which device is there."), error
    assert "handctl scan -p" not in str(run(family, "status", "-p", f"fake://{family}?fault=silent&clock=virtual").err)
