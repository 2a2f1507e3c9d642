"""One episode for each reader of a file: UsageError and nothing else, or content that is right.

A chunk is a line, or a whole small file where lines mean nothing alone.
"""

from __future__ import annotations

import hashlib
import json
import random
from pathlib import Path

from handctl.command import config_file, snapshots
from handctl.devices.barrett.firmware import srecords
from handctl.devices.ekso.export_opensim import LogFile
from handctl.errors import LinkError, UsageError
from handctl.link import ByteLink, CanFrame, Deadline, FrameLink
from handctl.link.replay import open_replay
from handctl.link.transcript import parse
from tests.fuzz.support import mutated


def damaged(source: random.Random, text: bytes, tokens: bytes) -> bytes:
    """The text with some of its lines lost, doubled, swapped, and some of its bytes changed."""
    lines = text.splitlines(keepends=True)
    for _ in range(source.randrange(4)):
        at = source.randrange(len(lines))
        match source.randrange(3):
            case 0 if len(lines) > 1:
                del lines[at]
            case 1:
                lines.insert(source.randrange(len(lines)), lines[at])
            case _:
                lines[at] = mutated(source, lines[at], tokens)
    return b"".join(lines)


def s_record(kind: str, address: int, data: bytes) -> str:
    """One line of an S-record file, 16-bit addresses."""
    body = bytes([len(data) + 3]) + address.to_bytes(2, "big") + data
    return f"S{kind}{body.hex().upper()}{~sum(body) & 0xFF:02X}"


def s_records(source: random.Random) -> int:
    """A firmware file (barrett §3.7): never an exception; only lines whose sum fits become records."""
    good = [s_record("0", 0, b"BH8"), *(s_record("1", 0x2000 + 16 * n, source.randbytes(16)) for n in range(10))]
    text = ("\n".join([*good, s_record("9", 0x2000, b"")]) + "\n").encode()
    if source.random() < 0.8:
        text = damaged(source, text, b"S0123456789ABCDEFabcdef \r\n\xff")
    firmware = srecords.parse("x", text)
    lines = text.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    for record in firmware.records:
        line = lines[record.line - 1].strip()
        digits = bytes.fromhex(line[2:])
        assert line[:2] in ("S1", "s1")
        assert sum(digits) & 0xFF == 0xFF
        assert digits[0] == len(digits) - 1
        assert record.data in digits[3:-1]
        assert record.address + len(record.data) <= 0x10000
    return len(lines)


TRANSCRIPT = b"""# handctl 0.1.0 exo dump, fake://exo
0.000000 > EB 90 01 04 11 E8 03 01 02
0.004120 < 90 EB 01 04 11 E8 03 01 02
0.010000 ! baud 57600
> EB 90 01 04 11 C0 05 02 DC
< 90 EB 01 05 11 C0 05
< 52 03 31
"""
CAN_TRANSCRIPT = b"""# wrist
0.010000 > can 11000001 [1] 04
0.020000 < can 11000001 [4] 01 02 03 04
> can 15000001 [2] 01 02
< can 15000001 [0]
"""
TRANSCRIPT_TOKENS = b"0123456789ABCDEF ><!# .can[]-+_einf\t\n\xc2\xb2\xef\xbb\xbf"


class Transcript:
    """A transcript, read and then played against requests (contract, section 6)."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "trace.txt"

    def __call__(self, source: random.Random) -> int:
        text = source.choice([TRANSCRIPT, CAN_TRANSCRIPT])
        data = damaged(source, text, TRANSCRIPT_TOKENS) if source.random() < 0.9 else source.randbytes(40)
        self._path.write_bytes(data)
        lines = data.count(b"\n") + 1
        try:
            entries = parse(data.decode("utf-8").split("\n"), "t")
        except UnicodeDecodeError:
            entries = []
        except UsageError as exc:
            assert "line" in exc.text
            entries = []
        for entry in entries:
            assert entry.time is None or 0 <= entry.time < float("inf")
            assert entry.mark in "><!"
            assert entry.data or entry.can_id is not None or entry.mark == "!"
            assert entry.can_id is None or 0 <= entry.can_id < 1 << 29
            assert entry.can_id is None or len(entry.data) <= 8
        self._play(source, lines)
        return lines

    def _play(self, source: random.Random, lines: int) -> None:
        try:
            link = open_replay(f"replay:{self._path}")
        except UsageError:
            return
        for _ in range(4):
            soon = Deadline(link.now, link.now() + source.random())
            try:
                if isinstance(link, ByteLink):
                    link.write(bytes.fromhex("EB 90 01 04 11 E8 03 01 02"), soon)
                    for _ in range(2 * lines):
                        assert len(link.read(soon, 5)) <= 5
                elif isinstance(link, FrameLink):
                    link.send(CanFrame(0x11000001, b"\x04"), soon)
                    for _ in range(2 * lines):
                        link.receive(soon)
            except LinkError as exc:
                assert exc.code == "replay-miss"
        link.close()


CONFIG = b"""# bench
port = "/dev/ttyUSB7"
format = 'plain'
retries = 3
timeout = 0.5

