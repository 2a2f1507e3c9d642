"""What a man page says beyond the command tree: links, output, files. Data only.

A page is looked up by its top-level command, "" is handctl(1). A family has its own files and examples in its module
`page`: FILES as here, EXAMPLES as in `frame.examples`, and `section() -> title, paragraphs, (term, text, lines) items` where
it has more to say.
"""

from __future__ import annotations

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
    ("replay:FILE", "A transcript recorded with `--trace` plays the device."),
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
            "Options by their long names, with _ for -, and the named devices; by default below ~/.config, on Windows below %APPDATA%.",
        ),
    ),
    "shell": (
        ("$XDG_STATE_HOME/handctl/shell-history", "The lines typed at the prompt; by default below ~/.local/state."),
    ),
    "sim": (
        (
            "$XDG_RUNTIME_DIR/handctl/sim-FAMILY.json",
            "What plain --fake keeps of a simulated device; without that variable below /run/user or the temporary folder.",
        ),
    ),
    "completion": (
        ("$XDG_DATA_HOME/bash-completion/completions/handctl", "Installed for bash; by default below ~/.local/share."),
        ("$XDG_DATA_HOME/zsh/site-functions/_handctl", "Installed for zsh; by default below ~/.local/share."),
        ("$XDG_CONFIG_HOME/fish/completions/handctl.fish", "Installed for fish; by default below ~/.config."),
        ("%LOCALAPPDATA%\\handctl\\handctl.ps1", "Installed for PowerShell on Windows."),
    ),
}
