"""A hand that restarts while something is asked of it is recognised at once, in every wait (barrett §3.6, §5.2.1)."""

from __future__ import annotations

import pytest

from handctl.devices.barrett.gcl.line import Restarted
from tests.barrett.support import changes, codes, scripted, simulated
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.refused import refused

BANNER = b"\n\rBarrettHand Firmware\n\rVersion 4.33\n\r=> "
BOOTS = {
    "apart": [b":", BANNER],
    "one chunk": [b":" + BANNER],
    "banner alone": [BANNER],
}


@each_row("boot", BOOTS)
@each_row("echo", [b"", b"FGE", b"FGET P"])
def test_a_question_is_asked_again_after_the_prompt(boot: str, echo: bytes) -> None:
    hand, link = scripted({"FGET P": [echo + BOOTS[boot][0], "1 2 3 4"]})
    for place, piece in enumerate(BOOTS[boot][1:]):
        link.put(1.0 + place, piece)
    assert hand.line.read("FGET P").lines == ("1 2 3 4",)
    assert codes(hand) == ["restarted"]
    assert "must be initialized (HI)" in hand.journal.messages[0].text
    assert link.sent_at[-1] >= (1.0 if boot == "apart" else 0.0)
    assert b"\x03" not in link.sent


@each_row("boot", BOOTS)
@each_row("command", ["C", "FSET DP 5"])
def test_what_moves_or_writes_is_not_repeated(boot: str, command: str) -> None:
    hand, link = scripted({command: b"".join(BOOTS[boot])})
    with pytest.raises(Restarted) as caught:
        hand.line.ask(command)
    assert (caught.value.code, caught.value.exit_code) == ("restarted", 5)
    assert "must be initialized (HI)" in caught.value.text
    assert link.sent == [command.encode() + b"\r"], "no ^C: nothing moves any more"
    assert link.clock < 1.0


@each_row("boot", BOOTS)
def test_a_restart_ends_a_group_of_writes(boot: str) -> None:
    """Its RAM is that of the EEPROM again: what was set before is gone, and reading back this line alone would not show it."""
    hand, link = scripted({"FSET DP 5": "", "PSET LFT 1": b"".join(BOOTS[boot]), "*": "5"})
    with refused(Restarted, "restarted") as caught:
        hand.write(changes("LFT=1", "DP=5"))
    assert "Lost by the restart: FSET DP 5" in caught.value.hint
    assert link.commands == ["FSET DP 5", "PSET LFT 1"]


@each_row("echo", [b"", b"C\r\n"])
def test_the_monitor_alone_ends_a_movement_long_before_its_deadline(echo: bytes) -> None:
    """No banner comes behind the ':': firmware that is gone, or a boot window that is still open."""
    hand, link = scripted({"C": echo + b":"})
    with refused(Restarted, "restarted"):
        hand.line.ask("C")
    assert link.commands == ["C"]
    assert link.clock < 1.0


def test_a_stale_banner_before_a_write_keeps_it_back() -> None:
    hand, link = scripted({"FSET DP 5": ""})
    link.put(0.0, BANNER)
    link.sleep(0.1)
    with pytest.raises(Restarted, match="FSET DP 5 was not sent"):
        hand.line.ask("FSET DP 5")
    assert link.commands == []


def test_the_version_and_help_texts_are_no_restart() -> None:
    for texts in ("values", "names", "prose"):
        hand, _ = simulated(f"texts={texts}&initialized=1")
        assert "4.33" in hand.version()
        assert len(hand.line.read("?").lines) > 20
        assert codes(hand) == []
    hand, link = scripted({"?HI": b"?HI\n\rHI: Hand Initialize\n\r=> "})
    link.dribble = 0.003
    assert hand.line.read("?HI").lines == ("HI: Hand Initialize",)


def test_a_banner_before_the_echo_of_the_version_is_a_restart() -> None:
    hand, _ = scripted({"VERS": [BANNER, "V4.33"]})
    assert hand.line.read("VERS").lines == ("V4.33",)
    assert codes(hand) == ["restarted"]


@pytest.mark.parametrize("off", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("chunk", ["apart", "together"])
def test_watch_over_a_power_cycle(off: float, chunk: str) -> None:
    link = f"fake://barrett?clock=virtual&wire=auto&boot-chunk={chunk}&switch=1,{1 + off}&initialized=1"
    result = run("barrett", "watch", "P", "--rate", "5", "--duration", "6", "-p", link, "--json")
    assert "must be initialized (HI)" in result.out, result


@pytest.mark.parametrize("chunk", ["apart", "together"])
def test_realtime_over_a_power_cycle(chunk: str) -> None:
    link = f"fake://barrett?clock=virtual&wire=auto&boot-chunk={chunk}&switch=1,1.02&boot=0.05&initialized=1"
    result = run(
        "barrett", "realtime", "--receive", "position", "--motors", "1", "--duration", "3", "-p", link, "--json"
    )
    assert result.code == 5, result
    assert "the hand restarted because of a power or cable problem, and must be initialized (HI)" in result.out


@each_row("boot", [0.3, 0.46, 0.48, 0.5, 0.502, 0.51, 0.53, 0.55, 1.2])
def test_a_banner_that_begins_at_the_end_of_a_wait_is_heard_to_its_end(boot: float) -> None:
    hand, link = simulated(f"found=boot&boot={boot}&wire=auto&boot-chunk=together")
    assert codes(hand) == ["restarted"]
    assert b"\x03" not in b"".join(link.sent)
