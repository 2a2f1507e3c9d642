"""What the manual page says beside the commands (see `docgen.texts`). Data only."""

from handctl.devices.aidin.speaking import section

EXAMPLES = (
    ("handctl aidin status -p tcp://192.168.0.20", "Port 8000 when none is given."),
    ("handctl aidin status --fake --json", "The simulated hand, for a script."),
    ("handctl aidin get joint_pos --fake", "The angles of all joints."),
    ("handctl aidin joints index.q3=160 -n --fake", "What would be sent: the others stay where they are."),
    ("handctl aidin stop -p tcp://192.168.0.20", "Stop all motors."),
    ("handctl aidin watch --count 3 --fake --csv", "Three samples as CSV."),
)

__all__ = ["EXAMPLES", "section"]
