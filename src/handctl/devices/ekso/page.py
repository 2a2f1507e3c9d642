"""What the manual page says beside the commands (see `docgen.texts`). Data only."""

from handctl.devices.ekso.gates import section

FILES = (("$XDG_STATE_HOME/handctl/ekso-audit.jsonl", "Who changed which setting; by default below ~/.local/state."),)
EXAMPLES = (
    ("handctl ekso status --fake", "The simulated DataPort."),
    ("handctl ekso status -p /dev/ttyACM0 --json", "What to look at first, for a script."),
    ("handctl ekso dump --fake", "Everything it tells."),
    ("handctl ekso log gait.csv --duration 60 -p /dev/ttyACM0", "A minute of the data stream into a file."),
    ("handctl ekso export gait.csv --format mot -o gait.mot", "The same as a motion file of OpenSim."),
)

__all__ = ["EXAMPLES", "FILES", "section"]
