"""The packages that handctl needs, and the oldest version of each that is known to do."""

from __future__ import annotations

import sys

PACKAGES = {"click": "8.1", "pyserial": "3.5", "rich": "13.7", "python-can": "4.3", "crcmod": "1.7", "bincopy": "20.0"}
TOML, BUILT_IN = {"tomli": "2.0"}, (3, 11)
"""What reads the configuration, and the first Python that can do so without it."""


def needed(python: tuple[int, ...] = sys.version_info[:2]) -> dict[str, str]:
    """Package -> oldest version, on a Python. A test compares with the package's own requirements."""
    return dict(PACKAGES) if python >= BUILT_IN else {**PACKAGES, **TOML}
