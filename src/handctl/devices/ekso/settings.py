"""Writing one setting of a worn EksoNR: limits, one SetValue when the wearer is still, read-back of everything, audit.

The limits are this tool's policy (`describe` shows them); the device's own are not documented and it answers for
itself. A write is never repeated.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence

from handctl.devices.ekso.audit import AuditLog
from handctl.devices.ekso.change import Change, check_change, check_code, limit_of, most, needs_second_answer, way
from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.frames import Command, Frame, set_value_body, status_text
from handctl.devices.ekso.map import NOTHING_SENT, SETTINGS, Word
from handctl.devices.ekso.memory import NOT_SENT, WINDOW, recent
from handctl.devices.ekso.stillness import require_stillness
from handctl.errors import (
    CheckFailed,
    DeviceRefused,
    HandctlError,
    Interrupted,
    LinkError,
    NoAnswer,
    NotConfirmed,
    OutputError,
    ProtocolError,
    UsageError,
)
from handctl.model.guide import Guide
from handctl.model.param import Step
from handctl.model.result import hex_bytes

BETWEEN_WRITES = 1.0
"""Seconds from one SetValue to the next."""
SHORTEST_WAIT = 0.05
"""Seconds: two clocks that disagree by a rounding must not make a wait of nothing."""
PERSONAL = "pilot_id"
"""Stays out of the log."""

Raws = tuple[int, ...]
"""The 22 settings as raw integers."""


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
        guide: Guide | None = None,
    ) -> None:
        self.port = port
        self.audit = audit
        self.override = override
        self.stepwise = stepwise
        self._ask = ask
        self._guide = guide or Guide()
        self._interrupted = False
        self._boot: int | None = None

    def write(self, wanted: Sequence[tuple[Word, int]], shown: Raws) -> Raws:
        """Write (setting, raw value) pairs one by one where they differ from `shown`; the settings after the last.

        Everything that can be refused is refused before the first of them. Raises UsageError, NotConfirmed,
        CheckFailed, DeviceRefused, OutputError, NoAnswer, ProtocolError, Interrupted.
        """
        changes = [Change(param, shown[param.word], raw) for param, raw in wanted if shown[param.word] != raw]
        for change in changes:
            (check_code(change) if self.stepwise else check_change(change, self.override))
        if changes:
            self.audit.check()
            self._still([change.param for change in changes if change.param.sitting])
        done: list[str] = []
        for change in changes:
            stages = way(change, self.override) if self.stepwise else [change.new]
            left: list[Change] = []
            try:
                self._ask_for(change, stages)
                for old, new in zip([change.old, *stages], stages, strict=False):
                    left = [Change(change.param, old, change.new)] if old != change.old else []
                    shown = self._write_one(Change(change.param, old, new), shown)
            except HandctlError as exc:
                if done or left:
                    hint = "" if isinstance(exc, NotConfirmed) or not exc.hint else f"{exc.hint.rstrip('.')}. "
                    exc.hint = f"{hint}{_standing(done, left, 'had come to')}."
                raise
            except KeyboardInterrupt:
                if not done and not left:
                    raise
                raise Interrupted(
                    f"interrupted; {_lower(_standing(done, left, 'stands at'))}",
                    hint="the same command goes on where it stopped",
                ) from None
            done.append(change.param.name)
        return shown

    def _ask_for(self, change: Change, stages: Sequence[int]) -> None:
        param = change.param
        text = change.text
        if len(stages) > 1:
            shown = ", ".join(param.typed(param.from_raw(raw)) for raw in stages)
            text += f", in {len(stages)} steps ({shown}), about {WINDOW * (len(stages) - 1):.0f} s"
        self._ask(f"Set {text}. A person may stand in the device", param.typed(_value(change)))
        if needs_second_answer(change):
            self._ask(f"{change.text}: this changes how the device drives. Really", "yes")

    def _write_one(self, change: Change, shown: Raws) -> Raws:
        """One step, alone: from the look at the last writes until its result is noted no other handctl may write."""
        begun = self.port.link.now()
        while True:
            with self.audit.alone():
                seconds = self._to_wait(change)
                if not seconds:
                    return self._write_alone(change, shown)
            if self.port.link.now() - begun > 3 * WINDOW:
                raise CheckFailed(
                    f"{self.port.where}: {change.text} is not permitted after {3 * WINDOW:.0f} s: somebody else writes "
                    f"{change.param.name} all the time",
                    hint=f"see the end of {self.audit.path}. {NOTHING_SENT}",
                    code="step-limit",
                )
            self._guide.say(
                f"waiting {seconds:.0f} s: one step in {WINDOW:.0f} s; {change.text} is next. Ctrl-C ends it here"
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
            if entry.name == change.param.name
            and (step := most(Change(change.param, entry.old, change.new), self.override)) is not None
            and abs(change.new - entry.old) > step
        ]
        if beyond:
            seconds = beyond[0].at + WINDOW - now
            if self.stepwise:
                return max(seconds, SHORTEST_WAIT)
            first = Change(change.param, beyond[0].old, change.new)
            raise UsageError(
                f"{first.text} within {WINDOW:.0f} s: more than {limit_of(change.param)} is beyond this tool's policy (not the "
                "device's limit)",
                hint=f"it is permitted in {max(seconds, 0):.0f} s. {NOTHING_SENT}",
                code="step-limit",
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

    def _write_alone(self, change: Change, shown: Raws) -> Raws:
        before = self.port.settings_raw()
        if before != shown:
            raise CheckFailed(
                f"{self.port.where}: settings changed meanwhile, nothing was written: {differences(shown, before)}",
                hint="look with `handctl ekso settings` and start again",
                code="changed-meanwhile",
            )
        boot = self._still([change.param] if change.param.sitting else [])
        assert change.param.id is not None
        body = set_value_body(change.param.id, change.new)
        with self._guide.counting() as presses:
            self._record("intent", change, boot, frame=hex_bytes(self.port.request(Command.SET_VALUE, body)))
        if presses.count:
            self._result(change, boot, None, None, f"{NOT_SENT}: interrupted")
            raise Interrupted(f"interrupted; {change.text} was not sent", hint="this setting is as it was")
        return self._send(change, before, boot, body)

    def _send(self, change: Change, before: Raws, boot: int, body: bytes) -> Raws:
        """The one SetValue; from here on nothing but a second Ctrl-C keeps the read-back from being done."""
        answer: Frame | None = None
        lost: HandctlError | None = None
        self._interrupted = False
        try:
            answer = self.port.exchange(Command.SET_VALUE, body)
        except KeyboardInterrupt:
            self._interrupted = True
        except (NoAnswer, ProtocolError) as exc:
            lost = exc
        except LinkError as exc:  # nobody is left who could be asked
            self._result(change, boot, None, None, f"not known: {exc.text}")
            raise _unread(change, exc) from None
        bound, self.port.bound = self.port.bound, None  # a written setting is always read back, also beyond --deadline
        try:
            after = self._read_back(change, before, answer)
        except HandctlError as exc:
            self._result(change, boot, answer, None, f"read-back failed: {exc.text}")
            raise _unread(change, exc) from None
        except KeyboardInterrupt as exc:
            self._result(change, boot, answer, None, "not read back: interrupted twice")
            raise Interrupted(
                f"interrupted again: {change.text} was sent and not read back", hint="look with `handctl ekso settings`"
            ) from exc
        finally:
            self.port.bound = bound
        failure = self._judge(change, before, after, answer, lost)
        step = Step(change.text, self.port.request(Command.SET_VALUE, body))
        if after[change.param.word] == change.new:
            self.port.journal.ledger.confirm("read back", step)
        else:
            self.port.journal.ledger.doubt(
                f"reads {change.param.shown(change.param.from_raw(after[change.param.word]))}", step
            )
        unlogged = self._result(change, boot, answer, after, "applied" if failure is None else failure.text)
        if failure is not None:
            raise failure
        if unlogged is not None:
            raise OutputError(
                f"{change.text} was written and reads back; only its entry is missing: {unlogged.text}",
                hint="make room and note it by hand; nothing else was sent",
                code=unlogged.code,
            )
        if self._interrupted:
            raise Interrupted(f"interrupted; {change.text} was written and read back", hint="nothing else was sent")
        if answer is None:
            self.port.journal.warn(
                "answer-lost", f"{change.text}: applied, but its answer was lost ({lost.text if lost else ''})"
            )
        return after

    def _read_back(self, change: Change, before: Raws, answer: Frame | None) -> Raws:
        after = self.port.settings_raw()
        if answer is None and after == before:  # perhaps on its way: look again before saying that it was not taken
            self.port.link.sleep(BETWEEN_WRITES)
            after = self.port.settings_raw()
        return after

    def _judge(
        self, change: Change, before: Raws, after: Raws, answer: Frame | None, lost: HandctlError | None
    ) -> HandctlError | None:
        """What the status and the read-back say together; None when the setting is as wanted and nothing else changed."""
        word = change.param.word
        wanted = (*before[:word], change.new, *before[word + 1 :])
        status = answer.words[0] & 0xFFFF if answer is not None else None
        refused = status is not None and status & 0xFF != 0
        if refused and status is not None and after == wanted:
            return CheckFailed(
                f"{self.port.where}: {change.text}: {status_text(status)}, and yet the new value reads back",
                hint="look with `handctl ekso settings` before anything else; please report it",
                code="read-back",
            )
        if after != wanted and (after != before or (status is not None and not refused)):
            return CheckFailed(
                f"{self.port.where}: {change.text}: the read-back differs: {differences(wanted, after)}"
                + (f"; status {status_text(status)}" if status is not None else ""),
                hint=_way_back(before, after),
                code="read-back",
            )
        if refused and status is not None:
            return DeviceRefused(
                f"{self.port.where}: {change.text}: {status_text(status)} (status 0x{status:04X})",
                hint=REFUSALS.get(status & 0xFF, "the device gave a status that nobody knows; please report it"),
                code=f"status-{status & 0xFF}",
            )
        if after == before and status is None:
            if lost is None:
                return Interrupted(f"interrupted; {change.text} was not applied")
            return lost.retold(
                f"{change.text}: not applied, the old value was read twice. {lost.text}",
                hint="nothing was changed; repeat the command if you still want it",
            )
        return None

    def _still(self, sitting: Sequence[Word]) -> int:
        """Stillness, and no restart since the last look: a restarted device may hold other settings."""
        boot = require_stillness(self.port, sitting)
        if self._boot is not None and (boot - self._boot) % 2**32 >= 2**31:
            raise CheckFailed(
                f"{self.port.where}: the device has restarted meanwhile; nothing was written",
                hint="look with `handctl ekso settings` and start again",
                code="restarted",
            )
        self._boot = boot
        return boot

    def _record(self, event: str, change: Change, boot: int, **more: object) -> None:
        param = change.param
        old, new = ({"raw": raw, "value": param.from_raw(raw)} for raw in (change.old, change.new))
        self.audit.record(
            event,
            self.port.link.now(),
            boot_ms=boot,
            id=param.id,
            name=param.name,
            unit=param.unit,
            old=old,
            new=new,
            override=self.override,
            **more,
        )

    def _result(
        self, change: Change, boot: int, answer: Frame | None, after: Raws | None, verdict: str
    ) -> OutputError | None:
        """Note what came of it; returned is why that failed, which must not hide what came of it. Nor must a Ctrl-C."""
        failure: OutputError | None = None
        with self._guide.counting() as presses:
            try:
                self._record(
                    "result",
                    change,
                    boot,
                    answer=hex_bytes(answer.data) if answer is not None else None,
                    status=answer.words[0] & 0xFFFF if answer is not None else None,
                    read_back=None
                    if after is None
                    else {p.name: after[p.word] for p in SETTINGS if p.name != PERSONAL},
                    verdict=verdict,
                )
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


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]


def _way_back(before: Raws, after: Raws) -> str:
    """What would set the settings that changed to what they were."""
    changed = [param for param in SETTINGS if after[param.word] != before[param.word]]
    if not changed:
        return "the old value is still there: nothing needs to be set back; look with `handctl ekso settings`"
    # a code that nobody knows is never written
    able = [p for p in changed if p.id is not None and (not p.choices or before[p.word] in p.choices)]
    ways = ", ".join(
        f"`handctl ekso set {shlex.quote(f'{p.name}={p.typed(p.from_raw(before[p.word]))}')}`" for p in able
    )
    left = ", ".join(p.name for p in changed if p not in able)
    text = "look with `handctl ekso settings` first" + (f"; {ways} sets back what changed" if ways else "")
    return text + (f"; {left} cannot be set back by this tool" if left else "")


REFUSALS = {
    1: "the device does not take it now: sit or stand still, then repeat",
    2: "the device has limits of its own that are not documented: try a smaller step",
    3: "the device does not allow this value or command",
}


def _unread(change: Change, error: HandctlError) -> HandctlError:
    error.hint = f"{change.text} was sent and could not be read back: read it before writing again. {error.hint}"
    return error


def _value(change: Change) -> float:
    return change.param.from_raw(change.new)


def differences(expected: Raws, found: Raws) -> str:
    """``step_length 15.50 in, expected 16.00 in; …`` for every word that differs."""
    return "; ".join(
        f"{param.name} is {param.shown(param.from_raw(is_))}, expected {param.shown(param.from_raw(should))}"
        for param, should, is_ in zip(SETTINGS, expected, found, strict=True)
        if should != is_
    )
