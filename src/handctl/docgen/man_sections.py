"""Sections of the man pages that are not in the command tree: links, output, safety, files.

A page is looked up by its top-level command, "" is handctl(1). A family has its own files and examples in its module
`manpage`: FILES as here, EXAMPLES as in `command.help_text`, and `section() -> title, paragraphs, (term, text, lines) items` where
it has more to say; EXCEPTIONS are rows of (key of a promise, commands or options that it does not cover, what they do instead and why), see `promises`.
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
        "A simulator inside the handctl command itself, which starts afresh with each command. The keys are listed in handctl-sim(1). Plain `--fake` "
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
    "Many commands start a movement immediately, without asking. Others ask first, and without a terminal they need `--yes`: the "
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
