"""A scan of a serial line, in words and rows: what was asked for, what was found, what came instead."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from handctl.devices.inspire import eb90
from handctl.devices.inspire.asker import Findings
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.identity import SIX_HINT, Kind
from handctl.devices.inspire.map import BAUD_RATES
from handctl.devices.inspire.mishaps import hint_for
from handctl.devices.inspire.quiet import Span
from handctl.devices.inspire.scanner import Scanner
from handctl.digits import number_in
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError, UsageError
from handctl.model.guide import Guide
from handctl.model.param import ids_in
from handctl.model.profile import Profile
from handctl.model.result import Column, Row, Table


class Target(NamedTuple):
    """What is looked for: its kind, the register that confirms a hit, a jittering one for the twin test, the former's name."""

    own: Kind
    probe: Span
    twin: Span
    value: str
    silence_hint: str

    @property
    def family(self) -> str:
        """Its command."""
        return self.own.family


def rows_of(found: Findings, link_name: str, kind: Target) -> list[Row]:
    """Scan rows by the contract: family, link, baud, id; beside them the probed value, and what is odd.

    The family is that of what answers; null where that is a device that nobody knows.
    """
    rows = []
    for speed, device_id, value in found.hits:
        is_, shown = found.kinds.get((speed, device_id), (kind.own, ""))
        odd = ["two devices with this id?"] if (speed, device_id) in found.twins else []
        if is_ is not kind.own:
            odd.append(f"{is_.words}: {shown}" if is_ is not None else shown)
        row: Row = {
            "family": is_.family if is_ is not None else None,
            "link": link_name,
            "baud": speed,
            "id": device_id,
        }
        rows.append({**row, kind.value: value, "suspicion": "; ".join(odd) or None})
    return rows


def columns_of(kind: Target) -> tuple[Column, ...]:
    """The columns of a scan."""
    return (
        Column("family", "Family"),
        Column("link", "Link"),
        Column("baud", "Baud", right=True),
        Column("id", "Id", right=True),
        Column(kind.value, kind.value, right=True),
        Column("suspicion", "Suspicion"),
    )


def parse_ids(text: str) -> list[int]:
    """``1-254`` or ``1,2,10-20`` -> ids in that order. Raises UsageError."""
    return ids_in(text, eb90.check_id)


def parse_speeds(text: str) -> list[int]:
    """``115200,57600`` -> speeds the manual has. Raises UsageError."""
    known = ", ".join(map(str, BAUD_RATES.values()))
    speeds = []
    for part in text.split(","):
        speed = number_in(part.strip())
        if speed is None or speed not in BAUD_RATES.values():
            raise UsageError(
                f"--speeds {text}: {part.strip()!r} is not a speed of this hand",
                hint=f"choose from {known} bit/s (exo §2.3.2)",
            )
        speeds.append(speed)
    return list(dict.fromkeys(speeds))


def default_wait(link_name: str) -> float:
    """Reply window in seconds: 20 ms, or 30 ms where the adapter's latency timer would eat those."""
    import os

    port = os.path.basename(os.path.realpath(link_name))
    try:
        with open(f"/sys/bus/usb-serial/devices/{port}/latency_timer", encoding="ascii") as file:
            return 0.030 if int(file.read()) > 6 else 0.020
    except (OSError, ValueError):
        return 0.020


