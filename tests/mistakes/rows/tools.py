"""Tools that talk to a device without a family's own commands: `listen`, which sends nothing, and `terminal`."""

from tests.mistakes.table import mistake

LISTEN, TERMINAL = "handctl.tools.listen", "handctl.tools.terminal"
SENDS = "tests/tools/test_listen.py::test_not_a_byte_leaves"
ASKED = "tests/tools/test_terminal.py::test_what_may_write_is_asked_for"

ROWS = (
    mistake(
        "terminal-forgets-what-it-has-set-going",
        "a device that moves on",
        "handctl.tools.terminal",
        "Conversation.send",
        "device.will_move()  # a batch or a shell remembers it behind the end of the terminal",
        "run.journal._moving = device.stop, 1 << 30",
        "tests/kernel/test_batch.py::test_ctrl_c_stops_what_earlier_lines_have_set_going",
    ),
    mistake(
        "listen-meets-the-device",
        "a byte that nobody asked for reaches a device that is being switched on",
        LISTEN,
        "Record.__init__",
        "self._link = link = run.open_link(listening=find)",
        "self._link = link = run.open_link(listening=find)\nrun.device().read([])\nrun.device().identify()",
        SENDS,
    ),
    mistake(
        "listen-wakes-the-device",
        "a byte that nobody asked for reaches a device that is being switched on",
        LISTEN,
        "received",
        "return link.read(deadline), None  # type: ignore[attr-defined]",
        'link.write(b"\\r", deadline)\nreturn link.read(deadline), None',
        SENDS,
    ),
    mistake(
        "terminal-asks-nothing",
        "a frame that writes goes out unasked",
        TERMINAL,
        "terminal",
        "asks = [one for one in typed if one.question]",
        "asks = [one for one in typed if one.question and one.step.moves and len(typed) > 9]",
        ASKED,
    ),
    mistake(
        "terminal-judges-each-line-alone",
        "the second half of a frame that writes goes out unasked",
        TERMINAL,
        "Keyboard.take",
        "whole = data if self._can else self._begun + data",
        "whole = data",
        "tests/tools/test_terminal.py::test_the_rest_of_what_was_begun_is_asked_for_too",
    ),
    mistake(
        "terminal-believes-the-first-frame",
        "what follows a request to read goes out unasked",
        TERMINAL,
        "Keyboard._judged",
        "if all(piece.frame and piece.asks and self._rules.planned(piece.raw, can_id) is None for piece in pieces):",
        "if self._rules.planned(pieces[0].raw, can_id) is None:",
        ASKED,
    ),
    mistake(
        "terminal-goes-on-after-a-no",
        "a frame that writes goes out although the answer was no",
        TERMINAL,
        "_one",
        "run.confirm(typed.asked, [typed.step])",
        "run.prompts.confirm(typed.asked, '', [typed.step], None)",
        "tests/tools/test_terminal.py::test_a_person_is_asked_and_may_say_no",
    ),
    mistake(
        "terminal-lets-it-run",
        "Ctrl-C leaves the device moving",
        TERMINAL,
        "Conversation.send",
        "if step.moves and not run.journal.drives:",
        "if step.moves and run.journal.drives:",
        "tests/tools/test_terminal.py::test_ctrl_c_stops_what_a_line_has_set_going",
    ),
    mistake(
        "terminal-skips-the-identity",
        "a frame that writes reaches a stranger",
        TERMINAL,
        "Conversation.send",
        "device.admit(typed.whole, step.can_id)",
        "pass",
        "tests/tools/test_terminal.py::test_a_stranger_gets_nothing_that_writes",
    ),
)
