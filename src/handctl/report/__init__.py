"""`report`: one page about one device for a service ticket, for any device with a map. Only reads.

Each part is read separately: if one cannot be read, the page says why and is written anyway, and the exit code is that
of the first error. Knows no family and no HTML.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib import metadata
from itertools import accumulate, chain, groupby
from typing import TYPE_CHECKING, Any, TypeVar

from handctl import __version__
from handctl.charts.curves import Curves, outline_svg
from handctl.command import get_set_watch
from handctl.command.envelope import why_silent
from handctl.command.family import load
from handctl.errors import CheckFailed, HandctlError, LinkError, NoAnswer, OutputError, ProtocolError, UsageError
from handctl.families import FAMILIES
from handctl.files import atomic_write, why_unwritable, writing
from handctl.link.link_interface import path_in
from handctl.link.transcript import TraceWriter, observed, parse
from handctl.model.device_picture import outline_of
from handctl.model.explainer import DEVICE, HOST, ExplainedBytes, Explainer
from handctl.model.param import ParamMap
from handctl.model.result import Column, Grid, Message, Row, Table
from handctl.report.html import Report, page
from handctl.report.redaction import REDACTED, Privacy
from handctl.screen.render import default_view
from handctl.system.processes import system_name
from handctl.tools.port_inventory import Machine, needed
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.command.run import Run


RATE_HZ = 10.0
LONGEST = 120_000
"""Characters of recorded bytes that a page takes; what is longer loses its middle."""
DATA = "handctl-report/1"
"""The schema of the JSON in a page."""
COLUMNS = (Column("file", "File"), Column("size", "Size", right=True, unit="B"), Column("sha256", "SHA-256"))
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class RequestedOptions:
    """What the user asked for: `watch` in seconds (0 = none), whether ids are kept, whether FILE may be replaced, and how many
    characters of recorded bytes the page takes."""

    watch: float = 3.0
    include_ids: bool = False
    force: bool = False
    longest: int = LONGEST


class Recorded:
    """The lines of a tap: all, or the beginning and the end, each of at least the characters that a page takes.

    `left_out` counts what was recorded between.
    """

    def __init__(self, longest: int) -> None:
        self._longest = self._room = longest
        self._kept = 0
        self._first: list[str] = []
        self._last: deque[str] = deque()
        self.left_out = 0

    def append(self, line: str) -> None:
        """One more, with its line end or without."""
        line = line.rstrip("\n")
        if self._room > 0:
            self._first.append(line)
            self._room -= len(line)
            return
        self._last.append(line)
        self._kept += len(line)
        while self._kept - len(self._last[0]) >= self._longest:
            left_out = self._last.popleft()
            self._kept -= len(left_out)
            self.left_out += _recorded(left_out)

    def precede(self, lines: Sequence[str]) -> None:
        """What was recorded before."""
        self._first[:0] = lines

    def __iter__(self) -> Iterator[str]:
        return chain(self._first, self._last)


class Visit:
    """One conversation with a device for one page: what was recorded, what went wrong, whether asking on makes sense."""

    def __init__(
        self, run: Run, params: ParamMap[Any], wishes: RequestedOptions, lines: Recorded | None = None
    ) -> None:
        """`lines`: what was recorded before, to which the rest is added."""
        self.run, self.params, self.wishes = run, params, wishes
        self.lines = Recorded(wishes.longest) if lines is None else lines
        self.problems: list[tuple[str, HandctlError]] = []
        self.over = False
        self.identity: dict[str, str] = {}
        """What the device says of itself, without what is private."""
        self.privacy = Privacy(params, wishes.include_ids)
        now = datetime.now(timezone.utc).isoformat(timespec="seconds")
        self.content = Report(params.kind, run.command, now, simulated=False)
        self.content.privacy, self.content.masked = _promise(self.privacy), self.privacy.masks

    def attempt(self, part: str, action: Callable[[], T]) -> T | None:
        """Return the result of `action`; None if it fails or the device is gone. Usage errors are raised."""
        if self.over:
            return None
        self.lines.append(f"# {part}")
        try:
            return action()
        except UsageError:
            raise
        except HandctlError as exc:
            self.failed(part, exc)
        return None

    def failed(self, part: str, error: HandctlError) -> None:
        """Note it. A lost link, and a device that never answered, are not asked again."""
        self.problems.append((part, error))
        silent = isinstance(error, NoAnswer | ProtocolError) and self.run.journal.counters.received == 0
        self.over = isinstance(error, LinkError) or silent

    # -- asking --

    def connect(self) -> None:
        """Connect to the device. Nothing is asked of one that cannot be reached."""
        if self.attempt("connection", self.run.device) is None:
            self.over = True

    def status(self, check: bool = False) -> Table | None:
        """Its health, with a picture where there is one."""
        device: Any = self.run.opened
        status = self.attempt("status", lambda: device.status(check))
        if status is None:
            self._explain_silence()
        else:
            self.show("status", status)
            outline = outline_of(self.params.kind)
            if outline is not None:
                pictures = (outline_svg(outline, by, status.rows) for by in outline.measures if by != "error")
                self.content.outlines = list(filter(None, pictures))
        return status

    def dump(self) -> Table | None:
        """Every documented quantity, and what the device says of itself."""
        device: Any = self.run.opened
        dump = self.attempt("dump", lambda: device.dump())  # noqa: PLW0108 - there may be none
        if dump is not None:
            dump.view = None
            self.show("dump", dump)
        identity = None
        if self.params.kept():  # a device without stored settings is not asked who it is
            identity = self.attempt("identity", lambda: device.identity())  # noqa: PLW0108 - there may be none
        if identity is not None:
            self.identity = self.privacy.identity(identity)
            self.content.facts = [fact for fact in self.identity.items() if fact[0] != "kind"]
        return dump

    def checks(self) -> Table | None:
        """What its family finds by looking deeper, reading alone; None where it has nothing of the kind."""
        checks = self.run.family.checks
        found = self.attempt("checks", lambda: checks(self.run)) if checks is not None else None
        if found is not None:
            self.show("checks", found)
        return found

    def show(self, part: str, table: Table) -> None:
        """Put a table on the page. What it could not read is a problem of this page; what it judged is not."""
        self.privacy.table(table)
        if table.failure is not None and not isinstance(table.failure, CheckFailed):
            self.failed(part, table.failure)
        setattr(self.content, part, _grids(table))
        self.content.data[part] = table.rows

    def watch(self) -> int:
        """Curves of what changes; the number of samples."""
        return self.attempt("watch", self._watch) or 0

    def _watch(self) -> int:
        run, content = self.run, self.content
        table = get_set_watch.watch(run, self.params, (), rate=RATE_HZ, count=None, duration=self.wishes.watch)
        seen = Curves(table.decimals)
        run.prompts.progress(f"watching for {self.wishes.watch:g} s")
        try:
            for sample in table.samples or ():
                seen.take(sample)  # what came before an error is kept
        except HandctlError as exc:
            self.failed("watch", exc)
        run.prompts.done()
        content.curves = seen.groups
        content.words = table.flags | {param.name for param in self.params if param.choices}
        content.seconds = seen.seconds
        stream = table.summary()["stream"] if table.summary is not None else {}
        rate = f", true rate {stream['rate_hz']:g} Hz" if stream.get("rate_hz") else ""
        content.watched = f"{plural(seen.count, 'sample')} in {content.seconds:.1f} s{rate}."
        return seen.count

    def _explain_silence(self) -> None:
        """Whether a device that never answered is there in another way (another speed), as every command would say."""
        if self.problems:
            part, error = self.problems[-1]
            with contextlib.suppress(HandctlError):
                self.problems[-1] = (part, why_silent(self.run, error))

    # -- telling --

    def conclude(self) -> None:
        """What is known when the conversation is over: findings, counters, this computer, the bytes, what is missing."""
        run, content, privacy = self.run, self.content, self.privacy
        link = run.link_name() if run.settings.port or run.settings.fake else "none"
        content.simulated = run.simulated
        content.facts = [("device", content.kind), ("link", privacy.text(link)), *content.facts]
        for part, error in self.problems:
            content.problems.append((part, error.reworded(privacy.text(error.text), hint=privacy.text(error.hint))))
        content.findings = privacy.messages(run.journal.messages)

        def blanked(text: str) -> str:  # numbers come from rows that are blanked already
            return privacy.text(text) if any(map(str.isalpha, text)) else text

        content.status, content.dump, content.checks, content.service = (
            [grid.with_texts(blanked) for grid in grids]
            for grids in (content.status, content.dump, content.checks, content.service)
        )
        content.counters = [
            (key.replace("_", " "), str(value))
            for key, value in run.journal.counters.as_row().items()
            if isinstance(value, int)
        ]
        content.environment = [(name, privacy.text(text)) for name, text in (*environment(), *port(link))]
        said = {"device": dict(content.facts), "made": content.made, "simulated": content.simulated}
        heard = [
            *content.findings,
            *(Message("error", error.code, error.text, error.hint) for _, error in content.problems),
        ]
        content.data |= {"schema": DATA, "version": __version__, "command": content.command, **said}
        content.data |= {"messages": [message.as_row() for message in heard], "counters": run.journal.counters.as_row()}
        content.data["watch"] = [
            {"name": curve.name, "part": curve.part or None, "unit": curve.unit or None, "min": curve.low, "max": curve.high, "last": curve.last}
            for group in content.curves.values() for curve in group if curve.count
        ]  # fmt: skip
        passed = any(map(_recorded, self.lines))
        told = explained(self.lines, content.kind, privacy)
        content.transcript = list(shortened(list(told), self.wishes.longest, self.lines.left_out)) if passed else []
        reason = "not read, see above" if self.problems else "nothing to show"
        content.missing = {"Status": reason, "Dump": reason, "Transcript": "no byte passed"}
        content.missing["Watch"] = reason if self.problems else "none was asked for (--watch 0)"
        if self.problems:
            content.missing["Findings"] = "the part that could be read shows none" if content.status else reason

    def written(self, path: str) -> Row:
        """Write the page; its row. Raises OutputError."""
        data = page(self.content).encode("utf-8", "replace")
        _write(path, data, self.wishes.force)
        self.run.journal.info("written", f"{path}: {self.content.privacy}")
        return {"file": path, "size": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def report(run: Run, params: ParamMap[Any], path: str, wishes: RequestedOptions) -> Table:
    """Read everything and write the page.

    Raises UsageError, before anything is sent, when FILE cannot be meant.
    """
    refuse(path, wishes.force)
    visit = Visit(run, params, wishes)
    run.in_use = True
    opening = run.family.open
    tap = TraceWriter(visit.lines.append)  # of ours, whether or not --trace has one of its own
    run.family = run.family._replace(
        open=lambda link, settings, journal: opening(observed(link, tap), settings, journal)
    )
    visit.connect()
    visit.status()
    visit.dump()
    visit.checks()
    if wishes.watch:
        visit.watch()
    visit.conclude()
    failure = visit.problems[0][1] if visit.problems else None
    return Table(rows=[visit.written(path)], columns=COLUMNS, failure=failure)


def _promise(privacy: Privacy) -> str:
    """What the page does not hold, in a sentence or two."""
    if privacy.keep_ids:
        return "with serial numbers and pilot ids (--include-ids), without users and home folders"
    text = "without serial numbers, users and home folders"
    if privacy.masks:
        text += f". {' and '.join(privacy.holds)} {REDACTED}, and the bytes that the device sent are left out"
    return f"{text}. --include-ids keeps them"


def _grids(table: Table) -> list[Grid]:
    """How people see a table."""
    if not table.rows:
        return []
    if table.view is not None:
        with contextlib.suppress(TypeError, ValueError):  # a view that counts with what is a word now
            return table.view(table.rows)
    return default_view(table)


# -- the file -----------------------------------------------------------------------------------------------------


def refuse(path: str, force: bool) -> None:
    """Raise UsageError for a file that is not to be replaced, and OutputError for a folder that takes none."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise UsageError(f"{path} is not a file", hint="give the name of a page, such as report.html", code="no-file")
    if os.path.exists(path) and not force:
        raise UsageError(
            f"{path} already exists", hint="choose another name, or use --force to replace the file", code="file-exists"
        )
    if why := why_unwritable(path):
        raise OutputError(
            f"{path}: cannot be written: {why}", hint="choose another folder. Nothing was sent.", code="no-folder"
        )


