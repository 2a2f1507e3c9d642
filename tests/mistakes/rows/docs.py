"""Documentation that lies: guides, README, help, manual pages, the schema, the types of the library."""

from tests.mistakes.table import mistake

LIES = "documentation that lies"

ROWS = (
    mistake(
        "guide-swaps-silence-and-garbage",
        LIES,
        "src/handctl/guides/output.md",
        "",
        "| 4 | Silence until the deadline. |",
        "| 4 | Bytes came, but no valid answer. |",
    ),
    mistake(
        "readme-command-that-is-not",
        LIES,
        "README.md",
        "",
        "handctl ports                                    # what is plugged in, who holds it",
        "handctl port                                     # what is plugged in, who holds it",
    ),
    mistake(
        "readme-message-that-is-never-said",
        LIES,
        "README.md",
        "",
        "| `connection refused` (3) | The server is off, or another client holds the device. | `handctl doctor -p tcp://192.168.0.10` |",
        "| `connection rejected` (3) | The server is off, or another client holds the device. | `handctl doctor -p tcp://192.168.0.10` |",
    ),
    mistake(
        "guide-names-a-page-that-is-not",
        LIES,
        "README.md",
        "",
        "| handctl-links(7) | ports, TCP, CAN, Bluetooth, names |",
        "| handctl-link(7) | ports, TCP, CAN, Bluetooth, names |",
    ),
    mistake(
        "guide-says-that-a-worn-hand-asks-nothing",
        LIES,
        "src/handctl/guides/safety.md",
        "",
        "| `ekso` | `set`, `restore` | `cancel`, `stop` |",
        "| `ekso` | `set` | `restore`, `cancel`, `stop` |",
    ),
    mistake(
        "manual-page-without-own-options",
        LIES,
        "handctl.docgen.man",
        "_below",
        'own = [option for option in leaf.options if option not in known and "--help" not in option.names]',
        "own = []",
    ),
    mistake(
        "help-text-and-page-differ",
        LIES,
        "handctl.tools.batch",
        "",
        '@click.option("--keep-going", is_flag=True, help="Continue after a line that failed. The exit code is still that of the first one.")',
        '@click.option("--keep-going", is_flag=True, help="Continue after a line that failed. The exit code is that of the last one.")',
    ),
    mistake(
        "schema-without-an-exit-code",
        LIES,
        "src/handctl/schema/envelope-1.json",
        "",
        "8,\n130",
        "130",
    ),
    mistake(
        "library-type-of-another-name",
        LIES,
        "src/handctl/hands.pyi",
        "",
        "class Exo(Device):",
        "class Exoskeleton(Device):",
    ),
)
