"""The steps of `handctl service`, each with the code of the command that it is, and the one report in which they end.

A step that fails is a row like any other finding. What is proposed at the end is the remedy of the most urgent finding, as that
says it: there is no second table of remedies here. Never writes, never moves.

The faults of a practice (`--demo`) are those of TRAINING_FAULTS in the family's module `remedies`; what each of them is the simulator says.
"""

from __future__ import annotations

import json
import random
import shlex
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple, TypeVar

import click

from handctl.command import snapshots
from handctl.command.command_lines import parse_line
from handctl.command.family import load, map_of
from handctl.command.library_call import Call
from handctl.command.run import Run
from handctl.errors import (
    CheckFailed,
    HandctlError,
    Hint,
    Interrupted,
    LinkError,
    UsageError,
    command_of,
    joined,
    reworded,
)
from handctl.families import FAMILIES, SCAN_ORDER
from handctl.files import PAGE_DATA, in_page, read_text, text_lines
from handctl.link.fake import meaning_of
from handctl.link.transcript import TraceWriter, observed
from handctl.model.check_rows import FAIL, OK, SKIPPED, TONES, WARNING, Check, table_of
from handctl.model.check_rows import view as checks_view
from handctl.model.device import NOT_THERE
from handctl.model.param import ParamMap
from handctl.model.result import Cell, Column, Grid, Row, Table
from handctl.report import DATA, Recorded, RequestedOptions, Visit, refuse
from handctl.screen.render import default_view
from handctl.tools import doctor
from handctl.tools.doctor_link import CHECKS
from handctl.tools.port_inventory import Machine
from handctl.tools.scan import Scan, free_ports
from handctl.wording import plural, sentence

T = TypeVar("T")
LONGEST = 400_000
"""Characters of recorded bytes in the report: `replay:` can play what is not left out, and `diff` reads a page of this size."""
MOST_BYTES = 4_000_000
SHOWN = 4
"""Quantities that changed while they were watched, named in the row."""
FEW = 2
"""So many rows of a step are told, where nothing is wrong; of more, their number."""
FIND = "find"
OF_LINE = frozenset(row[0] for row in CHECKS)
"""Checks of `doctor` that come before all that a device says of itself: a bad line makes that doubtful."""
PARTS = {"status": "status", "diagnose": "checks", "dump": "dump"}
"""Step -> its part of the report's data."""
WORST = f"{SKIPPED} {OK} {WARNING} {FAIL}"
"""Each status behind those that are not as bad."""
COLUMNS = (Column("step"), Column("check"), Column("status"), Column("evidence"), Column("remedy"))
NOTHING = "Nothing was found. Keep the report, and run the service again while the fault shows."
NO_STEP = "No finding has a next step of its own. Attach the report to the ticket."


class ServiceOptions(NamedTuple):
    """What was asked for, by the names of the options."""

    steps: Mapping[str, str]
    """Step -> what it does."""
    complaint: str | None
    ticket: str | None
    path: str | None
    skip: tuple[str, ...]
    resume: str | None
    against: str | None
    watch: float
    reads: int
    follow: bool
    include_ids: bool
    force: bool
    written: bool = True
    """Whether a report is written."""


def data_of(path: str) -> dict[str, Any]:
    """The data of a report. Raises UsageError for any other file, and for one that was changed by hand."""
    text = read_text(path, "a report", MOST_BYTES)
    try:
        found = json.loads(in_page(text, PAGE_DATA) or "null")
        fits = found["schema"] == DATA and _whole(found)
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError):
        fits = False
    if not fits:
        raise UsageError(
            f"{path}: not a report of handctl", hint=Hint("give a file that {} or `report` wrote", "service")
        )
    return found  # type: ignore[no-any-return]


