"""The result of a scan: a row per device found, and for every link without one the reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from handctl.errors import DeviceRefused, HandctlError, Hint, Interrupted, NoAnswer, ProtocolError, joined
from handctl.model.device import OTHER_FORM
from handctl.model.result import Column, Journal, LineQuality, Row, Table, hex_bytes
from handctl.model.scan_task import LABEL_HINT, NOT_ASKED
from handctl.wording import plural

TALKATIVE = 16
"""So many bytes unasked are somebody who talks by himself."""
MODBUS_HINT = (
    "a hand of this maker on RS-485 may speak Modbus RTU only: 01 03 03 E8 00 01 04 7A reads its id (not sent)"
)
COLUMNS = (
    Column("family", "Family"),
    Column("link", "Link"),
    Column("baud", "Baud", right=True),
    Column("id", "Id", right=True),
    Column("evidence", "Evidence"),
)
MORE = (Column("protocol", "Protocol"), Column("model", "Model"), Column("suspicion", "Suspicion"))
"""Shown where a row has them."""
VAGUE = (NoAnswer.default_code, "echo", "garbage", "deadline", NOT_ASKED)
"""What a search of all families tells in its own words."""


class Step(NamedTuple):
    """One probe: a family, at a speed (None = the link has none to set)."""

    family: str
    speed: int | None


@dataclass(slots=True)
class Search:
    """What was tried on one link and what came: `met` is the error of every probe without a device, `lines` what each family
    learned of the line, `line` that of the one that was found."""

    link: str
    rows: list[Row] = field(default_factory=list)
    met: dict[Step, HandctlError] = field(default_factory=dict)
    unasked: bytes = b""
    overheard: dict[str, list[int]] = field(default_factory=dict)
    """Family -> ids that others ask on this line."""
    error: HandctlError | None = None
    expired: bool = False
    lines: dict[str, LineQuality] = field(default_factory=dict)
    line: LineQuality = field(default_factory=LineQuality)
    left: list[str] = field(default_factory=list)
    """What was not asked, in words, with how to ask it."""
    facts: dict[str, object] = field(default_factory=dict)
    verdict: HandctlError | None = None
    """Why a maker's own search found nothing."""
    alone: bool = False
    """That search was the only one."""

    def meet(self, step: Step, error: HandctlError) -> None:
        """Record the error of a probe; silence never replaces an earlier one."""
        if step not in self.met or error.code != NoAnswer.default_code:
            self.met[step] = error


def report(searches: Sequence[Search], families: Sequence[str], journal: Journal) -> Table:
    """All rows; for every link without a device, what was tried and the result."""
    rows = [row for search in searches for row in search.rows]
    more = [column for column in MORE if any(row.get(column.key) for row in rows)]
    table = Table(rows=rows, columns=(*COLUMNS[:-1], *more, COLUMNS[-1]))
    stopped = [search.error for search in searches if isinstance(search.error, Interrupted)]
    errors = [_nothing(search) for search in searches if not search.rows and search.error not in stopped]
    for error in errors if table.rows or len(errors) > 1 else ():
        journal.warn(error.code, error.text, hint=error.hint)
    for search in searches:
        if words := search.line.words():
            journal.info("line", f"{search.link}: {words}")
        if search.expired and search.rows:
            journal.warn("deadline", f"{search.link}: --deadline ended the search")
        silent = search.verdict is not None and search.verdict.code == NoAnswer.default_code
        if search.left and silent and not search.rows:
            journal.warn(NOT_ASKED, f"{search.link}: the search did not try: {'; '.join(search.left)}")
    if stopped:
        table.failure = stopped[0]
    elif not table.rows:
        table.failure = errors[0] if len(errors) == 1 else _none(errors)
    elif all(row["family"] not in families for row in table.rows):
        found = next((search.verdict for search in searches if search.verdict is not None), None)
        table.failure = found or DeviceRefused(
            joined("a device replies that is of none of the families asked for", str(table.rows[0]["evidence"])),
            hint=LABEL_HINT,
            code="unknown-device",
        )
    table.extra = {
        "scan": {
            "links": [search.link for search in searches],
            "families": list(families),
            "tried": [
                {"link": search.link, "family": step.family, "baud": step.speed, "came": error.code}
                for search in searches
                for step, error in search.met.items()
            ],
            "left": [text for search in searches for text in search.left],
            **{key: value for search in searches for key, value in search.facts.items()},
        }
    }
    return table


