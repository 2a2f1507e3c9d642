"""In which state a client may find the simulated BarrettHand: what somebody, or a program that died, has left behind.

Puts the hand there at once; the states are those of the dossier's connect. Loaded with the hand, used on demand.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.barrett.board import Board

STATES = (
    "ready",
    "off",
    "boot",
    "monitor",
    "record",
    "loop",
    "loop-block",
    "loop-moving",
    "moving",
    "saving",
    "typed",
)
CRUISE = 16  # LCV that somebody has left: 1 count a sample (§6.2.1)


def put(device: Board, state: str) -> None:
    """Raises ValueError for a state that does not exist."""
    if state not in STATES:
        raise ValueError(f"unknown state {state!r}. Known: {', '.join(STATES)}")
    if state == "off":
        device.power(False)
        return
    if state in ("monitor", "record"):
        device.monitor.erase()
    if state in ("boot", "monitor", "record"):
        device.power(False)
        device.power(True)
        if state != "boot":
            device.monitor.until = None
            device.take()  # its ':' was said long ago
        if state == "record":
            device.feed(b"\xff")
            device.take()
        return
    if not device.powered:
        device.power(True)
    device.settle()
    for motor in device.hand.motors:
        motor.initialized = motor.initialized or state not in ("ready", "typed", "saving")
    lines = {"loop": b"LOOP\r", "moving": b"FSET MCV 16\rC\r", "saving": b"FSAVE\r", "typed": b"C"}
    line = lines.get(state.partition("-")[0], b"")
    device.feed(line)
    if state == "loop-block":
        device.feed(b"C" + bytes([CRUISE]))
    elif state == "loop-moving":
        device.feed(b"C" + (device.loop.block(CRUISE) if device.loop is not None else b""))
    device.take()