def _write(path: str, data: bytes, force: bool) -> None:
    """Write the page, whole or not at all. Raises OutputError."""
    with writing(path, "the report "), atomic_write(path, "wb") as file:
        file.write(data)
        if not force and os.path.exists(path):
            raise FileExistsError(17, "another program created the file in the meantime; it was not replaced")


# -- the recorded bytes, a transcript again, with what they mean as comments behind them --------------------------------


MEANING = 240
"""Characters of a meaning; a whole answer of text may have thousands."""


def explained(lines: Iterable[str], kind: str, privacy: Privacy) -> Iterator[str]:
    """The lines of a tap, private ones blanked, each followed by the frames that are complete with it."""
    if kind not in FAMILIES:  # nobody was found
        yield from lines
        return
    explainer: Explainer = load(kind, "explain_bytes").explainer()
    for line in lines:
        yield privacy.transcript(line)
        for entry in parse((line,)):
            if entry.mark == "!":
                yield from _comments(explainer.flush(), privacy)
            else:
                side = HOST if entry.mark == ">" else DEVICE
                yield from _comments(explainer.feed(side, entry.data, entry.can_id), privacy)
    yield from _comments(explainer.flush(), privacy)


def _comments(pieces: Iterable[ExplainedBytes], privacy: Privacy) -> Iterator[str]:
    """One comment per piece. Of what the device said nothing but its kind where its bytes are left out."""
    for piece in pieces:
        text = piece.meaning
        if piece.direction == DEVICE and privacy.masks:
            text = "a whole frame" if piece.frame else "no frame"
        if len(text) > MEANING:
            text = f"{text[:MEANING]} …"
        problem = f" [{piece.problem}]" if piece.problem else ""
        yield f"#   {'host' if piece.direction == HOST else 'device'}: {' '.join(text.split())}{problem}"


