"""Bytes as people have them: from a manual, a scope, a hex dump or a line of a transcript. Knows no protocol."""

from __future__ import annotations

import re
from typing import NamedTuple

from handctl.errors import UsageError
from handctl.model.piece import DEVICE, HOST

_CAN = re.compile(r"^(?:can\s+)?(?:0x)?([0-9A-Fa-f]{1,8})\s*(?:#|\[(\d)\])\s*(.*)$", re.IGNORECASE)
_MARK = re.compile(r"^\s*(?:\d+(?:\.\d+)?\s+)?([<>])\s*(.*)$", re.DOTALL)
_XXD = re.compile(r"^\s*[0-9A-Fa-f]{4,8}:\s+((?:[0-9A-Fa-f]{2,4} )+)(?: .*)?$")
_HEXDUMP = re.compile(r"^\s*[0-9A-Fa-f]{4,8}\s\s+([0-9A-Fa-f ]+?)\s*\|.*\|?\s*$")
_OFFSET_ONLY = re.compile(r"^\s*[0-9A-Fa-f]{8}\s*$")


class Given(NamedTuple):
    """Bytes, who sent them if that was said ("" = not), and the identifier of a CAN frame."""

    data: bytes
    side: str = ""
    can_id: int | None = None


def parse_given(text: str) -> list[Given]:
    """``EB 90``, ``0xEB,0x90``, ``\\xeb\\x90``, ``EB:90``, ``{0xEB, 0x90}``, hex dumps, transcript lines, CAN frames, JSON.

    Lines of bytes are joined unless they say who sent them. Raises UsageError naming what is no byte.
    """
    if (text.lstrip().startswith("{") and '"' in text) or text.strip() == "{}":
        return [Given(text.strip().encode("utf-8", "replace"))]
    found: list[Given] = []
    plain = b""
    for line in text.splitlines():
        marked = _MARK.match(line)
        side = "" if marked is None else HOST if marked[1] == ">" else DEVICE
        rest = line if marked is None else marked[2]
        can = _CAN.match(rest.strip())
        if can is not None:
            found.append(_can_frame(can, side))
        elif side:
            found.append(Given(_bytes_of(rest), side))
        else:
            plain += _bytes_of(_without_dump(rest))
    if plain:
        found.insert(0, Given(plain))
    if not found or not any(given.data or given.can_id is not None for given in found):
        raise UsageError("no bytes given", hint="write two hex digits a byte, such as `EB 90 01 04 11 E8 03 01 02`")
    return found


def _can_frame(match: re.Match[str], side: str) -> Given:
    can_id, data = int(match[1], 16), _bytes_of(match[3])
    announced = len(data) if match[2] is None else int(match[2])
    if can_id >= 1 << 29 or len(data) > 8 or announced != len(data):
        raise UsageError(
            f"{match[0].strip()!r} is not a CAN frame",
            hint="an identifier of 29 bits and as many bytes as announced, 8 at most: 11000001 [1] 04, or 11000001#04",
        )
    return Given(data, side, can_id)


def _without_dump(line: str) -> str:
    """A line of `xxd` or `hexdump -C` without its offset and its text column."""
    if _OFFSET_ONLY.match(line):
        return line
    match = _XXD.match(f"{line} ") or _HEXDUMP.match(line)
    return line if match is None else match[1]


def _bytes_of(text: str) -> bytes:
    cleaned = re.sub(r"\\x|\b0[xX]|[\s,;:_.{}\[\]()'\"-]|\bb(?=['\"])", " ", text)
    data = b""
    for word in cleaned.split():
        digits = word[:-1] if len(word) == 3 and word[-1] in "hH" else word
        digits = digits.zfill(2) if len(digits) == 1 else digits
        try:
            if not digits.isascii() or len(digits) % 2:
                raise ValueError(word)
            data += bytes.fromhex(digits)
        except ValueError as exc:
            raise UsageError(
                f"{word[:40]!r} is not hexadecimal bytes",
                hint="write two hex digits a byte, such as `EB 90 01`, `0xEB` or `\\xEB`",
            ) from exc
    return data
