"""The audit log of everything that was sent to change an EksoNR: JSON lines, appended, on the disk before it goes out.

No log, no write. The user's own log is always written, because the policy remembers by it; --audit names a further one.
Knows files and nothing of the device.
"""

from __future__ import annotations

import errno
import json
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

from handctl.devices.ekso import write_checks
from handctl.devices.ekso.write_policy import STEP_SECONDS
from handctl.errors import HandctlError, OutputError, UsageError
from handctl.files import SPELLED, clash, in_turn, opened, state_path
from handctl.model.result import Journal
from handctl.system import disk, file_locks, user_folders
from handctl.wording import some

TURN_SECONDS = 0.2
"""No longer is another writer waited for, who may be stopped in the middle: CancelAction waits for its entry."""
TAIL = 65536
"""Bytes at the end of the log that are searched for the last write."""
FILE_HINT = "make it writable, or choose another file with --audit FILE. Without this log no setting is written"
OWN_HINT = "make it writable. handctl reads the last writes from this log, and writes no setting without it"


def default_path() -> Path:
    """ekso-audit.jsonl in the user's state folder."""
    return state_path("ekso-audit.jsonl")


def logs(file: str | Path | None, always: dict[str, Any]) -> AuditLog:
    """The log that a write is noted in: FILE, whatever it is the user's own, and of a device what all users of this machine share."""
    played = always.get("simulated") or str(always.get("port")).startswith("replay:")  # no device of this computer
    shared = None if played else Shared(always)
    mine = AuditLog(default_path(), always, own_hint=OWN_HINT, memory=shared)
    return mine if file is None or clash(file, mine.path) else AuditLog(Path(file), always, memory=mine)