def _whole(data: dict[str, Any]) -> bool:
    """Whether everything that is used of a report is of the kind that it should be. Raises what Python does where it is not."""
    service = data.get("service", {"steps": {}, "rows": [], "hints": {}})
    values = (data.get("snapshot") or {"values": {}})["values"]
    texts = [data["made"], data["device"]["device"], *(step["state"] for step in service["steps"].values())]
    texts += [row[key] for row in service["rows"] for key in ("step", "check", "status", "evidence")]
    texts += [row["remedy"] or "" for row in service["rows"]]
    texts += [text for part in ("hints", "commands") for pair in service.get(part, {}).items() for text in pair]
    texts += [row.get("command", "") for row in service["rows"]]
    texts += [str(row[key]) for row in data["watch"] for key in ("name", "min", "max")]
    rows = [row for part in PARTS.values() for row in data.get(part, ())]
    return all(isinstance(text, str) for text in texts) and all(
        isinstance(one, dict) for one in (*rows, values, *service["rows"])
    )


class Service:
    """One service: the rows of its steps, and what became of each step."""

    def __init__(self, run: Run, kind: str | None, wishes: ServiceOptions) -> None:
        self.run, self.kind, self.wishes = run, kind, wishes
        self.rows: list[Row] = []
        self.steps: dict[str, Row] = {}
        self.more: dict[str, Any] = {}
        self.followed: list[Row] = []
        self.lines = Recorded(LONGEST)
        self.tap = TraceWriter(self.lines.append)
        self.hints: dict[str, str] = {}
        """Step -> its own most urgent next step."""
        self.reached = False
        self.ended: Interrupted | None = None
        self.visit = Visit(run, ParamMap("unknown", ()), self._of_page, self.lines)
        self.machine = Machine()
        self.heard = run.journal.on_message
        run.journal.on_message = None  # what is said on the way is a row, and stands in the report
        self.checks: Iterator[Check] = iter(())

    @property
    def _of_page(self) -> RequestedOptions:
        wishes = self.wishes
        replaces = wishes.force or (wishes.resume is not None and wishes.path is None)
        return RequestedOptions(wishes.watch, wishes.include_ids, replaces, LONGEST)

    def carried_out(self) -> Table:
        """All steps, and the report. Raises UsageError and OutputError, before anything is sent, for files that cannot be meant."""
        wishes, ask = self.wishes, self.run.prompts.text
        before, recorded = self._earlier()
        old = data_of(wishes.against) if wishes.against is not None else None
        path = wishes.path or wishes.resume or time.strftime("service-%Y%m%d-%H%M%S.html")
        if wishes.written:
            refuse(path, self._of_page.force)
        service = before.get("service", {})
        told = {key: getattr(wishes, key) or service.get(key) for key in ("complaint", "ticket")}
        if wishes.written:
            told["complaint"] = told["complaint"] or ask("What is the complaint? Press Enter to skip.")
            told["ticket"] = told["ticket"] or ask("What is the number of the ticket? Press Enter to skip.")
        self.find(before)
        self.lines.precede(recorded)
        for name in wishes.steps:
            if not self._taken_up(name, before):
                self.step(name, getattr(self, name))
        following = self._next()
        self.more["service"] = {**told, "steps": self.steps, "next": following, "report": None}
        return self._report(path, old, before)

    def _earlier(self) -> tuple[dict[str, Any], list[str]]:
        """The report that is continued, and its recorded bytes. Raises UsageError."""
        if (path := self.wishes.resume) is None:
            return {}, []
        found = data_of(path)
        if "service" not in found:
            raise UsageError(f"{path}: a report, but not of a service", hint=Hint("run {} without --resume", "service"))
        lines = text_lines(in_page(read_text(path, "a report", MOST_BYTES), "pre"))
        return found, [text for text in lines if not text.startswith("#   ")]  # what they mean is said again

    # -- steps --

    def step(self, name: str, action: Callable[[], Iterable[Check]]) -> None:
        """Carry one out: its rows, what it said, and the code of what went wrong. Nothing but a bug is raised."""
        run, visit = self.run, self.visit
        if name in self.wishes.steps and (self.ended is not None or not self.reached or visit.over):
            self.steps[name] = {"state": "failed", "code": "interrupted" if self.ended is not None else "not-reached"}
            return
        if name == "diagnose" and (run.family is None or run.family.checks is None):
            self.steps[name] = {"state": "skipped", "code": "no-diagnosis"}
            return
        if name in self.wishes.skip or (name in self.wishes.steps and self._declined(name)):
            self.steps[name] = {"state": "skipped", "code": None}
            return
        said, failed, first = len(run.journal.messages), len(visit.problems), len(self.rows)
        errors: list[HandctlError] = []
        run.prompts.progress(f"{name}: {self.wishes.steps.get(name, 'looking for the device')}")
        try:
            if name in self.wishes.steps and name != "doctor" and run.opened is None:
                visit.connect()
            for check in action():
                self._add(name, check)
        except HandctlError as exc:
            if name == FIND and isinstance(exc, UsageError):  # the line itself is wrong, and nothing was sent
                raise
            errors.append(exc)
        except KeyboardInterrupt:
            self.ended = Interrupted()
            errors.append(self.ended)
        errors += [error for _, error in visit.problems[failed:]]
        for error in errors:
            self._add(name, Check(error.code, FAIL, error.text, error.hint))
            self.hints.setdefault(name, error.hint)
        for message in run.journal.messages[said:]:
            if message.level != "info":
                self._add(name, Check(message.code, WARNING, message.text, message.hint))
            elif message.code == NOT_THERE:
                self._add(name, Check(message.code, OK, message.text, message.hint))
        state = "failed" if errors else "done"
        self.steps[name] = {"state": state, "code": errors[0].code if errors else None}
        run.prompts.done()
        if run.prompts.interactive and self.wishes.written:
            made = self.rows[first:]
            told = findings(made) or (made[-1:] if name == FIND else made if len(made) <= FEW else [])
            for row in told:
                run.prompts.say(f"  {row['status']}: {said_of(row)}")
            if not told:
                run.prompts.say(f"  {OK}: {plural(len(made), 'check')}")

    def _declined(self, name: str) -> bool:
        answer = self._asked(
            lambda: self.run.prompts.text(f"{name}: {self.wishes.steps[name]}. Press Enter to start or s to skip.")
        )
        return answer is None or answer.casefold() in ("s", "skip")

    def _asked(self, question: Callable[[], T]) -> T | None:
        """The answer; None for Ctrl-C, after which there is still a report."""
        try:
            return question()
        except KeyboardInterrupt:
            self.ended = Interrupted()
            return None

    def _add(self, step: str, check: Check) -> None:
        privacy = self.visit.privacy
        shown = check._replace(evidence=privacy.text(check.evidence), remedy=privacy.step(check.remedy))
        self.rows.append({"step": step, **shown.as_row()})

    def _taken_up(self, name: str, before: dict[str, Any]) -> bool:
        """Whether the earlier report has this step; then its rows and its data are in this one, too."""
        service = before.get("service", {})
        if service.get("steps", {}).get(name, {}).get("state") != "done" or not self.reached:
            return False
        self.steps[name] = {"state": "done", "code": None, "from": before["made"]}
        self.rows += [row for row in service["rows"] if row["step"] == name]
        wanted = (name, "line", "computer") if name == "doctor" else (name,)
        commands = service.get("commands", {})
        self.hints |= {
            key: _with_command(hint, commands.get(key, "")) for key, hint in service["hints"].items() if key in wanted
        }
        data, part = self.visit.content.data, PARTS.get(name, "")
        rows = before.get(part)
        if isinstance(rows, list):
            data[part] = rows
            keys = dict.fromkeys(key for row in rows for key in row if key != "address")
            setattr(self.visit.content, part, default_view(Table(rows=rows, columns=tuple(map(Column, keys)))))
        if name == "dump" and "snapshot" in before:
            data["snapshot"] = before["snapshot"]
        return True

    def find(self, before: dict[str, Any]) -> None:
        """Port and device, at the speed and with the id that it has."""
        self.step(FIND, self._found)
        run, family = self.run, self.run.family
        bad = [row for row in self.rows if row["status"] == FAIL]
        params = map_of(family.kind) if family is not None and family.kind in SCAN_ORDER else None
        if bad or family is None or params is None:
            self.hints.setdefault(FIND, next((_step_of(row) for row in bad if row["remedy"]), ""))
            return
        if before and before["device"]["device"] != family.kind:
            text = f"{self.wishes.resume} is of {before['device']['device']}, but {family.kind} is connected"
            raise UsageError(text, hint="run the service without --resume", code="other-device")
        if family.map_of is not None:
            params = family.map_of(run.settings)
        over, problems = self.visit.over, self.visit.problems
        self.visit = Visit(run, params, self._of_page, self.lines)
        self.visit.over, self.visit.problems = over, problems
        private = self.visit.privacy.text  # only now it is known what names this device
        self.rows = [{**row, "evidence": private(row["evidence"])} for row in self.rows]
        self.reached = True

    def _found(self) -> Iterator[Check]:
        run = self.run
        if not (run.settings.port or run.settings.fake):
            yield from self._port()
        last = "device" if self.kind is None else "open"
        self.checks = doctor.examine(run, self.machine, self.kind, self.wishes.reads)
        tapped = False
        for check in self.checks:
            if run.link is not None and not tapped:
                observed(run.link, self.tap)
                tapped = True
            yield check
            if check.name == last:
                break

    def _port(self) -> Iterator[Check]:
        """The one port that has a device. Raises LinkError, UsageError."""
        run = self.run
        names = free_ports(self.machine, run.journal)
        if len(names) > 1:
            scan = Scan(run, [self.kind] if self.kind else SCAN_ORDER, None, False, None, run.settings.deadline)
            found = [row for name in names for row in scan.look(name).rows]
            if not found:
                text = f"no device on {', '.join(names)}"
                raise LinkError(
                    text,
                    hint=Hint("check power and cable, or give LINK. {} looks longer", "scan --all"),
                    code="no-device",
                )
            names = list(dict.fromkeys(row["link"] for row in found))
        if len(names) > 1:
            names = [run.prompts.choose(f"Devices on {', '.join(names)}. Which one", names)]
        if not names[0]:
            raise UsageError("several ports have a device", hint="give LINK", code="several-devices")
        run.settings = run.settings._replace(port=names[0])
        yield Check("port", OK, names[0])

    def doctor(self) -> Iterator[Check]:
        """This computer, then the rest of the checks of the link."""
        machine, found = doctor.machine_checks(self.machine), []
        yield from machine
        for check in self.checks:
            found.append(check)
            yield check
        line = [check for check in found if check.status == FAIL and check.name in OF_LINE]
        for name, checks in (("line", line), ("doctor", found), ("computer", machine)):
            if (failure := table_of(checks, doctor.CAUSES).failure) is not None:
                self.hints[name] = failure.hint

    def status(self) -> Iterator[Check]:
        """Its findings are messages."""
        table = self.visit.status(check=True)
        if table is not None:
            if isinstance(table.failure, CheckFailed):
                self.hints["status"] = table.failure.hint
            else:
                yield Check("status", OK, f"{plural(len(table.rows), 'value')} read, nothing unhealthy")

    def diagnose(self) -> Iterator[Check]:
        """Rows of the family; none where it has no diagnosis that reads alone."""
        table = self.visit.checks()
        for row in table.rows if table is not None else ():
            yield Check(row["check"], row["status"], row["evidence"], _step_of({"remedy": None, **row}))
        if table is not None and table.failure is not None:
            self.hints["diagnose"] = table.failure.hint

    def watch(self) -> Iterator[Check]:
        """Errors, and the range of each value."""
        counters = self.run.journal.counters
        before = counters.retries, counters.bad_frames, counters.stray_bytes
        count = self.visit.watch()
        if not count:
            return
        errors = [
            now - then
            for now, then in zip((counters.retries, counters.bad_frames, counters.stray_bytes), before, strict=True)
        ]
        moved = [curve for group in self.visit.content.curves.values() for curve in group if curve.moved]
        ranges = [
            f"{'.'.join(filter(None, (curve.name, curve.part)))} {curve.low:g} to {curve.high:g}" for curve in moved
        ]
        if len(ranges) > SHOWN:
            ranges[SHOWN:] = [f"and {len(ranges) - SHOWN} more"]
        seen = f"{plural(count, 'sample')}, {errors[0]} retries, {errors[1]} bad frames, {errors[2]} stray bytes"
        changed = f"Changed: {', '.join(ranges)}" if ranges else "No value changed"
        assert self.run.family is not None
        remedy = Hint("run {}", f"{self.run.family.kind} doctor") if any(errors) else ""
        yield Check("watch", WARNING if any(errors) else OK, f"{seen}. {sentence(changed)}", remedy)

    def dump(self) -> Iterator[Check]:
        """Every quantity, and a snapshot of what is kept."""
        visit, run = self.visit, self.run
        table = visit.dump()
        if table is None:
            return
        kept = "no settings"
        if visit.params.kept():
            device = run.device()

            def read() -> dict[str, Any]:
                return snapshots.read_values(device, device.map.kept(further=device.further(visit.identity)))

            values = visit.attempt("settings", read) or {}
            link = visit.privacy.text(run.link_name())
            content = snapshots.make(visit.params.kind, visit.identity, values, link=link, fake=run.simulated)
            visit.content.data["snapshot"] = content
            kept = snapshots.counted(visit.params, list(values))
        yield Check("dump", OK, f"{plural(len(table.rows), 'value')} read, {kept} kept for comparison")

    # -- what to do next --

    def proposal(self) -> str:
        """The next step of the most urgent finding: what keeps us from the device, what it has itself, then the rest."""
        order = (FIND, "line", "status", "diagnose", "doctor", *self.wishes.steps, "computer")
        hint = next((self.hints[name] for name in order if self.hints.get(name)), "")
        return hint or next(
            (_step_of(row) for row in self.rows if row["status"] in (FAIL, WARNING) and row["remedy"]), ""
        )

    def _next(self) -> Row:
        """Propose it, and carry it out where it only reads."""
        hint = self.proposal()
        found: Row = {
            "text": sentence(hint) or (NO_STEP if findings(self.rows) else NOTHING),
            "command": None,
            "state": "proposed",
        }
        run, words = self.run, shlex.split(command_of(hint))
        if not words or self.ended is not None:
            return found
        try:
            one = parse_line(words, {})
            if one.leaf.family is not None and self.reached:
                words += ["-d", run.settings.device] if run.settings.device else ["-p", run.link_name()]
                words += ["--id", str(run.settings.id)] if run.settings.id is not None and one.leaf.family.ids else []
                one = parse_line(words, {})
        except (HandctlError, click.exceptions.Exit):
            return found
        found["command"] = shlex.join(["handctl", *words])
        late = run.end is not None and run.link is not None and run.link.now() >= run.end
        if not one.leaf.only_reads or not self.reached or late:
            return found
        if self.wishes.follow or self._asked(
            lambda: run.offer(f"Next: {found['text']} `{found['command']}` only reads")
        ):
            self.step("next", lambda: self._followed(Call(one.context, one.settings, one.leaf.family, False), one.leaf))
            found |= {"state": self.steps["next"]["state"], "rows": self.followed}
        return found

    def _followed(self, call: Call, leaf: Any) -> Iterator[Check]:
        """Carry out a command that only reads, on a link of its own, in what is left of --deadline."""
        if self.run.link is not None:
            call.settings = self.run.in_time(self.run.link, call.settings)
        self.run.close(None)
        self.visit.lines.append(f"# {call.command}")
        observed(call.open_link(), self.tap)
        outcome = call.carry_out(leaf.body(call))
        call.end_device()
        table, failure = outcome.table, outcome.failure
        if isinstance(failure, Interrupted):
            self.ended = failure
        if failure is not None and not isinstance(failure, CheckFailed):
            raise failure
        rows = self.followed = table.rows if table is not None else []
        text = failure.text if failure is not None else f"{plural(len(rows), 'row')}, nothing wrong"
        yield Check(call.command, OK if failure is None else WARNING, text, failure.hint if failure is not None else "")

    # -- the report --

    def _report(self, path: str, old: dict[str, Any] | None, before: dict[str, Any]) -> Table:
        """The page, and the rows with what is to be done."""
        visit, service = self.visit, self.more["service"]
        bad = findings(self.rows)
        if old is not None:
            service["against"] = {"made": old.get("made"), "differences": differences(old, self._now())}
        compared = _differing(service["against"]) if old is not None else []
        service["hints"] = {name: visit.privacy.step(hint) for name, hint in self.hints.items()}
        service["commands"] = {name: named for name, hint in service["hints"].items() if (named := command_of(hint))}
        text = visit.privacy.text
        following = dict(service["next"])
        if following["command"]:
            following["command"] = shlex.join(map(text, shlex.split(following["command"])))
        if "rows" in following:
            following["rows"] = visit.privacy.rows(following["rows"])
        facts = [(key.capitalize(), text(service[key] or "none was given")) for key in ("ticket", "complaint")]
        facts += [("Next step", text(service["next"]["text"])), ("Command", following["command"] or "none")]
        visit.content.service = [Grid(("Service", ""), tuple(facts)), *view(self.rows, self.steps), *compared]
        visit.content.data["service"] = {**service, "rows": self.rows, "next": following}
        visit.conclude()
        if before and "from" in self.steps.get("watch", {}):
            visit.content.data["watch"] = before.get("watch", [])
            ranges = [f"{row['name']} {row['min']} to {row['max']}" for row in before.get("watch", [])]
            visit.content.missing["Watch"] = f"watched earlier: {', '.join(ranges)}"
        shown = lambda rows: [*view(rows, self.steps), *compared]  # noqa: E731
        table = Table(rows=self.rows, columns=COLUMNS, view=shown, extra=self.more)
        self.run.journal.on_message = self.heard
        if self.wishes.written:
            service["report"] = visit.written(path)
        if self.ended is not None:
            table.failure = self.ended
        elif bad:
            table.failure = CheckFailed(
                f"the service has {plural(len(bad), 'finding')}", hint=_in_full(service["next"]), code="findings"
            )
        return table

    def _now(self) -> dict[str, Any]:
        return {**self.visit.content.data, "service": {"rows": self.rows}}


