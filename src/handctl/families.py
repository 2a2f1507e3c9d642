"""The device families, a row each, and the tools: what handctl has, before anything of it is loaded. Imports nothing.

The root group lists its commands from here, so that neither help nor completion imports a device family. This is the only
place outside of a family's own folder and its simulator's that names it.
"""


class FamilyRow:
    """One family: what is said of it, and where its modules are.

    help      one line for the root's help, without a full stop
    package   its folder. What the machinery asks for lies there in a module named after the role, with that name in it:
                cli      `cli`: the command group, with its `frame.family.Family`
                probe    `tools.probes.FamilyProbe`: looks for its device and pings it
                stopper  `stopping`: the bytes of its stop, see `stop.talk`
                explain  `explainer`: makes a `model.piece.Explainer` of recorded bytes
                writes   `words`: makes the `model.ledger.WriteWords` that tell which of its bytes write, and what acknowledges them
                page     optional, see `docgen.texts`: EXAMPLES, FILES and `section` of its manual page
    codec     module of its frame, which has the manual's name; `sign` in it says what in bytes that came shows its
              protocol, "" = nothing
    scan      its turn in `handctl scan`, the lowest first: what could disturb others comes late
    tell      its turn when recorded bytes tell whose they are: who takes more for his own comes later
    keys      options of its own that a named device may hold in the configuration file
    trigger   fastest speed in bit/s at which its device listens, and the bytes on which it acts wherever they stand
    """

    def __init__(
        self,
        help: str,
        package: str,
        *,
        codec: str,
        scan: int = 100,
        tell: int = 100,
        keys: tuple[str, ...] = (),
        trigger: tuple[int, bytes] | None = None,
    ) -> None:
        self.help = help
        self.package = package
        self.codec = codec
        self.scan = scan
        self.tell = tell
        self.keys = keys
        self.trigger = trigger

    def module(self, role: str) -> str:
        """Where the module of a role is."""
        return f"{self.package}.{role}"


FAMILIES: dict[str, FamilyRow] = {
    "exo": FamilyRow(
        "Inspire EH55BF1 exoskeleton hand (RS-232, Bluetooth serial)",
        "handctl.devices.inspire.exo",
        codec="handctl.devices.inspire.eb90",
        scan=3,
        tell=1,
    ),
    "wrist": FamilyRow(
        "Inspire wrist module of the dexterous hand (RS-232, RS-485, CAN)",
        "handctl.devices.inspire.wrist",
        codec="handctl.devices.inspire.eb90",
        scan=2,
        tell=2,
    ),
    "barrett": FamilyRow(
        "BarrettHand BH8 series (RS-232)",
        "handctl.devices.barrett",
        codec="handctl.devices.barrett.gcl.language",
        scan=4,
        tell=4,
        trigger=(
            38400,
            b"\x03\r\xff",
        ),  # ^C ends a movement, CR carries out a line, FF starts the boot monitor (§1, §8)
    ),
    "ekso": FamilyRow(
        "EksoNR DataPort (serial over USB)",
        "handctl.devices.ekso",
        codec="handctl.devices.ekso.frames",
        scan=1,
        tell=5,
    ),
    "aidin": FamilyRow(
        "AIDIN-hand (TCP, JSON)",
        "handctl.devices.aidin",
        codec="handctl.devices.aidin.messages",
        scan=5,
        tell=3,
        keys=("exchange", "poll_json", "tx_terminator"),
    ),
}
"""Command name -> its row, in the order of the root's help."""

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
"""Command name -> module with a click command named `cli`, and one line of help."""

COMMANDS: dict[str, tuple[str, str]] = {
    **{name: (row.module("cli"), row.help) for name, row in FAMILIES.items()},
    **TOOLS,
}

SCANNED: tuple[str, ...] = tuple(sorted(FAMILIES, key=lambda name: FAMILIES[name].scan))
"""The families in the order of a scan."""
TOLD: tuple[str, ...] = tuple(sorted(FAMILIES, key=lambda name: FAMILIES[name].tell))
"""The families in the order in which recorded bytes are offered to them."""
