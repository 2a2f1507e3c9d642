"""The table of device families and tools, so that nothing has to be loaded to list them. Imports `light` alone.

The root group lists its commands from here, so that neither help nor completion imports a device family. This is the only
place outside of a family's own folder and its simulator's that names it.
"""

from __future__ import annotations

from handctl.fast_classes import fast_dataclass, field


@fast_dataclass(eq=False)
class OwnOption:
    """An option that one family has: --NAME and HANDCTL_NAME; `settings.own` holds its value as NAME with _ for -.

    name     without the dashes in front
    help     its line of help
    metavar  what it takes, "" = nothing but the choices, or it is a flag
    choices  the words that it takes, () = any
    flag     it takes no value
    named    a named device may hold it in the configuration file
    implied  a flag that is set for every command that writes
    asked    only the commands that ask for it have it, among their own options (`command.options.FamilyOption`), and no key in the
             configuration file; else it is accepted at every level, as --port is
    """

    name: str
    help: str
    metavar: str = ""
    choices: tuple[str, ...] = ()
    flag: bool = False
    named: bool = False
    implied: bool = False
    asked: bool = False

    @property
    def key(self) -> str:
        """Its key in the settings."""
        return self.name.replace("-", "_")


@fast_dataclass(eq=False)
class FamilyRow:
    """One family: its help line, its modules, its place in a scan, its options.

    help      one line for the root's help, without a full stop
    package   its folder. What the machinery asks for lies there in a module named after the role, with that name in it:
                cli      `cli`: the command group, with its `command.family.Family`
                probe    `tools.family_probe.FamilyProbe`: looks for its device and pings it
                stopper  `stop_steps`: the bytes of its stop, see `model.stop_sequence`
                explain  `explainer`: makes a `model.explainer.Explainer` of recorded bytes
                write_rules  in `explain`, `words`: makes the `model.write_ledger.WriteRules` that tell which of its bytes write, and
                         what acknowledges them
                remedies  optional, `REMEDIES`: what a finding means and what to do, see `model.device_picture`
                outline  optional, in `remedies`, `OUTLINE`: its fingers or joints in their place, see `model.device_picture`
                page     optional, see `docgen.man_pages`: EXAMPLES, FILES and `section` of its manual page
    codec     module of its frame, which has the manual's name; `sign` in it says what in bytes that came shows its
              protocol, "" = nothing
    beside    the family that may be behind the same link as well, "" = none
    tcp_port  port of its device's server, for tcp://HOST without one; None = the port must be given
    scan      its turn in `handctl scan`, the lowest first: what could disturb others comes late
    tell      its turn when recorded bytes tell whose they are: who takes more for his own comes later
    options   those that only this family has
    facts     fact of its `proofs` -> the setting that it stands for, and what each value of the fact makes of that ("" = nothing);
              of words alone each is the value of the setting, too
    silent    its device may reply to nothing while it moves, or to its stop alone: no question finds it then
    unbroken  its command that no stop may interrupt, because the bytes of the stop would do harm; "" = none
    trigger   fastest speed in bit/s at which its device listens, and the bytes on which it acts wherever they stand
    """

    help: str
    package: str
    codec: str
    tcp_port: int | None = None
    beside: str = ""
    scan: int = 100
    tell: int = 100
    options: tuple[OwnOption, ...] = ()
    facts: dict[str, tuple[str, dict[str, str] | tuple[str, ...]]] = field(default_factory=dict)
    silent: bool = False
    unbroken: str = ""
    trigger: tuple[int, bytes] | None = None

    def module(self, role: str) -> str:
        """Where the module of a role is."""
        return f"{self.package}.{_WITHIN.get(role, role)}"


_WITHIN = {"write_rules": "explain_bytes", "outline": "remedies"}
"""Role -> the role in whose module it lies."""


_GAPS: dict[str, tuple[str, dict[str, str] | tuple[str, ...]]] = {
    "reads-across-gaps": ("across_gaps", {"answered": "yes", "silent": "no", "refused": "no"})
}


