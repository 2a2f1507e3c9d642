"""URLs of pyserial: which there are, and where each leads. Needs no pyserial, and takes a URL apart exactly as that does."""

from __future__ import annotations

SCHEMES = ("socket", "rfc2217", "spy", "loop", "hwgrep", "alt", "cp2110")
"""Any other is refused: nobody could tell to which device it leads."""
OF_A_PORT = ("spy", "alt", "cp2110")
"""They name a port of this computer by its path."""
OF_A_HOST = ("socket", "rfc2217")


def scheme_of(link: str) -> str:
    """The scheme of a URL in small letters, "" for a LINK that is none."""
    scheme, separator, _ = link.partition("://")
    return scheme.lower() if separator else ""


def path_in(link: str) -> str:
    """The path, or COM name, of the port that a LINK names; "" where it names none, or finds one by other marks."""
    scheme = scheme_of(link)
    if not scheme:
        return "" if link.startswith(("usb:", "can:", "replay:")) else link
    if scheme not in OF_A_PORT:
        return ""
    from urllib.parse import urlsplit

    try:
        parts = urlsplit(link)
    except ValueError:
        return ""
    if scheme == "cp2110":
        return "" if parts.netloc else parts.path
    return f"{parts.netloc}{parts.path}"


def host_in(link: str) -> tuple[str, str] | None:
    """Host and port of a URL that leads to a host; None where it leads elsewhere, or says no port."""
    if scheme_of(link) not in OF_A_HOST:
        return None
    from urllib.parse import urlsplit

    try:
        parts = urlsplit(link)
        host, port = parts.hostname, parts.port
    except ValueError:
        return None
    return (host, str(port)) if host and port is not None else None
