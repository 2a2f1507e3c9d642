"""Windows: what ends a program there beside Ctrl-C and Ctrl-Break, which Python hears itself.

Closing the window reaches a handler of the console, log-off and shutdown a hidden window: a program that has loaded
user32 (as ctypes does) is not told of them by the console. Each comes in a thread of its own, and the system ends the
program when that returns, or after some 5 seconds. Knows nothing of what is stopped.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

if sys.platform == "win32":
    import ctypes
    import threading
    import time
    from ctypes import wintypes
    from typing import Any

    C, BREAK, CLOSE, LOGOFF, SHUTDOWN = 0, 1, 2, 5, 6
    """CTRL_C_EVENT and those after it."""
    PATIENCE = 4.5
    """Seconds for the program to end by itself: a second more, and the system ends it (5 s for the window)."""
    WM_CLOSE, WM_QUERYENDSESSION, WM_ENDSESSION = 0x10, 0x11, 0x16

    _kept: list[Any] = []
    """What the system calls must not be collected."""

    def watch(ends: Callable[[], bool], pressed: Callable[[], None]) -> None:
        """From now on `ends` is called, in a thread of the system, when the program is to end: whether somebody does it.

        `pressed` is told of Ctrl-C and Ctrl-Break, beside Python's own handler.
        """
        if _kept:
            return

        def closing() -> None:
            if ends():
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
        """A window that nobody sees, for what is told to windows only."""
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

else:

    def watch(ends: Callable[[], bool], pressed: Callable[[], None]) -> None:
        """Signals tell it all."""
