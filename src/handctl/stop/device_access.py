"""The command's exclusive access to a device: its lock, and stopping the device when another process or a key asks for it.

The request comes from another process (`stop.stop_listener`) or from the stop key of a live view. The family's stop sequence then
runs on this command's own link, between two steps of the program and before anything else. Nothing more is written
afterwards, and the command ends as by Ctrl-C.
"""

from __future__ import annotations

import contextlib
import os
from _thread import RLock
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from handctl import interrupts
from handctl.errors import STOPPED, Aftermath, DeviceRefused, HandctlError, Interrupted, LinkError
from handctl.families import FAMILIES
from handctl.link import ByteLink
from handctl.model.result import hex_shown
from handctl.model.stop_on_interrupt import NOT_STOPPED
from handctl.model.stop_sequence import (
    RunningStop,
    Sent,
    StopContext,
    Stopped,
    StopSequence,
    context_for_link,
    found_again,
    shown,
    stop_sequence_of,
    with_repeat_counts,
)
from handctl.system import signals

if TYPE_CHECKING:
    from handctl.command.settings_and_checks import Invocation
    from handctl.link import Deadline, Link
    from handctl.link.device_lock import Lock, Reached
    from handctl.model.write_ledger import Addressee
    from handctl.stop.stop_listener import StopListener

UNSEEN = "something that no command stops, such as a calibration, was started here shortly before, and its end has not been seen"
MOST = 24
"""Bytes of an answer that are shown."""
MOST_CAME = 256
"""Bytes of an answer that an acknowledgement is looked for in."""
LONG = 60
"""Characters of sent bytes that fit into a message."""


def lock_for(run: Invocation, name: str, patience: float | None = None) -> Lock | None:
    """The lock of the LINK `name`, None if no other process can reach it. Raises InUse, LinkError; Interrupted for a command
    that may write to a device that was stopped after it began, such as a script that slept until now.

    `patience`: seconds for the last stop of a holder that died, None as long as one takes, but 0 in a command that stops.
    """
    if name.startswith("replay:") or (name.startswith("fake://") and not run.keeps):
        return None
    from handctl.link.device_lock import InUse, hold

    assert run.family is not None
    command = f"handctl {run.owner}"
    if patience is None and run.stops:
        patience = 0.0  # what else is on its way stops the device too
    try:
        lock = hold(
            name, command, run.family.tcp_port,
            family=run.family.kind, use="stops" if run.stops else "writes" if run.may_write else "reads", kept=run.keeps, patience=patience,
        )  # fmt: skip
    except InUse:
        raise
    except LinkError:
        if not run.keeps:
            raise
        return None  # a simulated device is in no danger
    if lock is not None and run.may_write and not run.stops and lock.stopped_since(run.began):
        lock.release()
        raise Interrupted(
            f"{name}: another handctl command stopped the device after this one had started. Nothing was sent",
            hint="run the command again if the device is to move",
            code=STOPPED,
        )
    return lock


