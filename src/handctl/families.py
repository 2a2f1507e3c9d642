"""Command name -> (module, one-line help). Data only; imports nothing.

The root group lists its commands from here, so that neither help nor completion imports a device family.
Each module has a click command named `cli`.
"""

FAMILIES: dict[str, tuple[str, str]] = {
    "exo": ("handctl.devices.inspire.exo_cli", "Inspire EH55BF1 exoskeleton hand (RS-232, Bluetooth serial)"),
    "wrist": ("handctl.devices.inspire.wrist_cli", "Inspire wrist module of the dexterous hand (RS-232, RS-485, CAN)"),
    "barrett": ("handctl.devices.barrett.cli", "BarrettHand BH8 series (RS-232)"),
}

TOOLS: dict[str, tuple[str, str]] = {
    "sim": ("handctl.sim.cli", "a simulated device as a server for any client: pty, TCP, slcan"),
}

COMMANDS: dict[str, tuple[str, str]] = {**FAMILIES, **TOOLS}
