"""What the manual page says beside the commands (see `docgen.texts`). Data only."""

FILES = (("exo-before-reset.json", "The snapshot that `factory-reset` writes first, here unless `--backup` says."),)
EXAMPLES = (
    ("handctl exo get position_actual temperature --fake", "Positions and temperatures of all fingers."),
    ("handctl exo get system_voltage --fake --format plain", "A bare number for a script."),
    ("handctl exo watch temperature --rate 20 --count 5 --fake --csv", "Five samples as CSV."),
    ("handctl exo position 1000 1000 1000 1000 1000 --wait 5 -p /dev/ttyUSB0", "Open the hand; asks first."),
    ("handctl exo position 1000 1000 1000 500 1000 -n --fake", "The bytes that would be sent."),
    ("handctl exo force 0 0 0 0 0 --yes -p /dev/ttyUSB0", "Release the hand, from a script."),
    ("handctl exo force 200 200 200 200 200 -n --fake", "The bytes that would be sent."),
    ("handctl exo set force_set=0,0,0,0,0 -p /dev/ttyUSB0", "Write all elements of a quantity; asks first."),
    ("handctl exo set position_set.index=300 -n --fake", "The bytes that would be sent."),
    ("handctl exo id --fake", "Which id the hand has."),
    ("handctl exo id 2 -p /dev/ttyUSB0", "Give it another one; asks first."),
    ("handctl exo baud --fake", "The speed code of the hand."),
    (
        "handctl exo baud 57600 --save --verify -p /dev/ttyUSB0",
        "Change the speed, keep it, and look for the hand there.",
    ),
    ("handctl exo save -p /dev/ttyUSB0", "Keep what was set; asks first."),
    ("handctl exo save -n --fake", "The bytes that would be sent."),
    (
        "handctl exo factory-reset --backup before-reset.json -p /dev/ttyUSB0",
        "Write a snapshot, then reset; asks first.",
    ),
    ("handctl exo clear-errors -p /dev/ttyUSB0", "Clear the errors and show what is left."),
    ("handctl exo clear-errors -n --fake", "The bytes that would be sent."),
    ("handctl exo calibrate -p /dev/ttyUSB0", "Calibrate step by step; the hand must be worn."),
    ("handctl exo scan -p /dev/ttyUSB0", "Which id answers at which speed."),
    ("handctl exo scan --ids 1-10 --speeds 115200 -p /dev/ttyUSB0", "Ten ids at one speed."),
    ("handctl exo diff exo-before.json --fake", "What has changed since the snapshot."),
    ("handctl exo restore exo-before.json -n --fake", "The bytes that would be sent."),
    ("handctl exo read 1000 2 --fake", "Two bytes from address 1000."),
    ("handctl exo write 1486 2C01 -n --fake", "The bytes that would be sent."),
    ('handctl exo raw -n "EB 90 01 04 11 E8 03 01 02"', "What a frame from the manual does; sends nothing."),
)
