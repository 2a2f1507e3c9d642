"""A download that was cut off, by whatever: the next command knows it, and sends nothing into the image."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from handctl.devices.barrett import state_files
from handctl.link import ByteLink
from handctl.link.fake import FakeLink
from tests.barrett.srecords import END, HEADER, record
from tests.support.cli import Result, run
from tests.support.each_row import each_row

LINES = [HEADER, *(record(0x2000 + place, bytes(32)) for place in range(0, 320, 32)), END]


def port_named(name: str) -> ByteLink:
    return cast(ByteLink, SimpleNamespace(name=name, fake=False, replayed=False))


class Killed(BaseException):
    """The end of the process, which no handler sees."""


class Bench:
    """A hand whose port is a real one, as far as the notes are concerned. `wire` has what reached it."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.wire, self.dies_behind, self.more = folder, list[bytes](), 10**9, ""
        (folder / "fw.s19").write_text("\n".join(LINES), encoding="ascii")
        write = FakeLink.write

        def written(link: FakeLink, data: bytes, deadline: Any) -> None:
            if len(self.wire) >= self.dies_behind:
                raise Killed
            self.wire.append(bytes(data))
            write(link, data, deadline)

        monkeypatch.setattr(FakeLink, "write", written)
        monkeypatch.setattr(state_files, "_lasts", lambda _link: True)
        monkeypatch.setenv("XDG_STATE_HOME", str(folder))

    def do(self, *words: str) -> Result:
        self.wire.clear()
        env = {"XDG_STATE_HOME": str(self.folder)}
        return run(
            "barrett", *words, "-p", f"fake://barrett?clock=virtual&image-records=10{self.more}", "--json", env=env
        )

    def cut(self) -> None:
        self.dies_behind = 40
        with pytest.raises(Killed):
            self.do("firmware", "download", str(self.folder / "fw.s19"), "--yes")
        self.dies_behind = 10**9


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


def test_what_follows_sends_nothing_into_the_image(bench: Bench) -> None:
    bench.cut()
    for words in (("status",), ("get", "P"), ("stop",), ("version",)):
        result = bench.do(*words)
        assert (result.code, bench.wire) == (6, []), (words, result, bench.wire)


def test_a_stop_is_held_back_once(bench: Bench) -> None:
    """Who asks again sees the hand move: it was loaded otherwise, and a stop that never goes out would be worse."""
    bench.cut()
    first, second = bench.do("stop"), bench.do("stop")
    assert (first.code, first.error["code"]) == (6, "not-now") and b"\x03" in b"".join(bench.wire), second
    assert bench.do("status").code == 6


def test_a_whole_download_ends_it(bench: Bench) -> None:
    bench.cut()
    again = bench.do("firmware", "download", str(bench.folder / "fw.s19"), "--yes")
    assert again.code == 0 and "not-running" in again.said and "silent-before" not in again.said  # nobody was asked
    assert bench.do("status").code == 0 and bench.do("stop").code == 0


@each_row("found", ["ready", "boot", "loop"])
def test_neither_a_banner_nor_a_prompt_ends_it(found: str, bench: Bench) -> None:
    """Half an image may print them, and moves nothing or anything. Who has loaded it otherwise says so."""
    bench.more = f"&found={found}"
    bench.cut()
    result = bench.do("status")
    assert (result.code, bench.wire) == (6, []) and str(state_files.downloads_path()) in result.err
    state_files.downloads_path().unlink()
    assert bench.do("status").code == 0


def test_a_download_that_was_not_begun_leaves_no_note(bench: Bench) -> None:
    bench.dies_behind = 4
    with pytest.raises(Killed):
        bench.do("firmware", "download", str(bench.folder / "fw.s19"), "--yes")
    bench.dies_behind = 10**9
    assert bench.do("status").code == 0


def test_another_name_of_the_port_shows_it_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """That below /dev/serial/by-id, and /dev/ttyUSB0: the stop is held back once in all, and a whole download ends it for both."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    name = tmp_path / "by-id"
    name.symlink_to("/dev/null")
    names = (str(name), "/dev/null")
    for first, other in (names, names[::-1]):
        state_files.note_download(port_named(first))
        assert all(state_files.is_half_loaded(port_named(one)) for one in names)
        assert state_files.holds_back(other) and not state_files.holds_back(first)
        assert not state_files.is_half_loaded(port_named("/dev/zero")) and not state_files.holds_back("/dev/zero")
        state_files.forget_download(port_named(other))
        assert not any(state_files.is_half_loaded(port_named(one)) for one in names)
