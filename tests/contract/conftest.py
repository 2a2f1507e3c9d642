"""What share of the large products of the contract is tried."""

from __future__ import annotations

import os

import pytest

SHARE = 64
"""An ordinary run of the whole suite takes one cell of a large product in 64."""


@pytest.fixture
def each(request: pytest.FixtureRequest) -> int:
    """Each how manieth cell of a product is tried."""
    config = request.config
    whole_suite = not config.option.file_or_dir or config.option.file_or_dir == ["tests"]
    marked = "contract" in config.option.markexpr.replace("not contract", "")
    return int(os.environ.get("HANDCTL_CONTRACT_EACH", "1")) if marked or not whole_suite else SHARE