def _step_of(row: Row) -> str:
    """The next step of a row, with the command that the row has as data."""
    return _with_command(row["remedy"] or "", str(row.get("command", "")).removeprefix("handctl "))


def _with_command(text: str, command: str) -> str:
    return reworded(Hint("{}", command), text) if command else text


def said_of(row: Row) -> str:
    """What a row says by itself: a check's evidence does not name what was checked."""
    return f"{row['check']}: {row['evidence']}" if row["step"] in ("doctor", "diagnose") else str(row["evidence"])


def findings(rows: list[Row]) -> list[Row]:
    """Those about which somebody must do something."""
    return [row for row in rows if row["status"] in (FAIL, WARNING)]


def _in_full(following: Row) -> str:
    """The next step, with the command as it is typed for this device."""
    command = following["command"]
    return joined(following["text"], f"In full: `{command}`" if command and following["state"] == "proposed" else "")


def differences(old: dict[str, Any], new: dict[str, Any]) -> list[Row]:
    """What a report has otherwise than an older one: settings, and how its checks came out. What only one of them looked at is none."""

    def settings(data: dict[str, Any]) -> dict[str, Any]:
        return dict((data.get("snapshot") or {"values": {}})["values"])

    def checks(data: dict[str, Any]) -> dict[str, Any]:
        worst = sorted(data.get("service", {}).get("rows", ()), key=lambda row: WORST.find(row["status"]))
        return {f"check {row['check']}": row["status"] for row in worst}

    found = []
    for facts in (settings, checks):
        was, now = facts(old), facts(new)
        for name in dict.fromkeys([*was, *now]) if was and now else ():
            both = name in was and name in now
            if was.get(name) != now.get(name) and (both or {was.get(name), now.get(name)} & {WARNING, FAIL}):
                found.append({"name": name, "was": was.get(name), "is": now.get(name)})
    return found