[devices.left]
kind = "exo"
port = '''/dev/ttyUSB0'''
id = 2

[devices.right]
kind = "wrist"
port = "can:socketcan:can0"
"""
CONFIG_TOKENS = b"[]{}\"'=.,#\\ \n\t_-+0123456789abcdefinfnan:TZ\xff\x00\x7f\xef\xbb\xbf"


class Configuration:
    """The configuration file: UsageError with a hint, or checked values."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "config.toml"

    def __call__(self, source: random.Random) -> int:
        self._path.write_bytes(damaged(source, CONFIG, CONFIG_TOKENS))
        try:
            found = config_file.read_config(str(self._path))
        except UsageError as exc:
            assert exc.exit_code == 2
            assert exc.hint
            return 1
        assert set(found.values) <= set(config_file.key_checks())
        for device in found.devices.values():
            assert device.kind in ("exo", "wrist", "barrett", "ekso", "aidin")
            assert device.entries["port"].value
        return 1


def checksum(content: dict[str, object]) -> str:
    """The checksum of a snapshot as its file format has it."""
    rest = {key: value for key, value in content.items() if key != "checksum"}
    return "sha256:" + hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


SNAPSHOT: dict[str, object] = {
    "schema": "handctl-snapshot/1", "kind": "exo", "device": {"id": 1}, "tool": {"name": "handctl", "version": "0.1.0"},
    "time": "2026-01-31T12:00:00+00:00", "link": "x", "fake": True, "values": {"id": 1, "position_set.little": 151},
}  # fmt: skip
SNAPSHOT_TEXT = json.dumps({**SNAPSHOT, "checksum": checksum(SNAPSHOT)}, indent=2).encode() + b"\n"
ODD: list[object] = [
    None,
    True,
    0,
    -1,
    1.5,
    float("nan"),
    float("inf"),
    10**400,
    "",
    "exo",
    "\ud800",
    [],
    {},
    [[]],
    {"a": {}},
    {"a": float("nan")},
    {"a": 1e400},
]


class Snapshot:
    """A snapshot file: refused, or exactly what was written."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "a.json"

    def __call__(self, source: random.Random) -> int:
        whole = False
        if source.random() < 0.6:
            data = damaged(source, SNAPSHOT_TEXT, b'{}[]":,\\ \n0123456789eE.-nulltrueNaN\xef\xbb\xbf\xff')
        else:  # damaged by somebody who knows how the checksum is made
            content = {**SNAPSHOT, source.choice(list(SNAPSHOT)): source.choice(ODD)}
            content["checksum"] = checksum(content)
            data = json.dumps(content).encode()
            whole = True
        self._path.write_bytes(data)
        try:
            found = snapshots.load(str(self._path), "exo")
        except UsageError as exc:
            assert exc.exit_code == 2
            return 1
        assert found["kind"] == "exo"
        assert found["schema"] == "handctl-snapshot/1"
        assert all(type(value) in (int, float) and abs(value) < float("inf") for value in found["values"].values())
        assert whole or found == {**SNAPSHOT, "checksum": checksum(SNAPSHOT)}
        return 1


class EksoLog:
    """A recorded log with its sidecar: rows as they were written, or a UsageError naming the line."""

    def __init__(self, folder: Path) -> None:
        from handctl.devices.ekso.recording_source import RowLayout
        from handctl.model.device_clock import Moment
        from handctl.record.csv_columns import Stamp
        from handctl.record.timeline import Timeline
        from tests.ekso.recordings import words_at

        self._path = folder / "gait.csv"
        self._texts = []
        for raw in (False, True):
            layout, timeline = RowLayout(raw=raw), Timeline(10.0)
            text = layout.header
            for seq in range(8):
                words = words_at(5_000_001 + 10 * seq)
                place = timeline.place(5_000_001 + 10 * seq, Moment(100 + seq / 100, 100.0015 + seq / 100))
                timeline.count(place)
                text += layout.line(Stamp(1.7e9 + seq / 100, place, seq), words, 'a "mark", here' if seq == 3 else "")
            self._texts.append(text.encode())
        self._sidecar = json.dumps({"schema": "handctl-ekso-log/1", "complete": True, "rows": 8}).encode()

    def __call__(self, source: random.Random) -> int:
        text = source.choice(self._texts)
        data = damaged(source, text, b'0123456789.-,"\r\n\0 \xff')
        sidecar = self._sidecar if source.random() < 0.8 else mutated(source, self._sidecar, b'{}":,0truefals')
        self._path.write_bytes(data)
        Path(f"{self._path}.json").write_bytes(sidecar)
        count = 0
        try:
            log = LogFile(str(self._path))
            for block in log.blocks():
                count += len(block.t_ms)
                assert {len(texts) for texts in block.columns.values()} == {len(block.t_ms)} == {len(block.segments)}
                assert [*block.columns] == list(log.layout.names)
        except UsageError as exc:
            assert exc.exit_code == 2
            return 9
        assert not log.closed or count == log.sidecar["rows"]  # type: ignore[index]
        return 9
