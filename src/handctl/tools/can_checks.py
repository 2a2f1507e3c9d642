"""The checks of `handctl doctor` that a CAN bus has of its own: the adapter, what its controller reports, the bitrate.

A bitrate is looked for by listening only: the controller neither sends nor acknowledges then, so that a wrong one
disturbs no one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from handctl.link import CanFrame, Deadline, FrameLink
from handctl.sentence import plural
from handctl.tools.machine_checks import Check

LISTEN_SECONDS = 0.25
BITRATES = (1_000_000, 500_000, 250_000, 125_000, 800_000)
"""Those of hands first: 1 Mbit/s (wrist §2.3), 500 kbit/s on sibling hands."""
REMEDIES = {
    "no-ack": "check the hand's power, CAN high and low, and the termination (120 ohm at both ends)",
    "bus-off": "check CAN high, CAN low and the bitrate. Opening the link starts the controller again",
    "refused": "unplug the adapter and plug it in again",
    "bel": "check the hand's power, CAN high and low, and the termination (120 ohm at both ends)",
    "bus-errors": "disconnect one of two devices that have one id, or check the termination (120 ohm at both ends)",
}
NAMES = {
    "no-ack": "no device acknowledges",
    "bus-off": "the CAN controller has left the bus (bus off)",
    "refused": "the adapter refuses frames (BEL)",
    "bel": "the adapter answers frames with BEL",
    "bus-errors": "frames are destroyed on the bus",
}


def adapter_check(link: FrameLink) -> Check:
    """Who the adapter says it is."""
    if link.adapter is None:
        return Check("adapter", "skipped", "this interface has no adapter that could be asked")
    return Check("adapter", "ok", link.adapter or "it answers, but reports neither version nor serial number")


def traffic(link: FrameLink, bound: Deadline, seconds: float) -> Check:
    """Frames of others before anything is sent."""
    deadline = link.deadline(seconds).earlier(bound)
    frames: list[CanFrame] = []
    while not deadline.expired and len(frames) < 1000:
        frame = link.receive(deadline)
        if frame is None:
            break
        frames.append(frame)
    if link.error_frames:
        remedy = "check bitrate, termination (120 ohm at both ends) and that a device is powered"
        return Check("unasked", "warning", f"{plural(link.error_frames, 'error frame')} on the bus", remedy)
    if link.damaged:
        remedy = "check the adapter's cable and hub, and that no other program reads its port"
        return Check(
            "unasked",
            "warning",
            f"{plural(link.damaged, 'damaged line')} of the adapter, such as {link.damage}",
            remedy,
        )
    return Check("unasked", "ok", f"{plural(len(frames), 'frame')} of others within {seconds:g} s")


def bus_checks(link: FrameLink, before: int, failed: Iterable[str], answered: bool, bound: Deadline) -> Iterator[Check]:
    """What the controller reports after the reads, and where no one answered, the bitrate.

    `failed` are the codes of reads that failed: their reports are over, as asking for them clears them.
    """
    trouble = link.trouble(before)
    if known := [code for code in failed if code in NAMES]:
        yield Check("bus", "warning" if answered else "fail", NAMES[known[0]], REMEDIES[known[0]])
    elif trouble is None:
        yield Check("bus", "skipped", "this interface reports no state of the bus")
    elif trouble.code:
        status = "warning" if answered else "fail"
        yield Check("bus", status, f"{NAMES[trouble.code]}. {trouble.evidence}", REMEDIES[trouble.code])
    else:
        yield Check("bus", "ok", f"no bus error. {trouble.evidence}")
    if not answered:
        yield _bitrate(link, bound)


def _bitrate(link: FrameLink, bound: Deadline) -> Check:
    """The bitrate at which frames of others are heard."""
    given = link.bitrate
    tried: list[int] = []
    noisy = False
    try:
        for bitrate in dict.fromkeys((given or BITRATES[0], *BITRATES)):
            if bound.expired:
                break
            heard = link.listen(bitrate, LISTEN_SECONDS)
            if heard is None:
                hint = (
                    "see the bitrate of a Linux interface with `ip -details link show can0`, "
                    "and the frames with `candump can0`"
                )
                return Check("bitrate", "skipped", "this interface cannot be set to listen only", hint)
            frames, errors = heard
            tried.append(bitrate)
            noisy = noisy or errors
            if frames and bitrate == given:
                return Check("bitrate", "ok", f"frames of others are heard at {given} bit/s")
            if frames:
                text = f"frames of others are heard at {bitrate} bit/s, not at {given}"
                return Check("bitrate", "fail", text, f"add ?bitrate={bitrate} to the LINK")
    finally:
        link.resume()
    at = f"handctl only listened, at {', '.join(map(str, tried))} bit/s"
    if noisy:
        hint = "check the termination (120 ohm at both ends), and add the bitrate of the bus to the LINK: ?bitrate=N"
        return Check("bitrate", "warning", f"the bus has traffic, but no whole frame was heard. {at}", hint)
    hint = "try adding ?bitrate=500000 to the LINK, but only while no other device is on the bus"
    return Check("bitrate", "skipped", f"no other device sends on this bus, so its bitrate cannot be heard. {at}", hint)