def _differing(against: dict[str, Any]) -> list[Grid]:
    lines = tuple((row["name"], str(row["was"]), str(row["is"])) for row in against["differences"])
    notes = () if lines else ("No difference.",)
    return [Grid(("Name", "Was", "Is"), lines, title=f"Compared with {against['made']}", notes=notes)]


def view(rows: list[Row], steps: dict[str, Row]) -> Iterator[Grid]:
    """A line for each step, then what was found."""
    lines = []
    for name, step in steps.items():
        mine = [row for row in rows if row["step"] == name]
        bad = findings(mine)
        status = bad[0]["status"] if bad else {"skipped": SKIPPED, "failed": FAIL}.get(step["state"], OK)
        evidence = [row["evidence"] for row in (mine[-1:] if name == FIND else mine)]
        found = joined(*evidence) if len(evidence) <= FEW else plural(len(mine), "check")
        found = plural(len(bad), "finding") if bad else found if mine else ""
        said = step["code"] if step["state"] == "failed" else "done earlier" if "from" in step else step["state"]
        lines.append((name, Cell(said, TONES[status]), found))
    yield Grid(("Step", "Result", "Found"), tuple(lines))
    if wrong := findings(rows):
        yield from checks_view(wrong)


# -- practice: a simulated device has a fault, the trainee says which, and it is checked and explained --------------------