class AuditLog:
    """An append-only file; every entry is on the disk when `record` returns, and nothing is held open between entries.

    `always` stands in every entry: operator, user, host, port, the place it leads to, tool version.
    `memory` is a further log that gets every entry too; `personal`: it is for people, who are told what is wrong with it.
    """

    personal = True
    flags, permissions = os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o600
    unusable = "the audit log cannot be written"

    def __init__(
        self, path: Path, always: dict[str, Any], *, memory: AuditLog | None = None, own_hint: str = FILE_HINT
    ) -> None:
        self.path = path
        self.always = always
        self.memory = memory
        self._hint = own_hint

    @property
    def every(self) -> tuple[AuditLog, ...]:
        """The logs that get each entry."""
        return (self,) if self.memory is None else (*self.memory.every, self)

    @property
    def read(self) -> tuple[AuditLog, ...]:
        """The logs that tell the last writes in its place: itself."""
        return (self,)

    def counts(self, entry: Mapping[str, Any]) -> bool:
        """Whether the entry may be of the device that is written to now."""
        if not (entry.get("simulated") or self.always.get("simulated")):
            return True
        return bool(entry.get("place", entry.get("port")) in (self.always.get("place"), self.always.get("port")))

    def check(self) -> None:
        """Make sure that entries can be written, before anything is sent. Raises OutputError."""
        if self.memory is not None:
            self.memory.check()
        with self._opened() as file:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                raise OSError(errno.EINVAL, "not a regular file, so the policy cannot read the last writes from it")
            disk.torn(file)

    @contextmanager
    def _opened(self) -> Iterator[int]:
        """The file, made when there is none; its descriptor is closed at the end. Raises OutputError."""
        try:
            fresh = self._made()
            file = os.open(self.path, self.flags | disk.BINARY, self.permissions)
            try:
                self._look(os.fstat(file), file)
                if fresh:
                    disk.sync_folder(self.path.parent)
                yield file
            finally:
                os.close(file)
        except OSError as exc:
            raise write_checks.refusal(
                write_checks.LOG, f"{self.path}: {self.unusable}: {exc.strerror or exc}", self._hint
            ) from exc

    def _made(self) -> bool:
        """Make the folder; whether the file is to be made in it. Raises OSError."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        return not self.path.exists()

    def _look(self, found: os.stat_result, file: int) -> None:
        """Raises OSError where the file is not what it should be: `check` looks at the user's own."""

    def unfinished(self) -> dict[str, Any] | None:
        """The intent at the end of the log: a write without a result. None if there is none."""
        try:
            lines, _ = self.tail()
        except OutputError:
            return None  # no log, or none that can be read: `check` tells
        for line in reversed(lines):
            with suppress(ValueError, RecursionError):  # half a line of a killed writer: its frame never went out
                entry = json.loads(line)
                if isinstance(entry, dict) and entry.get("event") in ("intent", "result"):
                    return entry if entry["event"] == "intent" else None
        return None

    def tail(self) -> tuple[list[bytes], bool]:
        """The last lines, whole but perhaps the last, and whether there are others before them; none where there is no log. Raises OutputError."""
        if not self.path.is_file():  # reading a device or a pipe might never end
            return [], False
        with self._opened() as file:
            return _tail(file)

    def checked(self, *, whole: bool = False) -> Checked:
        """Its chain: of the last lines, or with `whole` of all of them. Raises OutputError, UsageError."""
        if whole:
            with opened(self.path, "an audit log") as content:
                return check(iter(lambda: content.readline(TAIL), b""))
        lines, cut = self.tail()
        return check(lines, whole=not cut)

    def changed_at(self) -> float:
        """When the file was changed last, by the wall clock. Raises OutputError."""
        with self._opened() as file:
            return os.fstat(file).st_mtime

    @contextmanager
    def alone(self) -> Iterator[None]:
        """While it lasts no other handctl writes a setting by these logs: what they say last holds until the next entry.

        Raises OutputError, LinkError (code "busy").
        """
        with self.memory.alone() if self.memory is not None else nullcontext(), self._opened() as file:
            try:
                file_locks.whole(file)
            except BlockingIOError as exc:
                raise write_checks.refusal(
                    write_checks.FREE,
                    f"{self.path}: another handctl command is writing a setting",
                    "wait until it is done, then repeat the command. Nothing was sent.",
                ) from exc
            yield

    def record(self, event: str, host_s: float, **fields: Any) -> None:
        """Append one entry and wait until it is on the disk; `host_s` is the link's monotonic clock.

        Raises OutputError; what came of a write is noted in both logs as far as it can be.
        """
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        entry = {"event": event, "utc": now, "host_monotonic_s": round(host_s, 6), **self.always, **fields}
        failure: OutputError | None = None
        for log in reversed(self.every):  # the memory last: what it holds was not refused by another log
            try:
                log._append(json.dumps(log._kept(entry), ensure_ascii=False).encode("utf-8", SPELLED))
            except OutputError as exc:
                failure = failure or exc
                if event == "intent":
                    break
        if failure is not None:
            raise failure

    def _kept(self, entry: dict[str, Any]) -> dict[str, Any]:
        """What of an entry stands in this log."""
        return entry

    def _append(self, text: bytes) -> None:
        with self._opened() as file:
            # one entry at a time, each chained to the one before; an entry is worth more than the order of two
            with in_turn(file, TURN_SECONDS):
                line = linked(text, held(reversed(_tail(file)[0]))) + b"\n"
                # half a line of a killed writer, perhaps of another handctl: this entry starts a line of its own
                _write_all(file, b"\n" + line if disk.torn(file) else line)
            disk.sync(file)


# -- what all users of this machine share: another user, or another state folder, is no other device ----------------------
#
# Each user has a file that all may read and nobody else may write, in a folder that no variable moves. It holds what the steps
# need and nobody's name, and begins anew when its entries have long been of no use.


class _Readable(AuditLog):
    """The file of another user: nothing is written to it."""

    personal = False
    flags, permissions = os.O_RDONLY | disk.NO_LINK, 0
    unusable = "the last writes of another user cannot be read"

    def __init__(self, path: Path, always: dict[str, Any]) -> None:
        super().__init__(path, always, own_hint=SHARED_HINT)

    def _made(self) -> bool:
        return False  # the system has made the folder

    def _look(self, found: os.stat_result, file: int) -> None:
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "not a regular file")

    def counts(self, entry: Mapping[str, Any]) -> bool:
        """What runs on this machine and stands for a device is what its place says; of devices nothing tells one from another."""
        return bool(entry.get("local") == self.always["local"])


