"""What a user may say about how the hand speaks: who begins, what asks, what ends an object."""

from __future__ import annotations

import json
from math import inf
from pathlib import Path

import pytest

from handctl.devices.aidin.exchange_settings import (
    FIND_OUT,
    ExchangeMode,
    ExchangeSettings,
    exchange_settings_of,
    neutral,
)
from handctl.devices.aidin.stopper import ENDS
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError, UsageError
from handctl.model.command_settings import Settings
from tests.aidin.support import Streamer, feedback, hand_on, line, poller, simulated, stopped, streamer
from tests.support.cli import run, sent
from tests.support.each_row import each_row
from tests.support.refused import refused
from tests.support.scripted import ScriptedLink


def test_the_default_finds_out() -> None:
    assert exchange_settings_of(Settings()) == FIND_OUT == ExchangeSettings(ExchangeMode.UNKNOWN, b"{}", b"\n")
    assert exchange_settings_of(
        Settings(own={"exchange": "poll", "poll_json": ' { "a" : [1, 2.5, "\u00e4"] }', "tx_terminator": "nul"})
    ) == ExchangeSettings(ExchangeMode.POLL, b'{"a":[1,2.5,"\\u00e4"]}', b"\0")


@each_row("text", [
    '{"hand_mode":3}', '{"HAND_MODE":3}', '{"get":1,"hand_mode":1}', '{"a":[{"hand_mode":3}]}', '{"a":{"hand_mode":3}}',
    '{"hand\\u005fmode":3}', '{" hand_mode ":3}', '{"hand_mode\\u0000":3}', '{"maxtorque":0}', '{"hand_TP_cmd":[0]}', '{"hand_joint_cmd":[]}',
    '{"hand_taskspace_cmd":[]}', '{"hand_TT_cmd":[500]}',
])  # fmt: skip
def test_a_poll_object_never_commands(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        neutral(text)
    assert caught.value.code == "commanding-poll"


@each_row("text", [
    "", "{", "[1]", "1", "null", '{"a":NaN}', '{"a":Infinity}', '{"a":1e999}', "{'a':1}", '{"a":1}{"hand_mode":3}', "[" * 5000,
    '{"a":' * 20 + "1" + "}" * 20, '{"a":"' + "x" * 2040 + '"}',
])  # fmt: skip
def test_what_is_no_poll_object(text: str) -> None:
    with pytest.raises(UsageError):
        neutral(text)


def test_line_ends_in_the_text_do_not_end_the_object() -> None:
    assert neutral('{"a":\r\n"b\\n\\u0000"}') == b'{"a":"b\\n\\u0000"}'


@each_row("exchange", ["stream", "command"])
def test_a_poll_object_that_would_never_be_sent(exchange: str) -> None:
    with pytest.raises(UsageError):
        exchange_settings_of(Settings(own={"exchange": exchange, "poll_json": "{}"}))


# -- the exchange -----------------------------------------------------------------------------------------------------


def test_a_stream_is_never_asked() -> None:
    link = streamer()
    assert hand_on(link, way=ExchangeSettings(ExchangeMode.STREAM)).dump().failure is None
    assert link.sent == []
    mute = ScriptedLink()
    with pytest.raises(NoAnswer, match="--exchange stream sends no request"):
        hand_on(mute, way=ExchangeSettings(ExchangeMode.STREAM)).dump()
    assert (mute.sent, mute.clock) == ([], pytest.approx(1.0))


def test_a_poll_is_asked_at_once_with_the_object_of_the_user() -> None:
    link = poller(lambda request: feedback() if request == b'{"get":1}\r\n' else None)
    hand = hand_on(link, way=ExchangeSettings(ExchangeMode.POLL, neutral('{"get": 1}'), b"\r\n"))
    assert hand.dump().failure is None
    assert link.sent == [b'{"get":1}\r\n'] * 2
    assert link.sent_at[0] == 0.0
    mute = ScriptedLink()
    with refused(NoAnswer, "no-answer", '{"get":1}'):
        hand_on(mute, way=ExchangeSettings(ExchangeMode.POLL, neutral('{"get": 1}'))).dump()
    assert mute.sent == [b'{"get":1}\n'] * 2


def test_a_hand_that_answers_commands_is_not_commanded_to_look() -> None:
    link = poller(feedback())
    for silent in (False, True):
        with pytest.raises(UsageError) as caught:
            hand_on(link, way=ExchangeSettings(ExchangeMode.COMMAND)).conversation.connect(silent=silent)
        assert caught.value.code == "commands-only"
    assert link.sent == []


@each_row(("end", "data"), [("newline", b"\n"), ("none", b""), ("nul", b"\0"), ("crlf", b"\r\n")])
def test_every_object_has_the_terminator(end: str, data: bytes) -> None:
    hand, link = simulated(start="homed", exchange="poll", reader="nul" if end == "nul" else "tolerant")
    hand.conversation.way = exchange_settings_of(Settings(own={"tx_terminator": end}))
    hand.dump()
    stopped(link, tx_terminator=end)
    assert set(link.sent) == {b"{}" + data, b'{"hand_mode":3}' + data}


# -- what stop proves -------------------------------------------------------------------------------------------------


def test_stop_says_when_feedback_proves_nothing() -> None:
    idle = stopped(streamer(feedback(current_state=[20, -20] + [0] * 13)))
    assert idle.error is None and "does not show that the motors are off" in idle.text
    left = iter([300, 250, 200, 150] + [0] * 1000)
    busy = stopped(poller(lambda _: feedback(current_state=[next(left)] * 15)))
    assert busy.error is None and "the currents stopped" in busy.text
    hand = hand_on(Streamer(lambda t: line(feedback(current_state=[300 * (t < 1)] * 15)), 0.1))
    hand.dump()
    hand.link.sleep(1.0)
    assert hand.stop().evidence == "the currents stopped", "it was seen in the feedback before the stop"


def turning(counts: float, until: float = inf, **changes: object) -> Streamer:
    """A hand whose index.m3 turns by so many counts a second, at a current that counts as none."""
    at = lambda t: [0] * 5 + [round(counts * min(t, until))] + [0] * 9  # noqa: E731
    return Streamer(lambda t: line(feedback(**{"motor_pos": at(t), "current_state": [15] * 15, **changes})))


def turned_by_requests() -> ScriptedLink:
    """The same of a hand that only replies."""
    link = poller(
        lambda _: feedback(motor_pos=[0] * 5 + [round(17000 * link.clock)] + [0] * 9, current_state=[15] * 15)
    )
    return link


@each_row("name", STOPS := {
    "turns at a low current": (lambda: turning(17000), DeviceRefused, ""),
    "turns the other way, slowly": (lambda: turning(-1700), DeviceRefused, ""),
    "obeys late": (lambda: turning(17000, until=2.5), DeviceRefused, ""),
    "coasts": (lambda: turning(170000, until=0.2), None, ""),
    "turns, and its currents are missing": (lambda: turning(17000, current_state="?"), DeviceRefused, ""),
    "turns, polled": (turned_by_requests, DeviceRefused, ""),
    "holds": (lambda: streamer(feedback(current_state=[20] * 15)), None, ""),
    "tells no positions": (lambda: streamer({"current_state": [0] * 15}), ProtocolError, ""),
    "falls silent": (lambda: Streamer(lambda t: line(feedback()) if t < 0.1 else b"", period=0.02), NoAnswer, ""),
    "was ended": (lambda: Streamer(lambda t: line(feedback(current_state=[300 * (t < 0.03)] * 15))), None, "the currents stopped"),
})  # fmt: skip
def test_what_the_motors_show_behind_a_stop(name: str) -> None:
    """A motor that turns is not stopped, however low its current; and standing motors show nothing of their power."""
    make, error, evidence = STOPS[name]
    ended = stopped(make())
    assert (ended.error, ended.evidence) == (error, evidence), ended


def test_the_end_of_a_movement_shows_no_stop() -> None:
    """Its currents end with the last target: only what lasts until it is stopped shows that it was."""
    fading = lambda: Streamer(lambda t: line(feedback(current_state=[20 + 180 * (t < 0.03)] * 15)))  # noqa: E731
    assert stopped(fading()).evidence and not stopped(fading(), **{ENDS: True}).evidence


# -- the command line -------------------------------------------------------------------------------------------------

POLLED = "fake://aidin?clock=virtual&start=homed&exchange=poll"


@each_row("args", [
    ("status", "--exchange", "stream", "--poll-json", "{}"), ("status", "--poll-json", '{"hand_mode":3}'),
    ("status", "--exchange", "command"), ("joints", "index.q3=160", "--exchange", "command"), ("bias", "--exchange", "command"),
    ("watch", "--count", "1", "--exchange", "command"), ("home", "-n", "--poll-json", "x"), ("status", "--exchange", "push"),
    ("status", "--tx-terminator", "cr"),
])  # fmt: skip
def test_refused(args: tuple[str, ...], tmp_path: Path) -> None:
    trace = tmp_path / "t"
    result = run("aidin", *args, "-p", POLLED, "--trace", trace)
    assert result.code == 2, result
    assert not trace.exists() or sent(trace) == []


def test_options_at_any_level_and_in_the_environment(tmp_path: Path) -> None:
    trace = tmp_path / "t"
    polls = [b'{"a":1}\0']
    for args, env in (
        (("aidin", "--tx-terminator", "nul", "get", "motor_pos", "--poll-json", '{"a":1}'), {}),
        (("aidin", "get", "motor_pos"), {"HANDCTL_TX_TERMINATOR": "nul", "HANDCTL_POLL_JSON": '{"a":1}'}),
    ):
        assert run(*args, "-p", f"{POLLED}&reader=nul", "--trace", trace, env=env).code == 0
        assert sent(trace) == polls
    assert run("aidin", "status", "-p", POLLED, env={"HANDCTL_EXCHANGE": "push"}).code == 2
    assert run("exo", "dump", "--fake", "--exchange", "poll").code == 2


def test_a_dry_run_shows_the_terminator() -> None:
    for args in (("stop",), ("encoders", *["0"] * 15)):
        rows = run("aidin", *args, "-n", "--json", "--tx-terminator", "crlf").rows
        data = bytes.fromhex(rows[0]["bytes"])
        assert data.endswith(b"}\r\n") and json.loads(data)["hand_mode"] in (3, 10)


@each_row("link", ["/dev/ttyUSB0", "COM3", "usb:0403:6001", "spy:///dev/ttyUSB0"])
def test_the_hand_has_no_serial_wire(link: str) -> None:
    result = run("aidin", "status", "-p", link)
    assert result.code == 2
    assert "tcp://HOST (port 8000" in result.err


def test_without_a_link_the_hint_names_tcp() -> None:
    result = run("aidin", "status")
    assert result.code == 2
    assert "-p tcp://HOST (port 8000" in result.err and "ttyUSB" not in result.err
