"""README's troubleshooting table: what a message or symptom usually means, and the next step."""

from __future__ import annotations

from typing import NamedTuple


class Symptom(NamedTuple):
    """A row of README's table.

    key    its name in the tests
    said   words of the message, in backticks, or the symptom
    code   its exit code, None if it has none of its own
    cause  the usual cause
    step   the next step; commands in backticks, for the first family as an example
    """

    key: str
    said: str
    code: int | None
    cause: str
    step: str


SYMPTOMS = (
    Symptom("no-port", "`no such port`", 3, "The adapter is not plugged in, or has a different name.", "`handctl ports`"),
    Symptom("not-permitted", "`not permitted`", 3, "Your user is not in the group that may use the port.", "`handctl doctor -p /dev/ttyUSB0`"),
    Symptom("in-use", "`in use`", 3, "Another program has the port open.", "Find it with `handctl ports`, then close it"),
    Symptom("refused", "`connection refused`", 3, "The device, or the network adapter it is connected to, is off, or it already has another client.", "`handctl doctor -p tcp://192.168.0.10`"),
    Symptom("no-answer", "`no reply`", 4, "No power, a faulty cable, the wrong id or the wrong baud rate.", "`handctl scan --all -p /dev/ttyUSB0`"),
    Symptom("no-frame", "`instead of a valid frame`", 5, "The wrong baud rate, noise, or a different device.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("echo", "`only our own bytes`", 5, "An echo or a short circuit: no device replies.", "Check the wiring, then `handctl doctor -p /dev/ttyUSB0`"),
    Symptom("other-family", "`this is a wrist module`", 6, "The device belongs to a different family than the one you typed.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("not-initialized", "`Motor not initialized`", 6, "A BarrettHand must be initialized (HI) after power-on.", "`handctl barrett init -p /dev/ttyUSB0`"),
    Symptom("not-reached", "`not reached`", 7, "A finger is blocked, or an AIDIN-hand has not been homed since power-on.", "Free the finger, or home the hand: `handctl aidin home -p tcp://192.168.0.10`"),
    Symptom("hot", "`over_temperature` stays", None, "No command clears it. It goes away once the actuator has cooled down.", "Let it cool. `handctl exo clear-errors -p /dev/ttyUSB0` clears the other errors and shows any that remain"),
    Symptom("not-saved", "the old id or baud rate is back", None, "The new one has not been saved.", "Set it again, run `handctl exo save -p /dev/ttyUSB0` (add `--id` and the new id if you changed the id), then power-cycle the device"),
    Symptom("out-of-range", "`out of range`", 2, "The value is outside the documented range.", "Look up the range with `handctl exo describe`"),
    Symptom("not-confirmed", "not confirmed", 8, "The command moves or changes a device, and it was not confirmed.", "Run it with `--dry-run` (`-n`) to see the bytes, then with `--yes`"),
    Symptom("wrong-values", "the values look wrong", None, "Corrupted data, or a different device. A recording of the bytes shows which of the two it is.", "`handctl exo status -p /dev/ttyUSB0 --trace run.txt`, then `handctl trace show run.txt`"),
)  # fmt: skip
