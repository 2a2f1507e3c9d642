"""What looks like harm and is none, or cannot be avoided: the contract's exceptions, each with the cells that it covers.

A cell that an excuse covers must need it: where bytes were sent and nothing changed, it fails, and the excuse is to be
narrowed or taken out. Which cells are covered depends on the device and the command line alone, never on what happened.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from tests.harm.lines import Line
from tests.harm.states import State


class Excuse(NamedTuple):
    """why      the sentence of the table
    grants   whether it covers a line on a device in a state
    fits     whether that is all that happened: (what changed, what was said)
    """

    why: str
    grants: Callable[[State, Line], bool]
    fits: Callable[[list[str], str], bool] = lambda _changed, _text: True


def _no_velocity(changed: list[str], _text: str) -> bool:
    return not any("hand.motors" in place and ".drive." in place for place in changed)


def _own(state: State, line: Line) -> bool:
    """A line of the device's own family that looks for it at all speeds, or at its own."""
    own_speed = state.options.get("baud", "9600")
    return line.family == state.owner and ("--baud" not in line.words or own_speed in line.words)


def _scans_ids(state: State, line: Line) -> bool:
    if line.words[1:] != ("scan", "--ids", "1-8") or state.name.partition(",")[0] != "closing":
        return False
    speed = state.options.get("baud", "9600")
    return state.wire == "tcp" or (line.family in ("exo", "hand") and speed in ("19200", "38400"))


def _too_fast(state: State, line: Line) -> bool:
    """921600 bit/s, typed or by a scan, towards a boot monitor that waits."""
    waits = state.owner == "barrett" and state.wire == "serial" and state.name.startswith(("booting", "blank"))
    return waits and line.family == "hand" and ("921600" in line.words or line.words[1:] == ("scan", "--ids", "1-8"))


EXCUSES = (
    Excuse(
        "in a control block that somebody left half sent, bytes at a wrong speed, which was typed, are velocities",
        lambda state, line: state.in_block and not _own(state, line),
    ),
    Excuse(
        "a reading command of the hand met LOOP and ended it, which it says: no byte is harmless there",
        lambda state, line: state.looping and _own(state, line),
        lambda _changed, text: "LOOP" in text or "RealTime" in text,
    ),
    Excuse(
        "whoever sends a byte to a hand in LOOP ends it, a stop or a scan too: each byte that is no header of a control "
        "block does, and none can be sent that asks first; the velocities stay as they were",
        lambda state, _line: state.looping,
        _no_velocity,
    ),
    Excuse(
        "exo stop without an answer sends forces 0 all the same, and at 115200 a hand at 38400 hears ^C in its zeros: it stops",
        lambda state, line: (
            line.path == ("exo", "stop") and (state.device, state.name) == ("BarrettHand", "closing, 38400")
        ),
        lambda changed, _text: changed[0].startswith("_hear: '_hear_movement' -> '_hear_line'"),
    ),
    Excuse(
        "a scan was told to ask an id whose own number is ^C, 3, or which a hand at 38400 hears as that: id 4 at 57600",
        _scans_ids,
        lambda changed, _text: changed[0].startswith("_hear: '_hear_movement' -> '_hear_line'"),
    ),
    Excuse(
        "a hand was looked for at 921600 bit/s: a frame of any bytes is shorter there than a bit of 9600, and a boot monitor "
        "takes it for its trigger; `handctl scan` asks for the monitor first",
        _too_fast,
        lambda changed, _text: all(place.startswith(("monitor.", "_")) for place in changed),
    ),
)
"""In the order in which they are asked: the first that covers a cell is the one that it must need."""
