"""What a man page says beyond the command tree: links, output, files, examples. Data only.

A page is looked up by its top-level command, "" is handctl(1). A command without examples of its own gets those of
USUAL that it has the verbs for.
"""

from __future__ import annotations

LINKS = (
    ("/dev/ttyUSB0, COM3", "A serial port, opened exclusively. Any URL of pyserial will do too."),
    ("usb:VID:PID[:SERIAL]", "The serial port of that USB device and no other."),
    ("tcp://HOST:PORT", "Bytes over TCP."),
    (
        "can:INTERFACE:CHANNEL[?bitrate=N]",
        "Any python-can interface, such as `can:socketcan:can0` or `can:slcan:/dev/ttyACM0`.",
    ),
    (
        "fake://DEVICE[?KEY=VALUE&...]",
        "The simulator in this process; `--fake` is short for it. The keys are those of handctl-sim(1).",
    ),
    ("replay:FILE", "A transcript that `--trace` recorded plays the device."),
)

OUTPUT = (
    "Standard output carries data only, everything else goes to standard error. A table is drawn on a terminal; on a "
    "pipe the same columns are aligned. `--format plain` gives bare values, one row a line, separated by tabs.",
    "`--json` gives one object, also when the command fails: the rows, the messages, the exit code and the counters of "
    "the line. For a stream it is one row a line, and the last line is the object without rows under the key `end`. "
    "JSON is always UTF-8 and holds every character as it came.",
    "Everywhere else a control character, a bidi mark or a byte that is not UTF-8 is spelled out, such as `\\x1b` for "
    "Escape: what a device says cannot act on the terminal. Where standard output or standard error cannot show a "
    "character, a substitute stands for it: `deg C`, `...`, `sec.`, `#` for a bar, otherwise its number. In CSV "
    "`--no-formulas` puts ' before a text that begins with = + - or @ and is not a number.",
)

SAFETY = (
    "Reading is the default. What moves a device that may be worn, or changes it for good, asks first; without a "
    "terminal it needs `--yes`. `--dry-run` prints the exact bytes and sends nothing. A value outside the documented "
    "range is refused, never clamped. Writes are read back and never repeated. Ctrl-C stops a movement as far as the "
    "device's protocol can.",
    "A command that drives a device is guarded by a second process, which holds the link. When handctl is killed, that "
    "process sends the device's stop three times. Nothing can help where everything is killed at once: a container or a "
    "service that ends, the machine, its power. On Windows, and on CAN adapters behind a vendor's library, there is no "
    "second process, and a warning says so. A command that is only suspended is not dead: send `stop`.",
)

FILES: dict[str, tuple[tuple[str, str], ...]] = {
    "devices": (
        (
            "$XDG_CONFIG_HOME/handctl/config.toml",
            "Options by their long names, with _ for -, and the named devices; by default below ~/.config.",
        ),
    ),
    "exo": (("exo-before-reset.json", "The snapshot that `factory-reset` writes first, here unless `--backup` says."),),
    "barrett": (
        ("$XDG_STATE_HOME/handctl/barrett-saves.json", "The count of EEPROM saves; by default below ~/.local/state."),
        ("$XDG_STATE_HOME/handctl/barrett-greasing.json", "The greasings that `maintenance --greased` recorded."),
        ("$XDG_STATE_HOME/handctl/barrett-speeds.json", "The speed at which each port's hand was found last."),
        ("$XDG_STATE_HOME/handctl/gcl-history", "The lines typed at the prompt of `gcl`."),
    ),
    "ekso": (
        ("$XDG_STATE_HOME/handctl/ekso-audit.jsonl", "Who changed which setting; by default below ~/.local/state."),
    ),
    "completion": (
        ("$XDG_DATA_HOME/bash-completion/completions/handctl", "Installed for bash; by default below ~/.local/share."),
        ("$XDG_DATA_HOME/zsh/site-functions/_handctl", "Installed for zsh; by default below ~/.local/share."),
        ("$XDG_CONFIG_HOME/fish/completions/handctl.fish", "Installed for fish; by default below ~/.config."),
    ),
}

