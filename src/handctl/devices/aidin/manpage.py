"""What the manual page says beside the commands (see `docgen.man_pages`). Data only."""

from handctl.devices.aidin.exchange_settings import section
from handctl.families import FAMILIES

EXCEPTIONS = (
    (
        "verb",
        "`set`, `snapshot`, `diff`, `restore`",
        "The hand does not have these commands, because it does not store settings.",
    ),
    (
        "option",
        "`--id`, `--baud`",
        "The hand does not accept these options: it is on the network and has an address instead.",
    ),
    ("no-port", "`/dev/ttyUSB0`", "The hand has no serial port: a serial link is refused with exit code 2."),
    (
        "arrival",
        "`currents`",
        "A current has no target to miss, so a missed target never gives exit code 7.",
    ),
    (
        "expect",
        "`home`, `initial`",
        "They do not accept `--expect`, because they have their own check: each motor must come to rest at its origin.",
    ),
    (
        "expect",
        "`check`",
        "It does not accept `--expect`, because it already tests whether each motor reaches its target.",
    ),
)
DRY = (
    "initial",
    "encoders index.m1=1000",
    "joints index.q3=160",
    "fingertips index.x=10",
    "currents index.m1=20",
    "bias",
    "max-torque 300",
)
EXAMPLES = (
    (
        "handctl aidin status -p tcp://192.168.0.20",
        f"Show a health summary. The TCP port is {FAMILIES['aidin'].tcp_port} unless given.",
    ),
    ("handctl aidin status --fake --json", "Use the simulated hand, for a script."),
    ("handctl aidin get joint_pos --fake", "Read the angles of all joints."),
    ("handctl aidin get sensor_state.fz -p tcp://192.168.0.20", "Read one force of the fingertip sensors."),
    ("handctl aidin watch --count 3 --fake --csv", "Stream three samples as CSV."),
    ("handctl aidin stop -p tcp://192.168.0.20", "Stop all motors."),
    ("handctl aidin home -p tcp://192.168.0.20", "Open all fingers and set the origin. Asks first."),
    ("handctl aidin home -n --fake", "Show the messages that would be sent."),
    ("handctl aidin initial -p tcp://192.168.0.20", "Open all fingers. Asks first."),
    ("handctl aidin joints index.q3=160 -p tcp://192.168.0.20", "Move one joint. The others keep their position."),
    ("handctl aidin check -p tcp://192.168.0.20", "Test each motor and sensor of an open, empty hand. Asks first."),
    ("handctl aidin check -n --fake", "Show the messages that would be sent."),
    ("handctl aidin bias -p tcp://192.168.0.20", "Set the sensors to 0 at their current load."),
    ("handctl aidin max-torque 300 -p tcp://192.168.0.20", "Limit the current of all motors. Asks first."),
    *((f"handctl aidin {line} -n --fake", "Show the message that would be sent.") for line in DRY),
)

__all__ = ["EXAMPLES", "EXCEPTIONS", "section"]
