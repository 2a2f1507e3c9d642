"""What wine 8 does otherwise than Windows, made good for a program that runs there; on Windows this does nothing.

A read of a serial port that times out is no error on Windows, and one in wine (ERROR_TIMEOUT). The configuration manager
of wine lacks CM_MapCrToWin32Err, without which pyserial cannot list the ports. wine sets variables such as APPDATA itself;
where WINE_AS_APPDATA is set, its value is taken. Loaded at the start of the Python put together here, and in handctl.exe.
"""

from __future__ import annotations

import ctypes
import os
from typing import Any

ERROR_TIMEOUT = 1460
ERROR_GEN_FAILURE = 31


class _Overlapped:
    """GetOverlappedResult, for which a time that is over is no error."""

    def __init__(self, function: Any) -> None:
        object.__setattr__(self, "function", function)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(self.function, name, value)  # argtypes, restype

    def __call__(self, *words: Any) -> Any:
        return self.function(*words) or int(ctypes.GetLastError() == ERROR_TIMEOUT)  # type: ignore[attr-defined]


def shim() -> None:
    """Set the variables, and look at each function of a library when it is asked for."""
    for name in [name for name in os.environ if name.startswith("WINE_AS_")]:
        os.environ[name.removeprefix("WINE_AS_")] = os.environ.pop(name)
    # PyInstaller puts a class of its own in the place of ctypes.CDLL: what all libraries have in common lies below it
    library_of_all = next(kind for kind in reversed(ctypes.WinDLL.__mro__) if "__getattr__" in vars(kind))  # type: ignore[attr-defined]
    found = library_of_all.__getattr__

    def function(library: ctypes.CDLL, name: str) -> Any:
        if name == "CM_MapCrToWin32Err":
            kind = ctypes.WINFUNCTYPE(ctypes.c_ulong, ctypes.c_ulong, ctypes.c_ulong)  # type: ignore[attr-defined]
            return kind(lambda _code, _default: ERROR_GEN_FAILURE)
        return _Overlapped(found(library, name)) if name == "GetOverlappedResult" else found(library, name)

    library_of_all.__getattr__ = function


if os.name == "nt" and hasattr(ctypes.windll.ntdll, "wine_get_version"):  # type: ignore[attr-defined]
    shim()
