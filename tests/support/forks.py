"""handctl as a process of its own without the start of an interpreter: forked by a server that has imported all of it.

A start costs some milliseconds of processor time instead of some hundred. Streams, signals, locks, environment and exit
status are those of a program; what is imported when is not, so tests of start-up start a real one. Under coverage all do.
"""

from __future__ import annotations

import array
import atexit
import contextlib
import gc
import importlib
import io
import json
import os
import pkgutil
import select
import selectors
import signal
import socket
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from tests.support import in_process

ROOT = Path(__file__).parents[2]
LEFT_OUT = ("handctl.docgen", "handctl.build_zipapp")
MOST = 1 << 20
START_SECONDS = 60.0


def start(words: Sequence[str | Path], env: Mapping[str, str], **more: Any) -> Any:
    """`handctl WORDS` as a process: what `subprocess.Popen` returns, or a `Forked`, which does the same for our tests.

    Of the options stdin, stdout, stderr, cwd, and preexec_fn (a function of a module) are known.
    """
    args = [str(word) for word in words]
    if any(name.startswith("COVERAGE") for name in os.environ):
        return subprocess.Popen([sys.executable, "-m", "handctl", *args], env=dict(env), **more)
    return Forked(args, env, **more)


class Forked:
    """One process. Has of `subprocess.Popen` what the tests use."""

    def __init__(
        self, args: Sequence[str], env: Mapping[str, str], *, stdin: Any = subprocess.DEVNULL, stdout: Any = None,
        stderr: Any = None, cwd: str | Path | None = None, preexec_fn: Callable[[], object] | None = None,
    ) -> None:  # fmt: skip
        in_process.refuse("starts a process")
        assert stdin == subprocess.DEVNULL
        self.args, self.returncode = list(args), None
        with contextlib.ExitStack() as theirs:
            null = theirs.enter_context(open(os.devnull, "r+b", buffering=0)).fileno()
            self.stdout, out = self._stream(stdout, 1, null, theirs)
            self.stderr, err = self._stream(stderr, 2, null, theirs)
            first = "" if preexec_fn is None else f"{preexec_fn.__module__}:{preexec_fn.__qualname__}"
            request = {"args": self.args, "env": dict(env), "cwd": str(cwd or os.getcwd()), "first": first}
            self._came: dict[str, bytes | None] = {
                name: b"" if getattr(self, name) is not None else None for name in ("stdout", "stderr")
            }
            self._server = _server()
            self.pid: int = self._server.ask(request, [null, out, err])

    @staticmethod
    def _stream(wanted: Any, number: int, null: int, theirs: contextlib.ExitStack) -> tuple[IO[bytes] | None, int]:
        """Our end, and theirs."""
        if wanted == subprocess.PIPE:
            ours, other = os.pipe()
            theirs.callback(os.close, other)
            return open(ours, "rb"), other
        if wanted == subprocess.DEVNULL:
            return None, null
        if wanted is None:
            return None, number
        return None, wanted if isinstance(wanted, int) else wanted.fileno()

    def poll(self) -> int | None:
        """The exit status, negative for a signal; None while it runs."""
        if self.returncode is None:
            self.returncode = self._server.ended(self.pid, 0)
        return self.returncode

    def wait(self, timeout: float = 30.0) -> int:
        """The exit status. Raises TimeoutExpired."""
        if self.returncode is None:
            self.returncode = self._server.ended(self.pid, timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired(self.args, timeout)
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def communicate(self, timeout: float = 30.0) -> tuple[bytes | None, bytes | None]:
        """What came on the pipes until they ended, and the end itself. Raises TimeoutExpired."""
        end = time.monotonic() + timeout
        came = self._came
        with selectors.DefaultSelector() as waiting:
            for name in came:
                stream = getattr(self, name)
                if stream is not None and not stream.closed:
                    os.set_blocking(stream.fileno(), False)
                    came[name] = (came[name] or b"") + (stream.read1() or b"")  # what a readline left in its buffer
                    waiting.register(stream, selectors.EVENT_READ, name)
            while waiting.get_map():
                ready = waiting.select(max(0.0, end - time.monotonic()))
                if not ready:
                    raise subprocess.TimeoutExpired(self.args, timeout)
                for key, _ in ready:
                    chunk = os.read(key.fd, 65536)
                    came[key.data] = (came[key.data] or b"") + chunk
                    if not chunk:
                        waiting.unregister(key.fileobj)
                        key.fileobj.close()  # type: ignore[union-attr]
        self.wait(max(0.1, end - time.monotonic()))
        return came["stdout"], came["stderr"]


# -- the server, seen from the tests ----------------------------------------------------------------------------------


class _Server:
    """The one server of this test process."""

    def __init__(self) -> None:
        self.owner = os.getpid()
        self._line, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._ended: dict[int, int] = {}
        self._started: int | None = None
        text = f"from tests.support.forks import _serve; _serve({theirs.fileno()})"
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH", "")])])
        self._process = subprocess.Popen(
            [sys.executable, "-c", text], pass_fds=[theirs.fileno()], env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
        theirs.close()
        atexit.register(self.close)

    def close(self) -> None:
        """End it and all that it started, which counts as ours then."""
        if self.owner == os.getpid():
            self._line.close()
            self._process.wait(30)

    def ask(self, request: dict[str, Any], descriptors: list[int]) -> int:
        """Start a process; its number."""
        content = json.dumps(request).encode("utf-8", "surrogateescape")
        self._line.sendmsg([content], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", descriptors))])
        self._started = None
        while self._started is None:
            assert self._hear(START_SECONDS), "the server of forks does not answer"
        return self._started

    def ended(self, pid: int, seconds: float) -> int | None:
        """The exit status of a process, None when it still runs after `seconds`."""
        end = time.monotonic() + seconds
        while pid not in self._ended and self._hear(max(0.0, end - time.monotonic())):
            pass
        return self._ended.pop(pid, None)

    def _hear(self, seconds: float) -> bool:
        if not select.select([self._line], [], [], seconds)[0]:
            return False
        said = self._line.recv(MOST)
        assert said, "the server of forks has gone"
        told = json.loads(said)
        if "started" in told:
            self._started = told["started"]
        else:
            self._ended[told["ended"]] = told["code"]
        return True


_SERVERS: list[_Server] = []


def _server() -> _Server:
    if not _SERVERS or _SERVERS[-1].owner != os.getpid():
        _SERVERS.append(_Server())
    return _SERVERS[-1]


# -- the server itself ------------------------------------------------------------------------------------------------


def _serve(number: int) -> None:
    """Fork for whoever asks, tell who ended, until the tests end."""
    import handctl

    for module in pkgutil.walk_packages(handctl.__path__, "handctl."):
        if not module.name.endswith("__main__") and not module.name.startswith(LEFT_OUT):
            importlib.import_module(module.name)
    importlib.import_module("serial.tools.list_ports")
    gc.collect()
    gc.freeze()
    line = socket.socket(fileno=number)
    wake, call = os.pipe()
    os.set_blocking(wake, False)
    os.set_blocking(call, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(call)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C into the tests is theirs
    running: set[int] = set()
    while True:
        ready = select.select([line, wake], [], [])[0]
        if wake in ready:
            with contextlib.suppress(BlockingIOError):
                os.read(wake, 4096)
            _reap(line, running)
        if line in ready:
            request, rights, _, _ = line.recvmsg(MOST, socket.CMSG_SPACE(3 * 4))
            if not request:
                break
            descriptors = array.array("i", rights[0][2])
            pid = os.fork()
            if pid == 0:
                _become(
                    json.loads(request.decode("utf-8", "surrogateescape")), descriptors, (line.fileno(), wake, call)
                )
            running.add(pid)
            for descriptor in descriptors:
                os.close(descriptor)
            line.send(json.dumps({"started": pid}).encode())
    for pid in running:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)


def _reap(line: socket.socket, running: set[int]) -> None:
    while running:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if not pid:
            return
        running.discard(pid)
        with contextlib.suppress(OSError):  # the tests have ended
            line.send(json.dumps({"ended": pid, "code": os.waitstatus_to_exitcode(status)}).encode())


def _become(request: dict[str, Any], descriptors: Sequence[int], ours: Sequence[int]) -> None:
    """The child: takes on what a started program has, runs handctl, and ends."""
    code = 1
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        for number, descriptor in enumerate(descriptors):
            os.dup2(descriptor, number)
        for descriptor in (*descriptors, *ours):
            os.close(descriptor)
        os.environ.clear()
        os.environ.update(request["env"])
        os.chdir(request["cwd"])
        encoding, _, errors = os.environ.get("PYTHONIOENCODING", "utf-8").partition(":")
        sys.stdin = io.TextIOWrapper(open(0, "rb", closefd=False), encoding)  # noqa: SIM115 - to the end
        sys.stdout = io.TextIOWrapper(open(1, "wb", closefd=False), encoding, errors or None)  # noqa: SIM115 - to the end
        sys.stderr = io.TextIOWrapper(open(2, "wb", closefd=False), encoding, "backslashreplace", line_buffering=True)  # noqa: SIM115 - to the end
        sys.argv = ["handctl", *request["args"]]
        if request["first"]:
            module, _, name = request["first"].partition(":")
            getattr(importlib.import_module(module), name)()
        from handctl.cli import main

        code = main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:  # noqa: BLE001 - as an interpreter ends
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(Exception):
                stream.flush()
        os._exit(code)