class Shared(_Readable):
    """This user's file of the last writes."""

    flags, permissions = AuditLog.flags | disk.NO_LINK, 0o644
    unusable = "the last writes cannot be kept for the other users of this computer"

    def __init__(self, always: Mapping[str, Any]) -> None:
        kept = {"host": always.get("host"), "local": local(str(always.get("place")))}
        super().__init__(Path(user_folders.shared_file(SHARED_NAME)), kept)

    @property
    def read(self) -> tuple[AuditLog, ...]:
        """Its own, and those of the other users."""
        try:
            found = sorted(self.path.parent.glob(f"{SHARED_NAME}*"))
        except OSError:
            found = []  # `check` tells why
        return (self, *(_Readable(path, self.always) for path in found if path != self.path))

    def _look(self, found: os.stat_result, file: int) -> None:
        super()._look(found, file)
        if not user_folders.own(found):
            raise OSError(errno.EPERM, "it belongs to another user")
        if stat.S_IMODE(found.st_mode) != self.permissions:  # a file that others cannot read is no memory
            user_folders.let_all_read(file)

    def _kept(self, entry: dict[str, Any]) -> dict[str, Any]:
        kept: dict[str, Any] = {
            key: entry[key] for key in ("event", "utc", "host_monotonic_s", "name", "verdict") if key in entry
        }
        kept |= {key: {"raw": entry[key]["raw"]} for key in ("old", "new") if key in entry}
        return kept | self.always

    def _append(self, text: bytes) -> None:
        if datetime.now(timezone.utc).timestamp() - self.changed_at() > FORGOTTEN_SECONDS:
            with self._opened() as file:
                os.ftruncate(file, 0)
        super()._append(text)


SHARED_NAME = "handctl-ekso-"
SHARED_HINT = "remove the file. No setting is written as long as the last writes to the device are not known"
FORGOTTEN_SECONDS = 3600.0
"""So long after its last entry the shared file begins anew: it has no use behind STEP_SECONDS, whatever the clock was set to."""


def local(place: str) -> str | None:
    """What stands for a device on this machine itself, a simulator or a bridge: a pseudo-terminal, or a port of its own; else None.

    The number of a pseudo-terminal is soon another one's, so its age goes with it.
    """
    if found := re.fullmatch(r"tty 13[6-9]:(\d+)|tty 14[0-3]:(\d+)", place):
        with suppress(OSError):
            place += f" {os.stat(f'/dev/pts/{found[1] or found[2]}').st_ctime_ns}"
        return place
    return place if re.match(r"tcp (127\.|localhost|\[?::1)", place) else None


def _tail(file: int) -> tuple[list[bytes], bool]:
    """The last lines, and whether there are others before them."""
    size = os.fstat(file).st_size
    start = max(0, size - TAIL)
    lines = disk.read_at(file, size - start, start).split(b"\n")
    return (lines[1:], True) if start else (lines, False)


def _write_all(file: int, data: bytes) -> None:
    while data:
        data = data[os.write(file, data) :]


# -- the chain: each entry ends with a hash over itself and the entry before it -------------------------------------------
#
#     {"event": "intent", …, "chain": "<SHA-256 of the chain before, then of this line without its own>"}
#
# An entry that was edited does not fit its hash; where one was removed, added or moved, the next does not fit. What was cut off
# at the end does not show, and who knows this can write a new chain: it shows an edit, it is no signature.


_LINK = re.compile(rb', "chain": "([0-9a-f]{64})"\}$')


class Finding(NamedTuple):
    """A line of the log that does not fit: its number, counted from 1, the line, and what is wrong with it."""

    number: int
    line: bytes
    text: str


class Checked(NamedTuple):
    """A log that was looked through: entries with a hash, older ones without, halves of killed writers, what is wrong."""

    chained: int
    unchained: int
    torn: int
    findings: tuple[Finding, ...]


def linked(entry: bytes, before: str) -> bytes:
    """A JSON object as the line of an entry after `before`."""
    return entry[:-1] + b', "chain": "' + _digest(before.encode() + entry).encode() + b'"}'


