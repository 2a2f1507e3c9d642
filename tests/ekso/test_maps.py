"""The map of the EksoNR says the same as the tables of its simulator, which were transcribed by themselves."""

from __future__ import annotations

import re

import pytest

from handctl.devices.ekso.frames import Command, encode
from handctl.devices.ekso.parameter_map import DATA, EKSO, FEEDBACK, SETTINGS, Word
from handctl.sim import create
from handctl.sim.ekso import device
from handctl.sim.ekso.device import crc
from tests.ekso.commands import DATA_WORDS, FEEDBACK_WORDS, SETTING_WORDS
from tests.support.each_row import each_row


class Unit:
    """The simulated EksoNR, one message at a time; the answer is taken apart by hand."""

    def __init__(self, **options: str) -> None:
        self.line = create("ekso", {"sway": "0", **options})
        self.line.advance(0.0)
        self.ident = 0

    def words(self, command: int, body: bytes = b"") -> list[int]:
        """The words of an answer."""
        self.ident += 1
        head = bytes([command, len(body), 0, self.ident]) + body
        self.line.feed(head + crc(head).to_bytes(2, "big"))
        answer = self.line.take()
        assert answer[0] == command and answer[2:4] == bytes([0, self.ident]) and crc(answer) == 0
        return [answer[at] * 256 + answer[at + 1] for at in range(4, len(answer) - 2, 2)]

    def set(self, number: int, raw: int) -> int:
        """The status code of a SetValue."""
        (status,) = self.words(155, number.to_bytes(2, "big") + (raw % 65536).to_bytes(2, "big"))
        return status % 256


def named(words: tuple[Word, ...]) -> list[object]:
    return [pytest.param(param, id=param.name) for param in words]


WRITABLE = tuple(param for param in SETTINGS if param.writable)


def test_both_books_have_the_same_names_ids_and_places() -> None:
    assert [(param.word, param.name, param.id) for param in SETTINGS] == [
        (place, row[0], row[1]) for place, row in enumerate(device.SETTINGS)
    ]
    assert [param.word for param in DATA] == list(range(device.DATA_COUNT))
    assert [param.word for param in FEEDBACK] == list(range(device.FEEDBACK_COUNT))
    assert sorted(param.id for param in WRITABLE if param.id is not None) == list(range(200, 220))


@each_row(
    ("words", "command", "expected"),
    [(SETTINGS, 152, SETTING_WORDS), (DATA, 153, DATA_WORDS), (FEEDBACK, 154, FEEDBACK_WORDS)],
    ids=["settings", "data", "feedback"],
)
def test_both_books_have_the_same_values_at_power_on(
    words: tuple[Word, ...], command: int, expected: tuple[tuple[str, int, int], ...]
) -> None:
    """Word by word: name, sign and scale of the map against the unit's own numbers."""
    got = Unit().words(command)
    assert len(got) == len(words)
    shown = [(param.name, param.raw_of(word), 10**param.decimals) for param, word in zip(words, got, strict=True)]
    assert shown[: len(expected)] == list(expected)
    assert [param.name for param in words[len(expected) :]] in ([], ["boot_time_high", "boot_time_low"])


@each_row("param", named(WRITABLE))
def test_what_is_set_by_id_is_read_in_its_word(param: Word) -> None:
    """The ParameterID of the map changes the word of the map, and no other."""
    unit = Unit()
    before = unit.words(152)
    raw = next(
        value for value in (1, 3, 2, 0, 90, 1000, 410) if value != before[param.word] and not _judged(param, value)
    )
    assert param.id is not None and unit.set(param.id, raw) == 0
    after = unit.words(152)
    assert [place for place in range(22) if before[place] != after[place]] == [param.word]
    assert after[param.word] == raw


def _judged(param: Word, raw: int) -> int:
    return device.judge_value(param.word, raw % 65536)


@each_row("param", named(tuple(param for param in WRITABLE if param.choices)))
def test_both_books_list_the_same_codes(param: Word) -> None:
    """Every listed code is taken, every other refused as not allowed (status 3); the whole list by SetValue."""
    assert param.id is not None
    unit = Unit(posture="sitting")
    taken = [code for code in range(64) if unit.set(param.id, code) == 0]
    assert taken == sorted(param.choices)
    assert unit.set(param.id, 65535) == 3


@each_row("param", named(tuple(param for param in WRITABLE if not param.choices)))
def test_what_the_unit_takes_fits_the_map(param: Word) -> None:
    """The unit's own (invented) limits lie within the wire type; only shifts go below 0."""
    allowed = device.SETTINGS[param.word][2]
    assert isinstance(allowed, range) and param.id is not None
    for raw, status in ((allowed[0], 0), (allowed[-1], 0), (allowed[-1] + 1, 2), (allowed[0] - 1, 2)):
        unit = Unit()
        assert unit.set(param.id, raw) == status
        if status == 0:
            param.check(param.from_raw(raw))
            assert param.raw_of(unit.words(152)[param.word]) == raw
    assert (allowed[0] < 0) == param.signed


def test_ids_that_neither_book_has() -> None:
    for number in (0, 199, 220, 65535):
        assert Unit().set(number, 1) == 3
        assert all(param.id != number for param in EKSO)
    assert {param.name for param in SETTINGS if not param.writable} == {"swing_complete", "pilot_id"}


@each_row("preset", ["order", "sign"])
def test_ladders_are_read_in_order_and_sign(preset: str) -> None:
    """Dossier 8.3: word i = (i + 1) * 256 + 128 + i, and F000 + 17 * i."""
    unit = Unit(preset=preset)
    for command, words in ((152, SETTINGS), (153, DATA), (154, FEEDBACK)):
        got = unit.words(command)
        for place, (param, word) in enumerate(zip(words, got, strict=True)):
            raw = (place + 1) * 256 + 128 + place if preset == "order" else 0xF000 + 17 * place
            assert word == raw
            assert param.raw_of(word) == (raw - 65536 if param.signed and raw > 32767 else raw), param.name


def test_requests_of_the_host_are_requests_to_the_unit() -> None:
    """The host's own frames, in every length convention."""
    for mode in ("body", "n-4", "n-2", "frame"):
        line = create("ekso", {"length": mode})
        line.advance(0.0)
        for command, body, size in (
            (152, b"", 50),
            (153, b"", 60),
            (154, b"", 40),
            (155, b"\0\xca\6\x0e", 8),
            (156, b"\1\0", 8),
        ):
            line.feed(encode(Command(command), 513, body, mode))
            answer = line.take()
            assert (answer[0], answer[2:4], len(answer), crc(answer)) == (command, b"\2\1", size, 0)


def test_names_and_texts() -> None:
    for param in (*SETTINGS, *DATA, *FEEDBACK):
        assert re.fullmatch(r"[a-z][a-z_]*", param.name), param.name
        assert param.doc and not param.doc.endswith("."), param.name
        assert param.source.startswith("ekso §6"), param.name
        assert param.access == ("rw" if param.id is not None else "r")
        assert not param.trigger and not param.moves
    assert len({param.name for param in EKSO}) == 22 + 27 + 15
