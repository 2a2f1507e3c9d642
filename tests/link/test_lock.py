"""The lock file of a device: where it may lie, what it says, and that it is let go. One process at a time is in test_cli_devices."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from handctl.errors import LinkError
from handctl.link import device_lock
from handctl.link.device_lock import InUse, Reached, hold
from handctl.system import processes
from tests.support.virtual import virtual_time

LINK = "tcp://192.0.2.7:8000"


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """The two places where a lock may lie."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    for name in ("run", "tmp"):
        (tmp_path / name).mkdir()
    return tmp_path / "run" / "handctl", tmp_path / "tmp" / f"handctl-{os.getuid()}"


def files(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.exists() else []


def test_the_first_place_is_the_runtime_folder(folders: tuple[Path, Path]) -> None:
    held = hold(LINK, "handctl scan")
    assert held is not None
    ((file,), none) = (files(folder) for folder in folders)
    assert none == []
    pid = os.getpid()
    assert file.read_text() == f"{pid}\t{processes.began(pid)}\t\treads\t{LINK}\thandctl scan\n"
    held.release()
    held.release()
    assert file.read_text() == "", "nobody holds it, and the file stays"
    again = hold(LINK, "the next one")
    assert again is not None
    again.release()


EXO = ("exo", 1)


def test_what_no_command_stops_is_noted_for_the_next_one(folders: tuple[Path, Path]) -> None:
    """A calibration goes on behind the end of the process that has started it, however that ended."""
    first = hold(LINK, "handctl exo raw", family="exo")
    assert first is not None and not first.lasting(EXO)
    first.lasts(EXO, 30)
    os.close(first.descriptors[0])  # killed: nothing more is written
    second = hold(LINK, "handctl exo get", family="exo")
    assert second is not None and second.lasting(EXO) and not second.lasting(("exo", 2))
    second.release()
    assert device_lock.remembered(LINK)[0] == Reached("exo", {})
    third = hold(LINK, "handctl scan")
    assert third is not None and third.lasting(EXO)
    third.lasts(EXO, 0)
    third.release()
    assert files(folders[0])[0].read_text() == "\nexo\n"


@pytest.mark.parametrize("text", ["exo\t1\t1e9", "exo\t1\tnan", "exo\t1\t-3", "exo\t1\tx", "exo\t1", "1e9", ""])
def test_a_note_of_another_day_says_nothing(folders: tuple[Path, Path], text: str) -> None:
    first = hold(LINK, "handctl")
    assert first is not None
    first.release()
    files(folders[0])[0].write_text(f"\nexo\n{text}\n")
    again = hold(LINK, "handctl")
    assert again is not None and not again.lasting(EXO)
    again.release()


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("tcp://192.0.2.7:8000", "socket://192.0.2.7:08000/"),
        ("tcp://Hand.local:8000", "rfc2217://hand.LOCAL:8000?logging=debug"),
        ("tcp://127.1:8000", "tcp://localhost:8000"),
        ("socket://192.0.2.7:8000", "can:slcan:socket://192.0.2.7:8000"),
        ("{port}", "{alias}"),
        ("{port}", "spy://{alias}?file=x"),
        ("{port}", "can:slcan:{alias}"),
        ("can:socketcan:can0", "can:socketcan:can0?bitrate=500000"),
        ("usb:0403:6001:AB", "usb:0403:6001:ab"),
    ],
)
def test_one_device_has_one_lock_by_whatever_name(
    folders: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one: str, other: str
) -> None:
    """Who comes second is refused and told who has it."""
    monkeypatch.setattr(device_lock, "LAST_STOP_SECONDS", 0.02)
    alias = tmp_path / "by-id"
    alias.symlink_to("/dev/null")  # a character device, as a port is
    one, other = (name.format(port="/dev/null", alias=alias) for name in (one, other))
    held = hold(one, "handctl exo watch")
    assert held is not None
    with pytest.raises(InUse) as caught:
        hold(other, "handctl exo get", patience=0.0)
    assert caught.value.path == held.path and "`handctl exo watch`" in caught.value.text
    held.release()
    again = hold(other, "handctl exo get", patience=0.0)
    assert again is not None and again.path == held.path and len(files(folders[0])) == 1
    again.release()


def test_a_folder_of_somebody_else_is_not_trusted(folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """Who owns it could put another file in the place of ours."""
    for folder in folders:
        folder.mkdir()
    user = os.getuid()
    monkeypatch.setattr(device_lock, "private_folders", lambda: [str(folder) for folder in folders])
    monkeypatch.setattr(os, "getuid", lambda: user + 1)
    with pytest.raises(LinkError) as caught:
        hold(LINK, "handctl aidin stop")
    assert caught.value.code == "no-lock"
    assert [files(folder) for folder in folders] == [[], []]


def test_a_symbolic_link_in_the_place_of_the_file_is_not_followed(folders: tuple[Path, Path], tmp_path: Path) -> None:
    held = hold(LINK, "x")
    assert held is not None
    held.release()
    (file,) = files(folders[0])
    file.unlink()
    victim = tmp_path / "victim"
    victim.write_text("precious")
    file.symlink_to(victim)
    held = hold(LINK, "x")
    assert held is not None and len(files(folders[1])) == 1, "the second place"
    held.release()
    assert victim.read_text() == "precious"


KNOWN = "`handctl exo watch` (pid {pid})"
STOPS = f"`handctl exo stop -p {LINK}` stops the device and ends that command"


@pytest.mark.parametrize(
    ("content", "who", "hint"),
    [
        (
            "{pid}\t{start}\texo\treads\tx\thandctl exo watch\n",
            KNOWN,
            "kill {pid} ends it and stops nothing on the device",
        ),
        ("{pid}\t{start}\texo\twrites\tx\thandctl exo watch\n", KNOWN, "kill {pid} ends it as its Ctrl-C does"),
        ("{pid}\t{start}\texo\treads\tx\thandctl exo watch\n", KNOWN, STOPS),
        (
            "{pid}\t{start}\tbarrett\twrites\tx\thandctl barrett firmware download\n",
            "`handctl barrett firmware download` (pid {pid})",
            "do not interrupt it",
        ),
        ("", "another handctl", "wait for it"),
        ("4194303000\t1\texo\treads\tx\thandctl exo watch\n", "another handctl", "wait for it"),
        ("{pid}\t1\texo\treads\tx\tanother program with its number\n", "another handctl", "wait for it"),
        ("{pid} handctl exo watch\n", "another handctl", STOPS),
    ],
)
def test_who_holds_it_is_named_when_it_is_known(folders: tuple[Path, Path], content: str, who: str, hint: str) -> None:
    """And what is said of ending it is true of that holder: one that reads stops nothing. One that died may still stop."""
    held = hold(LINK, "handctl exo watch")
    assert held is not None
    (file,) = files(folders[0])
    pid = os.getpid()
    file.write_text(content.format(pid=pid, start=processes.began(pid)))
    with virtual_time() as clock, pytest.raises(LinkError) as caught:
        began = clock.now()
        hold(LINK, "handctl exo get", family="exo")
    assert (clock.now() - began >= device_lock.LAST_STOP_SECONDS) is ("pid" not in who)
    assert caught.value.code == "busy"
    assert caught.value.text.endswith(f"in use by {who.format(pid=pid)}")
    assert hint.format(pid=pid) in caught.value.hint
    held.release()
