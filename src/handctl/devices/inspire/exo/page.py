"""What the manual page says beside the commands (see `docgen.texts`). Data only."""

FILES = (("exo-before-reset.json", "The snapshot that `factory-reset` writes first, here unless `--backup` says."),)
EXAMPLES = (
    ("handctl exo scan -p /dev/ttyUSB0", "Which id answers at which speed."),
    ("handctl exo status --check --fake", "Exit status 7 when anything is unhealthy."),
    ("handctl exo get system_voltage --fake --format plain", "A bare number for a script."),
    ("handctl exo watch temperature --rate 20 --count 5 --fake --csv", "Five samples as CSV."),
    ("handctl exo snapshot before.json --fake", "All settings into a file, to compare and to restore."),
    ("handctl exo diff before.json --fake", "What has changed since."),
    ("handctl exo set position_set.index=300 -n --fake", "The bytes that would be sent."),
    ("handctl exo position 1000 1000 1000 1000 1000 --wait 5 -p /dev/ttyUSB0", "Open the hand; asks first."),
    ("handctl exo force 0 0 0 0 0 --yes -p /dev/ttyUSB0", "Release it, from a script."),
)