def scan(
    bus: Bus,
    kind: Target,
    guide: Guide,
    ids: Sequence[int],
    speeds: Sequence[int],
    window: int,
    wait_ms: float | None,
    find_all: bool,
    thorough: bool = True,
) -> Table:
    """Run a scan and put it into words. Finding nothing is an error that says what was tried and what came instead.

    `thorough`: what is silent is asked once more, one id at a time.
    """
    link = bus.link
    wait = wait_ms / 1000 if wait_ms is not None else default_wait(link.name)
    tried: list[int | None] = list(speeds) if link.can_set_baud else [link.baud]
    found = Scanner(
        bus,
        guide,
        window=window,
        wait=wait,
        find_all=find_all,
        probe=kind.probe,
        twin=kind.twin,
        own=kind.own,
        thorough=thorough,
    ).run(ids, tried)
    span = f"{wait * 1000:g} ms"
    method = f"one by one, {span} each" if window == 1 else f"{window} ids per window of {span}"
    speeds_text = ", ".join(str(speed) if speed else "the link's speed" for speed in tried)
    summary = (
        f"{found.probes} probes in {found.windows} windows, {found.seconds:.2f} s, asked for: ids {ids[0]} to {ids[-1]} at "
        f"{speeds_text}, {method}"
    )
    if found.single is not None:
        why = (
            "they answer one at a time only"
            if bus.journal.line.half_duplex
            else "a half-duplex line loses answers to several"
        )
        summary += f", then one by one, {1000 * found.single:.0f} ms each, as {why}"
    if found.cut:
        summary += ", ended by --deadline before all were asked"
    bus.journal.info("scanned", summary)
    if told := _line_words(bus.journal.line, found, window):
        bus.journal.info("line", told)
    for speed, device_id in found.unconfirmed:
        bus.journal.warn("unconfirmed", f"id {device_id}{_at(speed)} answered once and not again. It is not counted")
    table = Table(
        rows=rows_of(found, link.name, kind), columns=columns_of(kind), extra={"scan": _facts(found, window, wait)}
    )
    for speed, device_id in sorted(found.twins, key=str):
        bus.journal.warn(
            "twin-id",
            f"id {device_id}{_at(speed)}: good and bad checksums mix on values that jitter. Two devices may have this id",
            hint="leave one device on the line and give it another id",
        )
    strangers = [row for row in table.rows if row["family"] != kind.family]
    for row in strangers:
        bus.journal.warn(
            "other-device", f"id {row['id']}{_at(row['baud'])} is not of the family {kind.family}: {row['suspicion']}"
        )
    if not found.hits:
        table.failure = _nothing(found, link.name, summary, kind)
    elif len(strangers) == len(table.rows):
        table.failure = DeviceRefused(
            f"{link.name}: no {kind.family}, but {strangers[0]['suspicion']}", hint=SIX_HINT, code="other-device"
        )
    elif not find_all:
        bus.journal.info("first", "the scan ended at the first device", hint="add --all to look for more")
    return table


def _line_words(line: Profile, found: Findings, window: int) -> str:
    """What was learned of the line, and how ids were asked because of it; "" for a fast line of both directions."""
    words = line.words()
    if not words or not found.hits:
        return words
    if found.single is None:
        return f"{words}. {window} ids at a time" if window > 1 else words
    return f"{words}. One id at a time, {1000 * found.single:.0f} ms each"


def _at(speed: int | None) -> str:
    return f" at {speed}" if speed else ""


def _facts(found: Findings, window: int, wait: float) -> dict[str, object]:
    return {
        "window": window,
        "reply_window_ms": round(wait * 1000, 3),
        "probes": found.probes,
        "windows": found.windows,
        "seconds": round(found.seconds, 3),
        "single_ms": None if found.single is None else round(found.single * 1000, 3),
        "echo": found.echo,
        "garbage_bytes": found.garbage,
    }


def _nothing(found: Findings, name: str, summary: str, kind: Target) -> NoAnswer | ProtocolError:
    twice = [device_id for device_id, count in found.damaged.items() if count >= 2]
    if twice:
        return ProtocolError(
            f"{name}: id {', '.join(map(str, twice))} answered, but each time with a wrong checksum ({summary})",
            hint="leave one device on the line, check cable and ground: two devices have one id, or the line is disturbed",
            code="bad-checksum",
        )
    if found.beheaded:
        ids = ", ".join(map(str, sorted(found.beheaded)))
        return ProtocolError(
            f"{name}: id {ids} answered, but the first byte of each answer is missing ({summary})",
            hint=hint_for("first-byte-lost", kind.family),
            code="first-byte-lost",
        )
    if found.foreign:
        ids = ", ".join(str(device_id) for _, device_id in found.unconfirmed)
        return ProtocolError(
            f"{name}: id {ids} answered, but not when it was asked ({summary})",
            hint=hint_for("wrong-id", kind.family),
            code="wrong-id",
        )
    if found.echo:
        return ProtocolError(
            f"{name}: no {kind.family}, only our own bytes came back ({summary})",
            hint=hint_for("echo", kind.family),
            code="echo",
        )
    if found.garbage:
        return ProtocolError(
            f"{name}: no {kind.family}, but {found.garbage} bytes that form no valid answer ({summary})",
            hint=hint_for("garbage", kind.family),
            code="garbage",
            came=found.came if eb90.sign(found.came) else b"",
        )
    if found.cut:
        return NoAnswer(
            f"{name}: no {kind.family} so far ({summary})", hint="give a longer --deadline", code="deadline"
        )
    return NoAnswer(
        f"{name}: no {kind.family}, complete silence ({summary})",
        hint=kind.silence_hint,
    )
