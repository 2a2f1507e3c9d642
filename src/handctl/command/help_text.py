"""What `-h` shows besides what click does: the examples of each command, wrapped as wide as the terminal. Imported for help alone."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import click

from handctl.command.family import page_of
from handctl.command.options import words_of
from handctl.families import FAMILIES


def columns() -> int:
    """Width of the terminal, as shutil says: its import, with all its archives, would be a tenth of a help's time."""
    try:
        return int(os.environ["COLUMNS"]) or 80
    except (KeyError, ValueError):
        pass
    try:
        assert sys.__stdout__ is not None
        return os.get_terminal_size(sys.__stdout__.fileno()).columns or 80
    except (AssertionError, AttributeError, ValueError, OSError):
        return 80


def write_examples(ctx: click.Context, formatter: click.HelpFormatter) -> None:
    """Two or three command lines with what they show."""
    if examples := examples_of(words_of(ctx))[:MOST_SHOWN]:
        with formatter.section("Examples"):
            for line, text in examples:
                formatter.write(f"  {line}\n")
                wrapped(formatter, text.replace("`", ""), "      ")


def wrapped(formatter: click.HelpFormatter, text: str, first: str, later: str | None = None) -> None:
    """A text with each option in one piece: click would break at hyphens."""
    later = first if later is None else later
    import textwrap

    lines = textwrap.wrap(text, formatter.width, initial_indent=first, subsequent_indent=later, break_on_hyphens=False)
    formatter.write("\n".join(lines) + "\n")


# -- examples -------------------------------------------------------------------------------------------------------


MOST_SHOWN = 3
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
    "history": (
        ("handctl history --since yesterday", "What was written yesterday and today, the newest last."),
        ("handctl history exo --last 5", "The last five commands that wrote to an exoskeleton hand."),
        ("handctl history --json", "Every step with its bytes and its state, for a script."),
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
        ("handctl batch --json --keep-going -p /dev/ttyUSB0", "Run the commands from stdin, and print the results as JSON, one object per line."),
        ("handctl batch setup.txt --dry-run -d left", "The bytes that the file's commands would send."),
    ),
    "scan": (
        ("handctl scan", "Search every free serial port."),
        ("handctl scan -p /dev/ttyUSB0 --ids 1-254", "Search one port for every id."),
        ("handctl scan -p tcp://192.168.0.20 --json", "Search for a device on the network, for a script."),
    ),
    "prove": (
        ("handctl prove barrett --list --level move", "What can be found out, and how. Needs no device."),
        ("handctl prove barrett -p /dev/ttyUSB0 -o left.json", "Find it out by reading, and keep the facts."),
        ("handctl prove diff left.json right.json", "Compare two devices."),
    ),
    "doctor": (
        ("handctl doctor", "Check this computer."),
        ("handctl doctor -p /dev/ttyUSB0", "Check this computer, the link, and the device on it."),
    ),
    "service": (
        ("handctl service", "Find the device on a free port, check it, and write a report with the next step."),
        ("handctl service /dev/ttyUSB0 --complaint 'thumb does not close' --ticket 4711", "The same for one port."),
        ("handctl service -d left --resume service.html --against june.html", "Do the steps that are missing, and compare with an older report."),
        ("handctl service --demo exo", "Practise: find the fault of a simulated hand."),
    ),
    "top": (
        ("handctl top", "All named devices, live."),
        ("handctl top left --limit temperature=60 --duration 60 --csv", "Record one minute. The exit code is 7 if 60 °C was exceeded."),
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
    "twin": (
        ("handctl twin check run.txt --facts left.json", "How well the facts and the values of a recording describe its device."),
        ("handctl twin check later.txt --facts left.json --transcript run.txt", "How well a twin made from one recording predicts the replies in another."),
        ("handctl twin check run.txt --against 'fake://hand?model=df'", "The same for a simulator with options."),
    ),
    "plot": (
        ("handctl plot gait.csv -o gait.svg", "Plot a recording: one plot per quantity, one colour per finger."),
        ("handctl plot before.csv after.csv -o both.html", "Plot two recordings with the same axes, on a page for the browser."),
        ("handctl plot gait.csv --only temperature --open", "Plot one quantity and open it in the browser."),
        ("handctl plot gait.csv --json", "Print the lowest and highest values, for a script."),
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

SHARED: Examples = (
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
    ("handctl {0} log --check {0}.csv", "Check a recording, and show its breaks and clocks."),
    ("handctl {0} export {0}.csv --to xdf -o {0}.xdf", "Turn a recording into a file for other tools."),
    ("handctl {0} listen --duration 60 -d left", "Show what the device says by itself for one minute. Sends nothing."),
    (
        "handctl {0} listen --trace {0}-boot.txt -d left",
        "Start it before power-on, and keep the bytes. Ctrl-C ends it.",
    ),
    ("handctl {0} terminal --trace {0}-typed.txt -d left", "Type bytes or lines, see the replies, and keep both."),
    ("handctl {0} scan --fake", "The result of a scan, here of the simulated device."),
    ("handctl {0} stop -d left", "Send the stop, even while another handctl command is using the device."),
    ("handctl {0} stop -n --fake", "The bytes that would be sent."),
    ("handctl {0} report {0}.html --fake", "One page for a service ticket."),
    ("handctl {0} doctor -d left", "Check this computer, the link and the device."),
    ("handctl {0} snapshot {0}-before.json --fake", "Save the settings to a file."),
    ("handctl {0} diff {0}-before.json{1} -d left", "The changes since then."),
    ("handctl {0} diff {0}-before.json {0}-after.json{1}", "The differences between two files, without a device."),
    ("handctl {0} restore {0}-before.json{1} --dry-run -d left", "The bytes that would be sent."),
    ("handctl {0} restore {0}-before.json{1} -d left", "Write the values that differ, and read them back."),
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
    page = page_of(name)
    own: Examples = getattr(page, "EXAMPLES", ())
    return [*own, *((line.format(name, getattr(page, "SNAPSHOT_OPTION", "")), text) for line, text in SHARED)]
