"""A command that waits for a movement and ends by an error stops the device, as Ctrl-C would: nobody watches it any more."""

from __future__ import annotations

from unittest import mock

from handctl.command import open_links
from handctl.link import Deadline, open_link
from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.scripted import RecordedLink, hexed
from tests.support.stop import RELEASE

EXO, WRIST, HAND, BARRETT = hexed(RELEASE), "EB 90 01 07 31 0E 04", "EB 90 01 0F 12 F2 05" + " 00" * 12, "03"
TCP = "00 13 FF 10 05 F2 00 06 0C" + " 00" * 12
POSITION = ("position", "900", "900", "900", "900", "900", "--wait", "9")
MOVE = ("move", "--yaw", "20", "--time", "6000")
ANGLE = ("angle", "index=0", "--wait", "9")


class Hole(RecordedLink):
    """A simulated device behind a radio that carries nothing for `seconds`, from 0.3 s after the first frame with these bytes on."""

    def __init__(self, family: str, query: str, begins: bytes, seconds: float) -> None:
        super().__init__(
            open_link(f"fake://{family}?clock=virtual{query}", baud=9600 if family == "barrett" else 115200)
        )  # type: ignore[arg-type]
        self.begins, self.seconds = begins, seconds
        self.since = float("inf")

    def _closed(self) -> bool:
        return 0.3 < self.now() - self.since < 0.3 + self.seconds

    def write(self, data: bytes, deadline: Deadline) -> None:
        if self.begins in data:
            self.since = min(self.since, self.now())
        if self._closed():
            self.sent.append(bytes(data))
            self.sent_at.append(self.now())
            return
        super().write(data, deadline)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        data = super().read(deadline, size)
        while data and self._closed():  # what it says meanwhile is lost
            data = super().read(deadline, size)
        return data


def moved(family: str, query: str, words: tuple[str, ...], begins: str, seconds: float) -> tuple[Result, list[str]]:
    """The end of the command, and what was sent once the movement had begun."""
    link = Hole(family, query, bytes.fromhex(begins), seconds)
    port = "tcp://127.0.0.1:6000" if "tcp" in query else f"fake://{family}"
    with mock.patch.object(open_links.Connection, "_open", lambda *_: link):
        result = run(family, *words, "-y", "--json", "-p", port)
    return result, [hexed(data) for data, at in zip(link.sent, link.sent_at, strict=True) if at > link.since]


@each_row(
    ("family", "query", "words", "begins", "stop", "hole"),
    [
        ("exo", "", POSITION, "0B32", EXO, 1.6),
        ("exo", "", ("position", "ring=900", "--wait", "9"), "12D005", EXO, 1.6),
        ("wrist", "", MOVE, "310E04", WRIST, 1.6),
        ("hand", "&model=df&speed=20", ANGLE, "12D405", HAND, 2.8),
        ("hand", "&model=tp&bus=modbus-tcp", ANGLE, "0605D4", TCP, 2.5),
        ("barrett", "&initialized=1", ("close",), "43", BARRETT, 60.0),
        ("exo", "", (*POSITION, "--deadline", "0.6"), "0B32", EXO, 0.0),
        ("wrist", "", (*MOVE, "--deadline", "1.5"), "310E04", WRIST, 0.0),
        ("hand", "&model=df&speed=20", (*ANGLE, "--deadline", "1.5"), "12D405", HAND, 0.0),
        ("hand", "&model=tp&bus=modbus-tcp&speed=20", (*ANGLE, "--deadline", "1.5"), "0605D4", TCP, 0.0),
    ],
)
def test_an_error_in_a_movement_stops_it(
    family: str, query: str, words: tuple[str, ...], begins: str, stop: str, hole: float
) -> None:
    result, sent = moved(family, query, words, begins, hole)
    assert result.code == (5 if family == "barrett" else 4), result
    assert any(stop in one for one in sent), (result, sent)
    if family != "barrett":
        assert "handctl has stopped it" in result.error["text"], result
        assert "may still move" not in result.error["text"], result


@each_row(
    ("family", "query", "words", "begins", "hole"),
    [
        ("exo", "", POSITION, "0B32", 0.2),
        ("wrist", "", MOVE, "310E04", 0.3),
        ("hand", "&model=df", ANGLE, "12D405", 0.3),
    ],
)
def test_a_hole_that_is_over_in_time_ends_nothing(
    family: str, query: str, words: tuple[str, ...], begins: str, hole: float
) -> None:
    result, _ = moved(family, query, words, begins, hole)
    assert result.code == 0, result


def test_a_movement_that_was_refused_is_not_stopped() -> None:
    """Nothing was set going: speed 0 would be a change that nobody asked for."""
    result = run(
        "hand", "angle", "index=0", "--wait", "3", "-y", "--json", "-p", "fake://hand?clock=virtual&fault=refuse"
    )
    assert result.code == 6, result
    assert all("speed" not in row["meaning"] for row in result.json["writes"]), result
