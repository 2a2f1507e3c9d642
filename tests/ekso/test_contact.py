"""Contact with an EksoNR that is not the one in the books: replies of another form, a message less."""

from __future__ import annotations

import pytest

from tests.search.contact_worlds import EKSO, SERVICES
from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.odd_devices import odd_ekso

FORMS = ["msgID low byte first", "msgID 0", "CRC low byte first", "CRC inverted", "sum for CRC", "length 0"]


def asked(*words: str, fault: str = "") -> Result:
    return run("ekso", *words, "-p", f"fake://ekso?clock=virtual&fault={fault}", "--json")


@each_row("name", FORMS)
def test_replies_of_another_form_are_contact_and_no_value(name: str) -> None:
    with odd_ekso(every=lambda data: EKSO[name](data) if len(data) > 6 else data):
        result = asked("status")
    assert result.code == 5, result
    assert "other-form" in result.codes()
    assert not result.rows


@each_row("fault", ["bad-checksum", "cut-short", "noise", "wrong-id", "wrong-command", "acknowledge"])
def test_a_disturbed_line_is_no_other_form(fault: str) -> None:
    assert "other-form" not in asked("status", fault=fault).codes()


@pytest.mark.parametrize("instead", [None, b"", b"\0\3"], ids=["silent", "acknowledged", "refused"])
@pytest.mark.parametrize("message", ["settings", "data", "feedback"])
def test_a_message_that_is_not_there_is_left_out(message: str, instead: bytes | None) -> None:
    usual = len(asked("dump").rows)
    with odd_ekso(body=lambda command, data: instead if command == SERVICES[message] else data):
        dump, status, check = asked("dump"), asked("status"), asked("status", "--check")
    assert (dump.code, status.code) == (0, 0), (dump, status)
    assert (check.code, check.error["code"] if check.code else "") == (
        (0, "") if message == "feedback" else (7, "unhealthy")
    )
    assert "not-on-this-firmware" in dump.codes()
    assert "not-on-this-firmware" in status.codes()
    assert len(dump.rows) == usual - {"settings": 22, "data": 27, "feedback": 17}[message]
    assert not [row for row in (*dump.rows, *status.rows) if "error" in row]


@each_row("message", ["settings", "data", "feedback"])
def test_a_message_of_another_size_is_there_and_not_read(message: str) -> None:
    for change in (lambda data: data[:-2], lambda data: data + b"\0\0"):
        with odd_ekso(body=lambda command, data, change=change: change(data) if command == SERVICES[message] else data):
            dump, status = asked("dump"), asked("status")
        assert (dump.code, status.code) == (5, 5), (dump, status)
        assert "not-on-this-firmware" not in dump.codes() + status.codes()
        assert {"error" in row for row in status.rows} == {True, False}, "the others are shown"


def test_what_alone_is_not_answered_is_asked_with_reads_only() -> None:
    """A write was answered last: nothing of it is sent to look who is there."""
    from handctl.devices.ekso.frames import Command
    from handctl.devices.ekso.parameter_map import EKSO
    from tests.ekso.support import Unit, ekso_on

    unit = Unit()
    unit.on = {SERVICES["feedback"]: lambda _msg_id, _body: []}
    ekso = ekso_on(unit)
    ekso.port.exchange(Command.CANCEL_ACTION, b"\1\0")
    assert ekso.asked("feedback")[0].error is not None
    assert unit.commands().count(int(Command.CANCEL_ACTION)) == 1
    sent = len(unit.sent)
    readings = ekso.read([*EKSO["walk_time"].each, *EKSO["step_length"].each])
    assert [reading.value is None for reading in readings] == [True, False]
    assert len(unit.sent) == sent + 1
