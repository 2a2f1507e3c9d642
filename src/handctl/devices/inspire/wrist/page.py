"""What the manual page says beside the commands (see `docgen.texts`). Data only."""

EXAMPLES = (
    ("handctl wrist scan -p can:socketcan:can0", "Which id answers on a CAN bus."),
    ("handctl wrist status --fake --can", "The simulated module on its CAN wire."),
    ("handctl wrist move --pitch -10 --yaw 10 --time 1000 --fake", "Move to angles in degrees and wait."),
    ("handctl wrist center -p /dev/ttyUSB0", "Both axes to 0."),
    (
        'handctl wrist raw -n "EB 90 01 04 30 FC 03 02 36"',
        "What a frame from the manual really does; sends nothing.",
    ),
)
