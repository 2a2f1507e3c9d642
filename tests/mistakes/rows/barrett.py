"""The BarrettHand: GCL, how it is met, RealTime, firmware, care."""

from tests.mistakes.table import mistake

CONNECTING = "handctl.devices.barrett.gcl.connecting"
LINE = "handctl.devices.barrett.gcl.line"

ROWS = (
    mistake(
        "barrett-interrupt-is-a-boot-trigger",
        "boot trigger",
        LINE,
        "GclLine.abort_bytes",
        "return SAFE_ABORT if self.risky else ABORT",
        "return ABORT",
        "tests/barrett/test_line.py::test_an_interrupt_is_no_trigger_to_a_boot_monitor_at_any_speed",
    ),
    mistake(
        "barrett-stop-is-a-boot-trigger",
        "boot trigger",
        "handctl.devices.barrett.stopper",
        "_at",
        "data = SAFE_ABORT if speed is not None and speed > MONITOR_SPEED else ABORT",
        "data = ABORT",
        "tests/barrett/test_stop.py::test_nothing_that_goes_out_unheard_is_a_trigger",
        "tests/barrett/test_motion.py::test_stop_is_ctrl_c_and_power_off",
    ),
    mistake(
        "barrett-question-is-an-interrupt",
        "boot trigger",
        CONNECTING,
        "",
        'QUESTION = b"!\\0" + CR',
        "QUESTION = ABORT + CR",
        "tests/barrett/test_line.py::test_reads_are_retried_so_often",
        "tests/barrett/test_motion.py::test_a_spoiled_status_is_no_success",
    ),
)
