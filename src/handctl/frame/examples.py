"""Examples of the commands: for their help and for the manual. Data, and where to find that of a family.

A family has its own in EXAMPLES of its module `page`. A verb that every device has gets those of USUAL beside them.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence

from handctl.families import FAMILIES

MOST = 3
"""Of one command, in its help; the manual has all."""

Examples = Sequence[tuple[str, str]]

EXAMPLES: dict[str, Examples] = {
    "": (
        ("handctl exo status --fake", "The health of a simulated exoskeleton hand, without a device."),
        ("handctl ports", "The serial ports, and the programs that use them."),
        ("handctl barrett status -p /dev/ttyUSB0", "The health of a BarrettHand on a serial port."),
        ("handctl wrist status -p can:socketcan:can0", "The same for a wrist module on CAN."),
    ),
    "ports": (
        ("handctl ports", "Connected adapters, the programs that use them, and how to fix a port that cannot be opened."),
        ("handctl ports --json", "The same for a script."),
    ),
    "stop": (
        ("handctl stop -p /dev/ttyUSB0", "Stop a device that another handctl command is moving."),
        ("handctl stop -d left", "Stop a named device, even if another handctl command is using it."),
    ),
    "shell": (
        ("handctl shell -d left", "A prompt for one device: `status`, `get temperature`, `watch`."),
        ("handctl shell exo -p /dev/ttyUSB0", "The same for a port."),
    ),
    "batch": (
        ("handctl batch morning.txt -d left", "The lines of a file, on one device."),
        ("handctl batch --json --keep-going -p /dev/ttyUSB0", "The lines of stdin, with one row per line, for a script."),
        ("handctl batch setup.txt --dry-run -d left", "The bytes that the file's commands would send."),
    ),
    "scan": (
        ("handctl scan", "Search every free serial port."),
        ("handctl scan -p /dev/ttyUSB0 --ids 1-254", "Search one port for every id."),
        ("handctl scan -p tcp://192.168.0.20 --json", "Search for a device on the network, for a script."),
    ),
    "doctor": (
        ("handctl doctor", "Check this computer."),
        ("handctl doctor -p /dev/ttyUSB0", "Check this computer, the link, and the device on it."),
    ),
    "devices": (
        ("handctl devices list", "All named devices."),
        ("handctl devices show left", "One device, and the source of each value."),
        ("handctl devices add left exo -p /dev/ttyUSB0 --id 2", "Name a hand `left`."),
        ("handctl devices add left --from-scan found.json", "The same from the output of `handctl scan --json`."),
        ("handctl devices remove left", "Remove the name."),
    ),
    "trace": (
        ("handctl trace show run.txt", "A transcript, decoded line by line."),
        ("handctl trace show run.txt --only errors", "Only bad frames, refusals and missing replies."),
        ("handctl trace diff before.txt after.txt", "The differences in meaning between two transcripts."),
        ('handctl trace decode exo "EB 90 01 04 11 E8 03 01 02"', "One frame, explained."),
    ),
    "sim": (
        ("handctl sim exo --pty", "A simulated hand on a new pseudo terminal. Prints the link."),
        ("handctl sim wrist --slcan-tcp 127.0.0.1:0", "A wrist module behind an slcan adapter, for python-can."),
        ("handctl sim control hand.sock power-cycle", "Switch the simulator off and on."),
        ("handctl sim exo --pty --fault noise --every 5 --control hand.sock", "Junk around every fifth reply."),
        ("handctl sim wrist --pty --fault hot", "A wrist module that is too hot."),
        ("handctl sim barrett --pty --set found=monitor", "A BarrettHand without firmware, in its boot monitor."),
        ("handctl sim barrett --tcp 127.0.0.1:4001 --state hand.json", "A hand on a TCP port that keeps its memory."),
        ("handctl sim ekso --pty", "A DataPort on a new pseudo terminal."),
        ("handctl sim ekso --pty --set posture=sitting", "The wearer sits."),
        ("handctl sim aidin --tcp 127.0.0.1:8000", "An AIDIN-hand at its usual port number."),
        ("handctl sim aidin --tcp 127.0.0.1:0 --set exchange=poll", "A hand that sends feedback only when asked."),
        ("handctl sim bus bus.toml --pty", "All devices of the file on a new pseudo terminal."),
        ("handctl sim bus bus.toml --tcp 127.0.0.1:0", "The same for several clients on a TCP port."),
        ("handctl sim control hand.sock help", "The commands of that simulator."),
        ("handctl sim forget", "Reset every simulated device."),
        ("handctl sim forget exo", "Reset only the simulated exoskeleton hand."),
    ),
    "help": (
        ("handctl help", "All topics."),
        ("handctl help options", "The common options."),
        ("handctl help exo status", "The same as `handctl exo status -h`."),
    ),
    "completion": (
        ("handctl completion bash --install", "Install it for your user. Prints the next step."),
        ("handctl completion zsh -o _handctl", "Write it to a file."),
    ),
}  # fmt: skip
"""Top-level command -> command line, what it shows. "" is handctl itself."""

USUAL: Examples = (
    ("handctl {0} status --fake", "The health of a simulated device."),
    ("handctl {0} status --check -d left", "Exit with code 7 if anything is unhealthy."),
    ("handctl {0} dump --fake", "Every value that can be read."),
    ("handctl {0} dump --fake --json", "The same for a script."),
    ("handctl {0} describe", "All quantities, without a device."),
    ("handctl {0} describe --csv -o quantities.csv", "The same for a spreadsheet."),
    ("handctl {0} watch --count 3 --fake", "Three samples."),
    ("handctl {0} watch --duration 60 --csv -o curve.csv -d left", "Record one minute to a file."),
    ("handctl {0} log {0}.csv --count 5 --fake", "Record five rows to a file, with a sidecar that describes them."),
    ("handctl {0} log {0}.csv --duration 60 --rate 20 -d left", "One minute, 20 rows a second."),
    ("handctl {0} scan --fake", "The result of a scan, here of the simulated device."),
    ("handctl {0} stop -d left", "Stop at once, even while another handctl command is using the device."),
    ("handctl {0} stop -n --fake", "The bytes that would be sent."),
    ("handctl {0} report {0}.html --fake", "One page for a service ticket."),
    ("handctl {0} doctor -d left", "Check this computer, the link and the device."),
    ("handctl {0} snapshot {0}-before.json --fake", "Save all settings to a file."),
    ("handctl {0} diff {0}-before.json -d left", "The changes since then."),
    ("handctl {0} diff {0}-before.json {0}-after.json", "The differences between two files, without a device."),
    ("handctl {0} restore {0}-before.json --dry-run -d left", "The bytes that would be sent."),
    ("handctl {0} restore {0}-before.json -d left", "Write the settings that differ, and read them back."),
)


def examples_of(path: Sequence[str]) -> Examples:
    """Of one command that does something, by all its words; of a group those of all its commands; () is handctl itself."""
    if not path:
        return EXAMPLES[""]
    return [(line, text) for line, text in _known(path[0]) if line.split()[1 : 1 + len(path)] == list(path)]


def _known(name: str) -> Examples:
    """All of a top-level command: a family's own, from its module `page`, then those that its verbs share with others."""
    if name not in FAMILIES:
        return EXAMPLES.get(name, ())
    from importlib.util import find_spec

    where = FAMILIES[name].module("page")
    own: Examples = getattr(importlib.import_module(where), "EXAMPLES", ()) if find_spec(where) else ()
    return [*own, *((line.format(name), text) for line, text in USUAL)]
