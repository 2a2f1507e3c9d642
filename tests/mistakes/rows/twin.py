"""Twins: a recording that reaches anything but a simulator, an answer called equal that is not, values of another moment."""

from tests.mistakes.table import mistake

TWIN, VALUES, LINE = "handctl.tools.twin", "handctl.link.twin_values", "handctl.sim.engine.line_and_faults"
HERE = "tests/tools/test_twin.py::"
EQUAL = f"{HERE}test_only_the_same_bytes_are_equal"

ROWS = (
    mistake(
        "a-recording-goes-to-any-link",
        "recorded movements reach a device",
        TWIN,
        "simulated",
        "if kind != family:",
        "if kind and kind != family:",
        f"{HERE}test_a_recording_is_sent_to_no_device",
    ),
    mistake(
        "a-recording-goes-to-the-link-that-was-given",
        "recorded movements reach a device",
        TWIN,
        "check",
        'link = simulated(base or f"{SIMULATOR}{recording.family}", recording.family, recording.wire)',
        'link = base or simulated(f"{SIMULATOR}{recording.family}", recording.family, recording.wire)',
        f"{HERE}test_a_recording_is_sent_to_no_device",
    ),
    mistake(
        "a-check-changes-the-state-of-a-simulator",
        "a check writes",
        TWIN,
        "simulated",
        'options |= {"save": "never"} if "state" in options else {}',
        "options |= {}",
        f"{HERE}test_the_state_of_a_simulator_is_read_and_not_written",
    ),
    mistake(
        "answers-with-the-same-meaning-are-called-equal",
        "a difference is not told",
        TWIN,
        "verdict",
        "if recorded.raw == here.raw:",
        "if recorded.meaning == here.meaning:",
        EQUAL,
    ),
    mistake(
        "an-answer-that-is-missing-does-not-count",
        "a difference is not told",
        TWIN,
        "verdict",
        'return NONE if recorded is not None else EXTRA if here is not None else ""',
        'return EXTRA if here is not None else ""',
        EQUAL,
    ),
    mistake(
        "another-form-is-called-other-values",
        "a difference is made little of",
        TWIN,
        "verdict",
        "return VALUES if differ and form_of(recorded) == form_of(here) else FORM",
        "return VALUES if differ else FORM",
        EQUAL,
    ),
    mistake(
        "a-twin-as-found-shows-what-was-written-later",
        "a twin of another moment",
        VALUES,
        "values_of",
        "if value.value is not None and not (found and (value.name in values or value.name in written)):",
        "if value.value is not None:",
        f"{HERE}test_what_was_written_before_it_ended_is_what_a_twin_shows_as_it_was_left",
    ),
    mistake(
        "replies-overtake-each-other",
        "a reply reaches another request",
        LINE,
        "Cable._due",
        "self._floor = max(self._floor, self.now + wait)",
        "self._floor = self.now + wait",
        f"{HERE}test_reply_times_are_those_that_were_recorded_and_keep_the_order_of_the_replies",
    ),
)
