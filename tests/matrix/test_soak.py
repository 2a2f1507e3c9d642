"""What the suite `soak` of `tests/search` measures by: rates, rows that are lost, and one slow reader."""

from __future__ import annotations

from collections import Counter

import pytest

from tests.search.soak import Reader, Stream, check_slow, rates, steady, undisturbed


def test_rates_of_windows() -> None:
    assert rates([n / 10 for n in range(61)]) == pytest.approx([10.0, 10.0, 10.0], rel=0.06)
    halved = [n / 100 for n in range(3000)] + [30 + n / 50 for n in range(1500)]
    with pytest.raises(AssertionError):
        steady(halved, 1)
    with pytest.raises(AssertionError):
        steady([n / 10 for n in range(200)], 11)
    assert steady([n / 10 for n in range(200)], 9).startswith("200 samples, 10.")


def test_a_reader_sees_what_is_lost() -> None:
    stream = Stream("exo", (), (), 2, 1)
    end = {
        "stream": {"samples": 2, "failed": 0},
        "counters": dict.fromkeys(("retries", "bad_frames", "stray_bytes"), 0),
    }
    reader = Reader([0.0, 0.5], Counter({0.0: 2, 0.5: 2}), {**end, "ok": True, "messages": []})
    reader.check_complete(stream)
    for broken in (
        Reader([0.0], Counter({0.0: 2}), reader.end),
        Reader([0.0, 0.5], Counter({0.0: 2, 0.5: 1}), reader.end),
    ):
        with pytest.raises(AssertionError):
            broken.check_complete(stream)


@pytest.mark.real
def test_a_slow_reader_loses_no_row() -> None:
    undisturbed(lambda: check_slow("exo watch", 1.0))