SEEDS = 1_000_000
"""Demos that --seed can tell apart."""


def practise(run: Run, kind: str, finding: str | None, seed: int | None, wishes: ServiceOptions) -> Table:
    """One round. Raises UsageError for a finding that is none of the choices."""
    seed = random.randrange(SEEDS) if seed is None else seed
    draw = random.Random(seed)
    kind = kind or draw.choice(list(FAMILIES))
    practice: dict[str, str] = load(kind, "remedies").TRAINING_FAULTS
    faults = tuple(practice)
    if finding is not None and finding not in faults:
        raise UsageError(
            f"--finding {finding}: not a fault in a demo of {kind}", hint=f"give one of {', '.join(faults)}"
        )
    fault = draw.choice(faults)
    run.settings = run.settings._replace(
        port="&".join(filter(None, (f"fake://{kind}?fault={fault}&clock=virtual", practice[fault])))
    )
    run.prompts.moving = False  # progress names the LINK, and that the fault
    return Demo(run, kind, wishes._replace(written=False), (fault, seed, faults, finding)).carried_out()


class Demo(Service):
    """A service without a report, whose next step is found by the trainee first."""

    def __init__(
        self, run: Run, kind: str, wishes: ServiceOptions, task: tuple[str, int, tuple[str, ...], str | None]
    ) -> None:
        super().__init__(run, kind, wishes)
        self.fault, self.seed, self.faults, self.finding = task
        self.family = kind

    def _declined(self, name: str) -> bool:
        return False

    def _next(self) -> Row:
        """Ask for the finding, and explain what it was."""
        prompts = self.run.prompts
        if self.finding is None and prompts.interactive:
            for row in findings(self.rows):  # whose LINK would say which fault it is
                prompts.say(f"{row['step']}: {said_of(row).replace(self.run.link_name(), 'the device')}")
            for number, name in enumerate(self.faults, 1):
                prompts.say(f"  {number}  {name}: {meaning_of(self.family, name)}")
            answer = prompts.text("Which fault does this device have? Type its number or name.")
            names = dict(zip(map(str, range(1, len(self.faults) + 1)), self.faults, strict=False))
            self.finding = names.get(answer, answer) or None
        right = self.finding == self.fault
        text = f"the fault is {self.fault}: {meaning_of(self.family, self.fault)}"
        if self.finding is not None:
            text = f"{'right' if right else f'not {self.finding}'}: {text}"
        status = SKIPPED if self.finding is None else OK if right else FAIL
        proposal = self.proposal()
        self._add("finding", Check("finding", status, text, proposal))
        self.steps["finding"] = {"state": "done", "code": None} if self.finding else {"state": "skipped", "code": None}
        prompts.say(f"{sentence(text)} Next: {sentence(proposal)}")
        return {"text": sentence(proposal), "command": None, "state": "proposed"}

    def _report(self, path: str, old: dict[str, object] | None, before: dict[str, object]) -> Table:
        """The rows; what decides is whether the finding is right."""
        right = self.finding == self.fault
        told = {"family": self.family, "fault": self.fault, "seed": self.seed, "finding": self.finding}
        self.more["service"]["demo"] = {**told, "right": right if self.finding is not None else None}
        table = super()._report(path, old, before)
        if self.ended is None:
            wrong = CheckFailed(
                f"the fault is {self.fault}, not {self.finding}",
                hint=f"--seed {self.seed} repeats it",
                code="wrong-finding",
            )
            table.failure = None if right or self.finding is None else wrong
        return table
