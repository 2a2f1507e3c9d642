"""What the manual page says beside the commands (see `docgen.texts`). Data only."""

from handctl.devices.barrett.gcl.connecting import section

FILES = (
    ("$XDG_STATE_HOME/handctl/barrett-saves.json", "The count of EEPROM saves. The default folder is ~/.local/state."),
    ("$XDG_STATE_HOME/handctl/barrett-greasing.json", "The journal of greasing, written by `maintenance --greased`."),
    ("$XDG_STATE_HOME/handctl/barrett-speeds.json", "The speed at which the hand on each port was last found."),
    ("$XDG_STATE_HOME/handctl/gcl-history", "The lines typed at the prompt of `gcl`."),
)
EXAMPLES = (
    ("handctl barrett status -p /dev/ttyUSB0", "Show a health summary. handctl finds the speed."),
    ("handctl barrett init --fake", "Initialize the motors. The fingers open fully."),
    ("handctl barrett close --motors G -p /dev/ttyUSB0", "Close the fingers. Ctrl-C stops them."),
    ("handctl barrett get SG.F1 temperature --fake", "Read by mnemonic or by name."),
    ("handctl barrett set MCV=80 --motors 12 --fake", "Set the closing velocity of two fingers, in RAM."),
    ('handctl barrett gcl "FGET P S" "PGET TEMP" --fake', "Send any GCL commands."),
    ("handctl barrett errors 12", "Explain a status code. Needs no device."),
    ("handctl barrett firmware check hand.s19", "Check a firmware file. Needs no device."),
)

__all__ = ["EXAMPLES", "FILES", "section"]
