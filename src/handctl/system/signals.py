"""Signals: requests to end the program, alarms, and code that must run in the main thread at once.

On Windows there is no alarm and no signal between processes: what a thread hears reaches the main thread between two of
its steps. Every wait is cut into slices (`clock.SLICE`) for it, and elsewhere for the signal that comes just before a wait.
"""

from __future__ import annotations

import _thread
import contextlib
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from typing import Any

_plain: Any = import_module("_signal")
"""What `signal` wraps in enums: each sample of a control loop takes all of these and gives them back."""
Handler = Callable[[int, Any], None]

ENDING = ("SIGINT", "SIGQUIT", "SIGTERM", "SIGHUP", "SIGBREAK")
"""What asks the program to end: Ctrl-C, Ctrl-\\, a service manager, a closing terminal, Ctrl-Break. A device is stopped first."""
SUSPEND = "SIGTSTP"
"""Ctrl-Z. A command that may move something ends on it too: stopped in its sleep, it could not stop the device."""


_NUMBERED, _SUSPENDING = (
    [int(getattr(signal, name)) for name in names if hasattr(signal, name)] for names in (ENDING, (SUSPEND,))
)


def numbers(*, suspend: bool = False, alarm: bool = False) -> list[int]:
    """Those of ENDING, with SUSPEND and the alarm if asked for, that this system has."""
    return _NUMBERED + (_SUSPENDING if suspend else []) + (_ALARM if alarm else [])


def take(handler: Handler, which: Iterable[int], *, only_taken: bool = False) -> list[tuple[int, Any]]:
    """Let `handler` take these, or those that the system's own handler does not have; what they had before, for `give_back`."""
    before = [(number, _plain.getsignal(number)) for number in which]
    for number, old in before:
        if old is not handler and not (only_taken and old in (_plain.SIG_DFL, None)):
            _plain.signal(number, handler)
    return before


def give_back(before: Iterable[tuple[int, Any]]) -> None:
    """Each has what it had before `take`."""
    for number, old in before:
        _plain.signal(number, old if callable(old) else int(old or _plain.SIG_DFL))  # an enum of `signal`, too


def ignore(which: Iterable[int]) -> None:
    """These do nothing from now on."""
    for number in which:
        signal.signal(number, signal.SIG_IGN)


def interrupt(frame: Any) -> None:
    """Do now what Ctrl-C does just now, as far as that is handled."""
    handler = signal.getsignal(signal.SIGINT)
    if callable(handler):
        handler(signal.SIGINT, frame)


@contextlib.contextmanager
def held_back(which: Iterable[int], *, in_handler: bool = False) -> Iterator[None]:
    """These wait until it is over; what had arrived before is handled first. Within a handler, those that waited before go on waiting."""
    which = set(which)
    if sys.platform == "win32":
        with _deferred(which):
            yield
    else:
        after = signal.SIG_UNBLOCK, which
        try:
            before = _plain.pthread_sigmask(signal.SIG_BLOCK, which)
            after = (signal.SIG_SETMASK, before) if in_handler else after
            with _deferred(which):
                yield
        finally:
            _plain.pthread_sigmask(*after)


@contextlib.contextmanager
def _deferred(which: Iterable[int]) -> Iterator[None]:
    """What comes meanwhile is delivered when it is over; outside the main thread, which hears of signals alone, nothing comes.

    A signal that this thread blocks goes to another one, if there is any, and its handler runs in the main thread all the same.
    """
    if sys.platform != "win32" and not _thread._count():
        yield
        return
    import threading

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    raised: BaseException | None = None

    def keep(number: int, _frame: Any) -> None:
        came.append(number)

    before = [(number, _plain.getsignal(number)) for number in which]
    try:
        for number, _ in before:
            _plain.signal(number, keep)
        yield
    finally:
        for number, old in before:
            while _plain.getsignal(number) is keep:  # what was changed meanwhile stays
                try:
                    _plain.signal(number, _plain.SIG_DFL if old is None else old)
                except KeyboardInterrupt as exc:  # by a handler that is back already, before this one was
                    raised = exc
        for number in dict.fromkeys(came):
            _thread.interrupt_main(signal.Signals(number))
        if raised is not None:
            raise raised


# -- alarms -------------------------------------------------------------------------------------------------------


