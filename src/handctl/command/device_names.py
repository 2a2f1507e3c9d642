"""Which names a device may have in the configuration file, after -d and in a shell."""

from __future__ import annotations

NAME_HELP = "letters, digits, - and _"


def is_name(text: object) -> bool:
    """Whether a device may have this name: it must fit into a shell word and a bare TOML key."""
    return (
        isinstance(text, str)
        and bool(text)
        and text.isascii()
        and text.replace("-", "a").replace("_", "a").isalnum()
        and not text.startswith("-")
    )