class DeviceAccess:
    """The access of one command to a device while its link is open. `stopped`: the error after a requested stop, None before.

    link   the open link, None before it is
    """

    stop_key = "S"
    """A capital: no slip of a finger, and no word that was typed into the wrong window, stops a device."""

    def __init__(self, run: Invocation, lock: Lock | None) -> None:
        """Others are heard from now on, but by a command that stops itself."""
        self.stopped: HandctlError | None = None
        self.link: Link | None = None
        self.turn = RLock()  # no link is closed while it is being stopped
        self._report: dict[str, Any] | None = None
        self._run = run
        self._lock: Lock | None = None
        self._ear: StopListener | None = None
        self._place = run.place if lock is not None else ""
        self._until: dict[tuple[str, int], float] = {}
        self._silent: list[Addressee] = []
        self._at_rest: set[tuple[str, int]] = set()
        """Family and id of each device whose stop was acknowledged over this link, and that nothing has set going since."""
        if lock is not None:
            self._keep(lock)

    def _keep(self, lock: Lock) -> None:
        """Keep this lock and listen for requests next to it."""
        run = self._run
        self._lock = lock
        troubles = [lock.unrecorded] if lock.unrecorded else []
        if run.shows and not run.stops:
            from handctl.stop.stop_listener import StopListener

            try:
                self._ear = StopListener(
                    lock.path,
                    lambda meant: self.stop("stopped at the request of another handctl command", meant),
                    self.end,
                )
            except ValueError:
                pass  # this is not the main thread
            except OSError as exc:
                troubles.append(f"{lock.path}: no socket beside it: {exc.strerror or exc}")
        for trouble in troubles:
            hint = "make room there. Until then `stop` from another terminal ends this command by force"
            run.journal.warn(
                "unseen",
                f"other commands may not notice that this one is using the device, and cannot ask it to stop: {trouble}",
                hint,
            )

    def around(self, link: Link) -> None:
        """The link that is used from now on."""
        if link is self.link:
            return
        for descriptor in self._lock.descriptors if self._lock is not None else ():
            link.held = (*(other for other in link.held if other != descriptor), descriptor)
        self.link = link

    def serve(self, run: Invocation) -> None:
        """The next command of a session has the device from now on."""
        self._run = run

    def reopen(self) -> bool:
        """Look once for the port that was lost, lock it and open it as at first; False where a lost one stays lost.

        Raises LinkError while it is not there, or is in use. By then its name may lead to another place: that is locked.
        """
        run = self._run
        name = run.link_name()
        place = run.place
        if self._lock is not None and place != self._place and (os.path.exists(name) or place.startswith("tty ")):
            lock = lock_for(run, name)
            self.release()
            self._place, self._lock = place, None
            if lock is not None:
                self._keep(lock)
                if self.link is not None:
                    self.link.held = lock.descriptors
        return self.link is not None and self.link.reopen()

    def remember(self, run: Invocation) -> None:
        """This run has met its device, see `Lock.remember`. What cannot be on one line with it is no longer behind this link."""
        assert run.family is not None
        if self._lock is None or run.family.kind not in FAMILIES:  # `doctor` does not know whom it has met
            return
        met, link = self._reached(run), self.link
        if isinstance(link, ByteLink) and link.can_set_baud and run.family.recall is None:
            usual = run.settings.baud or run.family.baud
            met.settings.update({"baud": link.baud} if link.baud not in (None, usual) else {})  # it was changed
        self._lock.remember(met, replied=run.journal.counters.received > 0)
        for one in self._lock.going if run.journal.counters.received else ():
            pair = {one.family, met.family}
            apart = run.family.ids and one.key[1] != met.key[1]
            beside = len(pair) == 1 or any({kind, FAMILIES[kind].beside} == pair for kind in pair & FAMILIES.keys())
            if not (apart or beside):
                self._lock.at_rest(one)

    @property
    def known(self) -> tuple[Any, ...]:
        """The speed of the line and what its lock says of it: a reading that left both so need not `remember` the same again."""
        return getattr(self.link, "baud", None), *((self._lock.met, self._lock.going) if self._lock is not None else ())

    def moving(self, run: Invocation, to: Addressee | None, moves: bool) -> None:
        """This run has set its device going, or the one that it has written `to`, or a stop of that was acknowledged, see
        `Lock.set_going`. Never raises."""
        device = self._reached(run, to)
        (self._at_rest.discard if moves else self._at_rest.add)(device.key)
        if self._lock is not None:
            (self._lock.set_going if moves else self._lock.at_rest)(device)

    def renamed(self, before: Addressee, after: Addressee) -> None:
        """A device on this line has another id than before. Never raises."""
        self._at_rest = {after if one == before else one for one in self._at_rest}
        if self._lock is not None:
            self._lock.renamed(before, after)

    def _reached(self, run: Invocation, to: Addressee | None = None) -> Reached:
        """The device of this run, or the one that it has written `to`, and what reaches it."""
        from handctl.link.device_lock import Reached

        assert run.family is not None
        settings, link = run.settings, self.link
        own = run.family.kind, context_at(run, link).number if link is not None else 1
        kind, number = to or own
        found: dict[str, Any] = {"id": number if number != 1 else None, "baud": settings.baud}
        found["port"] = settings.port if (settings.port or "").startswith("can:") else None
        found |= {option.key: settings.own.get(option.key) for option in FAMILIES[kind].options if option.named}
        return Reached(kind, {key: value for key, value in found.items() if value is not None})

    def silent(self, device: Addressee) -> None:
        """Nothing at all has come from this device while it was being stopped."""
        self._silent.append(device)

    def gone(self) -> list[Addressee]:
        """The devices that have been silent at a stop before, too, while another one on the line has acknowledged its own: they are no
        longer remembered as moving."""
        silent = self._silent if self._at_rest and self._lock is not None else []
        return [device for device in silent if self._lock is not None and self._lock.silent(device)]

    def note_stop(self) -> None:
        """The device is being stopped, see `Lock.note_stop`."""
        if self._lock is not None:
            self._lock.note_stop()

    @property
    def sent(self) -> list[dict[str, Any]]:
        """What a requested stop has sent, see `rows`."""
        found: list[dict[str, Any]] = self._report["rows"] if self._report is not None else []
        return found

    def finish(self) -> None:
        """Call before the link is closed: a stop request from now on is told that this command is ending. Waits for one in another thread."""
        with self.turn:
            self.link = None

    def release(self) -> None:
        """Let others in. May be called twice."""
        if self._ear is not None:
            self._ear.close()
        if self._lock is not None:
            self._lock.release()

    def stop(self, who: str, meant: Collection[str] = ()) -> dict[str, Any]:
        """Run the family's stopper now, and write nothing after it; what went out and came back. Never raises.

        What only reads lets go of the link at once where another device on its line is `meant`, see `stop_listener.is_meant`.
        """
        with self.turn:
            if meant and self._run.may_write is False and self.link is not None and self.stopped is None:
                from handctl.stop.stop_listener import is_meant

                if not is_meant(*self._reached(self._run).key, meant):
                    return self._left_to_other(who)
            return self._stop(who, meant)

    def _left_to_other(self, who: str) -> dict[str, Any]:
        """Who asked stops another device on this line: nothing is sent any more, and nothing was stopped here."""
        assert self.link is not None
        self.link.block_sending()
        text = f"{who}, which stops another device on this line. Nothing was sent to this one"
        self.stopped = Interrupted(text, code=STOPPED)
        self._report = report(Stopped(text), ())
        return self._report

    def stop_from_outside(self, who: str) -> HandctlError | None:
        """The same in another thread than the command's, which is interrupted; None where no link is open. Never raises."""
        with self.turn:
            if self.link is not None:
                self.link.only_this_thread()
            self._stop(who)
            return self.stopped

    def _stop(self, who: str, meant: Collection[str] = ()) -> dict[str, Any]:
        if self._run.prompts.unstoppable:
            return report(Stopped(self._run.prompts.unstoppable), (), refused=True)
        if self.link is None or self.stopped is not None:
            return self._report or report(None, ())
        # A sleeping reader is waited for no longer, and must not cut this off.
        signals.alarm_is_over()
        self.note_stop()
        first: list[Sent] = []
        self._begin_typed(meant, first)
        sent: list[Sent] = []
        context = context_at(self._run, self.link)
        stopped = self._stopped_all(sent)
        if stopped.error is LinkError and found_again(self.link):
            stopped = self._stopped_all(sent)
            stopped = stopped._replace(text=f"connected again after the connection was lost: {stopped.text}")
        if stopped.error is None and not self._run.writes:
            self.moving(self._run, None, False)
        stopped = self.judged(stopped, {*_devices(self._run, context), *self._at_rest})
        self.link.block_sending()
        sent = [*first, *sent]
        wire = shown(sent)
        text = f"{who}. Sent {wire}: {stopped.text}" if 0 < len(wire) <= LONG else f"{who}: {stopped.text}"
        kind = stopped.error or Interrupted
        self.stopped = kind(text, hint=stopped.hint, code=NOT_STOPPED if stopped.error else STOPPED)
        self._report = report(stopped, sent, self._run, context)
        self._report["devices"] += [list(key) for key in self._at_rest]
        return self._report

    def _begin_typed(self, meant: Collection[str], sent: list[Sent]) -> None:
        """The steps for the device whose id somebody has typed, before those for the command's own. Who asks stops it completely afterwards."""
        run, link = self._run, self.link
        assert link is not None and run.family is not None
        own, ledger = self._reached(run).key, run.ledger if run.writes else None
        for kind, _, number in (one.partition(" ") for one in sorted(meant)):
            if kind == run.family.kind and number.isdecimal() and (kind, int(number)) != own:
                context = context_for_link(link, run.settings._replace(id=int(number)))
                with contextlib.suppress(ValueError, LookupError, OverflowError):  # of an id that no frame can have
                    RunningStop(link, stop_sequence_of(kind, context), sent, ledger).begin()

    def _stopped_all(self, sent: list[Sent]) -> Stopped:
        """The stop of the command's device, and of what earlier commands of its session have left moving on the link."""
        run, link = self._run, self.link
        assert link is not None
        own = partial(begun_at, run, link, sent)
        return own().finish() if run.session is None else run.session.stop_all(run, link, sent, own)

    def unstoppable(self, run: Invocation, to: Addressee | None, seconds: float) -> None:
        """Note that something has begun that no command stops, and may last so long; 0 = it is over. On which device: see `moving`."""
        device = self._reached(run, to).key
        if self.link is not None:
            self._until[device] = self.link.now() + seconds
        if self._lock is not None:
            self._lock.lasts(device, seconds)

    def _lasting(self, device: Addressee) -> bool:
        """Whether such a thing may still last there."""
        here = self.link is not None and self.link.now() < self._until.get(device, float("-inf"))
        return here or (self._lock is not None and self._lock.lasting(device))

    def judged(self, stopped: Stopped, devices: Iterable[Addressee]) -> Stopped:
        """The result of a stop of these: no success while something lasts there that none ends, whoever has started it with handctl."""
        left = self._run.prompts.goes_on()
        if left is None and any(map(self._lasting, devices)):
            left = Aftermath(UNSEEN, "switch the power off if the device is still moving")
        if left is None:
            return stopped
        error = stopped.error or DeviceRefused
        return stopped._replace(text=f"{stopped.text}. But {left.text}", hint=left.hint, error=error, evidence="")

    def pressed(self, frame: Any) -> None:
        """The stop key of a live view. A Ctrl-C right after it does not cut the stop off."""

        with interrupts.stopping(), signals.held_back(signals.numbers(suspend=True, alarm=True), in_handler=True):
            self.stop(f"stopped by the key {self.stop_key}")
        self.end(frame)

    def end(self, frame: Any) -> None:
        """The way of Ctrl-C, whatever that is just now. Where it only counts, the next write ends the command."""

        if not self._run.prompts.unstoppable:
            signals.interrupt(frame)


