"""Writing one setting of a worn EksoNR: limits, one SetValue when the wearer is still, read-back of everything, audit.

The limits are those of `write_policy`; the device's own are not documented and it answers for itself. A write is never repeated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from handctl.devices.ekso import write_checks
from handctl.devices.ekso.audit_log import NOT_SENT, AuditLog, recent
from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.frames import Command, Frame
from handctl.devices.ekso.parameter_map import NOTHING_SENT, SETTINGS, Word, boot_ms
from handctl.devices.ekso.setting_change import Change, Raws, differences, judge
from handctl.devices.ekso.stillness import moving
from handctl.devices.ekso.write_policy import BETWEEN_WRITES, READS_APART, STEP_SECONDS, largest_step, write_limits_of
from handctl.errors import (
    Aftermath,
    HandctlError,
    Hint,
    Interrupted,
    LinkError,
    NoAnswer,
    NotConfirmed,
    OutputError,
    ProtocolError,
)
from handctl.model.param import Step
from handctl.model.prompts import Prompts
from handctl.model.result import hex_bytes
from handctl.wording import plural

SHORTEST_WAIT = 0.05
"""Seconds: two clocks that disagree by a rounding must not make a wait of nothing."""
LOOK_AGAIN = Hint("check with {} and start again", "ekso settings")
PERSONAL = "pilot_id"
"""Stays out of the log."""


# -- one write ----------------------------------------------------------------------------------------------------


class Writer:
    """Writes settings one by one, with all gates.

    ask       question with the word to be typed; raises NotConfirmed
    override  step limits may be exceeded (not those of leg lengths)
    stepwise  a far value is led to in permitted steps with the waits between them, instead of being refused
    guide     tells of the waits; holds Ctrl-C back while an entry is on its way to the disk
    """

    def __init__(
        self,
        port: DataPort,
        audit: AuditLog,
        ask: Callable[[str, str], None],
        *,
        override: bool,
        stepwise: bool = False,
        prompts: Prompts | None = None,
    ) -> None:
        self.port = port
        self.audit = audit
        self.override = override
        self.stepwise = stepwise
        self._ask = ask
        self._guide = prompts or Prompts()
        self._interrupted = False
        self._last: int | None = None
        self._boot: int | None = None
        self._looks: Mapping[str, Callable[[Sequence[Change], Raws], None]] = {
            write_checks.LOG: lambda _changes, _shown: audit.check(),
            write_checks.LISTED: self._listed,
            write_checks.STEP: self._step,
            write_checks.STILL: self._still,
            write_checks.RESTARTED: self._running_on,
            write_checks.SAME: self._same,
            write_checks.INTENT: self._intent,
        }

    def write(self, wanted: Sequence[tuple[Word, int]], shown: Raws) -> Raws:
        """Write (setting, raw value) pairs one by one where they differ from `shown`; the settings after the last.

        Everything that can be refused is refused before the first of them. Raises UsageError, NotConfirmed,
        CheckFailed, DeviceRefused, OutputError, NoAnswer, ProtocolError, Interrupted.
        """
        changes = [Change(param, shown[param.word], raw) for param, raw in wanted if shown[param.word] != raw]
        if changes:
            self._pass(write_checks.READ, changes, shown)
        done: list[str] = []
        for change in changes:
            stages = change.way(self.override) if self.stepwise else [change]
            left: list[Change] = []
            try:
                self._ask_for(change, stages)
                for stage in stages:
                    left = [stage._replace(new=change.new)] if stage is not stages[0] else []
                    shown = self._write_one(stage, shown)
            except HandctlError as exc:
                if done or left:
                    if isinstance(exc, NotConfirmed):
                        exc.hint = ""
                    exc.add_aftermath(Aftermath(behind=f"{_standing(done, left, 'had reached')}.", joint=". "))
                raise
            except KeyboardInterrupt:
                if not done and not left:
                    raise
                raise Interrupted(
                    f"interrupted. {_standing(done, left, 'is at')}",
                    hint="repeat the command: it continues where it stopped",
                ) from None
            done.append(change.param.name)
        return shown

    def write_back(self, param: Word, shown: Raws) -> None:
        """Write the value that a setting has already, once and with all gates. Raises what `write` does, and DeviceRefused with the status."""
        change = Change(param, shown[param.word], shown[param.word])
        self._pass(write_checks.READ, [change], shown)
        self._ask_for(change, [change])
        self._write_one(change, shown)

    def _pass(self, moment: str, changes: Sequence[Change], shown: Raws) -> None:
        """All gates of a moment, in the order of the table."""
        for gate in write_checks.at(moment):
            self._looks[gate](changes, shown)

    def _listed(self, changes: Sequence[Change], _shown: Raws) -> None:
        for change in changes:
            change.check_code()

    def _step(self, changes: Sequence[Change], _shown: Raws) -> None:
        for change in () if self.stepwise else changes:
            change.check_step(self.override)

    def _ask_for(self, change: Change, stages: Sequence[Change]) -> None:
        param = change.param
        text = change.text
        if len(stages) > 1:
            shown = ", ".join(param.typed(param.from_raw(stage.new)) for stage in stages)
            text += f", in {plural(len(stages), 'step')} ({shown}), about {STEP_SECONDS * (len(stages) - 1):.0f} s"
        self._ask(f"Set {text}. A person may be standing in the device", param.typed(param.from_raw(change.new)))
        if change.asked_twice:
            self._ask(f"{change.text}: this changes how the device drives. Really", "yes")

    def _write_one(self, change: Change, shown: Raws) -> Raws:
        """One step, exclusively: no other handctl may write between reading the last writes and recording the result."""
        begun = self.port.link.now()
        while True:
            with self.audit.alone():
                seconds = self._to_wait(change)
                if not seconds:
                    self._pass(write_checks.ALONE, [change], shown)
                    return self._send(change, shown)
            if self.port.link.now() - begun > 3 * STEP_SECONDS:
                raise write_checks.refusal(
                    write_checks.WAITED,
                    f"{self.port.where}: {change.text} is not permitted after {3 * STEP_SECONDS:.0f} s: someone else keeps writing {change.param.name}",
                    f"check the end of {self.audit.path}. {NOTHING_SENT}",
                )
            self._guide.say(
                f"waiting {seconds:.0f} s, because one step is permitted every {STEP_SECONDS:.0f} s. {change.text} is next. Ctrl-C stops here"
            )
            self._sleep(seconds)

    def _to_wait(self, change: Change) -> float:
        """Seconds until this step is permitted after the last writes, also those of other runs; 0 after the pause that any
        write needs. Raises UsageError instead where a step is not waited for.
        """
        now = self.port.link.now()
        past = recent(self.audit, now)
        beyond = [
            entry
            for entry in past
            if entry.name == change.param.name and len(change._replace(old=entry.old).way(self.override)) > 1
        ]
        if beyond:
            seconds = beyond[0].at + STEP_SECONDS - now
            if self.stepwise:
                return max(seconds, SHORTEST_WAIT)
            raise write_checks.refusal(
                write_checks.PACE,
                f"{change._replace(old=beyond[0].old).text} within {STEP_SECONDS:.0f} s: more than {largest_step(change.param)} is beyond this tool's policy (not the "
                "device's limit)",
                f"it is permitted in {max(seconds, 0):.0f} s. Writes to another EksoNR count as well, because it does not report which unit it is. "
                f"{NOTHING_SENT}",
            )
        if past:
            self._sleep(past[0].at + BETWEEN_WRITES - now)
        return 0.0

    def _sleep(self, seconds: float) -> None:
        now = self.port.link.now()
        end = self.port.deadline(seconds)
        self.port.link.sleep(end.at - now)  # what comes next is not sent after --deadline
        if self.port.over and end.at < now + seconds:
            self.port.settings_raw()  # raises, saying that the deadline has passed

    def _same(self, _changes: Sequence[Change], shown: Raws) -> None:
        before = self.port.settings_raw()
        if before != shown:
            raise write_checks.refusal(
                write_checks.SAME,
                f"{self.port.where}: the settings changed in the meantime. Nothing was written: {differences(shown, before)}",
                LOOK_AGAIN,
            )

    def _intent(self, changes: Sequence[Change], _shown: Raws) -> None:
        (change,) = changes
        with self._guide.count_interrupts() as presses:
            self._record("intent", change, frame=hex_bytes(self.port.request(Command.SET_VALUE, change.body)))
        if presses.count:
            self._result(change, None, None, f"{NOT_SENT}: interrupted")
            raise Interrupted(f"interrupted. {change.text} was not sent", hint="this setting has not changed")

    def _send(self, change: Change, before: Raws) -> Raws:
        """The one SetValue; from here on nothing but a second Ctrl-C keeps the read-back from being done, which has its deadlines."""
        answer: Frame | None = None
        lost: HandctlError | None = None
        self._interrupted = False
        try:
            answer = self.port.exchange(Command.SET_VALUE, change.body)
        except KeyboardInterrupt:
            self._interrupted = True
        except (NoAnswer, ProtocolError) as exc:
            lost = exc
        except LinkError as exc:  # nobody is left who could be asked
            self._result(change, None, None, f"unknown: {exc.text}")
            exc.add_aftermath(_unread(change))
            raise
        bound, self.port.bound = self.port.bound, None  # a written setting is always read back, also beyond --deadline
        try:
            with self._guide.count_interrupts() as presses:
                presses.most = 0 if self._interrupted else 1
                after = self._read_back(change, before, answer)
            self._interrupted = self._interrupted or presses.count > 0
        except HandctlError as exc:
            self._result(change, answer, None, f"read-back failed: {exc.text}")
            exc.add_aftermath(_unread(change))
            raise
        except KeyboardInterrupt as exc:
            again = self._interrupted or presses.count > 0
            self._result(change, answer, None, f"not read back: interrupted{' twice' if again else ''}")
            raise Interrupted(
                f"interrupted{' again' if again else ''}: {change.text} was sent and not read back",
                hint=Hint("check with {}", "ekso settings"),
            ) from exc
        finally:
            self.port.bound = bound
        contradicted = self.port.statuses if self.port.contradiction is not None else ""
        failure = judge(self.port.where, change, before, after, answer, lost, contradicted)
        step = Step(change.text, self.port.request(Command.SET_VALUE, change.body))
        taken, refused = change.shown_by(answer, after), answer is not None and answer.status & 0xFF != 0
        if taken:
            self.port.journal.ledger.confirm("read back", step)
        if not taken or contradicted or refused:  # a value that was refused and reads back shows neither
            self.port.journal.ledger.doubt(
                f"reads {change.param.shown(change.param.from_raw(after[change.param.word]))}", step
            )
        unlogged = self._result(change, answer, after, "applied" if failure is None else failure.text)
        if failure is not None:
            raise failure
        if unlogged is not None:
            raise write_checks.refusal(
                write_checks.RESULT,
                f"{change.text} was written and read back. Only its audit log entry is missing: {unlogged.text}",
                "free some disk space and note the change by hand. Nothing else was sent",
            )
        if self._interrupted:
            raise Interrupted(f"interrupted. {change.text} was written and read back", hint="nothing else was sent")
        if answer is None:
            self.port.journal.warn(
                "answer-lost", f"{change.text}: applied, but its reply was lost ({lost.text if lost else ''})"
            )
        return after

    def _read_back(self, change: Change, before: Raws, answer: Frame | None) -> Raws:
        after = self.port.settings_raw()
        refused = answer is not None and answer.status & 0xFF
        if after == before and not refused:  # perhaps on its way: look again before saying that it was not taken
            self.port.link.sleep(BETWEEN_WRITES)
            after = self.port.settings_raw()
        return after

    def _still(self, changes: Sequence[Change], _shown: Raws) -> None:
        """Read twice, at least 100 ms apart. Raises CheckFailed naming the condition that fails."""
        port, sitting = self.port, [change.param for change in changes if write_limits_of(change.param).sitting]
        first, moment = port.read(Command.GET_DATA).words, port.moment
        port.link.sleep(READS_APART)
        second = port.read(Command.GET_DATA).words
        if why := moving(first, second, port.moment.since(moment), sitting):
            hint = f"{'sit' if sitting else 'sit or stand'} still and repeat the command. This check cannot be switched off"
            raise write_checks.refusal(write_checks.STILL, f"{port.where}: not written: {why}", hint)
        self._last, self._boot = self._boot, boot_ms(second)

    def _running_on(self, _changes: Sequence[Change], _shown: Raws) -> None:
        """A restarted device may hold other settings."""
        if self._last is not None and self._boot is not None and (self._boot - self._last) % 2**32 >= 2**31:
            raise write_checks.refusal(
                write_checks.RESTARTED,
                f"{self.port.where}: the device has restarted in the meantime. Nothing was written",
                LOOK_AGAIN,
            )

    def _record(self, event: str, change: Change, **more: object) -> None:
        param = change.param
        old, new = ({"raw": raw, "value": param.from_raw(raw)} for raw in (change.old, change.new))
        said = {"boot_ms": self._boot, "id": param.id, "name": param.name, "unit": param.unit, "old": old, "new": new}
        self.audit.record(event, self.port.link.now(), **said, override=self.override, **more)

    def _result(self, change: Change, answer: Frame | None, after: Raws | None, verdict: str) -> OutputError | None:
        """Record the result. Returns the error of the log, if any; neither that nor Ctrl-C may hide the result."""
        failure: OutputError | None = None
        data, status = (hex_bytes(answer.data), answer.status) if answer is not None else (None, None)
        back = {p.name: after[p.word] for p in SETTINGS if p.name != PERSONAL} if after is not None else None
        with self._guide.count_interrupts() as presses:
            try:
                self._record("result", change, answer=data, status=status, read_back=back, verdict=verdict)
            except OutputError as exc:
                failure = exc
        self._interrupted = self._interrupted or presses.count > 0
        return failure


def _standing(done: Sequence[str], left: Sequence[Change], verb: str) -> str:
    """``Already written: swing_time. step_length stands at 13.00 in on its way to 14.75 in``"""
    texts = [f"Already written: {', '.join(done)}"] if done else []
    for change in left:
        now, end = (change.param.shown(change.param.from_raw(raw)) for raw in (change.old, change.new))
        texts.append(f"{change.param.name} {verb} {now} on its way to {end}")
    return ". ".join(texts)


def _unread(change: Change) -> Aftermath:
    return Aftermath(
        hint=f"{change.text} was sent but could not be read back: read it before you write again", joint=". "
    )
