"""Ctrl-C in `set`, as it is typed: what it has set going is stopped before the command ends, and what it left is said."""

from __future__ import annotations

from collections.abc import Sequence
from unittest import mock

from handctl.command import open_links
from handctl.link import Deadline, open_link
from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.scripted import RecordedLink, changing, hexed
from tests.support.stop import RELEASE


class Pressed(RecordedLink):
    """A simulated device on virtual time at which Ctrl-C comes once a frame that begins so was sent."""

    def __init__(self, family: str, begin: str) -> None:
        super().__init__(open_link(f"fake://{family}?clock=virtual", baud=115200))  # type: ignore[arg-type]
        self.begin = begin
        self.pressed = False

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.sent.append(bytes(data))
        self.sent_at.append(self.now())
        self.inner.write(data, deadline)
        if hexed(data).startswith(self.begin) and not self.pressed:
            self.pressed = True
            raise KeyboardInterrupt


def pressed(family: str, begin: str, words: Sequence[str]) -> tuple[Result, list[str]]:
    """The command with Ctrl-C behind that frame; its end, and the writing frames from that one on."""
    link = Pressed(family, begin)
    with mock.patch.object(open_links.Connection, "_open", lambda *_: link):
        result = run(family, *words, "-y", "--json", "-p", f"fake://{family}")
    assert link.pressed, result
    return result, changing(link.sent)


@each_row(
    ("family", "words", "begin", "stop"),
    [
        ("exo", "set position_set.index=900", "EB 90 01 05 12", "EB 90 01 0B 32"),
        ("exo", "set force_set.index=100", "EB 90 01 05 12", hexed(RELEASE)),
        ("exo", "set position_set.index=900 force_set.index=100", "EB 90 01 05 12", hexed(RELEASE)),
        ("wrist", "set yaw_set=20", "EB 90 01 05 31", "EB 90 01 07 31 0E 04"),
    ],
)
def test_ctrl_c_in_set_stops_what_it_has_set_going(family: str, words: str, begin: str, stop: str) -> None:
    result, frames = pressed(family, begin, words.split())
    assert result.code == 130, result
    assert len(frames) > 1 and any(frame.startswith(stop) for frame in frames[1:]), frames
    assert result.error["text"].casefold().startswith("interrupted"), result
    assert result.json["writes"][0]["bytes"].startswith(begin), result


def test_ctrl_c_in_set_of_what_does_not_move_sends_no_stop() -> None:
    result, frames = pressed("exo", "EB 90 01 04 12", ["set", "baud_code=1"])
    assert result.code == 130 and len(frames) == 1, (result, frames)
    assert "not known whether baud_code was written" in result.error["text"]
