"""What a command leaves behind: in the words of an error, once, wherever it is told."""

from __future__ import annotations

import pytest

from handctl.errors import Aftermath, CheckFailed, HandctlError, Interrupted, LinkError, NoAnswer
from handctl.model.prompts import Prompts
from handctl.model.result import Counters
from handctl.model.stop_on_interrupt import NOT_STOPPED, on_early_end, stopped_by_ctrl_c
from handctl.model.stop_sequence import Stopped
from tests.support.each_row import each_row

LEFT = Aftermath("the hand goes on", "let it finish")


def test_an_error_tells_what_is_left_behind_its_text_and_before_its_hint() -> None:
    error = LinkError("the port is gone", hint="look at the cable")
    error.add_aftermath(Aftermath("the hand goes on", "let it finish", joint=". "))
    assert (error.text, error.hint) == ("the port is gone. The hand goes on", "let it finish. Look at the cable")
    assert str(error) == error.text
    error.add_aftermath(Aftermath("and on"))
    assert (error.text, error.hint) == (
        "the port is gone. The hand goes on. And on",
        "let it finish. Look at the cable",
    )


def test_what_stands_behind_the_hint_is_the_last_step() -> None:
    error = LinkError("the port is gone", hint="look at the cable.")
    error.add_aftermath(Aftermath("half is set", "keep away", behind="already set: a.", joint=". "))
    assert error.hint == "keep away. Look at the cable. Already set: a."
    error.text = "gone"
    assert (error.text, error.hint) == ("gone", "keep away. Look at the cable. Already set: a.")
    bare = LinkError("gone", left=Aftermath(behind="already set: a"))
    assert bare.hint == "already set: a"


def test_what_is_told_anew_is_all_that_is_told() -> None:
    error = CheckFailed("off", hint="again")
    error.add_aftermath(Aftermath("it moves", "switch it off", moving=True))
    told = error.reworded("other", hint="next")
    assert (told.text, told.hint, told.left.moving, type(told)) == ("other", "next", False, CheckFailed)
    assert error.reworded("other").hint == "switch it off. Again"
    error.text += "!"
    assert (error.text, error.hint) == ("off. It moves!", "switch it off. Again")
    error.hint = "none"
    assert (error.text, error.hint, error.left.moving) == ("off. It moves!", "none", True)


@each_row("sent", [0, 1])
def test_only_what_was_sent_is_left(sent: int) -> None:
    counters = Counters(writes=3)
    with pytest.raises(LinkError) as lost, on_early_end(LEFT, since=counters):
        counters.writes += sent
        raise LinkError("gone")
    assert lost.value.text == ("gone. The hand goes on" if sent else "gone")
    with pytest.raises(Interrupted if sent else KeyboardInterrupt) as ended, on_early_end(LEFT, since=counters):
        counters.writes += sent
        raise KeyboardInterrupt
    if isinstance(ended.value, Interrupted):
        assert (ended.value.text, ended.value.hint) == ("interrupted: the hand goes on", "let it finish")


def test_a_step_is_the_text_of_ctrl_c() -> None:
    with (
        pytest.raises(Interrupted, match="interrupted: it was sent") as ended,
        on_early_end(Aftermath(hint="it was sent")),
    ):
        raise KeyboardInterrupt
    assert ended.value.hint == ""
    with pytest.raises(KeyboardInterrupt), on_early_end(LEFT, interrupt=False):
        raise KeyboardInterrupt
    with (
        pytest.raises(CheckFailed, match="off") as failed,
        on_early_end(Aftermath(hint="it was sent"), by=HandctlError),
    ):
        raise CheckFailed("off", hint="look")
    assert failed.value.hint == "it was sent. Look"


def test_ctrl_c_stops_first_and_tells_then() -> None:
    done: list[str] = []

    def stop() -> Stopped:
        done.append("stop")
        return Stopped("it stands")

    with pytest.raises(Interrupted, match="interrupted: it stands"), stopped_by_ctrl_c(stop, Prompts()):
        raise KeyboardInterrupt
    assert done == ["stop"]


def test_ctrl_c_is_130_only_where_the_stop_was_acknowledged() -> None:
    """Else the code of what speaks against it, with what to do."""
    failed = Stopped("nothing answered", "switch the power off", NoAnswer)
    with pytest.raises(NoAnswer, match="nothing answered") as caught, stopped_by_ctrl_c(lambda: failed, Prompts()):
        raise KeyboardInterrupt
    assert (caught.value.exit_code, caught.value.code, caught.value.hint) == (4, NOT_STOPPED, "switch the power off")
