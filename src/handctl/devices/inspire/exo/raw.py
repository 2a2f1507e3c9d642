"""Raw frames for an exoskeleton hand: what typed bytes would do, and which of them are refused."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire import eb90
from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.explain_bytes import InspireExplainer
from handctl.devices.inspire.raw import check_values, forceable, refused, several
from handctl.devices.inspire.register_map import ALONE
from handctl.errors import UsageError
from handctl.model.explainer import HOST
from handctl.model.param import Step

WORN = "This may move or change a hand that a person may be wearing"


def plan_raw(data: bytes, force_ambiguous: bool) -> Step:
    """What these bytes would do to an exoskeleton hand. Reads are harmless; anything else is not, a frame without its beginning included:
    bytes that somebody sent before may complete it.

    What only lacks the right checksum is planned, refused and asked as the frame it almost is: an error of the line may put
    it right, and a device may be lenient.
    """
    pieces = InspireExplainer(EXO).decode(data, HOST)
    goes_on = data.endswith(eb90.HOST[:1])  # bytes sent later would complete a frame
    piece, *more = pieces
    whole = piece.raw.startswith(eb90.HOST) and (piece.frame or (piece.problem == "bad-checksum" and not goes_on))
    if more or not whole:
        return several(data, pieces, lambda frame: plan_raw(frame, force_ambiguous))
    frame = eb90.Frame(data[:2], data[2], data[4], data[5:-1])
    if frame.flag == eb90.READ and len(frame.payload) == 3:
        return Step(piece.meaning, data)
    if not force_ambiguous:
        _check_frame(frame)
    return Step(piece.meaning, data, moves=True, strands=frame.flag == eb90.WRITE)


def _check_frame(frame: eb90.Frame) -> None:
    """Refuse a write or a command that no such hand, or another device, is meant to get. Raises UsageError."""
    if frame.flag not in (eb90.WRITE, *eb90.COMMANDS):
        return
    with forceable(code="out-of-range"):
        eb90.check_id(frame.id)  # what the hands on the line make of another one is unknown
    if frame.flag == eb90.WRITE and frame.address is not None:
        check_values(EXO, frame.address, frame.data)
    elif frame.flag != eb90.WRITE and len(frame.payload) == 10:
        values = eb90.unpack_s16(frame.payload)
        if frame.flag == eb90.FORCE_COMMAND and 1020 <= values[0] <= 1043:
            what = f"a write of 8 bytes at {values[0]}"
            raise refused(f"a wrist module takes this frame for {what}, this hand for a force command")
        with forceable():
            check_command(eb90.COMMANDS[frame.flag], values)


def check_command(which: str, values: Sequence[int]) -> None:
    """Refuse values that the command for five fingers does not have: -1 is one of the position registers only. Raises UsageError."""
    for element, value in zip(EXO[f"{which}_set"].each, values, strict=True):
        element.param.check(value, f"{which} {element.part}")
        if which == "position" and value == ALONE:
            raise UsageError(
                f"position {element.part} = -1 is out of range",
                hint="use 0 to 1000 (exo §2.2.2). Only the registers accept -1. Nothing was sent.",
                code="out-of-range",
            )
