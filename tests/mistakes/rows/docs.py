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
        "tests/docs/test_readme.py::test_exit_codes",
    ),
    mistake(
        "readme-command-that-is-not",
        LIES,
        "README.md",
        "",
        "handctl ports                                    # what is plugged in, who holds it",
        "handctl port                                     # what is plugged in, who holds it",
        "tests/docs/test_readme.py::test_every_example_is_a_line_that_handctl_takes",
    ),
    mistake(
        "readme-message-that-is-never-said",
        LIES,
        "README.md",
        "",
        "| `connection refused` (3) | The server is off, or another client holds the device. | `handctl doctor -p tcp://192.168.0.10` |",
        "| `connection rejected` (3) | The server is off, or another client holds the device. | `handctl doctor -p tcp://192.168.0.10` |",
        "tests/docs/test_readme.py::test_each_message_of_the_table_is_met",
    ),
    mistake(
        "guide-names-a-page-that-is-not",
        LIES,
        "README.md",
        "",
        "| handctl-links(7) | ports, TCP, CAN, Bluetooth, names |",
        "| handctl-link(7) | ports, TCP, CAN, Bluetooth, names |",
        "tests/docs/test_readme.py::test_every_guide_that_is_named_is_there",
    ),
    mistake(
        "guide-says-that-a-worn-hand-asks-nothing",
        LIES,
        "src/handctl/guides/safety.md",
        "",
        "| `ekso` | `set`, `restore` | `cancel`, `stop` |",
        "| `ekso` | `set` | `restore`, `cancel`, `stop` |",
        "tests/docs/test_asking.py::test_a_command_asks_or_begins_as_the_table_says",
    ),
    mistake(
        "manual-page-without-own-options",
        LIES,
        "handctl.docgen.man",
        "_below",
        'own = [option for option in leaf.options if option not in known and "--help" not in option.names]',
        "own = []",
        "tests/docs/test_docs.py::test_every_command_option_and_help_text_is_in_its_page",
    ),
    mistake(
        "help-text-and-page-differ",
        LIES,
        "handctl.tools.batch",
        "",
        'help="Continue after a line that failed. The exit code is still that of the first one.",',
        'help="Continue after a line that failed. The exit code is that of the last one.",',
        "tests/docs/test_docs.py::test_regenerated_is_committed",
    ),
    mistake(
        "schema-without-an-exit-code",
        LIES,
        "src/handctl/schema/envelope-1.json",
        "",
        "8,\n130",
        "130",
        "tests/kernel/test_schema.py::test_not_confirmed_and_dry_run_are_valid",
    ),
    mistake(
        "library-type-of-another-name",
        LIES,
        "src/handctl/hands.pyi",
        "",
        "class Exo(Device):",
        "class Exoskeleton(Device):",
        "tests/docs/test_docs.py::test_regenerated_is_committed",
    ),
)
