"""What the manual page says beside the commands (see `docgen.texts`). Data only."""

from handctl.devices.ekso.gates import section

FILES = (("$XDG_STATE_HOME/handctl/ekso-audit.jsonl", "Who changed which setting. By default below ~/.local/state."),)
EXCEPTIONS = (("option", "`--id`", "The DataPort has no device ids."),)
EXAMPLES = (
    ("handctl ekso status -p /dev/ttyACM0 --json", "The health, for a script."),
    ("handctl ekso status --fake", "The simulated DataPort."),
    ("handctl ekso get step_length left_knee_angle --fake", "Two quantities by name."),
    ("handctl ekso get 216 --fake", "One by the number of its word."),
    ("handctl ekso time --fake", "The device's clock."),
    ("handctl ekso date --fake", "The device's date."),
    ("handctl ekso settings --fake", "All settings, decoded."),
    ("handctl ekso data --fake", "Angles, currents and forces now."),
    ("handctl ekso feedback --fake", "Steps, times and assistance."),
    ("handctl ekso policy", "Which checks and questions come before a setting. Needs no device."),
    (
        "handctl ekso set step_length=14 --operator Ada -p /dev/ttyACM0",
        "Change one setting, with every check and question.",
    ),
    ("handctl ekso set step_length=14 -n --fake", "The bytes that would be sent."),
    ("handctl ekso cancel --operator Ada -p /dev/ttyACM0", "Cancel the running action."),
    ("handctl ekso restore ekso-before.json --operator Ada -p /dev/ttyACM0", "Write what differs, one by one."),
    ("handctl ekso log gait.csv --duration 60 -p /dev/ttyACM0", "A minute of the data stream into a file."),
    ("handctl ekso export gait.csv --to mot -o gait.mot", "A log as a motion file of OpenSim."),
    ("handctl ekso export gait.csv --to csv --si -o gait-si.csv", "A log in metres and radians."),
)

__all__ = ["EXAMPLES", "EXCEPTIONS", "FILES", "section"]
