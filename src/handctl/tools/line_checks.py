"""The checks of `handctl doctor` for what a serial line does to answers: what a family measured of it, in words."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from handctl.model.profile import Profile
from handctl.tools.machine_checks import Check

BLUETOOTH = 20
"""Bytes of a packet of Bluetooth 4.0 as serial modules send them (exo §1.1)."""
ONE_MASTER = "leave only one device and one master on the line: end other programs, or disconnect the second master"


def line_checks(line: Profile, failed: Collection[str], unasked: bool) -> Iterator[Check]:
    """First byte, half duplex, packets, others. `failed`: codes of reads that failed; `unasked`: data came by itself."""
    answered = bool(len(line.trips))
    yield _first_byte(failed, answered)
    yield _half_duplex(line)
    yield _packets(line)
    yield _others(line, unasked)


def _first_byte(failed: Collection[str], answered: bool) -> Check:
    if "first-byte-lost" in failed:
        remedy = "use another RS-485 adapter, or set this one to switch its direction sooner"
        return Check("first_byte", "warning" if answered else "fail", "replies arrive without their first byte", remedy)
    if not answered:
        return Check("first_byte", "skipped", "no reply arrived")
    return Check("first_byte", "ok", "replies arrive with their first byte")


def _half_duplex(line: Profile) -> Check:
    if line.half_duplex is None:
        return Check("half_duplex", "skipped", "only a reply shows whether the line is full duplex")
    if line.half_duplex:
        text = "a reply is lost while handctl is sending: half duplex, as on RS-485"
        return Check("half_duplex", "ok", text, "let other programs wait for each answer, as handctl does")
    return Check("half_duplex", "ok", "a reply arrives while handctl is sending: full duplex")


def _packets(line: Profile) -> Check:
    if line.longest is None:
        return Check("packets", "skipped", "no long answer was read")
    if line.packet is None:
        return Check("packets", "ok", f"an answer of {line.longest} bytes arrives byte by byte, not in packets")
    if line.packet == line.longest:
        text = f"an answer of {line.longest} bytes arrives in one piece: something in between buffers the data"
        return Check("packets", "ok", text, "if you need quick replies, turn off buffering in the serial server")
    text = f"an answer of {line.longest} bytes arrives in packets of {line.packet}"
    if line.packet == BLUETOOTH:
        text += ", the size of Bluetooth 4.0"
    return Check("packets", "ok", text, "let other programs wait for the whole answer, not for its first packet")


def _others(line: Profile, unasked: bool) -> Check:
    if line.others:
        return Check(
            "others",
            "warning",
            "received frames that are not replies to handctl: another program uses this line",
            ONE_MASTER,
        )
    if unasked:
        return Check("others", "skipped", "data came unasked, but no whole frame of this family")
    return Check("others", "ok", "no frames from other programs")
