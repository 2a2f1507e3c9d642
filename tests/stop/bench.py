"""A port of which nothing is ever opened, and the simulated device behind it: what a lock keeps of a place can be tried there.

And the access of a command to its device, as another process reaches it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from handctl.command import open_links
from handctl.command.open_links import Connection
from handctl.link import ByteLink, FrameLink, Link, open_link
from handctl.link.device_lock import remembered
from handctl.link.fake import FakeLink
from handctl.stop.device_access import DeviceAccess
from handctl.tools import stop

PORT = "/dev/null"
"""A character device, as a port is: its lock is that of a port, and nothing is ever opened."""
HOST = "tcp://192.0.2.7:8000"


class Bench:
    """The device behind PORT and HOST, and for how long who is there was asked."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.there = ""
        self.first = b""
        """What somebody else has sent to the device before."""
        self.asked: list[float] = []
        patch.setattr(open_links, "open_link", self._open)
        patch.setattr(stop, "open_link", self._ask)

    def _open(self, name: str, **options: Any) -> Link:
        place = name if name.startswith("fake://") else f"fake://{self.there}clock=virtual"
        link = open_link(place, baud=options.get("baud"))
        if self.first and isinstance(link, ByteLink):
            link.set_baud(9600)
            for line in self.first.splitlines(keepends=True):
                link.write(line, link.deadline(1.0))
                link.read(link.deadline(0.1))
            link.set_baud(options.get("baud") or 115200)
        return link

    def _ask(self, name: str, **options: Any) -> Link:
        link = self._open(name, **options)
        assert isinstance(link, ByteLink | FrameLink)
        link.name = name
        began, close = link.now(), link.close

        def closed() -> None:
            self.asked.append(link.now() - began)
            close()

        link.close = closed  # type: ignore[method-assign]
        return link


def last_family(link: str) -> str:
    """The family of the device that was met last."""
    met, _ = remembered(link)
    return met.family if met is not None else ""


def lock_file() -> Path:
    (file,) = (Path(os.environ["XDG_RUNTIME_DIR"]) / "handctl").glob("lock-*")
    return file


@contextmanager
def noting_access() -> Iterator[list[DeviceAccess]]:
    """What is opened in here, as another command reaches it that asks for a stop."""
    opened, access = Connection.opened, list[DeviceAccess]()

    def noted(connection: Connection, *args: Any, **more: Any) -> Any:
        found = opened(connection, *args, **more)
        assert connection.device_access is not None
        access.append(connection.device_access)
        return found

    with mock.patch.object(Connection, "opened", noted):
        yield access


@contextmanager
def noting(deaf: str = "") -> Iterator[list[bytes]]:
    """What is written to a simulated line; who is `deaf` hears nothing of it once it is being stopped."""
    sent: list[bytes] = []
    write = FakeLink.write

    def noted(link: FakeLink, data: bytes, deadline: Any) -> None:
        sent.append(data)
        if not deaf or not data.hex().startswith(deaf):
            write(link, data, deadline)

    with mock.patch.object(FakeLink, "write", noted):
        yield sent