if sys.platform == "win32":
    import threading

    _ALARM: list[int] = []
    _over: list[threading.Event] = []
    """No alarm any more, for each of them."""

    def alarm(handler: Handler, seconds: float) -> list[tuple[int, Any]]:
        """Call `handler` in the main thread after `seconds`; what had the alarm before, for `no_alarm`."""
        over = threading.Event()
        bell = Bell(lambda frame: None if over.is_set() else handler(0, frame))
        _ring_after(over, bell.ring, seconds, 0.0)
        return []

    def look(handler: Handler, seconds: float, again: float) -> None:
        """Call `handler` after `seconds`, then each `again`, in threads: the main one may be waiting for a reader."""

        def call() -> None:  # in a thread of its own: one call may wait, the next ends the process
            threading.Thread(target=handler, args=(0, None), daemon=True).start()

        _ring_after(threading.Event(), call, seconds, again)

    def _ring_after(over: threading.Event, ring: Callable[[], None], seconds: float, again: float) -> None:
        _over.append(over)

        def run() -> None:
            wait = seconds
            while not over.wait(wait):
                ring()
                if not again:
                    return
                wait = again

        threading.Thread(target=run, daemon=True).start()

    def no_alarm(before: Iterable[tuple[int, Any]] = ()) -> None:
        """No alarm any more; who had it `before` has it again."""
        while _over:
            _over.pop().set()

else:
    _ALARM = [int(signal.SIGALRM)]

    def alarm(handler: Handler, seconds: float) -> list[tuple[int, Any]]:
        """Call `handler` in the main thread after `seconds`; what had the alarm before, for `no_alarm`."""
        before = take(handler, [signal.SIGALRM])
        signal.setitimer(signal.ITIMER_REAL, seconds)
        return before

    def look(handler: Handler, seconds: float, again: float) -> None:
        """Call `handler` after `seconds`, then each `again`, also while the main thread waits for a reader."""
        take(handler, [signal.SIGALRM])
        signal.setitimer(signal.ITIMER_REAL, seconds, again)

    def no_alarm(before: Iterable[tuple[int, Any]] = ()) -> None:
        """No alarm any more; who had it `before` has it again."""
        signal.setitimer(signal.ITIMER_REAL, 0)
        give_back(before)


def alarm_is_over() -> None:
    """No alarm any more, not even one that is due and held back. Other threads than the main one hear of none."""
    with contextlib.suppress(ValueError):
        no_alarm((number, _plain.SIG_IGN) for number in _ALARM)


def listen(pressed: Callable[[], None]) -> None:
    """Treat what ends a program without a signal, such as closing a window on Windows, like SIGTERM from now on.

    `pressed` is told there of Ctrl-C at once, in another thread: the main one hears of it when it waits for nothing.
    """
    if sys.platform == "win32":
        _watch(pressed)


if sys.platform == "win32":
    # Closing the window reaches a handler of the console, log-off and shutdown a hidden window: a program that has loaded
    # user32 (as ctypes does) is not told of them by the console. Each comes in a thread of its own, and the system ends the
    # program when that returns, or after some 5 seconds.

    C, BREAK, CLOSE, LOGOFF, SHUTDOWN = 0, 1, 2, 5, 6
    """CTRL_C_EVENT and those after it."""
    PATIENCE = 4.5
    """Seconds for the program to end by itself: a second more, and the system ends it (5 s for the window)."""
    WM_CLOSE, WM_QUERYENDSESSION, WM_ENDSESSION = 0x10, 0x11, 0x16

    _kept: list[Any] = []
    """What the system calls must not be collected."""

    def _watch(pressed: Callable[[], None]) -> None:
        """Call `pressed` on Ctrl-C and Ctrl-Break, in a system thread, in addition to Python's own handler."""
        if _kept:
            return
        import ctypes
        from ctypes import wintypes

        def closing() -> None:
            if signal.getsignal(signal.SIGTERM) not in (signal.SIG_DFL, None):
                _thread.interrupt_main(signal.SIGTERM)
                time.sleep(PATIENCE)

        def handler(event: int) -> bool:
            if event in (C, BREAK):
                pressed()
            elif event in (CLOSE, LOGOFF, SHUTDOWN):
                closing()
            return False  # who was there before goes on: Python's handler of Ctrl-C, the end

        routine = ctypes.WINFUNCTYPE(wintypes.BOOL, wintypes.DWORD)(handler)
        _kept.append(routine)
        ctypes.WinDLL("kernel32").SetConsoleCtrlHandler(routine, True)
        threading.Thread(target=_window, args=(closing,), daemon=True).start()

    def _window(closing: Callable[[], None]) -> None:
        """An invisible window, for messages that only windows receive."""
        import ctypes
        from ctypes import wintypes

        user32, kernel32 = ctypes.WinDLL("user32"), ctypes.WinDLL("kernel32")
        kernel32.GetModuleHandleW.restype = wintypes.HMODULE
        user32.CreateWindowExW.restype = wintypes.HWND
        user32.DefWindowProcW.restype = ctypes.c_ssize_t
        user32.DefWindowProcW.argtypes = (wintypes.HWND, wintypes.UINT, wintypes.WPARAM, wintypes.LPARAM)
        procedure_type = ctypes.WINFUNCTYPE(
            ctypes.c_ssize_t, wintypes.HWND, wintypes.UINT, wintypes.WPARAM, wintypes.LPARAM
        )

        def told(window: int, message: int, word: int, long: int) -> int:
            if message == WM_QUERYENDSESSION:
                return 1
            if message == WM_CLOSE or (message == WM_ENDSESSION and word):
                closing()
                return 0
            return int(user32.DefWindowProcW(window, message, word, long))

        class Class(ctypes.Structure):
            """WNDCLASSW."""

            _fields_ = (
                ("style", wintypes.UINT), ("procedure", procedure_type), ("class_extra", ctypes.c_int),
                ("window_extra", ctypes.c_int), ("instance", wintypes.HINSTANCE), ("icon", wintypes.HANDLE),
                ("cursor", wintypes.HANDLE), ("background", wintypes.HANDLE), ("menu", wintypes.LPCWSTR),
                ("name", wintypes.LPCWSTR),
            )  # fmt: skip

        procedure = procedure_type(told)
        found = Class(procedure=procedure, instance=kernel32.GetModuleHandleW(None), name="handctl")
        _kept.append((procedure, found))
        user32.RegisterClassW(ctypes.byref(found))
        none = ctypes.c_void_p()
        window = user32.CreateWindowExW(
            0, wintypes.LPCWSTR("handctl"), wintypes.LPCWSTR("handctl"), 0, 0, 0, 0, 0, none, none,
            wintypes.HINSTANCE(found.instance), none,
        )  # fmt: skip
        message = wintypes.MSG()
        while window and user32.GetMessageW(ctypes.byref(message), none, 0, 0) > 0:
            user32.DispatchMessageW(ctypes.byref(message))


