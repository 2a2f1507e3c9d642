"""The table of the hostile suite: a plugin of pytest, see conftest."""

from __future__ import annotations

from tests.harm.table import Table


def table() -> Table:
    """The plugin of pytest that prints it."""
    return Table("handctl-hostile", "hostile suite", "kind of hostility", "failed", "HANDCTL_HOSTILE")
