"""What the manual page says beside the commands (see `docgen.man_pages`). Data only."""

from handctl.devices.ekso.write_checks import section

FILES = (
    (
        "$XDG_STATE_HOME/handctl/ekso-audit.jsonl",
        "The audit log: who changed which setting. The default folder is ~/.local/state.",
    ),
)
EXCEPTIONS = (("option", "`--id`", "The device does not accept this option: the DataPort has no device ids."),)
EXAMPLES = (
    ("handctl ekso status -p /dev/ttyACM0 --json", "Show a health summary, for a script."),
    ("handctl ekso status --fake", "Use the simulated DataPort."),
    ("handctl ekso get step_length left_knee_angle --fake", "Read two quantities by name."),
    ("handctl ekso get 216 --fake", "Read one by its ParameterID."),
    ("handctl ekso time --fake", "Show the device's time of day."),
    ("handctl ekso date --fake", "Show the device's date."),
    ("handctl ekso settings --fake", "Show all settings, decoded."),
    ("handctl ekso data --fake", "Show the current angles, motor currents and forces."),
    ("handctl ekso feedback --fake", "Show steps, times and assistance."),
    ("handctl ekso policy", "Show the checks and confirmations before a write. Needs no device."),
    (
        "handctl ekso set step_length=14 --operator Ada -p /dev/ttyACM0",
        "Change one setting, with every check and confirmation.",
    ),
    ("handctl ekso set step_length=14 -n --fake", "Show the bytes that would be sent."),
    ("handctl ekso cancel --operator Ada -p /dev/ttyACM0", "Send CancelAction. This may not stop the device."),
    (
        "handctl ekso restore ekso-before.json --operator Ada -p /dev/ttyACM0",
        "Write the settings that differ, one by one.",
    ),
    ("handctl ekso log gait.csv --duration 60 -p /dev/ttyACM0", "Record one minute of data to a file."),
    ("handctl ekso export gait.csv --to mot -o gait.mot", "Turn a log into an OpenSim motion file."),
    ("handctl ekso log --check gait.csv", "Check a recording, and show its breaks and clocks."),
    ("handctl ekso export gait.csv --to bids -o gait-bids", "Turn a log into a BIDS motion dataset."),
    ("handctl ekso gait gait.csv --steps steps.csv", "Find the strides in a log, and list each of them."),
    ("handctl ekso gait before.csv after.csv", "Compare two logs, and list the settings that differ."),
    ("handctl ekso export gait.csv --to csv --si -o gait-si.csv", "Turn a log into metres and radians."),
)

__all__ = ["EXAMPLES", "EXCEPTIONS", "FILES", "section"]
