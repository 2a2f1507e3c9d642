"""Links to a device: serial port, TCP, CAN, simulator, replay. `open_link(LINK)` picks the back end. Knows no protocol.

    /dev/ttyUSB0, COM3, spy:// socket:// rfc2217:// loop://   serial.py   (pyserial)
    usb:VID:PID[:SERIAL]                                      serial.py   (found by pyserial, then opened)
    tcp://host:port                                           tcp.py      (socket)
    fake://exo?seed=1                                         fake.py     (a simulator in this process)
    can:INTERFACE:CHANNEL[?bitrate=…]                         can.py      (python-can)
    replay:FILE                                               replay.py   (a transcript plays the device)

What all of them are is in link_interface.py. The clock belongs to the link: deadlines are made by it, so a link may run on
virtual time.
"""

from __future__ import annotations

from collections.abc import Mapping

from handctl.errors import UsageError
from handctl.link.link_interface import (
    ByteLink,
    CanFrame,
    Deadline,
    FrameLink,
    Link,
    NoFrames,
    NoLink,
    RawAccess,
    Trouble,
)

__all__ = [
    "ByteLink",
    "CanFrame",
    "Deadline",
    "FrameLink",
    "Link",
    "NoFrames",
    "NoLink",
    "RawAccess",
    "Trouble",
    "is_can",
    "open_link",
]


NO_OPTIONS: Mapping[str, str] = {}


def open_link(
    link: str,
    *,
    baud: int | None = None,
    tcp_port: int | None = None,
    exclusive: bool = True,
    listening: bool = False,
    simulator: Mapping[str, str] = NO_OPTIONS,
) -> Link:
    """Open `link`; `baud` in bit/s for serial ports, `tcp_port` for a tcp:// without a port.

    Not `exclusive` is for a stop only, which must go out although another program has the port. `simulator` are options of
    a simulated device beyond those of its LINK. `listening`: a CAN controller begins by listening only, where it can.

    Raises UsageError for a LINK that cannot be understood, LinkError for one that cannot be opened.
    """
    # Imported on use: a fake or a TCP link must not pay for pyserial.
    if link.startswith("fake://") and is_can(link):
        from handctl.link.fake import FakeFrames

        return FakeFrames(link, simulator)
    if link.startswith("fake://"):
        from handctl.link.fake import FakeLink

        return FakeLink(link, baud, simulator)
    if link.startswith("replay:"):
        from handctl.link.replay import open_replay

        return open_replay(link, baud)
    if link.startswith("tcp://"):
        from handctl.link.tcp import TcpLink

        return TcpLink(link, tcp_port)
    if link.startswith("can:"):
        from handctl.link.can import CanLink

        return CanLink(link, exclusive=exclusive, listening=listening)
    if not link:
        raise UsageError("the LINK is empty", hint="give a port, such as -p /dev/ttyUSB0, or --fake")
    kind, colon, rest = link.partition(":")
    if colon and kind in ("fake", "tcp"):
        raise UsageError(f"{link}: // is missing behind {kind}:", hint=f"give {kind}://{rest.lstrip('/')}")
    from handctl.link.serial import open_serial

    return open_serial(link, baud, exclusive=exclusive)


def is_can(link: str) -> bool:
    """Whether a LINK carries CAN frames instead of bytes."""
    if link.startswith("replay:"):
        from handctl.files import opened

        try:
            with opened(link.removeprefix("replay:"), "a transcript") as file:
                lines = (line for line in iter(lambda: file.readline(1 << 16), b"") if b">" in line or b"<" in line)
                first = next((line for line in lines if not line.lstrip().startswith(b"#")), b"")
                return b"> can " in first or b"< can " in first
        except (OSError, UsageError):
            return False  # opening it will say what is wrong
    if link.startswith("fake://bus?"):
        from handctl.link.fake import carries_frames

        return carries_frames(link)
    return link.startswith("can:") or (link.startswith("fake://") and "bus=can" in link.partition("?")[2].split("&"))
