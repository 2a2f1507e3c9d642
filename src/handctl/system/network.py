"""Which address this computer has towards another one. Sends nothing."""

from __future__ import annotations


def source(address: str) -> str:
    """The address of this computer from which it would speak to `address`; "" where no way leads there. Sends nothing."""
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        try:
            asked.connect((address, 9))
            return str(asked.getsockname()[0])
        except OSError:
            return ""
