"""The third book: tests/transcripts/ekso-dataport.txt. The host sends every `>` and judges every `<` as it says."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.device import Ekso
from handctl.devices.ekso.frames import Command, cancel_body, set_value_body
from handctl.devices.ekso.parameter_map import EKSO, MESSAGES
from handctl.errors import HandctlError
from handctl.link.transcript import parse
from handctl.model.result import Journal
from tests.ekso.support import in_pieces
from tests.support.each_row import each_row
from tests.support.places import TRANSCRIPTS
from tests.support.scripted import Reply, ScriptedLink

FILE = TRANSCRIPTS / "ekso-dataport.txt"


@dataclass
class Case:
    name: str
    kind: str
    says: dict[str, str] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)


def read_cases() -> list[Case]:
    cases: list[Case] = []
    for line in FILE.read_text(encoding="utf-8").splitlines():
        if line.startswith("# case "):
            name, _, kind = line.removeprefix("# case ").partition(": ")
            cases.append(Case(name, kind))
        elif cases and line.startswith("# "):
            word, _, rest = line[2:].partition(" ")
            if word in ("host", "msgid", "gives", "fails", "foreign", "sim"):
                cases[-1].says[word] = rest
        elif cases and line:
            cases[-1].lines.append(line)
    return cases


CASES = read_cases()


def test_the_file_is_whole() -> None:
    assert len(CASES) == 36
    assert {case.kind for case in CASES} == {"accept", "resync", "reject", "sent"}
    assert all({"host", "msgid"} <= case.says.keys() for case in CASES)


def ask(port: DataPort, host: str) -> str:
    """What the host words of a case give."""
    word, _, rest = host.partition(" ")
    if word in MESSAGES:
        return " ".join(map(str, Ekso(port).words(word)))
    if word in ("time", "date"):
        return str(Ekso(port).shown(word).rows[0]["value"])
    if word == "cancel":
        return str(port.exchange(Command.CANCEL_ACTION, cancel_body(int(rest, 0))).words[0] & 0xFFFF)
    ((element, value),) = EKSO.assignments([rest])
    param = EKSO[element.param.name]
    assert param.id is not None
    return str(port.exchange(Command.SET_VALUE, set_value_body(param.id, param.to_raw(value))).words[0] & 0xFFFF)


@each_row("how", ["whole", "bytes", "threes", "noise"])
@each_row("case", CASES, ids=lambda case: case.name)
def test_the_host_and_the_transcripts(case: Case, how: str) -> None:
    entries = parse(case.lines, case.name)
    replies = b"".join(entry.data for entry in entries if entry.mark == "<")
    pieces = [b"\x00\xff\x12", replies, b"\x7e\x00"] if how == "noise" else in_pieces(replies, how)

    def answer(request: bytes) -> list[Reply]:
        return [(0.001 * (number + 1), piece) for number, piece in enumerate(pieces)]

    link = ScriptedLink(answer if replies else None)
    port = DataPort(link, Journal(), first_id=int(case.says["msgid"]), retries=0)
    if case.kind in ("accept", "resync"):
        assert ask(port, case.says["host"]) == case.says["gives"]
        assert port.journal.counters.foreign_frames == (int(case.says["foreign"]) if "foreign" in case.says else None)
    else:
        with pytest.raises(HandctlError) as caught:
            ask(port, case.says["host"])
        assert caught.value.code == case.says.get("fails", "no-answer")
        assert caught.value.exit_code == (5 if "fails" in case.says else 4)
    assert link.sent == [entry.data for entry in entries if entry.mark == ">"]