def held(lines: Iterable[bytes]) -> str:
    """What the next entry builds on, the lines given from the last to the first; "" for the first entry."""
    for line in lines:
        if (link := _link(line.rstrip())) is not None:
            return link
    return ""


ENTRY = 8192
"""Bytes kept of a line that is no entry of the chain: no entry of ours is longer."""


def check(lines: Iterable[bytes], *, whole: bool = True) -> Checked:
    """Look through a log; without `whole` the lines begin somewhere in it, and the first is taken as it is."""
    before = "" if whole else None
    counts = {"chained": 0, "unchained": 0, "torn": 0}
    findings: list[Finding] = []
    for number, raw in enumerate(lines, 1):
        line = raw.rstrip()
        if not line:
            continue
        found, link = _LINK.search(line), _link(line)
        if found is not None:
            counts["chained"] += 1
            if before is not None and _digest(before.encode() + line[: found.start()] + b"}") != link:
                findings.append(
                    Finding(number, line[:ENTRY], "was edited, or an entry before it is missing or was moved")
                )
        elif link is not None and not counts["chained"]:
            counts["unchained"] += 1  # of a handctl that knew no chain
        elif link is None and line.startswith(b'{"event"'):
            counts["torn"] += 1  # half a line of a killed writer
        else:
            findings.append(
                Finding(number, line[:ENTRY], "has no hash: an older handctl wrote it, or it was added by hand")
            )
        before = link if link is not None else before
    return Checked(**counts, findings=tuple(findings))


def finding_texts(checked: Checked) -> Iterator[str]:
    """The findings for people: ``line 7 (2026-11-22T10:00:00.000+00:00, intent step_length) was edited, …``."""
    for finding in checked.findings:
        try:
            entry = json.loads(finding.line)
            words = f"{entry['utc']}, {entry['event']} {entry.get('name', '')}".rstrip()
        except (ValueError, TypeError, KeyError, RecursionError):
            words = "no entry"
        yield f"line {finding.number} ({words}) {finding.text}"


MOST_TOLD = 3


def check_whole_log(audit: AuditLog, journal: Journal) -> HandctlError | None:
    """Check the audit log: a note if it is unchanged, otherwise the failure. Raises UsageError."""
    checked = audit.checked(whole=True)
    if checked.findings and not checked.chained + checked.unchained:
        raise UsageError(
            f"{audit.path}: not an audit log: {next(finding_texts(checked))}",
            hint="name the audit log with --audit FILE",
        )
    count = checked.unchained
    older = f" Entries from an older handctl, without a hash: {count}. These cannot be checked." if count else ""
    if not checked.findings:
        journal.info(
            "audit",
            f"{audit.path}: {checked.chained} entries, none was edited, removed or moved.{older} Entries removed from the end would not be noticed",
        )
        return None
    places = some(list(finding_texts(checked)), MOST_TOLD, "; ", ", and")
    return write_checks.refusal(
        write_checks.EDITED,
        f"{audit.path}: the audit log was changed after it was written: {places}.{older}",
        "find out who has access to the file, and compare it with a backup. If you move the log away, a new one starts",
    )


def _link(line: bytes) -> str | None:
    """The link for the entry after this line; None if the line is not a complete entry."""
    found = _LINK.search(line)
    if found is not None:
        return found[1].decode()
    try:
        return _digest(line) if isinstance(json.loads(line), dict) else None
    except (ValueError, RecursionError):
        return None


def _digest(data: bytes) -> str:
    import hashlib

    return hashlib.sha256(data).hexdigest()


# -- what the logs remember: the policy holds for any EksoNR that was written to, not for one run, port or log -----------
#
# An EksoNR reports nothing that tells it from another, and a port's name or number leads to another one after it was plugged
# in again. So each write of the last seconds counts, but those to simulators, which are what their LINK says. How old an entry
# is at least, the monotonic clock proves: it never goes back, and since a restart of this machine at least its uptime has
# passed. The wall clock, which is set, decides only over entries of another machine, and one from the future is refused.


NOT_SENT = "not sent"
"""How the verdict on a write begins that never went out."""


class Past(NamedTuple):
    """A write of the last seconds: when at the earliest on the link's clock, which setting, its raw values."""

    at: float
    name: str
    old: int
    new: int