def _none(errors: Sequence[HandctlError]) -> HandctlError:
    """Nothing on any of several links: the most telling of their errors decides the exit code."""
    worst = max(errors, key=lambda error: (error.exit_code == 5, error.exit_code))
    return type(worst)(
        joined(f"no device on {plural(len(errors), 'link')}", worst.text), hint=worst.hint, code=worst.code
    )


def _nothing(search: Search) -> HandctlError:
    """Why there is no device on one link."""
    if search.error is not None:
        return search.error
    name, unasked = search.link, search.unasked
    if len(unasked) >= TALKATIVE:
        shown = hex_bytes(unasked[:24])
        if is_modbus(unasked):
            text = f"{name}: a Modbus RTU master or device is communicating on this line ({shown})"
            return ProtocolError(text, hint=f"{MODBUS_HINT}. Nothing was sent.", code="modbus")
        for family, ids in search.overheard.items():
            text = f"{name}: another program or master communicates with {family} id {', '.join(map(str, ids))} on this line ({shown})"
            anyway = Hint("stop whatever is sending, or search anyway: {}. Nothing was sent.", f"{family} scan --all")
            return ProtocolError(text, hint=anyway, code="talks")
        text = f"{name}: {plural(len(unasked), 'byte')} arrived before handctl sent anything ({shown}). No supported device does that"
        return ProtocolError(
            text, hint="check for another device, or a wrong speed (--baud). Nothing was sent.", code="talks"
        )
    if (told := search.verdict) is not None and (told.code not in VAGUE or search.alone):
        return told
    tried = f"Tried {_summary(search.met)}"
    if search.expired:
        return NoAnswer(
            f"{name}: --deadline ended the search. {tried}", hint="give a longer --deadline", code="deadline"
        )
    met = {error.code: error for error in search.met.values() if error.code != NoAnswer.default_code}
    passed_over = met.pop(NOT_ASKED, None)  # nothing came of it, and it is the next step
    if not met:
        hint = SILENCE if passed_over is None else passed_over.hint
        return NoAnswer(f"{name}: complete silence. {tried}", hint=hint, code=NoAnswer.default_code)
    if (known := next((met[code] for code in CONTACT if code in met), None)) is not None:
        return ProtocolError(joined(known.text, tried), hint=known.hint, code=known.code)
    if met.keys() <= {"echo", "echo-differs"}:
        hint = "check the wiring: this is an echo or a short between TX and RX, not a device"
        return ProtocolError(f"{name}: only our own bytes come back. {tried}", hint=hint, code="echo")
    hint = GARBAGE if passed_over is None else joined(passed_over.hint, GARBAGE)
    return ProtocolError(f"{name}: data arrived, but no valid reply. {tried}", hint=hint, code="garbage")


CONTACT = ("boot-monitor", OTHER_FORM, "bad-length", "no-echo")
"""Codes of what is evidently a device of that family, and yet gives no valid reply."""
SILENCE = Hint(
    "check the power and the cable, and that TX and RX are not swapped and RS-232 is not connected to RS-485. {} waits longer for each reply. For a CAN adapter give "
    "-p can:slcan:PORT",
    "scan --all",
)
GARBAGE = "check for another kind of device, a disturbed line, two devices with one id, or an slcan adapter (-p can:slcan:PORT)"


def _summary(met: Mapping[Step, HandctlError]) -> str:
    """``ekso at 115200 (no-answer), exo at 115200, 57600, 19200 (echo)``."""
    groups: dict[tuple[str, str], list[str]] = {}
    for step, error in met.items():
        groups.setdefault((step.family, error.code), []).append(str(step.speed) if step.speed else "")
    parts = []
    for (family, code), speeds in groups.items():
        at = f" at {', '.join(filter(None, speeds))}" if any(speeds) else ""
        parts.append(f"{family}{at}: {'silence' if code == NoAnswer.default_code else code}")
    return "; ".join(parts) or "nothing"


def is_modbus(data: bytes) -> bool:
    """Whether `data` holds a Modbus RTU frame: address 1..247, a function, and a CRC-16 that fits."""
    for start in range(len(data) - 4):
        if not 1 <= data[start] <= 247 or not 1 <= data[start + 1] & 0x7F <= 24:
            continue
        crc = 0xFFFF
        for end in range(start, len(data) - 2):
            crc ^= data[end]
            for _ in range(8):
                crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
            if end >= start + 2 and data[end + 1 : end + 3] == crc.to_bytes(2, "little"):
                return True
    return False
