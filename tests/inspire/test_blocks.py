"""Few transactions: the plan of a dump, and what happens when the hand stays silent to a block across gaps."""

from __future__ import annotations

import pytest

from handctl.command.get_set_watch import select
from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.register_device import Memory, plan
from handctl.errors import HandctlError, NoAnswer, ProtocolError
from handctl.model.param import Element
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink, codes, fake_hand, hand_on, hexed, message, unhex

READ_HEAD = "EB 90 01 04 11 E8 03 0A 0B"
HEAD = "90 EB 01 0D 11 E8 03 01 00 00 00 00 00 00 00 00 00 0B"
READ_LIVE = "EB 90 01 04 11 C0 05 97 72"
READABLE = tuple(param for param in EXO if param.readable)
ALL = [element for param in READABLE for element in param.each]
GROUPS = [
    (1000, 1), (1001, 1), (1004, 1), (1005, 1), (1009, 1),
    (1472, 2), (1486, 10), (1498, 10), (1546, 12), (1582, 10), (1594, 10), (1606, 5), (1618, 5),
]  # fmt: skip


# -- the plan ---------------------------------------------------------------------------------------------------------


def spans(names: str) -> list[tuple[int, int]]:
    return [(block.address, block.size) for block in plan(tuple(EXO[name] for name in names.split()))]


def test_a_dump_is_two_blocks() -> None:
    """exo §2.3: 1000..1009 and 1472..1622; 623 bytes do not fit into one frame of 252."""
    assert [(block.address, block.size) for block in plan(READABLE)] == [(1000, 10), (1472, 151)]


def test_plans_of_some_quantities() -> None:
    assert spans("id") == [(1000, 1)]
    assert spans("position_set") == [(1486, 10)]
    assert spans("temperature position_set") == [(1486, 137)]
    assert spans("position_actual force_actual current error temperature") == [(1546, 77)]
    assert spans("id temperature") == [(1000, 1), (1618, 5)]
    assert plan(()) == []


def test_order_of_asking_does_not_matter() -> None:
    assert plan(READABLE[::-1]) == plan(READABLE)


def test_blocks_respect_the_limit() -> None:
    blocks = plan(READABLE, limit=40)
    assert all(block.size <= 40 for block in blocks)
    assert [group.name for block in blocks for group in block.groups] == [param.name for param in READABLE]
    assert [(block.address, block.size) for block in blocks] == [
        (1000, 10),
        (1472, 36),
        (1546, 12),
        (1582, 29),
        (1618, 5),
    ]


def test_memory_knows_what_was_read() -> None:
    memory = Memory()
    memory.blocks += [(1000, b"\x01\x02"), (1486, b"\x03\x04\x05")]
    assert memory.bytes_at(1000, 2) == b"\x01\x02"
    assert memory.bytes_at(1487, 2) == b"\x04\x05"
    assert memory.bytes_at(1001, 2) is None
    assert memory.bytes_at(999, 1) is None
    assert memory.bytes_at(1488, 2) is None


# -- reading ----------------------------------------------------------------------------------------------------------


def test_a_dump_is_exactly_two_requests() -> None:
    hand, link = fake_hand()
    table = hand.dump()
    assert [hexed(request) for request in link.sent] == [READ_HEAD, READ_LIVE]
    assert [row["value"] for row in table.rows if row["name"] == "position_actual"] == [110, 220, 330, 440, 550, 660]
    assert [block["address"] for block in table.extra["blocks"]] == [1000, 1472]
    assert [len(bytes.fromhex(block["raw"])) for block in table.extra["blocks"]] == [10, 151]
    assert hand.journal.counters.as_row()["sent"] == 2


def test_one_element_is_one_request_for_its_group() -> None:
    hand, link = fake_hand()
    (reading,) = hand.read(select(EXO, ("position_actual.index",)))
    assert (reading.value, hexed(reading.raw)) == (440, "B8 01")
    assert [hexed(request) for request in link.sent] == ["EB 90 01 04 11 0A 06 0C 32"]


def requests_of(link: object) -> list[tuple[int, int]]:
    """(address, count) of each read that was sent."""
    sent: list[bytes] = link.sent  # type: ignore[attr-defined]
    assert all(request[4] == 0x11 for request in sent)
    return [(int.from_bytes(request[5:7], "little"), request[7]) for request in sent]


def test_a_hand_silent_to_blocks_is_asked_group_by_group() -> None:
    hand, link = fake_hand("fault=block-silent")
    values = [reading.value for reading in hand.read(ALL)]
    assert values[:6] == [1, 0, 0, 0, 0, 558]
    assert values[-5:] == [31, 32, 33, 34, 35]
    assert None not in values
    assert requests_of(link) == [(1000, 10), (1000, 10), *GROUPS]
    assert codes(hand).count("block-silent") == 1
    assert "10 bytes at 1000" in message(hand, "block-silent")


def test_a_hand_that_was_silent_to_blocks_is_not_asked_for_one_again() -> None:
    hand, link = fake_hand("fault=block-silent")
    hand.read(ALL)
    before = len(link.sent)
    hand.read(ALL)
    assert requests_of(link)[before:] == GROUPS


def test_silence_to_the_first_block_and_its_first_group_is_nobody() -> None:
    hand, link = fake_hand("fault=silent")
    with pytest.raises(NoAnswer) as caught:
        hand.dump()
    assert caught.value.exit_code == 4
    assert requests_of(link) == [(1000, 10), (1000, 10), (1000, 1), (1000, 1), (1546, 2)]


