"""What the manual page says beside the commands (see `docgen.man_pages`). Data only."""

from handctl.devices.barrett.gcl.connect_table import section

FILES = (
    ("$XDG_STATE_HOME/handctl/barrett-saves.json", "The count of EEPROM saves. The default folder is ~/.local/state."),
    ("$XDG_STATE_HOME/handctl/barrett-greasing.json", "The greasing journal, written by `maintenance --greased`."),
    ("$XDG_STATE_HOME/handctl/barrett-speeds.json", "The baud rate at which the hand on each port was last found."),
    ("$XDG_STATE_HOME/handctl/gcl-history", "The lines typed at the `gcl` prompt."),
)
EXCEPTIONS = (
    ("option", "`--id`", "The hand does not accept this option: GCL has no device ids."),
    (
        "arrival",
        "`torque-open`, `torque-close`",
        "They close or open until the motors stall. They have no target to miss, so a missed target never gives exit code 7.",
    ),
    (
        "arrival",
        "`init`",
        "It sends the hand's command HI, which takes the position at which a motor stalls as its end stop, wherever that is. So a blocked finger does not give exit code 7.",
    ),
    (
        "hot",
        "`status --check`",
        "While its temperature fault is set, the hand refuses to report its values, so the exit code is 6 instead of 7.",
    ),
)
DRY = (
    "init",
    "open --motors G",
    "close",
    "move 8000",
    "home --motors S",
    "step-open",
    "step-close",
    "torque-open",
    "torque-close",
    "set HSG.F1=150",
    "save",
    "load",
    "defaults",
    "reset",
)
EXAMPLES = (
    ("handctl barrett status -p /dev/ttyUSB0", "Show a health summary. handctl finds the baud rate."),
    ("handctl barrett get SG.F1 temperature --fake", "Read by mnemonic or by name."),
    ("handctl barrett get P -p /dev/ttyUSB0", "Show the positions of the fingers and the spread."),
    ("handctl barrett version --fake", "Show the firmware version of the simulated hand."),
    ("handctl barrett errors", "List all status codes. Needs no device."),
    ("handctl barrett errors 12", "Explain a status code. Needs no device."),
    ("handctl barrett help C --fake", "Show what the hand and the manual say about a command."),
    ("handctl barrett fingertips --fake", "Show the fingertips of the hand."),
    ("handctl barrett fingertips --positions 8000 8000 8000 0", "Calculate them from these counts. Needs no device."),
    ("handctl barrett stop --motors 1 -p /dev/ttyUSB0", "Stop all motors and switch motor 1 off."),
    ("handctl barrett init --fake", "Initialize the motors. The fingers open fully."),
    ("handctl barrett open -p /dev/ttyUSB0", "Open the fingers and the spread."),
    ("handctl barrett close --motors G -p /dev/ttyUSB0", "Close the fingers. Ctrl-C stops them."),
    (
        "handctl barrett close --expect contact -p /dev/ttyUSB0",
        "Grip an object. The exit code is 7 if the fingers met nothing.",
    ),
    ("handctl barrett move 8000 --motors 12 -p /dev/ttyUSB0", "Move two fingers to position 8000."),
    ("handctl barrett move F1=8000 F3=500 -p /dev/ttyUSB0", "Move finger 1, then finger 3."),
    ("handctl barrett home -p /dev/ttyUSB0", "Move all motors to position 0."),
    ("handctl barrett step-open 500 --motors 1 -p /dev/ttyUSB0", "Open one finger by 500 counts."),
    ("handctl barrett step-close 500 --motors 1 -p /dev/ttyUSB0", "Close one finger by 500 counts."),
    ("handctl barrett torque-open --motors G -p /dev/ttyUSB0", "Open until the fingers stall."),
    ("handctl barrett torque-close --motors G -p /dev/ttyUSB0", "Close until the fingers stall."),
    (
        "handctl barrett realtime --receive position --duration 5 -p /dev/ttyUSB0",
        "Watch the positions for five seconds.",
    ),
    (
        "handctl barrett realtime --motors 1 --law 'velocity.F1 = clamp((9000 - P.F1)/20, -40, 40)' --until 'abs(P.F1 - 9000) < 50' -p /dev/ttyUSB0",
        "Move finger 1 to position 9000 with a control law. Starts immediately.",
    ),
    (
        "handctl barrett realtime --motors 1 --law 'velocity.F1 = clamp((9000 - P)/4 - D/4, -40, 40)' --duration 60 -p /dev/ttyUSB0",
        "Hold finger 1 at position 9000 against pushes, for a minute. Starts immediately.",
    ),
    (
        "handctl barrett realtime --receive position --duration 5 --log run.csv -p /dev/ttyUSB0",
        "Record the positions to a new file with a sidecar.",
    ),
    ("handctl barrett set MCV=80 --motors 12 --fake", "Set the closing velocity of two fingers, in RAM."),
    ("handctl barrett save -p /dev/ttyUSB0", "Save the parameters to EEPROM. Asks first."),
    ("handctl barrett baud -p /dev/ttyUSB0", "Show the baud rate of the hand."),
    (
        "handctl barrett baud 38400 --save -p /dev/ttyUSB0",
        "Change the baud rate of the hand and the port, and save it.",
    ),
    ("handctl barrett load -p /dev/ttyUSB0", "Load the saved parameters into RAM. Asks first."),
    ("handctl barrett defaults -p /dev/ttyUSB0", "Load the factory parameters into RAM. Asks first."),
    ("handctl barrett diagnose -p /dev/ttyUSB0", "Run all checks that only read."),
    ("handctl barrett diagnose --list", "List the symptoms in the manual."),
    ("handctl barrett first-light -p /dev/ttyUSB0", "Bring a hand from the cupboard into use. Asks before each step."),
    ("handctl barrett maintenance -p /dev/ttyUSB0", "Show any maintenance that is due."),
    ("handctl barrett maintenance --steps lubrication", "List the steps for greasing. Needs no device."),
    ("handctl barrett strain -p /dev/ttyUSB0", "Measure the strain gauges without load."),
    ("handctl barrett strain --open -p /dev/ttyUSB0", "The same, but open the fingers first."),
    ("handctl barrett reset -p /dev/ttyUSB0", "Restart the firmware. Run `init` afterwards."),
    ('handctl barrett gcl "FGET P S" "PGET TEMP" --fake', "Send GCL commands."),
    ("handctl barrett gcl --file grip.gcl -p /dev/ttyUSB0", "Send a script, with pauses where it says DELAY."),
    ("handctl barrett gcl -p /dev/ttyUSB0", "Open a prompt for GCL commands."),
    ("handctl barrett firmware check hand.s19", "Check a firmware file. Needs no device."),
    ("handctl barrett firmware download hand.s19 -p /dev/ttyUSB0", "Load the file into the hand. Asks first."),
    *((f"handctl barrett {line} -n --fake", "Show the bytes that would be sent.") for line in DRY),
)

__all__ = ["EXAMPLES", "EXCEPTIONS", "FILES", "section"]
