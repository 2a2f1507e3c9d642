"""What carries a command: batch and shell, options, configuration, links of several commands."""

from tests.mistakes.table import mistake

BATCH = "handctl.frame.lines"
SESSION = "handctl.frame.connection"

ROWS = (
    mistake(
        "set-point-that-is-equal-left-out",
        "a finger that is elsewhere is not moved",
        "handctl.frame.verbs",
        "unequal",
        "return not _acts(element) and reading is not None and reading.error is None and reading.value == value",
        "return reading is not None and reading.error is None and reading.value == value",
        "tests/kernel/test_set_twice.py::test_what_acts_is_always_written",
    ),
    mistake(
        "question-from-the-set-point",
        "a question shows where the axis was sent as where it is",
        "handctl.frame.verbs",
        "_places",
        "places = {course.target: device.map[course.actual] for course in device.courses}",
        "places = {course.target: device.map[course.target] for course in device.courses}",
        "tests/kernel/test_terminal.py::test_a_command_of_fingers_asks_with_a_table",
    ),
    mistake(
        "frame-full-disk-hides-the-device",
        "wrong exit code",
        "handctl.frame.outcome",
        "weightier",
        "if error is None or isinstance(error, OutputError):",
        "if error is not lost:",
        "tests/kernel/test_render.py::test_the_error_of_the_device_weighs_more_than_a_full_disk",
    ),
    mistake(
        "frame-swapped-letters-are-another-word",
        "wrong advice",
        "handctl.sentence",
        "_slipped",
        "return swapped or (len(one) > 2 and one[place + 1 :] == other[place + 1 :])",
        "return len(one) > 2 and one[place + 1 :] == other[place + 1 :]",
        "tests/kernel/test_nearest.py::test_two_swapped_neighbours_are_always_understood",
    ),
    mistake(
        "batch-ends-as-the-last-failed-line",
        "wrong exit code",
        BATCH,
        "_failure",
        "one, first = failed[0]",
        "one, first = failed[-1]",
        "tests/kernel/test_batch.py::test_with_keep_going_the_exit_code_is_that_of_the_first_line_that_failed",
    ),
    mistake(
        "session-keeps-stale-input",
        "stale input believed",
        SESSION,
        "Session.connection",
        "_discard(known.link)",
        "pass",
        "tests/kernel/test_batch.py::test_what_came_between_two_lines_belongs_to_neither",
    ),
    mistake(
        "batch-goes-on-behind-a-failure",
        "swallowed error",
        BATCH,
        "_run",
        "if error is not None and not (keep_going and error.exit_code != Interrupted.exit_code):",
        "if error is not None and error.exit_code == Interrupted.exit_code:",
        "tests/kernel/test_batch.py::test_the_first_failure_ends_it_and_is_its_exit_code",
    ),
    mistake(
        "batch-asks-nothing",
        "missing question",
        BATCH,
        "_confirmed",
        "if plan.question and not one.settings.yes and not one.settings.dry_run",
        "if plan.question and one.settings.yes and not one.settings.dry_run",
        "tests/kernel/test_batch.py::test_a_yes_runs_what_asks_and_the_next_line_sees_it",
    ),
    mistake(
        "session-one-link-for-two-ids",
        "two locks",
        SESSION,
        "Session.connection",
        "for other in [other for other, one in self._open.items() if one.name == name]:",
        "for other in ():",
        "tests/kernel/test_batch.py::test_one_place_is_open_once",
    ),
    mistake(
        "session-keeps-a-lost-link",
        "stale input believed",
        SESSION,
        "Session.keeps",
        "if lost or stopped:",
        "if stopped:",
        "tests/kernel/test_batch.py::test_a_link_that_failed_once_is_opened_again_though_it_reads_on",
    ),
)