def context_at(run: Invocation, link: Link) -> StopContext:
    """What the run knows of its device on this link: more, once it has written to it."""
    met = run.opened is not None and run.journal.counters.writes > 0
    return run.opened.stop_context() if met else context_for_link(link, run.settings)


def begun_at(
    run: Invocation,
    link: Link,
    sent: list[Sent],
    sequence: Callable[[StopContext], StopSequence] | None = None,
    until: Deadline | None = None,
) -> RunningStop:
    """The stop of the run's family over `link`, or another `sequence`, at the most `until` then; its steps are out. Never raises."""
    assert run.family is not None
    context = context_at(run, link)
    said = sequence(context) if sequence is not None else stop_sequence_of(run.family.kind, context)
    stop = RunningStop(link, said, sent, run.ledger if run.writes else None, until)
    stop.begin()
    return stop


def _devices(run: Invocation, context: StopContext) -> list[Addressee]:
    """The devices that a stop with this context is for."""
    assert run.family is not None
    return [*context.going] or [(run.family.kind, context.number)]


def report(
    stopped: Stopped | None,
    sent: Sequence[Sent],
    run: Invocation | None = None,
    context: StopContext | None = None,
    *,
    refused: bool = False,
) -> dict[str, Any]:
    """The result of a stop as JSON, as `stop` shows it; `run` and its `context` tell the devices that it was sent to."""
    devices = _devices(run, context) if run is not None and context is not None else []
    return {
        "id": devices[0][1] if devices else None,
        "devices": [list(device) for device in devices],
        "rows": rows(sent),
        "wire": wire(sent),
        "evidence": stopped.evidence if stopped is not None else "",
        "text": stopped.text if stopped is not None else "",
        "hint": stopped.hint if stopped is not None else "",
        "error": stopped.error.__name__ if stopped is not None and stopped.error is not None else "",
        "stranger": stopped is not None and stopped.stranger,
        "open": stopped is not None,
        "refused": refused,
    }


