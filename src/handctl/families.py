"""Command name -> (module, one-line help). Data only; imports nothing.

The root group lists its commands from here, so that neither help nor completion imports a device family.
Each module has a click command named `cli`.
"""

FAMILIES: dict[str, tuple[str, str]] = {
    "exo": ("handctl.devices.inspire.exo.cli", "Inspire EH55BF1 exoskeleton hand (RS-232, Bluetooth serial)"),
    "wrist": ("handctl.devices.inspire.wrist.cli", "Inspire wrist module of the dexterous hand (RS-232, RS-485, CAN)"),
    "barrett": ("handctl.devices.barrett.cli", "BarrettHand BH8 series (RS-232)"),
    "ekso": ("handctl.devices.ekso.cli", "EksoNR DataPort (serial over USB)"),
    "aidin": ("handctl.devices.aidin.cli", "AIDIN-hand (TCP, JSON)"),
}

TOOLS: dict[str, tuple[str, str]] = {
    "stop": ("handctl.tools.stop", "stop a device at once, even while another handctl uses it"),
    "ports": (
        "handctl.tools.ports",
        "serial ports and CAN interfaces: what they are, who holds them, what to do about it",
    ),
    "scan": ("handctl.tools.scan", "which device answers on a port: family, speed, id; read-only"),
    "doctor": ("handctl.tools.doctor", "checks of this machine and of one link, each with its remedy"),
    "devices": ("handctl.tools.devices", "named devices in the configuration file: list, add, remove, show"),
    "sim": ("handctl.sim.cli", "a simulated device as a server for any client: pty, TCP, slcan"),
    "trace": ("handctl.tools.trace", "show, decode, diff recorded transcripts, without a device"),
    "completion": ("handctl.tools.completion", "print or install the shell completion: bash, zsh, fish"),
}

EXPLAINERS: dict[str, str] = {
    "exo": "handctl.devices.inspire.explain:exo",
    "wrist": "handctl.devices.inspire.explain:wrist",
    "aidin": "handctl.devices.aidin.explain:aidin",
    "barrett": "handctl.devices.barrett.explain:barrett",
    "ekso": "handctl.devices.ekso.explain:ekso",
}
"""Family -> module:function that makes its explainer of recorded bytes."""

WRITES: dict[str, str] = {
    "exo": "handctl.devices.inspire.writes:exo",
    "wrist": "handctl.devices.inspire.writes:wrist",
    "aidin": "handctl.devices.aidin.writes:aidin",
    "barrett": "handctl.devices.barrett.writes:barrett",
    "ekso": "handctl.devices.ekso.writes:ekso",
}
"""Family -> module:function that tells which of its bytes write and what acknowledges them (`ledger.WriteWords`)."""

SECTIONS: dict[str, str] = {"barrett": "handctl.devices.barrett.gcl.connecting:section"}
"""Family -> module:function that gives a section of its manual page: title, paragraphs, and (term, text, lines) items."""

FAMILY_KEYS: dict[str, tuple[str, ...]] = {"aidin": ("exchange", "poll_json", "tx_terminator")}
"""Family -> options of its own that a named device may hold in the configuration file."""

COMMANDS: dict[str, tuple[str, str]] = {**FAMILIES, **TOOLS}

PROBES: dict[str, str] = {
    "ekso": "handctl.devices.ekso.probe",
    "wrist": "handctl.devices.inspire.wrist.probe",
    "exo": "handctl.devices.inspire.exo.probe",
    "barrett": "handctl.devices.barrett.probe",
    "aidin": "handctl.devices.aidin.probe",
}
"""Family -> module that looks for its device and pings it; what it offers stands in `tools.probes`."""

STOPPERS: dict[str, str] = {
    "exo": "handctl.devices.inspire.exo.stopper",
    "wrist": "handctl.devices.inspire.wrist.stopper",
    "barrett": "handctl.devices.barrett.stopper",
    "ekso": "handctl.devices.ekso.stopper",
    "aidin": "handctl.devices.aidin.stopper",
}
"""Family -> module that knows the bytes of its stop; what it offers stands in `stopping`."""

SIGNS: dict[str, str] = {
    "barrett": "handctl.devices.barrett.gcl.language:sign",
    "aidin": "handctl.devices.aidin.messages:sign",
    "ekso": "handctl.devices.ekso.frames:sign",
    "exo": "handctl.devices.inspire.eb90:sign",
    "wrist": "handctl.devices.inspire.eb90:sign",
}
"""Family -> module:function that says what in bytes that came shows its protocol, "" = nothing."""

TRIGGERS: dict[str, tuple[int, bytes]] = {"barrett": (38400, b"\x03\r\xff")}
"""Family -> fastest speed at which its device listens, and the bytes on which it acts wherever they stand.

^C ends a movement, CR carries out a line, FF makes the boot monitor take what follows for firmware (barrett §1, §8).
"""