EXAMPLES: dict[str, tuple[tuple[str, str], ...]] = {
    "": (
        ("handctl exo dump --fake", "Everything that a simulated exoskeleton hand tells; needs no device."),
        ("handctl exo status -p /dev/ttyUSB0", "What to look at first, decoded."),
        ("handctl wrist status -p can:socketcan:can0", "The same for a wrist module on CAN."),
        ("handctl barrett status -p usb:0403:6001 --json", "The same for a BarrettHand, for a script."),
    ),
    "exo": (
        ("handctl exo scan -p /dev/ttyUSB0", "Which id answers at which speed."),
        ("handctl exo status --check --fake", "Exit status 7 when anything is unhealthy."),
        ("handctl exo get system_voltage --fake --format plain", "A bare number for a script."),
        ("handctl exo watch temperature --rate 20 --count 5 --fake --csv", "Five samples as CSV."),
        ("handctl exo snapshot before.json --fake", "All settings into a file, to compare and to restore."),
        ("handctl exo diff before.json --fake", "What has changed since."),
        ("handctl exo set position_set.index=300 -n --fake", "The bytes that would be sent."),
        ("handctl exo position 1000 1000 1000 1000 1000 --wait 5 -p /dev/ttyUSB0", "Open the hand; asks first."),
        ("handctl exo force 0 0 0 0 0 --yes -p /dev/ttyUSB0", "Release it, from a script."),
    ),
    "wrist": (
        ("handctl wrist scan -p can:socketcan:can0", "Which id answers on a CAN bus."),
        ("handctl wrist status --fake --can", "The simulated module on its CAN wire."),
        ("handctl wrist move --pitch -10 --yaw 10 --time 1000 --fake", "Move to angles in degrees and wait."),
        ("handctl wrist center -p /dev/ttyUSB0", "Both axes to 0."),
        (
            'handctl wrist raw -n "EB 90 01 04 30 FC 03 02 36"',
            "What a frame from the manual really does; sends nothing.",
        ),
    ),
    "barrett": (
        ("handctl barrett status -p /dev/ttyUSB0", "Finds the speed by itself."),
        ("handctl barrett init --fake", "Initialize the motors; the fingers open fully."),
        ("handctl barrett close --motors G -p /dev/ttyUSB0", "Close the fingers; Ctrl-C stops them."),
        ("handctl barrett get SG.F1 temperature --fake", "By mnemonic or by name."),
        ("handctl barrett set MCV=80 --motors 12 --fake", "The closing velocity of two fingers, in RAM."),
        ('handctl barrett gcl "FGET P S" "PGET TEMP" --fake', "Any GCL."),
        ("handctl barrett errors 12", "What a status code means; needs no device."),
        ("handctl barrett firmware check hand.s19", "Whether a firmware file is whole; needs no device."),
    ),
    "aidin": (
        ("handctl aidin status -p tcp://192.168.0.20", "Port 8000 when none is given."),
        ("handctl aidin status --fake --json", "The simulated hand, for a script."),
        ("handctl aidin get joint_pos --fake", "The angles of all joints."),
        ("handctl aidin joints index.q3=160 -n --fake", "What would be sent: the others stay where they are."),
        ("handctl aidin stop -p tcp://192.168.0.20", "Stop all motors."),
        ("handctl aidin watch --count 3 --fake --csv", "Three samples as CSV."),
    ),
    "ekso": (
        ("handctl ekso status --fake", "The simulated DataPort."),
        ("handctl ekso status -p /dev/ttyACM0 --json", "What to look at first, for a script."),
        ("handctl ekso dump --fake", "Everything it tells."),
        ("handctl ekso log gait.csv --duration 60 -p /dev/ttyACM0", "A minute of the data stream into a file."),
        ("handctl ekso export gait.csv --format mot -o gait.mot", "The same as a motion file of OpenSim."),
    ),
    "ports": (
        ("handctl ports", "What is plugged in, who holds it, and what to do where it cannot be opened."),
        ("handctl ports --json", "The same for a script."),
    ),
    "stop": (
        ("handctl stop -p /dev/ttyUSB0", "Stop what another handctl moves there."),
        ("handctl stop -d left", "Stop a device by its name, whoever has it."),
    ),
    "scan": (("handctl scan -p /dev/ttyUSB0", "Which device answers there; only reads."),),
    "doctor": (("handctl doctor -p /dev/ttyUSB0", "Checks of this machine and of that link."),),
    "devices": (
        ("handctl devices list", "The devices that have a name."),
        ("handctl devices show left", "One of them, and where each value comes from."),
    ),
    "trace": (("handctl trace show run.txt", "A transcript, decoded line by line."),),
    "sim": (
        ("handctl sim exo --pty", "A simulated hand on a new pseudo terminal; the link is printed."),
        ("handctl sim wrist --slcan-tcp 127.0.0.1:0", "A wrist module behind an slcan adapter, for python-can."),
        ("handctl sim exo --pty --fault noise --every 5 --control hand.sock", "Every fifth answer comes with junk."),
        ("handctl sim control hand.sock power-cycle", "Switch it off and on."),
    ),
    "completion": (
        ("handctl completion bash --install", "For this user; says what to do next."),
        ("handctl completion zsh -o _handctl", "Into a file of your choice."),
    ),
}

USUAL: tuple[tuple[str, str], ...] = (
    ("handctl {} status --fake", "What to look at first, of a simulated device."),
    ("handctl {} status --check --fake", "Exit status 7 when anything is unhealthy."),
    ("handctl {} dump --fake --json", "Everything it tells, for a script."),
    ("handctl {} describe", "All its quantities; needs no device."),
    ("handctl {} watch --count 3 --fake", "Three samples."),
)
