"""What the manual page says beside the commands (see `docgen.texts`). Data only."""

from handctl.devices.barrett.gcl.connecting import section

FILES = (
    ("$XDG_STATE_HOME/handctl/barrett-saves.json", "The count of EEPROM saves; by default below ~/.local/state."),
    ("$XDG_STATE_HOME/handctl/barrett-greasing.json", "The greasings that `maintenance --greased` recorded."),
    ("$XDG_STATE_HOME/handctl/barrett-speeds.json", "The speed at which each port's hand was found last."),
    ("$XDG_STATE_HOME/handctl/gcl-history", "The lines typed at the prompt of `gcl`."),
)
EXAMPLES = (
    ("handctl barrett status -p /dev/ttyUSB0", "Finds the speed by itself."),
    ("handctl barrett init --fake", "Initialize the motors; the fingers open fully."),
    ("handctl barrett close --motors G -p /dev/ttyUSB0", "Close the fingers; Ctrl-C stops them."),
    ("handctl barrett get SG.F1 temperature --fake", "By mnemonic or by name."),
    ("handctl barrett set MCV=80 --motors 12 --fake", "The closing velocity of two fingers, in RAM."),
    ('handctl barrett gcl "FGET P S" "PGET TEMP" --fake', "Any GCL."),
    ("handctl barrett errors 12", "What a status code means; needs no device."),
    ("handctl barrett firmware check hand.s19", "Whether a firmware file is whole; needs no device."),
)

__all__ = ["EXAMPLES", "FILES", "section"]
