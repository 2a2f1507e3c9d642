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
        return Check("first_byte", "warning" if answered else "fail", "answers come without their first byte", remedy)
    if not answered:
        return Check("first_byte", "skipped", "no answer came")
    return Check("first_byte", "ok", "answers come with their first byte")


def _half_duplex(line: Profile) -> Check:
    if line.half_duplex is None:
        return Check("half_duplex", "skipped", "only an answer shows whether both directions work at once")
    if line.half_duplex:
        text = "an answer is lost while something is sent: half duplex, as RS-485 is"
        return Check("half_duplex", "ok", text, "let other programs wait for each answer, as handctl does")
    return Check("half_duplex", "ok", "an answer comes while something is sent: both directions work at once")


def _packets(line: Profile) -> Check:
    if line.longest is None:
        return Check("packets", "skipped", "no long answer was read")
    if line.packet is None:
        return Check("packets", "ok", f"an answer of {line.longest} bytes comes as it is sent, in no packets")
    if line.packet == line.longest:
        text = f"an answer of {line.longest} bytes comes in one piece: something on the way gathers bytes"
        return Check("packets", "ok", text, "where answers must be quick, let the serial server send bytes at once")
    text = f"an answer of {line.longest} bytes comes in packets of {line.packet}"
    if line.packet == BLUETOOTH:
        text += ", the size of Bluetooth 4.0"
    return Check("packets", "ok", text, "let other programs wait for the whole answer, not for its first packet")


def _others(line: Profile, unasked: bool) -> Check:
    if line.others:
        return Check("others", "warning", "frames came that answer nothing that was asked: others speak", ONE_MASTER)
    if unasked:
        return Check("others", "skipped", "data came unasked, but no whole frame of this family")
    return Check("others", "ok", "no frame of others was heard")
