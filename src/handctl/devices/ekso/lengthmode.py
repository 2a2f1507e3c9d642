"""Which length convention the requests of an EksoNR need: the manual does not say what the length byte counts (ekso §6)."""

from __future__ import annotations

from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.frames import LENGTH_MODES, Command
from handctl.errors import HandctlError, NoAnswer, ProtocolError, UsageError

ORDER = ("body", "frame", "n-2", "n-4")
REST = 0.5
"""Seconds of quiet behind an attempt that failed: a device that expects more bytes would swallow the next request."""


def find_mode(port: DataPort) -> str:
    """Try GetTime, a read, with every length convention until one is answered; the port keeps that one.

    Raises NoAnswer, ProtocolError of the first attempt when none is answered, or none before the port's bound.
    """
    failure: HandctlError | None = None
    for mode in ORDER:
        port.mode = mode
        try:
            port.exchange(Command.GET_TIME)
            return mode
        except (NoAnswer, ProtocolError) as exc:
            failure = failure or exc
        if port.over:
            break
        port.link.sleep(port.deadline(REST).remaining)
    port.mode = "body"
    assert failure is not None
    raise failure


def check_mode(text: str) -> str:
    """A length convention or "auto". Raises UsageError."""
    if text not in (*LENGTH_MODES, "auto"):
        raise UsageError(f"length convention {text!r} does not exist", hint=f"auto, {', '.join(LENGTH_MODES)}")
    return text