# -- the main thread ----------------------------------------------------------------------------------------------


class Bell:
    """Calls `handler` with the frame in the main thread, between two of its steps, once any thread rings."""

    def __init__(self, handler: Callable[[Any], None]) -> None:
        """Raises ValueError outside the main thread."""
        self._handler = handler
        if sys.platform == "win32":
            self._before = take(_call, [signal.SIGFPE])  # nothing sends it: it is a number only
        else:
            self._before = take(lambda _number, frame: handler(frame), [signal.SIGUSR1])

    def ring(self) -> None:
        """From any thread."""
        if sys.platform == "win32":
            _calls.append(self._handler)
            _thread.interrupt_main(signal.SIGFPE)
        else:
            import threading

            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR1)

    def close(self) -> None:
        if sys.platform != "win32":
            give_back(self._before)


_calls: deque[Callable[[Any], None]] = deque()
"""What is to be called in the main thread, where a signal is no more than a number."""


def _call(_number: int, frame: Any) -> None:
    while _calls:
        _calls.popleft()(frame)


class Served:
    """Signals for a server: end (SIGTERM, SIGINT) or power-cycle (SIGUSR1). `reader` wakes its select."""

    def __init__(self) -> None:
        self.stop = False
        self.power_cycles = 0
        self._cycle = -1
        which = [int(signal.SIGTERM), int(signal.SIGINT)]
        if sys.platform == "win32":
            import socket  # a select there takes nothing else

            which.append(int(signal.SIGBREAK))
            self._ends = socket.socketpair()
            for end in self._ends:
                end.setblocking(False)
            self.reader, writer = (end.fileno() for end in self._ends)
        else:
            self.reader, writer = self._ends = os.pipe()
            for end in self._ends:
                os.set_blocking(end, False)
            self._cycle = int(signal.SIGUSR1)
            which.append(self._cycle)
        self._old = take(self._note, which)
        self._old_wakeup = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        listen(lambda: None)

    def _note(self, number: int, _frame: Any) -> None:
        if number == self._cycle:
            self.power_cycles += 1
        else:
            self.stop = True

    def drain(self) -> None:
        """What woke the select is taken."""
        with contextlib.suppress(BlockingIOError):
            if sys.platform == "win32":
                self._ends[0].recv(4096)
            else:
                os.read(self.reader, 4096)

    def __enter__(self) -> Served:
        return self

    def __exit__(self, *_: object) -> None:
        signal.set_wakeup_fd(self._old_wakeup)
        give_back(self._old)
        for end in self._ends:
            if sys.platform == "win32":
                end.close()
            else:
                os.close(end)
