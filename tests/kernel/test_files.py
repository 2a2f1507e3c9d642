"""Files are there whole or not at all, and what is no file is never replaced."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from handctl.files import atomic_write, state_path
from tests.support.each_row import each_row


def test_a_new_file_appears_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with atomic_write(path) as file:
        file.write("line\r\nmore ü\n")
        assert not path.exists()
    assert path.read_bytes() == "line\r\nmore ü\n".encode()
    assert os.listdir(tmp_path) == ["a.json"]


def test_an_error_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old", encoding="ascii")
    with pytest.raises(KeyboardInterrupt), atomic_write(path, "wb") as file:
        file.write(b"new")
        raise KeyboardInterrupt
    assert path.read_text(encoding="ascii") == "old"
    assert os.listdir(tmp_path) == ["a.json"]


def test_permissions_and_links_stay(tmp_path: Path) -> None:
    path, link = tmp_path / "a.json", tmp_path / "link"
    path.write_text("old", encoding="ascii")
    path.chmod(0o640)
    link.symlink_to("a.json")
    with atomic_write(link) as file:
        file.write("new")
    assert link.is_symlink()
    assert path.read_text(encoding="ascii") == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_pipe_is_written_to(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    with atomic_write(pipe) as file:
        file.write("through")
    assert os.read(reader, 100) == b"through"
    os.close(reader)
    assert stat.S_ISFIFO(pipe.lstat().st_mode)


def test_no_folder_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "none" / "a.json"):
        pass
    with pytest.raises(IsADirectoryError), atomic_write(tmp_path):
        pass


@each_row(("base", "place"), [("/state", "/state"), ("", "/me/.local/state"), ("here", "/me/.local/state")])
def test_the_state_folder(base: str, place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A relative path counts for nothing there, says the XDG specification."""
    monkeypatch.setenv("HOME", "/me")
    monkeypatch.setenv("XDG_STATE_HOME", base)
    assert state_path("x.json") == Path(place) / "handctl" / "x.json"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_what_is_no_file_holds_no_configuration(tmp_path: Path) -> None:
    from handctl.command.config_edit import change
    from handctl.errors import UsageError

    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(UsageError, match="is not a file"):
        change(str(pipe), lambda config: config.text, {}, "left")
    assert stat.S_ISFIFO(pipe.lstat().st_mode)


def test_it_is_on_the_disk_before_it_takes_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a power cut may leave an empty file where the old one was."""
    path, synced = tmp_path / "a.json", []
    path.write_text("old", encoding="ascii")
    fsync = os.fsync

    def note(file: int) -> None:
        synced.append((os.fstat(file).st_size, path.read_text(encoding="ascii")))
        fsync(file)

    monkeypatch.setattr(os, "fsync", note)
    with atomic_write(path) as file:
        file.write("newer")
    assert synced == [(5, "old")]
    assert path.read_text(encoding="ascii") == "newer"
