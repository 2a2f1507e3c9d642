"""Reading and writing an open port or connection by its descriptor alone, without the library that opened it.

On Windows that is the system's handle of it, opened for overlapped operations, as pyserial opens ports and Python sockets.
"""

from __future__ import annotations

import sys

if sys.platform == "win32":
    import _winapi
    import ctypes

    from handctl.system import clock

    LOOK_SECONDS = 0.001
    """Between two looks whether a port has received anything."""

    def write(descriptor: int, data: bytes, seconds: float) -> int:
        """Write what goes within `seconds`; returns how much. Raises BlockingIOError where nothing goes, OSError."""
        return len(data) and _ended(_winapi.WriteFile(descriptor, data, overlapped=True)[0], seconds)

    def read(descriptor: int, size: int, seconds: float) -> bytes:
        """What has arrived, waiting `seconds` for the first; b"" at the end. Raises BlockingIOError on silence, OSError."""
        end = clock.now() + seconds
        try:
            while not (there := _arrived(descriptor)):  # a read of a port waits for all that it asks for
                if clock.now() >= end:
                    raise BlockingIOError
                clock.sleep(LOOK_SECONDS)
        except _NoPort:
            there = size
        operation = _winapi.ReadFile(descriptor, min(there, size), overlapped=True)[0]
        count = _ended(operation, end - clock.now())
        return bytes(operation.getbuffer() or b"")[:count]

    def _ended(operation: _winapi.Overlapped, seconds: float) -> int:
        """How many bytes an operation has moved; one that has not ended in time is taken back."""
        if _winapi.WaitForMultipleObjects([operation.event], False, max(0, round(seconds * 1000))):
            operation.cancel()
            count, _ = operation.GetOverlappedResult(True)
            if not count:
                raise BlockingIOError
            return count
        return operation.GetOverlappedResult(True)[0]

    class _State(ctypes.Structure):
        """COMSTAT."""

        _fields_ = (("flags", ctypes.c_ulong), ("received", ctypes.c_ulong), ("waiting", ctypes.c_ulong))

    class _NoPort(Exception):
        """The descriptor is that of a connection."""

    def _arrived(descriptor: int) -> int:
        """How many bytes a serial port has received. Raises _NoPort, OSError."""
        if _winapi.GetFileType(descriptor) != _winapi.FILE_TYPE_CHAR:
            raise _NoPort
        errors, state = ctypes.c_ulong(), _State()
        kernel32 = ctypes.WinDLL("kernel32", use_last_error=True)
        if not kernel32.ClearCommError(ctypes.c_void_p(descriptor), ctypes.byref(errors), ctypes.byref(state)):
            raise ctypes.WinError(ctypes.get_last_error())
        return int(state.received)

    close = _winapi.CloseHandle

else:
    import os

    from handctl.system.waits import ended, readable, writable

    def write(descriptor: int, data: bytes, seconds: float) -> int:
        """Write what goes within `seconds`; returns how much. Raises BlockingIOError where nothing goes, OSError."""
        try:
            return os.write(descriptor, data)
        except BlockingIOError:
            if not writable(descriptor, seconds):
                raise
            return 0

    def read(descriptor: int, size: int, seconds: float) -> bytes:
        """What has arrived, waiting `seconds` for the first; b"" at the end. Raises BlockingIOError on silence, OSError."""
        if not readable(descriptor, seconds):
            raise BlockingIOError
        if not (data := os.read(descriptor, size)) and not ended(descriptor):
            raise BlockingIOError
        return data

    close = os.close
