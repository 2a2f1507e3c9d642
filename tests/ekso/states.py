"""The states in which a command may meet an EksoNR."""

from __future__ import annotations

from collections.abc import Iterator

from tests.harm.states import State


def states() -> Iterator[State]:
    for posture in ("sitting", "standing", "walking", "held"):
        yield State("EksoNR", posture, "ekso", "ekso", {"posture": posture, "sway": "0"})
    for posture in ("standing", "walking"):
        yield State("EksoNR", f"{posture}, USB", "ekso", "ekso", {"posture": posture, "sway": "0", "usb": "1"})
        yield State("EksoNR", posture, "ekso", "ekso", {"posture": posture, "sway": "0"}, wire="tcp")
    yield State("EksoNR", "standing, 9600", "ekso", "ekso", {"posture": "standing", "sway": "0", "baud": "9600"})
