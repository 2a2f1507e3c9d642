"""What the manual page says beside the commands (see `docgen.man_pages`). Data only."""

from handctl.devices.inspire.common_cli import settings_examples

FILES = (("exo-before-reset.json", "The snapshot that `factory-reset` writes first. `--backup` names another file."),)
EXCEPTIONS = (
    (
        "leave-alone",
        "`force`",
        "In the other commands that take a value for each finger, such as `position`, -1 leaves a finger as it is. In `force`, -1 is a force like any other.",
    ),
)
EXAMPLES = (
    ("handctl exo get position_actual temperature --fake", "Show positions and temperatures of all fingers."),
    ("handctl exo get system_voltage --fake --format plain", "Print a bare number for a script."),
    ("handctl exo watch temperature --rate 20 --count 5 --fake --csv", "Take five samples as CSV."),
    ("handctl exo position 1000 1000 1000 1000 1000 --wait 5 -p /dev/ttyUSB0", "Open the hand. Asks first."),
    ("handctl exo position 1000 1000 1000 500 1000 -n --fake", "Show the bytes and send nothing."),
    (
        "handctl exo position ring=900 index=100 -n --fake",
        "Show the bytes that move two fingers only, and send nothing.",
    ),
    ("handctl exo force 0 0 0 0 0 --yes -p /dev/ttyUSB0", "Release the hand, from a script."),
    ("handctl exo force 200 200 200 200 200 -n --fake", "Show the bytes and send nothing."),
    ("handctl exo set force_set=0,0,0,0,0 -p /dev/ttyUSB0", "Write all elements of a quantity. Asks first."),
    ("handctl exo set position_set.index=300 -n --fake", "Show the bytes and send nothing."),
    *settings_examples("exo", 57600),
    ("handctl exo calibrate -p /dev/ttyUSB0", "Calibrate step by step. Someone has to wear the hand."),
    ("handctl exo scan -p /dev/ttyUSB0", "Find the id and the baud rate of the hand."),
    ("handctl exo scan --ids 1-10 --baud 115200 -p /dev/ttyUSB0", "Try ten ids at one baud rate."),
    ("handctl exo diff exo-before.json --fake", "Show what has changed since the snapshot."),
    ("handctl exo restore exo-before.json -n --fake", "Show the bytes and send nothing."),
    ("handctl exo read 1000 2 --fake", "Read two bytes from address 1000."),
    ("handctl exo write 1486 2C01 -n --fake", "Show the bytes and send nothing."),
    ('handctl exo raw -n "EB 90 01 04 11 E8 03 01 02"', "Explain a frame from the manual and send nothing."),
)
