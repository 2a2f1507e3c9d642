"""A few of the devices that mean no good on real wires and in real time: served by a process of its own over TCP or a pty."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from handctl.sim.engine import serve
from tests.harm.cell import Port
from tests.hostile.cell import FORMATS, Folder, attempt
from tests.hostile.devices import Place

pytestmark = pytest.mark.real

PLACES = (
    (Place("exo", "a byte a second", "serial"), "pty", ("exo", "status")),
    (Place("barrett", "escapes behind words", "serial"), "pty", ("barrett", "help", "HI")),
    (Place("aidin", "a string without end", "tcp"), "tcp", ("aidin", "status")),
    (Place("ekso", "junk behind", "tcp"), "tcp", ("ekso", "dump")),
)
"""The device, the wire, a command."""


class Wired(Port):
    """The cable, whose time is that of the clock."""

    def opened(self) -> Wired:
        self._start = self.line.now - time.monotonic()
        return self


def _serve(place: Place, wire: str, told: Connection) -> None:
    def tell(link: str) -> str:
        told.send(link)
        return link

    port = Wired(place.make())
    server = serve.Server(serve.Alone(port))
    if wire == "tcp":
        server.behind(serve.TcpDoor("127.0.0.1", 0), tell)
    else:
        server.at(serve.PtyPort(port.line.device.speed), tell)
    server.run(60.0)


@contextmanager
def served(place: Place, wire: str) -> Iterator[str]:
    """What is given as --port."""
    context = multiprocessing.get_context("fork")
    hear, tell = context.Pipe(duplex=False)
    process = context.Process(target=_serve, args=(place, wire, tell), daemon=True)
    process.start()
    try:
        assert hear.poll(20.0), "the device does not begin"
        yield hear.recv()
    finally:
        process.kill()
        process.join()


@pytest.mark.parametrize(("place", "wire", "words"), PLACES, ids=str)
def test_a_wire_that_means_no_good(place: Place, wire: str, words: tuple[str, ...], tmp_path: Path) -> None:
    with served(place, wire) as link:
        for how in ("table", "json"):
            done = attempt([*words, "-p", link, "--deadline", "2", *FORMATS[how]], how, Folder(tmp_path))
            assert not done.failure, f"--{how}, exit {done.code}: {done.failure}"
