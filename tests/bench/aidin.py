"""The AIDIN-hand over TCP: one exchange against a bare loopback exchange of the same bytes, a stream kept up with, and
small writes without TCP_NODELAY, which cost 44 ms where the client does not acknowledge at once (dossier 9)."""

from __future__ import annotations

import json
import multiprocessing
import socket
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from handctl.devices.aidin.conversation import Conversation
from handctl.devices.aidin.exchange_settings import ExchangeMode, ExchangeSettings
from handctl.link.tcp import TcpLink
from handctl.model.result import Journal
from tests.bench.measure import Figure, handctl, served

ASKED = b"{}\n"
POLLED = ExchangeSettings(exchange=ExchangeMode.POLL)
RATE, FAST = 100, 500
PLATEAU_MS = 40.0


def told() -> bytes:
    """Feedback with 17 digits, about 1.5 kB: the longest that a hand is likely to send (dossier 7)."""
    content = {
        "motor_pos": [140000 + n for n in range(15)],
        "joint_pos": [2.0594885173533090 + n / 7 for n in range(20)],
        "task_space_pos": [80.599999999999994 + n / 7 for n in range(15)],
        "current_state": [100 + n for n in range(15)],
        "sensor_state": [0.34999999999999998 + n / 7 for n in range(30)],
    }
    return json.dumps(content, separators=(",", ":")).encode() + b"\n"


def _answer(listener: socket.socket, piece: int) -> None:
    """A server that answers each object; with `piece` in writes of so many bytes, and without TCP_NODELAY."""
    data = told()
    while True:
        client, _ = listener.accept()
        with client:
            if not piece:
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while client.recv(2048):
                for at in range(0, len(data), piece or len(data)):
                    client.send(data[at : at + (piece or len(data))])


@contextmanager
def answering(piece: int = 0) -> Iterator[int]:
    """Such a server in a process of its own; yields its port."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        process = multiprocessing.get_context("fork").Process(target=_answer, args=(listener, piece), daemon=True)
        process.start()
        try:
            yield listener.getsockname()[1]
        finally:
            process.terminate()
            process.join()


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    runs = 300 if quick else 2000
    with answering() as port:
        ours, floor = exchanges(port, runs)
    note = f"{len(told())} bytes, decoded and checked; the floor is send and recv alone, in turn with ours"
    yield Figure("aidin poll over loopback", ours, floor, "us", 10.0, note, "send and recv")
    with answering(400) as port:
        slow = statistics.median(polled(port, 20)) / 1000
    yield Figure(
        "aidin poll, server sends 400 bytes per write",
        slow,
        PLATEAU_MS,
        "ms",
        0.25,
        "a client that delays its acknowledgement waits so long",
        "delayed acknowledgement",
    )
    yield streamed(2 if quick else 10)
    yield recorded(4 if quick else 20)


def exchanges(port: int, runs: int) -> tuple[float, float]:
    """Median microseconds of our exchange and of a bare one, in turn; the server has one client at a time."""
    ours: list[float] = []
    bare: list[float] = []
    while len(ours) < runs:
        ours += polled(port, 100)
        with socket.create_connection(("127.0.0.1", port)) as plain:
            plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            bare += [timed(lambda: exchange(plain)) for _ in range(100)]
    return statistics.median(ours), statistics.median(bare)


def polled(port: int, runs: int) -> list[float]:
    """Microseconds of each of our exchanges, decoded and checked."""
    link = TcpLink(f"tcp://127.0.0.1:{port}")
    conversation = Conversation(link, Journal(), way=POLLED)
    conversation.refresh()
    times = [timed(conversation.refresh) for _ in range(runs)]
    link.close()
    return times


def timed(call: Callable[[], object]) -> float:
    """Microseconds of a call."""
    began = time.perf_counter()
    call()
    return (time.perf_counter() - began) * 1e6


def exchange(plain: socket.socket) -> None:
    """One question and its answer, to the last byte."""
    plain.sendall(ASKED)
    while not plain.recv(4096).endswith(b"\n"):
        pass


def streamed(seconds: int) -> Figure:
    """Objects that `watch` took of a stream beside those that came: none may be lost or be late."""
    with served("aidin", "--tcp", "127.0.0.1:0", "--set", f"rate={RATE}") as link:
        done = handctl(
            "aidin", "watch", "motor_pos", "-p", link, "--rate", "0", "--duration", str(seconds), "--json"
        )  # fmt: skip
    end = json.loads(done.splitlines()[-1])["end"]
    note = f"{end['stream']['samples']} samples of {RATE} a second, {end['counters']['bad_frames']} damaged"
    return Figure(
        "aidin watch, period of the samples",
        1000 / end["stream"]["rate_hz"],
        1000 / RATE,
        "ms",
        1.05,
        note,
        "the stream",
    )


def recorded(seconds: int) -> Figure:
    """The rows of a `log` of a fast stream beside the objects that came: the note counts those without a row."""
    with (
        tempfile.TemporaryDirectory() as folder,
        served("aidin", "--tcp", "127.0.0.1:0", "--set", f"rate={FAST}") as link,
    ):
        file = Path(folder) / "bench.csv"
        handctl("aidin", "log", str(file), "-p", link, "--rate", "0", "--count", str(seconds * FAST), "--json")
        about = json.loads(file.with_name("bench.csv.json").read_text(encoding="utf-8"))
    note = f"{about['rows']} rows, {about['lost']} lost, {about['skipped']} skipped"
    period = about["duration_s"] / (about["rows"] - 1) * 1000
    return Figure(f"aidin log at {FAST} Hz, period of the rows", period, 1000 / FAST, "ms", 1.02, note, "the stream")
