"""Stops: the talk with the device, who holds it, Ctrl-C, and what is said of it."""

from tests.mistakes.table import mistake

RELEASE = "handctl.devices.inspire.exo.release"
STAY = "handctl.devices.inspire.wrist.stay"
TALK = "handctl.model.stopping"

ROWS = (
    mistake(
        "exo-stop-hold-not-acknowledged",
        "evidence believed",
        RELEASE,
        "keep",
        "if held is None:",
        "if held is None and not places:",
        "tests/stop/test_talk.py::test_a_hold_that_is_not_acknowledged_is_no_stop",
    ),
    mistake(
        "exo-stop-hold-not-sent",
        "stop not sent",
        RELEASE,
        "release",
        "if told is not None:",
        "if told is not None and heard[1:]:",
        "tests/stop/test_talk.py::test_a_hold_that_is_not_acknowledged_is_no_stop",
    ),
    mistake(
        "exo-stop-six-places-for-five",
        "same fact twice",
        RELEASE,
        "keep",
        "places = eb90.unpack_s16(told.payload)[:FINGERS]",
        "places = eb90.unpack_s16(told.payload)[1:MEASURED]",
        "tests/stop/test_talk.py::test_a_hold_that_is_not_acknowledged_is_no_stop",
    ),
    mistake(
        "exo-stop-clamps-the-places",
        "out of range clamped",
        RELEASE,
        "keep",
        "places = eb90.unpack_s16(told.payload)[:FINGERS]",
        "places = [min(1000, max(0, place)) for place in eb90.unpack_s16(told.payload)[:FINGERS]]",
        "tests/stop/test_talk.py::test_a_hold_that_is_not_acknowledged_is_no_stop",
    ),
    mistake(
        "wrist-stop-axes-swapped",
        "byte order",
        STAY,
        "hold",
        "data = eb90.pack_s16([yaw, pitch])",
        "data = eb90.pack_s16([pitch, yaw])",
        "tests/stop/test_talk.py::test_a_wrist_is_held_where_it_is_yaw_first",
    ),
    mistake(
        "wrist-stop-asks-once",
        "stop sent once",
        STAY,
        "stay",
        "for count in range(ASKS):",
        "for count in range(1):",
        "tests/stop/test_talk.py::test_a_wrist_that_is_silent_twice_is_asked_a_third_time",
    ),
    mistake(
        "wrist-stop-refusal-told-as-success",
        "swallowed error",
        STAY,
        "hold",
        "refused = frame is not None and frame.data != bytes([eb90.ACCEPTED])",
        "refused = False",
        "tests/stop/test_talk.py::test_a_wrist_that_refuses_its_hold_was_not_stopped",
    ),
    mistake(
        "stop-sent-once",
        "stop sent once",
        TALK,
        "insisting",
        "for _ in range(times):",
        "for _ in range(1):",
        "tests/stop/test_talk.py::test_a_stop_that_is_one_write_goes_out_until_it_is_acknowledged",
    ),
    mistake(
        "stop-nothing-came-is-no-error",
        "evidence believed",
        TALK,
        "insisting",
        "error = ProtocolError if came else NoAnswer",
        "error = ProtocolError if came else None",
        "tests/stop/test_talk.py::test_a_stop_that_is_one_write_goes_out_until_it_is_acknowledged",
    ),
    mistake(
        "stop-listens-to-noise-for-ever",
        "deadline ignored",
        TALK,
        "_bytes",
        "while not deadline.expired and sum(map(len, pieces)) < MOST:",
        "while sum(map(len, pieces)) < 1000 * MOST:",
        "tests/stop/test_talk.py::test_a_line_full_of_noise_does_not_hold_a_stop_up",
    ),
    mistake(
        "stop-child-asks-too",
        "stop not sent",
        TALK,
        "unheard",
        "if (reads or not say.reads) and say.step not in steps:",
        "if reads and say.step not in steps:",
        "tests/stop/test_talk.py::test_who_cannot_listen_sends_what_changes_something",
    ),
)
