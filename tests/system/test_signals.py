"""What waits while a device is stopped: a signal that another thread takes, too."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from handctl.stop.device_access import DeviceAccess
from handctl.system import signals

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no signal is sent to a thread there")


@pytest.fixture
def ctrl_c() -> Iterator[Callable[[], None]]:
    """Ctrl-C as the system delivers it to a process whose main thread blocks it: to another thread."""
    over = threading.Event()
    other = threading.Thread(target=over.wait, daemon=True)
    other.start()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    taken, tell = os.pipe()
    os.set_blocking(tell, False)
    woken = signal.set_wakeup_fd(tell)

    def press() -> None:
        signal.pthread_kill(other.ident or 0, signal.SIGINT)
        os.read(taken, 1)  # the other thread has taken it
        for _ in range(1000):  # and Python looked often
            other.is_alive()

    yield press
    signal.set_wakeup_fd(woken)
    os.close(taken)
    os.close(tell)
    signal.signal(signal.SIGINT, before)
    over.set()
    other.join()


@pytest.mark.parametrize("in_handler", [False, True])
def test_a_signal_that_another_thread_takes_waits_too(in_handler: bool, ctrl_c: Callable[[], None]) -> None:
    through = False
    with pytest.raises(KeyboardInterrupt):
        with signals.held_back([signal.SIGINT], in_handler=in_handler):
            ctrl_c()
            through = True
        for _ in range(1000):
            threading.active_count()
    assert through and signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("in_handler", [False, True])
def test_within_a_handler_what_waited_before_goes_on_waiting(in_handler: bool) -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR2])
    try:
        with signals.held_back([signal.SIGUSR2], in_handler=in_handler):
            pass
        assert (signal.SIGUSR2 in signal.pthread_sigmask(signal.SIG_BLOCK, ())) is in_handler
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def test_what_is_set_meanwhile_stays(ctrl_c: Callable[[], None]) -> None:
    with signals.held_back([signal.SIGINT]):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_ctrl_c_does_not_cut_off_the_stop_of_the_key(ctrl_c: Callable[[], None]) -> None:
    done = []

    class Access(DeviceAccess):
        def __init__(self) -> None:
            self._run: Any = SimpleNamespace(prompts=SimpleNamespace(unstoppable=""))

        def stop(self, who: str) -> dict[str, Any]:
            ctrl_c()
            done.append(who)
            return {}

    with pytest.raises(KeyboardInterrupt):
        Access().pressed(None)
    assert done == ["stopped by the key S"]
