"""A port without a descriptor to wait on (Windows, socket://) is set up once, and deadlines are exact around its waits."""

from __future__ import annotations

from typing import Any

import pytest

from handctl.link import ByteLink, open_link
from handctl.link.serial import SLICE_SECONDS
from tests.support.cli import PATIENCE, in_time

pytestmark = pytest.mark.real


@pytest.fixture
def link() -> Any:
    found = open_link("loop://")
    yield found
    found.close()


def test_reading_changes_no_setting(link: ByteLink, monkeypatch: pytest.MonkeyPatch) -> None:
    port = link._port  # type: ignore[attr-defined]
    anew: list[object] = []
    monkeypatch.setattr(port, "_reconfigure_port", lambda *words: anew.append(words))
    for text in (b"a", b"answer of twenty byte"):
        link.write(text, link.deadline(PATIENCE))
        came = b""
        while len(came) < len(text):
            came += link.read(link.deadline(PATIENCE), size=8)
        assert came == text
    assert link.read(link.deadline(0.005)) == b""
    assert (anew, port.timeout) == ([], SLICE_SECONDS)


@pytest.mark.parametrize("seconds", [0.0, 0.004, 0.03])
def test_a_silent_port_is_left_when_the_time_is_over(link: ByteLink, seconds: float) -> None:
    """Not a slice later: of some tries the best, on a machine that has more to do."""

    def silence() -> None:
        assert link.read(link.deadline(seconds)) == b""

    in_time(silence, seconds, seconds + 0.01, tries=100)
