"""Listen for requests to stop the device of this process: from another process, or the keys pressed in a live view.

Another process connects to a socket next to the lock file (`system.local_socket`). A signal (SIGIO) reports it, so nothing polls; on
Windows a thread waits instead. The handler runs between two steps of the program, even while that waits for the device or (not
on Windows) for a reader of its output. Who asks says which device it means. The reply is `heard` at once, then one line of JSON with the bytes
sent and the devices that they were for.
A thread waits for the key, so the loop on the wire never checks for it.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections import deque
from collections.abc import Callable, Collection
from functools import partial
from typing import Any

from handctl import interrupts
from handctl.command.terminal_prompts import is_terminal
from handctl.system import clock, local_socket, signals, terminal

STOP_SECONDS = 9.0
"""Longest time from `heard` to the report: the longest stop, with silence at every step."""
LARGEST = 1 << 16


_open: list[StopListener] = []
"""The listeners of this process: one for each link."""
_answered = [0]
"""How many stops they have answered with."""


class StopListener:
    """Listens while it is open. `answer` gets what those who ask mean, see `is_meant`, stops the device and says how; `after` is
    then called with the frame.
    """

    def __init__(self, lock: str, answer: Callable[[list[str]], dict[str, Any]], after: Callable[[Any], None]) -> None:
        """Raises OSError; ValueError outside the main thread."""
        self._answer, self._after = answer, after
        self._busy = False
        self._peers: list[Any] = []
        path = _beside(lock)
        with contextlib.suppress(FileNotFoundError):
            local_socket.remove(path)  # of one that was killed: who has the lock has this name
        self._door = local_socket.Listener(path, 4)
        try:
            local_socket.tell_at_once(self._door, self._called)
        except BaseException:
            self._door.close()
            raise
        _open.append(self)

    def close(self) -> None:
        """Listen no more. May be called twice."""
        if self in _open:
            _open.remove(self)
        self._door.close()

    def _called(self, frame: Any) -> None:
        if interrupts.waits_for_frame(partial(self._called, frame)):
            return
        if self._busy:
            self._hear()  # somebody else who wishes the same, while the device is being stopped
        elif interrupts.is_stopping():  # of an interrupt, an error, or another link of this process
            self._hear_and_wait()
        else:
            before = _answered[0]
            with interrupts.stopping():
                for one in _open:  # who wishes for the stop of another link is heard now, and not behind this one
                    one._hear_and_wait()
            if _answered[0] > before:
                self._after(frame)

    def _hear_and_wait(self) -> None:
        if self._hear():
            interrupts.behind_stop(self._serve_all)

    def _serve_all(self) -> None:
        """Serve all that wait."""
        self._busy = True
        try:
            with interrupts.stopping(), signals.held_back(signals.numbers(suspend=True, alarm=True), in_handler=True):
                while self._serve():
                    _answered[0] += 1
        finally:
            self._busy = False

    def _serve(self) -> bool:
        """Serve one waiting process; False if there is none."""
        if not self._hear() and not self._peers:
            return False
        import json

        report = json.dumps(self._answer([_said(peer) for peer in self._peers])).encode() + b"\n"
        while self._peers:
            peer = self._peers.pop(0)
            with contextlib.suppress(OSError):
                peer.send(report)
            peer.close()
        return True

    def _hear(self) -> bool:
        """Reply `heard` to a waiting process; it gets the report later. False if none is waiting."""
        try:
            peer = self._door.accept()
        except OSError:
            return False
        with contextlib.suppress(OSError):
            peer.send(b"heard\n")
        self._peers.append(peer)
        return True


SAID_SECONDS = 0.05
"""For what is meant: who asks says it with the connection."""


def is_meant(kind: str, number: int, said: Collection[str]) -> bool:
    """Whether one of those who ask has `said` that it means this device: by its family, by that and its id, or by nothing at all."""
    return not {"", kind, f"{kind} {number}"}.isdisjoint(said)


def _said(peer: Any) -> str:
    """What who has connected means; "" where it says nothing."""
    said = b""
    with contextlib.suppress(OSError):
        peer.settimeout(SAID_SECONDS)
        while not said.endswith(b"\n") and len(said) < LARGEST and (more := peer.recv(256)):
            said += more
    return said.decode("utf-8", "replace").rstrip("\n")


def ask(lock: str, until: float, seconds: float = STOP_SECONDS, meant: str = "") -> tuple[bool, dict[str, Any] | None]:
    """Ask the holder of `lock` to stop. Returns whether it replied before `until` (`clock.now`), and its report within `seconds`.

    `meant` as in `is_meant`.

    The report is None when it ended, or fell silent, on the way.
    """
    import json

    try:
        with contextlib.closing(local_socket.connected(_beside(lock), max(0.001, until - clock.now()))) as line:
            line.sendall(f"{meant}\n".encode())
            came = line.recv(6)
            if not came:
                return False, None
            line.settimeout(seconds)
            with contextlib.suppress(OSError):
                while len(came) < LARGEST and (chunk := line.recv(4096)):
                    came += chunk
    except OSError:
        return False, None
    try:
        report = json.loads(came.partition(b"\n")[2])
    except (ValueError, RecursionError):
        report = None
    return True, report if isinstance(report, dict) else None


def _beside(lock: str) -> str:
    folder, name = os.path.split(lock)
    name = name.removeprefix("lock-")
    if len(name) > 60:
        import hashlib

        name = hashlib.sha256(name.encode()).hexdigest()[:32]
    return os.path.join(folder, f"stop-{name}")


class Keyboard:
    """Hands each key to `pressed` in the main thread until it is closed; then the terminal is as it was.

    What was typed before is thrown away: a key that was meant for something else must not stop a device.
    """

    def __init__(self, pressed: Callable[[str, Any], None], descriptor: int) -> None:
        """`pressed` is called with the key and the frame. Raises `terminal.TROUBLE` where it cannot be."""
        self._keys = terminal.Listener(descriptor)
        self._pressed = pressed
        self._waiting: deque[str] = deque()
        self._bell = signals.Bell(self._hand_over)
        self._thread = threading.Thread(target=self._wait, daemon=True)
        self._thread.start()

    @classmethod
    def on_terminal(cls, pressed: Callable[[str, Any], None]) -> Keyboard | None:
        """The keys, where a person can press them: stdin is a terminal, this is the job in front, and its main thread."""
        if not is_terminal(sys.stdin) or threading.current_thread() is not threading.main_thread():
            return None
        descriptor = sys.stdin.fileno()
        try:
            return cls(pressed, descriptor) if terminal.in_front(descriptor) else None
        except terminal.TROUBLE:
            return None

    def close(self) -> None:
        """No keys any more."""
        self._keys.wake()
        self._thread.join()
        self._keys.close()
        self._bell.close()

    def _wait(self) -> None:
        while came := self._keys.wait():
            if keys := keys_in(came):
                self._waiting.extend(keys)
                self._bell.ring()

    def _hand_over(self, frame: Any) -> None:
        if interrupts.waits_for_frame(partial(self._hand_over, frame)):
            return
        while self._waiting:
            self._pressed(self._waiting.popleft(), frame)


ESCAPE = "\x1b"


def keys_in(came: bytes) -> str:
    """The keys of what a terminal sent at once. An arrow or a function key begins with ESC too, and is none."""
    text = came.decode("utf-8", "ignore")
    return text if text == ESCAPE else text.partition(ESCAPE)[0]