def rows(sent: Sequence[Sent]) -> list[dict[str, Any]]:
    """Sent and received bytes, one row per step; repetitions are one row."""
    return [
        {
            "step": at,
            "bytes": step.wire,
            "meaning": step.meaning,
            "reads": reads,
            "times": times,
            "answer": hex_shown(came, MOST) or None,
        }
        for at, ((step, reads, came), times) in enumerate(with_repeat_counts(sent), 1)
    ]


def wire(sent: Sequence[Sent]) -> list[dict[str, Any]]:
    """The traffic for the ledger of the process that asked: each step as often as it was sent, and the last reply."""
    return [
        {
            "data": step.data.hex(),
            "can_id": step.can_id,
            "meaning": step.meaning,
            "times": times,
            "came": came[:MOST_CAME].hex(),
        }
        for (step, reads, came), times in with_repeat_counts(sent)
        if not reads
    ]


@contextlib.contextmanager
def keyboard(hold: DeviceAccess | None, pressed: Callable[[str], bool]) -> Iterator[bool]:
    """While it lasts each key on the terminal goes to `pressed`, which says whether the command ends; whether there are keys.

    The stop key stops the device first.
    """
    from handctl.stop.stop_listener import Keyboard

    def came(key: str, frame: Any) -> None:
        if hold is not None and key == hold.stop_key:
            hold.pressed(frame)
        elif pressed(key):
            (hold.end if hold is not None else signals.interrupt)(frame)

    keys = Keyboard.on_terminal(came)
    try:
        yield keys is not None
    finally:
        if keys is not None:
            keys.close()
