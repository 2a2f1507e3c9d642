"""Forward kinematics: the dossier's vectors, and the product of the four matrices of Table 9 as an independent oracle."""

from __future__ import annotations

import random
from math import cos, pi, sin, sqrt

import pytest

from handctl.devices.barrett.maintenance.fingertips import LIMITS, beyond, tip
from handctl.devices.barrett.realtime.joint_angles import Joints, joints
from tests.support.each_row import each_row

# F1 tip, F2 tip, F3 tip in mm, joints of F1 and F2 (barrett §9.5; dossier, section 10)
VECTORS = [
    ((0, 0, None), (0, 0, 0), (-25.0, -142.8684, 132.4394), (25.0, -142.8684, 132.4394), (0, 142.8684, 132.4394)),
    ((8500, 1575, None), (90, 68, 22.6667), (-52.7139, 0, 172.3713), (52.7139, 0, 172.3713), (0, 27.7139, 172.3713)),
    ((17000, 3150, None), (180, 136, 45.3333), (-25, -24.2640, 84.4638), (25, -24.2640, 84.4638), (0, -24.2640, 84.4638)),
    ((17500, 3150, None), (180, 140, 46.6667), (-25, -23.0082, 78.8620), (25, -23.0082, 78.8620), (0, -23.0082, 78.8620)),
    ((10000, 0, 6000), (0, 48, 58.6667), (-25, -44.4598, 146.9213), (25, -44.4598, 146.9213), (0, 44.4598, 146.9213)),
    ((12000, 1575, 8000), (90, 64, 64), (-53.0351, 0, 138.2736), (53.0351, 0, 138.2736), (0, 28.0351, 138.2736)),
]  # fmt: skip
Matrix = list[list[float]]


@each_row(("posture", "angles", "f1", "f2", "f3"), VECTORS)
def test_vectors(
    posture: tuple[int, int, int | None], angles: tuple[float, ...], f1: tuple[float, ...], f2: tuple[float, ...], f3: tuple[float, ...]
) -> None:  # fmt: skip
    position, spread, breakaway = posture
    for finger, expected in (("F1", f1), ("F2", f2), ("F3", f3)):
        got = joints(finger, position, spread, breakaway)
        assert got == pytest.approx((0 if finger == "F3" else angles[0], *angles[1:]), abs=5e-5)
        assert tip(finger, got) == pytest.approx(expected, abs=5e-5)


def link(a: float, alpha: float, d: float, theta: float) -> Matrix:
    """Equation 1: frame i in frame i-1."""
    ct, st, ca, sa = cos(theta), sin(theta), cos(alpha), sin(alpha)
    return [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d], [0, 0, 0, 1]]


def product(*matrices: Matrix) -> Matrix:
    result = [[float(i == j) for j in range(4)] for i in range(4)]
    for m in matrices:
        result = [[sum(result[i][k] * m[k][j] for k in range(4)) for j in range(4)] for i in range(4)]
    return result


def oracle(finger: str, angles: Joints) -> tuple[float, ...]:
    """Equation 2 with Tables 8 and 9."""
    r, j = {"F1": (-1, 1), "F2": (1, 1), "F3": (0, -1)}[finger]
    t1, t2, t3 = (angle * pi / 180 for angle in angles)
    chain = product(
        link(r * 25, 0, 84, r * t1 - pi / 2 * j),
        link(50, pi / 2, 0, t2 + 2.46 * pi / 180),
        link(70, 0, 0, t3 + 50 * pi / 180),
        link(50, -pi / 2, 9.5, 0),
    )
    return tuple(chain[i][3] for i in range(3))


def test_closed_form_is_the_product_of_the_matrices() -> None:
    chance = random.Random(5)
    for _ in range(500):
        angles = Joints(*(chance.uniform(-10, limit + 20) for limit in LIMITS))
        for finger in ("F1", "F2", "F3"):
            assert tip(finger, angles) == pytest.approx(oracle(finger, angles), abs=1e-10)


def test_the_spread_is_a_mirror() -> None:
    for spread in range(0, 3151, 350):
        x1, y1, z1 = tip("F1", joints("F1", 6000, spread))
        x2, y2, z2 = tip("F2", joints("F2", 6000, spread))
        assert (x1, y1, z1) == pytest.approx((-x2, y2, z2))
        assert tip("F3", joints("F3", 6000, spread)) == tip("F3", joints("F3", 6000, 0))


def test_breakaway_is_continuous_and_keeps_the_inner_link() -> None:
    before, at = joints("F2", 7000, 100), joints("F2", 7000, 100, 7000)
    assert at == pytest.approx(before)
    after = joints("F2", 7375, 100, 7000)
    assert after.inner == before.inner
    assert after.outer - before.outer == pytest.approx(4)  # 375 counts: 1 degree before, 4 after


def test_no_tip_leaves_the_bars_of_the_live_view() -> None:
    from handctl.devices.barrett.maintenance.fingertips import REACH

    for position in range(0, 20001, 500):
        for spread in range(0, 3151, 525):
            for finger in ("F1", "F2", "F3"):
                for breakaway in (None, 0):
                    x, y, z = tip(finger, joints(finger, position, spread, breakaway))
                    assert sqrt(x * x + y * y) < REACH and 0 < z < REACH


def test_limits() -> None:
    """50 counts of a finger beyond an end are still at it."""
    assert beyond(joints("F1", 17550, 3157), broken_away=False) == []
    assert beyond(joints("F1", 17551, 3158), broken_away=False) == [1, 2]
    assert beyond(joints("F1", 18151, 0), broken_away=False) == [2, 3]
    assert beyond(joints("F3", -50, 9999), broken_away=False) == []
    assert beyond(joints("F3", -51, 9999), broken_away=False) == [2]
    assert beyond(joints("F1", 12000, 1575, 8000), broken_away=True) == []  # 64 degrees: no limit there