FAMILIES: dict[str, FamilyRow] = {
    "exo": FamilyRow(
        "Inspire EH55BF1 exoskeleton hand (RS-232, Bluetooth serial)",
        "handctl.devices.inspire.exo",
        codec="handctl.devices.inspire.eb90",
        scan=3,
        tell=1,
        facts=_GAPS,
    ),
    "wrist": FamilyRow(
        "Inspire wrist module for dexterous hands (RS-232, RS-485, CAN)",
        "handctl.devices.inspire.wrist",
        codec="handctl.devices.inspire.eb90",
        beside="hand",
        scan=2,
        tell=2,
        facts=_GAPS,
    ),
    "barrett": FamilyRow(
        "BarrettHand BH8 series (RS-232)",
        "handctl.devices.barrett",
        codec="handctl.devices.barrett.gcl.codec",
        scan=4,
        tell=4,
        silent=True,  # only ^C ends a movement early (§5.5)
        unbroken="firmware download",  # half a firmware is none, and the boot monitor would take a stop for firmware
        facts=dict.fromkeys(
            ("position-sign", "position-at-stop"), ("position_sign", ("signed", "unsigned", "clamped"))
        ),
        options=(
            OwnOption(
                "interrupt",
                "Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.",
                flag=True,
                implied=True,
            ),
        ),
        # ^C ends a movement, CR carries out a line, FF makes the boot monitor take what follows for firmware (§1, §8).
        trigger=(38400, b"\x03\r\xff"),
    ),
    "ekso": FamilyRow(
        "EksoNR DataPort (serial over USB)",
        "handctl.devices.ekso",
        codec="handctl.devices.ekso.frames",
        scan=1,
        tell=5,
        facts={"length-convention": ("length_mode", ("body", "n-4", "n-2", "frame"))},
        options=(
            OwnOption("operator", "Your name, for the audit log. Required with --yes.", metavar="NAME", asked=True),
            OwnOption(
                "length-mode",
                "Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.",
                metavar="MODE",
                asked=True,
            ),
        ),
    ),
    "aidin": FamilyRow(
        "AIDIN-hand (TCP, JSON)",
        "handctl.devices.aidin",
        codec="handctl.devices.aidin.json_codec",
        tcp_port=8000,
        scan=5,
        tell=3,
        silent=True,  # one that speaks only when it is commanded, see `exchange`
        facts={
            "exchange": ("exchange", ("stream", "poll")),
            "request-terminator": ("tx_terminator", ("newline", "none", "nul", "crlf")),
        },
        options=(
            OwnOption(
                "exchange",
                "When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.",
                choices=("auto", "stream", "poll", "command"),
                named=True,
            ),
            OwnOption(
                "poll-json",
                "The JSON object that requests feedback (default: {}). It must not be a command.",
                metavar="TEXT",
                named=True,
            ),
            OwnOption(
                "tx-terminator",
                "The terminator sent after each object (default: newline).",
                choices=("newline", "none", "nul", "crlf"),
                named=True,
            ),
        ),
    ),
    "hand": FamilyRow(
        "Inspire RH56 dexterous hands (RS-232, RS-485, CAN, Modbus RTU, Modbus TCP)",
        "handctl.devices.inspire.hand",
        codec="handctl.devices.inspire.eb90",
        tcp_port=6000,  # rh56 §2.3
        scan=6,
        tell=6,
        facts={
            **_GAPS,
            "generation": ("model", ("df", "tp", "f1", "dg2")),
            "protocol": ("protocol", {"eb90": "eb90", "modbus": "modbus", "both": ""}),
        },
        options=(
            OwnOption(
                "model",
                "Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.",
                metavar="MODEL",
                named=True,
            ),
            OwnOption(
                "side", "Left or right hand. The hand itself cannot report it.", choices=("left", "right"), named=True
            ),
            OwnOption(
                "protocol",
                "The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).",
                choices=("auto", "eb90", "modbus"),
                named=True,
            ),
        ),
    ),
}
"""Command name -> its row, in the order of the root's help."""

TOOLS: dict[str, dict[str, tuple[str, str]]] = {
    "Find and diagnose": {
        "ports": ("handctl.tools.ports", "list serial ports and CAN interfaces, and the programs that use them"),
        "scan": ("handctl.tools.scan", "detect the device on a port: family, baud rate, id"),
        "top": ("handctl.tools.top", "show all named devices live, those that need attention at the top"),
        "history": ("handctl.tools.history", "show what handctl wrote to devices earlier, and when"),
        "prove": ("handctl.tools.prove", "find out by experiment what the documents leave open about a device"),
        "doctor": ("handctl.tools.doctor", "check this computer and the link, with a remedy for each problem"),
        "service": (
            "handctl.tools.service",
            "guided service: find the device, check it, propose the next step, write a report",
        ),
    },
    "Stop and run commands": {
        "stop": ("handctl.tools.stop", "stop a device at once, even while another handctl command is using it"),
        "shell": ("handctl.tools.shell", "type commands at a prompt, on one open link"),
        "batch": ("handctl.tools.batch", "run many commands on one open link, from a script or stdin"),
    },
    "Set up": {
        "devices": ("handctl.tools.devices", "name devices in the configuration file: list, add, remove, show"),
        "completion": (
            "handctl.tools.completion",
            "print or install the shell completion: bash, zsh, fish, PowerShell",
        ),
    },
    "Work without a device": {
        "sim": ("handctl.tools.sim", "serve a simulated device to any client: pty, TCP, slcan"),
        "plot": ("handctl.tools.plot", "draw the curves of a recording as SVG or HTML"),
        "trace": ("handctl.tools.trace", "show, decode or compare recorded transcripts"),
        "twin": ("handctl.tools.twin", "compare the simulator of one particular device with its recording"),
        "help": ("handctl.tools.help", "show the manual, a guide, a command or the common options"),
    },
}
"""Heading of the root's help -> command name -> module with a click command named `cli`, and one line of help."""

WIRES = ("serial", "can", "modbus-tcp")
"""The kinds of wire that a family may name, each an option of its commands."""

HISTORY = ("devices", "all", "off")
"""Which writes are kept for later: to devices, to simulators and transcripts too, or none."""

COMMANDS: dict[str, tuple[str, str]] = {
    **{name: (f"{row.package}.cli", row.help) for name, row in FAMILIES.items()},
    **{name: tool for tools in TOOLS.values() for name, tool in tools.items()},
}

LISTED: dict[str, tuple[str, ...]] = {
    "Devices": tuple(FAMILIES),
    **{title: tuple(tools) for title, tools in TOOLS.items()},
}
"""Heading -> the commands below it, as the root's help lists them."""

SCAN_ORDER: tuple[str, ...] = tuple(sorted(FAMILIES, key=lambda name: FAMILIES[name].scan))
"""The families in the order of a scan."""
EXPLAIN_ORDER: tuple[str, ...] = tuple(sorted(FAMILIES, key=lambda name: FAMILIES[name].tell))
"""The families in the order in which recorded bytes are offered to them."""
