"""What the manual page says beside the commands (see `docgen.man_pages`). Data only."""

EXCEPTIONS = (
    (
        "settings",
        "`diff`, `restore`",
        "The module stores no settings, so these commands end with exit code 2. With `--setpoints`, they use the set points instead.",
    ),
    (
        "hot",
        "`clear-errors`",
        "This command does not exist for the module, because its manual documents no way to clear errors.",
    ),
)
SNAPSHOT_OPTION = " --setpoints"
"""In the examples of `diff` and `restore`: a wrist has nothing else to compare."""
EXAMPLES = (
    ("handctl wrist status --fake --can", "Show the simulated module on a CAN bus."),
    ("handctl wrist status --fake", "Show the simulated module on a serial line."),
    ("handctl wrist get pitch_actual yaw_actual --fake", "Show the angles of both axes."),
    ("handctl wrist move --pitch -10 --yaw 10 --time 1000 --fake", "Move to angles in degrees and wait."),
    ("handctl wrist move --pitch 5 -n --fake", "Show the bytes and send nothing."),
    ("handctl wrist center -p /dev/ttyUSB0", "Move both axes to 0."),
    ("handctl wrist center --time 2000 --fake", "Move both axes to 0 in two seconds."),
    ("handctl wrist set yaw_set=10 pitch_set=-10 --fake", "Write two quantities and read them back."),
    ("handctl wrist set move_time=1000 -n --fake", "Show the bytes and send nothing."),
    ("handctl wrist scan -p can:socketcan:can0", "Find the id on a CAN bus."),
    ("handctl wrist scan --ids 1-10 -p /dev/ttyUSB0", "Try ten ids on a serial port."),
    ("handctl wrist read 1038 6 --fake", "Read six bytes from address 1038."),
    ("handctl wrist hand-read 1000 2 -p /dev/ttyUSB0", "Read two bytes from the hand that the wrist belongs to."),
    ("handctl wrist write 1038 6400 -n --fake", "Show the bytes and send nothing."),
    ("handctl wrist hand-write 1486 2C01 -n --fake", "Show the bytes and send nothing."),
    ('handctl wrist raw -n "EB 90 01 04 30 FC 03 02 36"', "Explain a frame from the manual and send nothing."),
)