def recent(audit: AuditLog, now: float) -> list[Past]:
    """The writes to any EksoNR within the last STEP_SECONDS seconds, the newest first; `now` is the link's clock.

    A write whose result nobody noted counts. Raises CheckFailed where a log does not tell: nothing may be written then.
    """
    found = [past for log in audit.every for one in log.read for past in _recent(one, now)]
    return sorted(found, key=lambda past: past.at, reverse=True)


def _recent(audit: AuditLog, now: float) -> list[Past]:
    found: list[Past] = []
    ended: dict[str, tuple[float, bool]] = {}
    for entry in _entries(audit):
        if not audit.counts(entry):
            continue
        age = _age(entry, now, audit)
        name = str(entry["name"])
        if entry["event"] == "result":
            ended[name] = age, str(entry.get("verdict", "")).startswith(NOT_SENT)
            continue
        age, unsent = ended.pop(name, (age, False))
        if age > STEP_SECONDS:
            break
        if not unsent:
            found.append(Past(now - age, name, entry["old"]["raw"], entry["new"]["raw"]))
    return found


def _entries(audit: AuditLog) -> Iterator[dict[str, Any]]:
    """Intents and results from the last to the first that the tail of the log holds whole."""
    unfit = {finding.line for finding in audit.checked().findings}
    for line in reversed(audit.tail()[0]):
        if not line.strip() or _half(line):
            continue
        try:
            entry = json.loads(line)
            if not isinstance(entry, dict):
                raise TypeError(line)
            if line.rstrip() in unfit:
                _refuse(audit, write_checks.EDITED)
            elif entry.get("event") == "intent":
                unfit = set()  # it was not refused: what had been done by hand before it was long past
            if entry.get("event") not in ("intent", "result"):
                continue
            moments = float(entry["host_monotonic_s"]), datetime.fromisoformat(entry["utc"]).timestamp()
            if entry["event"] == "intent" and not all(isinstance(entry[key]["raw"], int) for key in ("old", "new")):
                raise TypeError(line)
            if not isinstance(entry["name"], str) or any(moment != moment for moment in moments):
                raise TypeError(line)
        except (ValueError, TypeError, KeyError, RecursionError):
            _refuse(audit, write_checks.DAMAGED)
            continue
        yield entry


def _half(line: bytes) -> bool:
    """Half a line of a killed writer: an intent that was not whole on the disk was never sent, and a result follows its intent."""
    return line.startswith(b'{"event"') and not line.rstrip().endswith(b"}")


def _age(entry: Mapping[str, Any], now: float, audit: AuditLog) -> float:
    """Seconds that have passed since at least. Raises CheckFailed for what lies in the future."""
    noted = float(entry["host_monotonic_s"])
    bound = now - noted if noted <= now else now  # the machine has restarted since: its clock began at 0 then
    if entry.get("host") == audit.always.get("host"):
        return bound
    passed = (datetime.now(timezone.utc) - datetime.fromisoformat(entry["utc"])).total_seconds()
    if passed < 0:
        raise write_checks.refusal(
            write_checks.CLOCK,
            f"{audit.path}: the last write was at {entry['utc']}, which is {-passed:.0f} s in the future, so a clock was set back",
            "set the clock of this computer, then repeat the command. Nothing was sent.",
        )
    return min(bound, passed)


WRONG = {
    write_checks.EDITED: ("its last entries were edited or removed by hand", " `handctl ekso policy` shows which."),
    write_checks.DAMAGED: ("its end is damaged", ""),
}


def _refuse(audit: AuditLog, gate: str) -> None:
    """Raise CheckFailed for what was done to the log by hand or by a fault, if that may be of the last seconds."""
    if datetime.now(timezone.utc).timestamp() - audit.changed_at() > STEP_SECONDS:
        return
    wrong, more = WRONG[gate]
    raise write_checks.refusal(
        gate,
        f"{audit.path}: {wrong}, so handctl does not know what was written last, and when",
        f"repeat the command in {STEP_SECONDS:.0f} s, when the last write no longer matters.{more} Nothing was sent.",
    )
