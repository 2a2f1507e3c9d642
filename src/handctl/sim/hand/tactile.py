"""What the skin of the simulated RH56 hands feels: 17 zones of a TP, 34 words of F1 and DG2 (dossier §3.4, §3.2).

A hand that touches nothing shows value i at index i, so that a swap is seen (dossier §10); what a finger grasps is added. Where
on a zone an object lies is invented: in its middle, weaker towards the edge.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

MOST = 4095
INVALID = 65535  # at 65280 and above a value is saturated or invalid (dossier §3.4)
VALUES = 1062
FINGER = ((3, 3), (12, 8), (10, 8))  # rows and columns of tip, nail, pad
THUMB = ((3, 3), (12, 8), (3, 3), (12, 8))  # tip, nail, middle, pad
PALM = (8, 14)


def _zones() -> list[tuple[int, int, int, int]]:
    """(finger 0..4 or 5 = palm, index of the first value, rows, columns), in the order of the addresses."""
    zones, first = [], 0
    for finger, shapes in enumerate((FINGER, FINGER, FINGER, FINGER, THUMB, (PALM,))):
        for rows, columns in shapes:
            zones.append((finger, first, rows, columns))
            first += rows * columns
    return zones


ZONES = _zones()
NAILS = (1, 4, 7, 10, 13)  # zones that an object within the hand does not touch
DEAD = (6, *range(12, 17))  # middle tip; thumb and palm (dossier §3.4)


def skin(presses: Sequence[float], dead: bool, saturated: bool, quiet: bool) -> list[int]:
    """All values of a TP for what each of six fingers is pressed with, g; the palm feels what all press together."""
    values = [0] * VALUES if quiet else list(range(VALUES))
    felt = [*presses[:4], max(presses[4:6]), sum(presses) / 6.0]
    for number, (finger, first, rows, columns) in enumerate(ZONES):
        if dead and number in DEAD:
            values[first : first + rows * columns] = [0] * (rows * columns)
        elif felt[finger] > 0.0 and number not in NAILS:
            for place in range(rows * columns):
                share = _share(place // columns, rows) * _share(place % columns, columns)
                values[first + place] = min(MOST, values[first + place] + int(felt[finger] * share))
    if saturated:
        values[0], values[-1] = INVALID, INVALID - 255
    return values


def _share(place: int, count: int) -> float:
    """1 in the middle, less towards the ends."""
    return 1.0 - abs(2.0 * place + 1.0 - count) / (count + 1.0)


def words(presses: Sequence[float]) -> list[int]:
    """F1 and DG2: of five fingers normal and tangential force in 0.01 N, direction, proximity (24 bits); a palm of 3 x 3."""
    found = []
    for number in range(5):
        press = presses[number] if number < 4 else max(presses[4:])
        near = 8000000 if press > 0.0 else 1000 * (number + 1)
        normal = min(65535, round(0.98 * press)) or 11 * (number + 1)
        found += [normal, normal // 4, 65535 if press <= 0.0 else 15 * number, near % 65536, near // 65536]
    return found + [201 + place + round(0.98 * sum(presses) / 60.0) for place in range(9)]