def shortened(lines: list[str], longest: int = LONGEST, more: int = 0) -> Iterator[str]:
    """All lines, or the beginning and the end of them with what was recorded between counted, `more` of it no longer there."""
    total = sum(map(len, lines))
    passed = list(accumulate(map(len, lines)))
    kept = [total <= longest or not longest * 3 // 4 < place <= total - longest // 4 for place in passed]
    for keep, group in groupby(zip(kept, lines, strict=True), key=lambda pair: pair[0]):
        some = [line for _, line in group]
        yield from (
            some if keep else [f"# {sum(map(_recorded, some)) + more} lines left out: --trace FILE keeps them all"]
        )


def _recorded(line: str) -> bool:
    """Whether a trace would have it: it is none of our remarks."""
    return not line.startswith("#")


# -- this computer: no user, no host name, no folder ------------------------------------------------------------------

Facts = list[tuple[str, str]]
"""(what, text) in the order of the page."""


def environment() -> Facts:
    """System, Python and the versions of the packages that handctl uses."""
    facts = [("system", system_name()), ("Python", f"{platform.python_implementation()} {platform.python_version()}")]
    return facts + [(name, _version(name)) for name in needed()]


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed as a package"


def port(link: str) -> Facts:
    """What the system reports about the serial port or CAN interface of `link`; nothing for other links."""
    machine = Machine()
    if link.startswith("can:socketcan:"):
        name = link.removeprefix("can:socketcan:").partition("?")[0]
        return [fact for found in machine.can_interfaces() if found.name == name for fact in (
            ("CAN interface", name), ("state", found.state), ("driver", found.driver or "unknown"),
            ("bitrate", f"{found.bitrate} bit/s" if found.bitrate else "not reported"),
        )]  # fmt: skip
    path = path_in(link)  # the device file of a serial LINK; a COM name stays as it is
    path = path if path.startswith("/dev/") or path.upper().startswith("COM") else ""
    if link.startswith("usb:"):
        found = next(iter(machine.matching(link)), None)
    else:
        found = machine.port(path) if path else None
    if found is None:
        return [("port", f"{path or 'none'}: not known to the system")] if path or link.startswith("usb:") else []
    return [fact for fact in (
        ("port", found.path), ("adapter", found.chip.name if found.chip is not None else ""),
        ("USB", ":".join(found.usb.split(":")[:2])), ("driver", found.driver), ("product", found.product),
        ("state", found.state), ("held by", ", ".join(map(str, found.held))), ("group", found.group),
        ("latency timer", f"{found.latency_ms} ms" if found.latency_ms is not None else ""),
    ) if fact[1]]  # fmt: skip