def test_a_single_group_is_never_asked_as_a_block() -> None:
    hand, link = fake_hand("fault=block-silent")
    assert [reading.value for reading in hand.read(select(EXO, ("current",)))] == [21, 22, 23, 24, 25]
    assert requests_of(link) == [(1594, 10)]
    assert codes(hand) == []


@each_row(
    ("fault", "kind"),
    [("bad-checksum", ProtocolError), ("wrong-id", ProtocolError), ("loopback", ProtocolError), ("silent", NoAnswer)],
)
def test_nothing_readable_at_all_is_an_error(fault: str, kind: type[HandctlError]) -> None:
    hand, _ = fake_hand(f"fault={fault}")
    with pytest.raises(kind):
        hand.dump()


# -- in part ----------------------------------------------------------------------------------------------------------


def without(address: int, size: int, reply: bytes | None = None) -> ScriptedLink:
    """A hand that answers all reads with zeros, except those that touch a span: silence, or `reply`."""

    def answer(request: bytes) -> list[Reply]:
        first, count = int.from_bytes(request[5:7], "little"), request[7]
        if first < address + size and address < first + count:
            return [(0.001, reply)] if reply is not None else []
        body = bytes([request[2], count + 3, 0x11]) + request[5:7] + bytes(count)
        return [(0.001, b"\x90\xeb" + body + bytes([sum(body) % 256]))]

    return ScriptedLink(answer)


def test_a_group_that_is_not_there_leaves_the_others() -> None:
    """What answered before answers again, and that group alone does not, twice: this firmware does not have it."""
    hand = hand_on(without(1594, 10))
    table = hand.dump()
    assert table.failure is None
    assert not [row for row in table.rows if "error" in row or row["name"] == "current"]
    assert sum("value" in row for row in table.rows) == 37
    assert "not-on-this-firmware" in codes(hand)
    (found,) = hand.read([Element(hand.map["current"], 0)])
    assert (found.value, found.error and found.error.exit_code) == (None, 4)


def test_a_group_of_which_a_part_is_silent_is_on_this_firmware() -> None:
    hand = hand_on(without(1596, 2))
    table = hand.dump()
    assert table.failure is not None and table.failure.exit_code == 4
    assert {row["name"] for row in table.rows if "error" in row} == {"current"}
    assert "not-on-this-firmware" not in codes(hand)


def test_a_group_that_is_silent_while_all_are_is_not_called_missing() -> None:
    """It answers no read across gaps, and nothing at all from its errors on."""
    over: list[bool] = []

    def answer(request: bytes) -> list[Reply]:
        address, count = int.from_bytes(request[5:7], "little"), request[7]
        over.extend([True] * (address == 1606))
        body = bytes([request[2], count + 3, 0x11]) + request[5:7] + bytes(count)
        good = count <= 12 and not over
        return [(0.001, b"\x90\xeb" + body + bytes([sum(body) % 256]))] if good else []

    hand = hand_on(ScriptedLink(answer))
    table = hand.dump()
    assert {row["name"] for row in table.rows if "error" in row} == {"error", "temperature"}
    assert table.failure is not None
    assert table.failure.exit_code == 4
    assert "not-on-this-firmware" not in codes(hand)


@each_row("reply", [None, "90 EB 01 9A 11 C0 05 00 00", "00 55 AA", "90 EB 01 05 11 C0 05 2E 02 0D"])
def test_a_second_block_that_fails_leaves_the_first(reply: str | None) -> None:
    """Everything from 1472 on cannot be read; what was read before is shown, the rest is marked."""
    hand = hand_on(without(1472, 151, unhex(reply) if reply else None))
    table = hand.dump()
    good = {row["name"] for row in table.rows if "value" in row}
    assert good == {"id", "baud_code", "clear_errors", "save", "calibrate"}
    assert sum("error" in row for row in table.rows) == 37
    assert table.failure is not None
    assert table.failure.exit_code in (4, 5)


@each_row("reply", ["90 EB 01 9A 11 C0 05 00 00", "00 55 AA", "90 EB 01 05 11 C0 05 2E 02 0D"])
def test_an_unreadable_second_block_never_ends_the_first(reply: str) -> None:
    """The same when only the block fails, not its groups: the groups one by one may still do."""

    def answer(request: bytes) -> list[Reply]:
        if hexed(request) == READ_LIVE:
            return [(0.001, unhex(reply))]
        body = bytes([request[2], request[7] + 3, 0x11]) + request[5:7] + bytes(request[7])
        return [(0.001, b"\x90\xeb" + body + bytes([sum(body) % 256]))]

    table = hand_on(ScriptedLink(answer)).dump()
    assert {row["name"] for row in table.rows if "value" in row} >= {"id", "baud_code"}


def test_a_snapshot_leaves_out_what_this_firmware_lacks_and_refuses_to_be_partial() -> None:
    from handctl.command.snapshots import read_values

    hand = hand_on(without(1498, 10))
    assert "force_set.little" not in read_values(hand, hand.map.kept())
    with pytest.raises(HandctlError) as caught:
        hand = hand_on(without(1486, 22))
        read_values(hand, hand.map.kept(), needed={"force_set.little"})
    assert caught.value.exit_code == 4
    assert "force_set.little" in caught.value.text
