"""What the manual page says beside the commands (see `docgen.man_pages`). Data only."""

from handctl.devices.inspire.common_cli import settings_examples

FILES = (("hand-before-reset.json", "The snapshot that `factory-reset` writes first. `--backup` changes its name."),)
EXCEPTIONS = (
    (
        "other-family",
        "a hand on a `wrist` module",
        "If a hand is attached to a wrist module, both reply on the same line, and the commands of `handctl hand` work. If only a wrist module replies, they end with the message `this is a wrist module`.",
    ),
)
EXAMPLES = (
    ("handctl hand status --fake", "Show the simulated RH56DFTP."),
    ("handctl hand status --fake --model f1", "Show a simulated RH56F1."),
    ("handctl hand dump --fake --modbus-tcp", "Read every register over Modbus TCP."),
    ("handctl hand status -p tcp://192.168.11.210", "Show a tactile hand on the network."),
    ("handctl hand get angle_actual temperature --fake", "Show angles and temperatures of all fingers."),
    ("handctl hand watch temperature --rate 20 --count 5 --fake --csv", "Take five samples as CSV."),
    ("handctl hand angle 1000 1000 1000 1000 1000 1000 --wait 5 -p /dev/ttyUSB0", "Open the hand. Asks first."),
    ("handctl hand angle index=300 -n --fake", "Show the bytes that move the index finger only, and send nothing."),
    ("handctl hand position -1 -1 -1 500 -1 -1 -n --fake", "Show the bytes and send nothing."),
    ("handctl hand speed 100 100 100 100 100 100 -p /dev/ttyUSB0", "Make the next movement slow."),
    ("handctl hand force 200 200 200 200 200 200 --fake", "Make a closing finger stop at 200 g."),
    ("handctl hand set speed_set.index=300 -n --fake", "Show the bytes and send nothing."),
    *settings_examples("hand", 921600),
    ("handctl hand calibrate -p /dev/ttyUSB0", "Calibrate the force sensors. The hand must be open and empty."),
    ("handctl hand scan -p /dev/ttyUSB0", "Find the id, the baud rate and the protocol of the hand."),
    ("handctl hand scan --ids 1-10 --baud 115200 -p /dev/ttyUSB0", "Try ten ids at one baud rate."),
    ("handctl hand network --fake", "Show the IP address of a tactile hand, and the one this computer needs."),
    ("handctl hand network 192.168.11.211 -n --fake", "Show the bytes and send nothing."),
    (
        "handctl hand network 192.168.11.211 -p tcp://192.168.11.210",
        "Change the IP address of a hand. You type it again to confirm.",
    ),
    ("handctl hand tactile --fake --modbus-tcp", "Draw all 17 tactile zones."),
    ("handctl hand tactile index palm --fake --csv", "Print the values of the index finger and the palm."),
    ("handctl hand tactile --watch --count 2 --rate 0 --fake --json", "Take two samples of all zones."),
    ("handctl hand tactile index --watch -p tcp://192.168.11.210", "Watch one finger while it touches something."),
    ("handctl hand pair -p /dev/ttyUSB0", "Find out which of two hands on one bus is left and right, and name both."),
    (
        "handctl hand pair /dev/ttyUSB0 /dev/ttyUSB1",
        "Find out which of two hands on two ports is left and right, and name both.",
    ),
    (
        "handctl hand pair tcp://192.168.11.210",
        "Name two hands that have the same IP address, and give one a new address.",
    ),
    ("handctl hand read 1546 12 --fake", "Read twelve bytes from address 1546."),
    ("handctl hand write 1528 2C01 -n --fake", "Show the bytes and send nothing."),
    ('handctl hand raw -n "EB 90 01 04 11 0A 06 0C 32"', "Explain an EB90 frame and send nothing."),
    ('handctl hand raw -n "01 03 06 0A 00 06 E5 42"', "Explain a Modbus RTU frame and send nothing."),
)
