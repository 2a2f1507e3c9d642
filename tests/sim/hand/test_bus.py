"""Several simulated RH56 hands on one pair or one CAN bus, as they are delivered: with one id. Virtual time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import handctl.sim.hand
from handctl.sim import create
from tests.support.bus_file import text

ANGLES = "EB 90 {0} 04 11 0A 06 0C {1}"
RTU_ANGLES = {1: "01 03 06 0A 00 06 E5 42", 2: "02 03 06 0A 00 06 E5 71"}


@pytest.fixture(autouse=True)
def _listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(handctl.sim.hand, "LISTED", True, raising=False)


class Pair:
    """A client on RS-485."""

    def __init__(self, path: Path, *devices: dict[str, Any], **line: Any) -> None:
        file = path / "bus.toml"
        file.write_text(text("half-duplex", devices, **line), encoding="utf-8")
        self.end = create("bus", {"file": str(file)})
        self.now = 0.0
        self.end.advance(0.0)

    def ask(self, request: str, seconds: float = 0.1) -> bytes:
        self.now += 0.005
        self.end.advance(self.now)
        self.end.feed(bytes.fromhex(request))
        heard = b""
        until = self.now + seconds
        while (event := self.end.next_event()) is not None and event <= until:
            self.now = max(event, self.now)
            self.end.advance(self.now)
            heard += self.end.take()
        self.now = until
        self.end.advance(self.now)
        answer: bytes = heard + self.end.take()
        return answer


def request(number: int) -> str:
    return ANGLES.format(f"{number:02X}", f"{(number + 0x31) % 256:02X}")


def test_two_ids_answer_one_by_one_over_both_protocols(tmp_path: Path) -> None:
    pair = Pair(tmp_path, {"kind": "hand", "model": "df", "id": 1}, {"kind": "hand", "model": "tp", "id": 2})
    for number in (1, 2, 1):
        answer = pair.ask(request(number))
        assert answer[:3] == bytes([0x90, 0xEB, number])
        assert sum(answer[2:-1]) % 256 == answer[-1]
        answer = pair.ask(RTU_ANGLES[number])
        assert answer[:3] == bytes([number, 3, 12])
        assert len(answer) == 17


def test_one_id_twice_answers_alike_or_collides(tmp_path: Path) -> None:
    """Answers that are alike overlap to a good frame; of readings that differ nothing good is left (dossier §6)."""
    pair = Pair(tmp_path, {"kind": "hand", "model": "df"}, {"kind": "hand", "model": "df"})
    assert pair.ask("EB 90 01 04 11 E8 03 01 02").hex() == "90eb010411e8030102"
    for question in (request(1), RTU_ANGLES[1]):
        alone = Pair(tmp_path, {"kind": "hand", "model": "df"}).ask(question)
        assert pair.ask(question) != alone


def test_both_obey_one_id(tmp_path: Path) -> None:
    pair = Pair(tmp_path, {"kind": "hand", "model": "df"}, {"kind": "hand", "model": "df"})
    pair.ask("EB 90 01 05 12 D4 05 2C 01 1E", 3.0)
    for number in (1, 2):
        assert pair.end.command(f"device {number} get 1552 2") == "2C 01"
        assert "move=1" in pair.end.command(f"device {number} acts")


def test_a_wrist_and_a_hand_of_another_generation(tmp_path: Path) -> None:
    """The harm of the dossier Q4: what saves a DF resets an F1 that has the same id."""
    pair = Pair(tmp_path, {"kind": "hand", "model": "f1"}, {"kind": "exo", "id": 2})
    pair.ask("EB 90 01 04 12 ED 03 01 08")
    assert "factory-reset=1" in pair.end.command("device 1 acts")


def test_two_hands_on_one_can_bus(tmp_path: Path) -> None:
    file = tmp_path / "can.toml"
    rows = "".join(f'[[device]]\nkind = "hand"\nmodel = "tp"\nid = {number}\n' for number in (1, 2))
    file.write_text(f'[line]\nwire = "can"\n{rows}', encoding="utf-8")
    end = create("bus", {"file": str(file)})
    end.advance(0.0)
    for number in (1, 2):
        end.feed_frame(0x01930000 + number, b"\x06")
        end.advance(float(number))
        assert end.take_frames() == [(0x01930000 + number, bytes((2, 1, 2, 3, 2, 0)))]
