"""Texts of the pages that are not in the command tree: links, output, files, promises of every device.

A page is looked up by its top-level command, "" is handctl(1). A family has its own files and examples in its module
`page`: FILES as here, EXAMPLES as in `command.help_text`, and `section() -> title, paragraphs, (term, text, lines) items` where
it has more to say; EXCEPTIONS are rows of (key of a promise, commands or options that it does not cover, reason). The tables
of README and the guides are generated from here, and `tests/promises` checks each row of the promises for every family.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from handctl.command.family import page_of
from handctl.families import FAMILIES

LINKS = (
    ("/dev/ttyUSB0, COM3", "A serial port, opened exclusively. pyserial URLs work too."),
    ("usb:VID:PID[:SERIAL]", "The serial port of exactly that USB device."),
    ("tcp://HOST:PORT", "A TCP connection."),
    (
        "can:INTERFACE:CHANNEL[?bitrate=N]",
        "Any python-can interface, such as `can:socketcan:can0` or `can:slcan:/dev/ttyACM0`.",
    ),
    (
        "fake://DEVICE[?KEY=VALUE&...]",
        "The simulator in this process, which starts over each time. The keys are listed in handctl-sim(1). Plain `--fake` "
        "keeps the device's state until you log out.",
    ),
    ("replay:FILE", "A transcript recorded with `--trace`, replayed in place of the device."),
)

OUTPUT = (
    "Data goes to standard output, everything else to standard error. On a terminal the result is a table with lines; on a "
    "pipe the same columns are aligned with spaces. `--format plain` prints bare values separated by tabs, one row per line.",
    "`--json` prints one object, even if the command fails: the rows, the messages, the exit code and the counters of "
    "the line. A stream prints one row per line, then a last line with the object, without rows, under the key `end`. "
    "JSON is always UTF-8 and contains every character unchanged.",
    "In all other formats, control characters, bidi marks and bytes that are not UTF-8 are escaped, such as `\\x1b` for "
    "Escape, so a device cannot control your terminal. If standard output or standard error cannot show a character, handctl "
    "replaces it: `deg C`, `...`, `sec.`, `#` for a bar, otherwise its number. In CSV, `--no-formulas` puts ' before any "
    "text that begins with = + - or @ and is not a number.",
)

SAFETY = (
    "Many movements start at once, without asking. Other commands ask first, and without a terminal they need `--yes`: the "
    "table in handctl-safety(7) lists both. `--dry-run` prints the exact bytes and sends nothing. Values outside the "
    "documented range are refused, never clamped. Writes are read back and never retried. Ctrl-C stops a movement as far as "
    "the device's protocol allows.",
    "While a command drives a device, a second process keeps the link open. If handctl is killed, that process stops the "
    "device as `stop` does. It cannot help if everything dies at once: the container, the service, the computer, its "
    "power. For CAN adapters that use a vendor's library there is no second process, and handctl warns you. "
    "A command that is only suspended is still alive: run `stop`.",
)

FILES: dict[str, tuple[tuple[str, str], ...]] = {
    "devices": (
        (
            "$XDG_CONFIG_HOME/handctl/config.toml",
            "Options by their long names, with _ for -, and the named devices; by default in ~/.config, on Windows in %APPDATA%.",
        ),
    ),
    "shell": (("$XDG_STATE_HOME/handctl/shell-history", "The history of the prompt; by default in ~/.local/state."),),
    "sim": (
        (
            "$XDG_RUNTIME_DIR/handctl/sim-FAMILY.json",
            "The state of a device simulated with plain --fake; without that variable in /run/user or the temporary folder.",
        ),
    ),
    "completion": (
        ("$XDG_DATA_HOME/bash-completion/completions/handctl", "Installed for bash; by default in ~/.local/share."),
        ("$XDG_DATA_HOME/zsh/site-functions/_handctl", "Installed for zsh; by default in ~/.local/share."),
        ("$XDG_CONFIG_HOME/fish/completions/handctl.fish", "Installed for fish; by default in ~/.config."),
        ("%LOCALAPPDATA%\\handctl\\handctl.ps1", "Installed for PowerShell on Windows."),
    ),
}


# -- promises -----------------------------------------------------------------------------------------------------------


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
    Symptom("refused", "`connection refused`", 3, "The server is off, or another client is connected to the device.", "`handctl doctor -p tcp://192.168.0.10`"),
    Symptom("no-answer", "`no reply`", 4, "No power, a faulty cable, the wrong id or the wrong baud rate.", "`handctl scan --all -p /dev/ttyUSB0`"),
    Symptom("no-frame", "`instead of a valid frame`", 5, "The wrong baud rate, noise, or a different device.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("echo", "`only our own bytes`", 5, "An echo or a short circuit: no device replies.", "Check the wiring, then `handctl doctor -p /dev/ttyUSB0`"),
    Symptom("other-family", "`this is a wrist module`", 6, "The device belongs to a different family than the one you typed.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("not-initialized", "`Motor not initialized`", 6, "A BarrettHand must be initialized (HI) after power-on.", "`handctl barrett init -p /dev/ttyUSB0`"),
    Symptom("not-reached", "`not reached`", 7, "A finger is blocked, or an AIDIN-hand has not been homed since power-on.", "Free the finger, or home the hand: `handctl aidin home -p tcp://192.168.0.10`"),
    Symptom("hot", "`over_temperature` stays", None, "No command clears it. It goes away once the actuator has cooled down.", "Let it cool. `handctl exo clear-errors -p /dev/ttyUSB0` clears all other errors and shows which remain"),
    Symptom("not-saved", "the old id or baud rate is back", None, "The new one has not been saved.", "Set it again, run `handctl exo save -p /dev/ttyUSB0` (with `--id` and the new id, if you changed that), then power-cycle the device"),
    Symptom("out-of-range", "`out of range`", 2, "The value is outside the documented range.", "Look up the range with `handctl exo describe`"),
    Symptom("not-confirmed", "not confirmed", 8, "The command moves or changes a device, and it was not confirmed.", "Run it with `--dry-run` (`-n`) to see the bytes, then with `--yes`"),
    Symptom("wrong-values", "the values look wrong", None, "Corrupted data, or a different device. A recording of the bytes shows which of the two it is.", "`handctl exo status --trace run.txt`, then `handctl trace show run.txt`"),
)  # fmt: skip


class Verb(NamedTuple):
    """A command that every device has: its name, its usage, and its effect."""

    name: str
    typed: str
    does: str


VERBS = (
    Verb("status", "status [--check]", "Shows a decoded health summary. With `--check`, the exit code is 7 if something is wrong."),
    Verb("dump", "dump", "Shows every documented quantity that can be read."),
    Verb("get", "get NAME...", "Shows quantities by name. `NAME.ELEMENT` selects one element."),
    Verb("set", "set NAME=VALUE...", "Writes quantities and reads them back. Everything that can be set can be read with `get`."),
    Verb("describe", "describe [NAME...]", "Lists the address, type, unit, range and access of each quantity. It needs no device."),
    Verb("watch", "watch [NAME...]", "Shows a live view on a terminal, and a stream elsewhere. `--count` and `--duration` limit it."),
    Verb("log", "log FILE", "Records samples with the time of this computer, and marks every gap."),
    Verb("scan", "scan", "Runs `handctl scan` for this family only. It tries each id (1 to 254) and baud rate that the family can have, within a time limit if the line is silent. `--all` has no time limit."),
    Verb("doctor", "doctor", "Runs `handctl doctor` for this family: checks this computer, the link, and the device."),
    Verb("snapshot", "snapshot FILE", "Saves the settings to a file, and for `exo` and `wrist` the set points too."),
    Verb("diff", "diff A [B]", "Compares two snapshots, a snapshot and the device, or two devices. The exit code is 7 if they differ."),
    Verb("restore", "restore FILE", "Writes the settings that differ from a snapshot, and reads them back."),
    Verb("report", "report FILE", "Writes one page for a service ticket."),
    Verb("stop", "stop", "Sends the stop at once, without asking. A BarrettHand or an AIDIN-hand loses its motor power, an RH56 hand moves a little further, and an EksoNR may not stop at all: see handctl-safety(7)."),
)  # fmt: skip

WORDS = {
    "verb": "has the command",
    "option": "accepts the option",
    "arrival": "fails with exit code 7 if the target is not reached",
    "expect": "accepts --expect",
    "leave-alone": "accepts -1 to leave a finger alone",
    "settings": "compares and restores settings",
    "model": "shows its model in JSON",
    **{row.key: f"README's troubleshooting: {row.said}" for row in SYMPTOMS},
}
"""Key of a promise -> its text in the table of exceptions."""


class Exempt(NamedTuple):
    """An exception from a promise: the family, the commands or options, and the reason."""

    family: str
    promise: str
    where: str
    why: str


def exceptions(family: str = "") -> Iterator[Exempt]:
    """The exceptions of one family, or of all."""
    for name in [family] if family else FAMILIES:
        for promise, where, why in getattr(page_of(name), "EXCEPTIONS", ()):
            yield Exempt(name, promise, where, why)
