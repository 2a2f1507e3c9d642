"""What a stop that was acknowledged says of the axes: held, left alone, standing, moving, or not seen any more. In process."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

from handctl.errors import CheckFailed, DeviceRefused, HandctlError, NoAnswer
from handctl.model.command_settings import Settings
from handctl.model.movement import stands_still
from handctl.model.stop_check import Looks
from handctl.model.stop_sequence import AGAIN, StopContext, Stopped, exchange_steps, stop_sequence_of
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink

Place = Callable[[float], float]
"""Where an axis reads so many seconds after the last write."""


class Axes:
    """A device of EB 90 whose axes read by themselves: it acknowledges what is written, and nothing changes its `places`.

    `spaces` are the start addresses of what is read, set and, for an exo, of the forces; `silent_after` writes it is silent.
    """

    def __init__(self, actual: int, targets: int, places: Sequence[Place], silent_after: int = 99) -> None:
        self.actual, self.targets, self.places, self.silent_after = actual, targets, places, silent_after
        self.memory: dict[int, bytes] = {}
        self.writes: list[bytes] = []
        self.since = 0.0
        self.link = ScriptedLink(self.answer)

    def answer(self, request: bytes) -> list[Reply]:
        flag, address = request[4], int.from_bytes(request[5:7], "little")
        if len(self.writes) >= self.silent_after:
            return []
        if flag in (0x11, 0x30):
            data = b"".join(self._two(at) for at in range(address, address + request[7], 2))[: request[7]]
            body = request[4:7] + data
        else:
            self.writes.append(request)
            self.since = self.link.now()
            if flag in (0x31, 0x32) and request[3] == 0x0B:
                at = self.targets if flag == 0x32 else 1498
                self._keep(at, request[5:-1])
                body = bytes([flag]) + (self._places() if flag == 0x31 else bytes(10))
            else:
                self._keep(address, request[7:-1])
                body = request[4:7] + b"\x01"
        whole = bytes([request[2], len(body)]) + body
        return [(0.001, b"\x90\xeb" + whole + bytes([sum(whole) % 256]))]

    def _keep(self, address: int, data: bytes) -> None:
        for at in range(0, len(data), 2):
            self.memory[address + at] = data[at : at + 2]

    def _places(self) -> bytes:
        return b"".join(struct.pack("<h", round(place(self.link.now() - self.since))) for place in self.places)

    def _two(self, address: int) -> bytes:
        if self.actual <= address < self.actual + 2 * len(self.places):
            return self._places()[address - self.actual :][:2]
        return self.memory.get(address, b"\0\0")

    def stop(self, family: str, **settings: object) -> Stopped:
        own = Settings()._replace(**settings)  # type: ignore[arg-type]
        return exchange_steps(self.link, stop_sequence_of(family, StopContext(own, proven=True)), [])


def at(*places: float) -> list[Place]:
    return [lambda _seconds, place=place: place for place in places]  # type: ignore[misc]


def exo(*places: float, silent_after: int = 99) -> Axes:
    return Axes(1546, 1486, at(*places, 500), silent_after)


def wrist(*places: float, silent_after: int = 99) -> Axes:
    return Axes(1020, 1038, at(*places), silent_after)


def words(frame: bytes, start: int) -> list[int]:
    return list(struct.unpack(f"<{(len(frame) - 1 - start) // 2}h", frame[start:-1]))


EXO_HOLDS: list[tuple[list[int], list[int], type[HandctlError] | None, str]] = [
    ([100, 200, 300, 400, 500], [100, 200, 300, 400, 500], None, ""),
    ([100, 200, 1003, 400, 500], [100, 200, 1000, 400, 500], None, "middle reads 1003"),
    ([1020, 200, 300, 400, -20], [1000, 200, 300, 400, 0], None, "thumb reads -20"),
    ([1021, 200, 300, 400, 500], [-1, 200, 300, 400, 500], CheckFailed, "little reads 1021"),
    ([100, 200, 300, -1, 500], [100, 200, 300, -1, 500], CheckFailed, "index reads -1"),
    ([100, 200, 300, -21, 32767], [100, 200, 300, -1, -1], CheckFailed, "index reads -21, thumb reads 32767"),
    ([-1, -1, -1, -1, -1], [-1, -1, -1, -1, -1], CheckFailed, "thumb reads -1"),
]


@each_row("places, held, error, told", EXO_HOLDS)
def test_an_exo_holds_each_finger_that_reads_a_position(
    places: list[int], held: list[int], error: type[HandctlError] | None, told: str
) -> None:
    """The ends are those of the travel (exo §2.2.1); -1 leaves a finger alone (exo §2.3.7)."""
    hand = exo(*places)
    stopped = hand.stop("exo")
    force, hold = hand.writes
    assert words(force, 5) == [0] * 5 and words(hold, 5 if hold[4] == 0x32 else 7) == held, hold.hex(" ")
    assert (hold[4] == 0x32) == (-1 not in held)
    assert stopped.error is error and told in stopped.text, stopped


WRIST_HOLDS: list[tuple[tuple[int, int], str, list[int], type[HandctlError] | None]] = [
    ((-345, 1125), "0e04", [1125, -345], None),
    ((2220, 1125), "0e04", [1125, 2212], None),
    ((2263, 1125), "0e04", [1125], CheckFailed),
    ((-345, -2601), "1004", [-345], CheckFailed),
    ((-3000, 3000), "", [], CheckFailed),
]


@each_row("places, address, held, error", WRIST_HOLDS)
def test_a_wrist_holds_each_axis_that_reads_an_angle(
    places: tuple[int, int], address: str, held: list[int], error: type[HandctlError] | None
) -> None:
    """Yaw is set at 1038, pitch at 1040 (wrist §2.1): one alone is one register."""
    device = wrist(*places)
    stopped = device.stop("wrist")
    assert [(frame[5:7].hex(), words(frame, 7)) for frame in device.writes] == ([(address, held)] if address else [])
    assert stopped.error is error, stopped
    assert error is None or ("pitch" in stopped.text.partition("Not held")[2]) == (2263 in places), stopped


@each_row(
    ("family", "place", "then", "error"),
    [
        ("exo", 300, -1, CheckFailed),
        ("exo", 300, 32767, CheckFailed),
        ("exo", 1000, 1020, None),
        ("wrist", 1125, 32767, CheckFailed),
        ("wrist", 2550, 2590, None),
    ],
)
def test_a_reading_that_is_no_position_shows_no_standstill(
    family: str, place: int, then: int, error: type[HandctlError] | None
) -> None:
    """Each was held, and reads the same twice behind that: no value, or one that no finger has."""
    device = exo(100, place, 300, 400, 500) if family == "exo" else wrist(-345, place)
    commands = 2 if family == "exo" else 1
    device.places[1] = lambda _seconds: place if len(device.writes) < commands else then
    stopped = device.stop(family)
    assert stopped.error is error, stopped
    assert error is None or stopped.text.endswith("ring" if family == "exo" else "yaw"), stopped


def test_an_axis_that_was_not_held_and_is_seen_standing_is_no_error() -> None:
    hand = exo(100, 200, 300, 400, 500)
    hand.places = [*hand.places[:2], lambda seconds: 1100 if len(hand.writes) < 2 else 1010.0, *hand.places[3:]]
    stopped = hand.stop("exo")
    assert words(hand.writes[1], 7) == [100, 200, -1, 400, 500]
    assert stopped.error is None and "middle reads 1100" in stopped.text, stopped


def going(speed: float, start: float = 200) -> Place:
    return lambda seconds: start + speed * seconds


def braking(run_on: float, seconds: float = 0.25, start: float = 200) -> Place:
    """Runs on so far within that time, and rests there."""
    return lambda passed: start + run_on * min(1.0, passed / seconds)


def coming_back(over: float, start: float = 200) -> Place:
    """Is far over when it is first looked at."""
    return lambda passed: start + (max(0.0, over - 20 * passed) if passed > 0.1 else 0.0)


MOVES: list[tuple[str, Place, bool]] = [
    ("at rest", going(0), False),
    ("a reading that changes at rest", lambda seconds: 200 + 3 * (int(seconds * 1000) % 2), False),
    ("brakes within the silence", braking(30), False),
    ("brakes for longer", braking(60, 0.8), False),
    ("comes back to where it is held", coming_back(80), False),
    ("60 a second", going(60), True),
    ("-100 a second", going(-100, 800), True),
    ("20 a second", going(20), True),
    ("10 a second, within the noise from look to look", going(10), True),
    ("-7 a second", going(-7), True),
    ("brakes, and then creeps on", lambda seconds: 200 + min(60, 150 * seconds) + 8 * seconds, True),
    ("readings that wander within the noise", lambda seconds: 200 + (0, 2, 1, 3, 0, 1)[int(seconds / 0.2) % 6], False),
]


@each_row("family", ["exo", "wrist", "hand"])
def test_what_moves_slowly_behind_a_stop_is_seen(family: str) -> None:
    for what, place, moves in MOVES:
        if family == "hand":
            if what.startswith("comes back"):
                continue  # speed 0 holds nothing: a finger that moves does not obey
            device = Axes(1546, 1486, [place, *at(200, 300, 400, 500, 600)])
        elif family == "exo":
            device = Axes(1546, 1486, [*at(200, 300), place, *at(400, 500, 600)])
        else:
            device = Axes(1020, 1038, [place, *at(300)])
        stopped = device.stop(family, own={"protocol": "eb90"})
        assert (stopped.error is DeviceRefused) == moves and (moves or stopped.error is None), (what, stopped)


@each_row("family", ["hand", "exo", "wrist"])
def test_a_device_that_goes_on_behind_its_acknowledgement_is_stopped_once_more(family: str) -> None:
    """It stays an error: nobody knows why the first stop was not obeyed."""
    count = {"hand": 6, "exo": 6, "wrist": 2}[family]
    actual, targets = (1020, 1038) if family == "wrist" else (1546, 1486)
    once = Axes(actual, targets, at(*[300] * count))
    assert once.stop(family, own={"protocol": "eb90"}).error is None
    obeys = len(once.writes)

    def place(seconds: float) -> float:
        return 300 if len(device.writes) > obeys else 300 + 200 * seconds

    device = Axes(actual, targets, [place, *at(*[300] * (count - 1))])
    stopped = device.stop(family, own={"protocol": "eb90"})
    assert (stopped.error, len(device.writes)) == (DeviceRefused, 2 * obeys), stopped
    assert f"{AGAIN}, and now" in stopped.text


def test_the_rotation_of_the_thumb_is_its_wearers() -> None:
    """The hand has no motor for it (exo §2.3.7 has five): it may move behind a stop."""
    hand = Axes(1546, 1486, [*at(100, 200, 300, 400, 500), going(200)])
    assert hand.stop("exo").error is None


@each_row("family, silent_after", [("exo", 2), ("wrist", 1), ("hand", 1)])
def test_a_device_that_is_not_seen_again_is_no_success(family: str, silent_after: int) -> None:
    device = {
        "exo": lambda: exo(100, 200, 300, 400, 500, silent_after=silent_after),
        "wrist": lambda: wrist(100, 200, silent_after=silent_after),
        "hand": lambda: Axes(1546, 1486, at(*range(100, 700, 100)), silent_after),
    }[family]()
    answered = device.link.answer

    def answer(request: bytes) -> list[Reply]:
        """The last write itself is acknowledged."""
        return list(answered(request)) if request[4] in (0x11, 0x30) or len(device.writes) < silent_after else []

    device.link.answer = answer
    stopped = device.stop(family)  # a hand that has acknowledged in one protocol is not tried in the other
    assert stopped.error is NoAnswer and stopped.hint and stopped.heard, stopped
    assert len(device.writes) == silent_after


@each_row(
    ("readings", "verdicts"),
    [
        ((0, 0), [True]),
        ((0, 2, 2), [None, True]),
        ((0, 2, 0, 3), [None, None, True]),
        ((0, 3, 6, 9), [None, None, False]),
        ((0, 3, 6, 6), [None, None, True]),
        ((0, 2, 3, 5), [None, None, False]),
        ((0, 40, 60, 60), [None, None, True]),
        ((0, 40, 60, 90), [None, None, False]),
        ((0, 40, 60, 62, 61, 63), [None, None, None, None, True]),
        ((0, 40, 60, 62, 64), [None, None, None, False]),
    ],
)
def test_readings_after_a_stop(readings: tuple[int, ...], verdicts: list[bool | None]) -> None:
    """Equal ones stand at once; those that differ within the noise, here 3, are compared with the first one too."""
    looks = Looks([readings[0]], lambda before, now: stands_still(before, now, 3))
    assert [looks.judge([one]) for one in readings[1:]] == verdicts


@each_row(
    ("before", "now", "held", "still"),
    [
        ([5, 5], [5, 8], [], True),
        ([5, 5], [5, 9], [], False),
        ([5, 20], [5, 10], [5, 5], True),
        ([5, 5], [5, 10], [5, 5], False),
        ([5, 20], [5, 10], [5, None], False),
        ([20, 5], [10, 30], [5, 5], False),
    ],
)
def test_standing_still(before: list[int], now: list[int], held: list[int | None], still: bool) -> None:
    assert stands_still(before, now, 3, held) is still
