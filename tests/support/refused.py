"""A refusal by its code: how it is worded stands in tests/messages alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from handctl.errors import HandctlError


@contextmanager
def refused(
    kind: type[HandctlError] | tuple[type[HandctlError], ...], code: str, *values: str
) -> Iterator[pytest.ExceptionInfo[HandctlError]]:
    """Like `pytest.raises`, of an error that has this code and names these values."""
    with pytest.raises(kind) as caught:
        yield caught
    assert caught.value.code == code, caught.value
    assert not [value for value in values if value not in caught.value.text], caught.value
