"""What leaves handctl is a sentence: the capital and the full stop that a text lacks, and none where it would change a name."""

from __future__ import annotations

from handctl.errors import joined, typed
from handctl.wording import sentence
from tests.support.cli import fake, run
from tests.support.each_row import each_row


@each_row(
    ("text", "said"),
    [
        ("the hand did not answer within 0.3 s", "The hand did not answer within 0.3 s."),
        ("power-cycle the hand, then use `--baud 9600`", "Power-cycle the hand, then use `--baud 9600`."),
        ("nothing was sent (dry run)", "Nothing was sent (dry run)."),
        ("it's 5", "It's 5."), ("give a speed of 115200 bit/s", "Give a speed of 115200 bit/s."),
        ("wait for 0.5", "Wait for 0.5."), ("two values, both 1000", "Two values, both 1000."),
        ("", ""), ("Done.", "Done."), ("is it on?", "Is it on?"), ("the answer is:", "The answer is:"),
        ("the bytes EB 90 01 …", "The bytes EB 90 01 …"),
    ],
)  # fmt: skip
def test_an_ordinary_text(text: str, said: str) -> None:
    assert sentence(text) == said == sentence(said)


@each_row(
    ("text", "said"),
    [
        ("/dev/ttyUSB9: no such port", "/dev/ttyUSB9: no such port."), ("id 5 is taken", "id 5 is taken."),
        ("stdin: cannot be read", "stdin: cannot be read."), ("config, line 3: unknown key", "config, line 3: unknown key."),
        ("baud_code is already 0", "baud_code is already 0."), ("handctl sent nothing", "handctl sent nothing."),
        ("exo has no quantity 'x'", "exo has no quantity 'x'."), ("--fake needs none", "--fake needs none."),
        ("q3 is an angle", "q3 is an angle."), ("`handctl ports` lists them", "`handctl ports` lists them."),
        ("write /dev/ttyUSB0", "Write /dev/ttyUSB0"), ("give tcp://192.168.1.20:8000", "Give tcp://192.168.1.20:8000"),
        ("ping 192.168.1.20", "Ping 192.168.1.20"), ("add --yes", "Add --yes"), ("add -d NAME", "Add -d NAME"),
        ("give KEY=VALUE", "Give KEY=VALUE"), ("look into report.html", "Look into report.html"),
    ],
)  # fmt: skip
def test_a_name_stays_as_it_is_typed(text: str, said: str) -> None:
    assert sentence(text) == said == sentence(said)


def test_a_person_and_a_script_read_the_same_sentence() -> None:
    result = run("exo", "dump", "--json")
    assert result.error["text"].startswith("No device") and result.error["text"].endswith((".", "?"))
    assert f"handctl: error: {result.error['text']}\n  Next: {result.error['hint']}\n" == result.err


def test_a_name_of_this_command_is_never_capitalised() -> None:
    """A link or a file may be called as a word is; the next command has names of its own."""
    run("exo", "get", "id", "-p", "b", "-o", "lines")
    assert sentence("b at 9600 bit/s: no reply") == "b at 9600 bit/s: no reply."
    assert sentence("lines exists") == "lines exists."
    run("exo", "get", "id", "-p", fake())
    assert sentence("b at 9600 bit/s: no reply") == "B at 9600 bit/s: no reply."


def test_a_name_stays_as_it_is_typed_inside_a_text() -> None:
    """A device called as a word is: behind another one's part, too."""
    typed.add("ab")
    try:
        assert joined("aa: no reply", "ab: no reply") == "aa: no reply. ab: no reply"
        assert joined("aa: no reply", "cd: no reply") == "aa: no reply. Cd: no reply"
    finally:
        typed.clear()


def test_a_quantity_that_begins_a_message_keeps_its_name() -> None:
    for words in (("set", "calibrate=1"), ("set", "temperature.index=3")):
        result = run("exo", *words, "--fake", "--json")
        assert f"`{words[1].partition('=')[0].partition('.')[0]}`" in result.error["text"], result
