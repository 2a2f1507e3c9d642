"""A comparison of large values that fails tells so at once, wherever it runs."""

from __future__ import annotations

from random import Random

import pytest

from tests.support.each_row import each_row
from tests.support.telling import LARGE

DICE = Random(1)
ONE, OTHER = ("\n".join(f"{DICE.getrandbits(320):080x}" for _ in range(2000)) for _ in range(2))


@each_row("turned", [str, str.encode, str.splitlines, lambda text: {"rows": text.splitlines()}])
def test_a_large_comparison_tells_the_first_difference(turned: type[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """difflib would take minutes over these: with `CI` set pytest asks it for all of them."""
    monkeypatch.setenv("CI", "1")
    changed = ONE[:LARGE] + "x" + ONE[LARGE + 1 :]
    for left, right in ((ONE, OTHER), (ONE, changed)):
        with pytest.raises(AssertionError) as caught:
            assert turned(left) == turned(right)
        assert "differ" in str(caught.value) and len(str(caught.value)) < 1000


def test_what_must_not_be_in_a_large_text_is_told_with_its_place() -> None:
    with pytest.raises(AssertionError, match="at 4050: ") as caught:
        assert ONE[4050:4100] not in ONE
    assert len(str(caught.value)) < 1000
