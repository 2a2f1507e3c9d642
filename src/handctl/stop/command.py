"""The command `stop` of every family: the bytes first, then words. Asks nothing, needs no lock, disk or configuration.

Who has the device is asked to stop it (`link.ear`); one that does not answer is ended if it is ours, and the bytes go out
from here. A port that another program has open is written to all the same.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from handctl import errors
from handctl.errors import DeviceRefused, HandctlError, LinkError
from handctl.frame.options import PASSED_OVER
from handctl.link.lock import Holder, InUse, Lock, began, sleeps
from handctl.model.result import Column, Table
from handctl.stop.holding import Hold, carry_out, lock_for, report

if TYPE_CHECKING:
    from handctl.frame.run import Run
    from handctl.model.param import Step
    from handctl.stop.talk import Aim, Sent, Talk

GONE_SECONDS = 0.2
"""A process that was ended has let go of the port by then."""
AGAIN_SECONDS = 1.0
"""How long a port or connection is tried again that somebody has just let go of, or is about to."""
TRY_SECONDS = 0.01
COLUMNS = (Column("step", "Step", right=True), Column("bytes", "Bytes"), Column("meaning", "Meaning"), Column("answer", "Answer"))  # fmt: skip


def stop(run: Run, talk: Callable[[Aim], Talk] | None = None, otherwise: Callable[[Any], str] | None = None) -> Table:
    """Stop the device of this run, by who has it or from here; rows with the bytes that went out and what came back.

    `talk` takes the place of the family's stopper. `otherwise` is tried where it heard nothing: device -> what was seen.
    """
    if run.settings.dry_run:
        return run.dry_run(_plan(run, talk))
    name = run.link_name()
    for problem in run.meta.get(PASSED_OVER, ()):
        run.journal.warn("passed-over", problem.text, problem.hint)
    lock, told, ended = _ask_holder(run, name)
    if told is None or not (told["open"] or told["refused"]):
        told = _from_here(run, lock, talk, patient=ended, otherwise=otherwise)
    else:
        _take_over(run, told)
    table = Table(rows=told["rows"], columns=COLUMNS, plain=("bytes",))
    where = "" if name in told["text"] else f"{name}: "
    if told["refused"]:
        table.failure = DeviceRefused(f"{where}nothing was sent: {told['text']}", hint=told["hint"], code="not-now")
    elif told["error"]:
        kind: type[HandctlError] = getattr(errors, told["error"], HandctlError)
        table.failure = kind(f"{where}{told['text']}", hint=told["hint"])
    else:
        run.journal.info("stopped", f"{where}{told['text']}", told["hint"])
    return table


def _plan(run: Run, talk: Callable[[Aim], Talk] | None) -> list[Step]:
    """What goes out where nothing answers."""
    from handctl.link import is_can
    from handctl.stop.talk import Aim, talk_of, unheard

    assert run.family is not None
    port = run.settings.port
    can = run.settings.wire == "can" if port is None else is_can(port)
    fixed = can or run.family.baud is None or (port or "").startswith(("tcp://", "socket://", "replay:"))
    speed = None if fixed else run.settings.baud or _last_speed(run, port or "") or run.family.baud
    aim = Aim(run.settings, can, speed)
    return unheard(talk(aim) if talk is not None else talk_of(run.family.kind, aim), reads=True)


def _last_speed(run: Run, name: str) -> int | None:
    """The speed at which the device was found last, where its family keeps that."""
    return run.family.recall(name) if run.family is not None and run.family.recall is not None else None


# -- who has it ---------------------------------------------------------------------------------------------------


def _ask_holder(run: Run, name: str) -> tuple[Lock | None, dict[str, Any] | None, bool]:
    """The lock where it is free; else the holder's report, None without one; and whether somebody has just let go."""
    try:
        return lock_for(run, name), None, False
    except InUse as exc:
        busy = exc
    except LinkError as exc:
        run.journal.warn(exc.code, exc.text, exc.hint)
        return None, None, False
    from handctl.link.ear import HEARD_SECONDS, ask

    until = time.monotonic() + HEARD_SECONDS
    who = busy.holder
    if who is None or not sleeps(who.pid):
        while True:
            heard, told = ask(busy.path, until)
            if told is not None:
                by = str(who) if who is not None else "another handctl"
                run.journal.info("asked", f"{by} has the device and was asked to stop it")
                return None, told, True
            if heard or time.monotonic() >= until:
                break
            with contextlib.suppress(LinkError):
                return lock_for(run, name), None, True  # it has let go meanwhile
            time.sleep(TRY_SECONDS)
    _end(run, who)
    return None, None, True


def _take_over(run: Run, told: dict[str, Any]) -> None:
    """Note in the ledger of this command what another one has sent for it, from the report of that one."""
    from handctl.model.param import Step

    for one in told.get("wire", ()):
        step = Step(one["meaning"], bytes.fromhex(one["data"]), moves=True, can_id=one["can_id"])
        run.ledger.plan([step])
        for _ in range(one["times"]):
            run.ledger.passed(0.0, ">", step.data, step.can_id)
        run.ledger.passed(0.0, "<", bytes.fromhex(one["came"]), step.can_id)
        if told["evidence"]:
            run.ledger.confirm(told["evidence"], step)


def _end(run: Run, who: Holder | None) -> None:
    """End a holder that does not answer, if it is surely the one and this user's."""
    if who is None:
        run.journal.warn(
            "holder",
            "another program has the device and does not answer. Its lock does not say which",
            "find the program with `handctl ports` and end it",
        )
        return
    if not who.start or not hasattr(os, "pidfd_open"):
        text = f"{who} has the device and does not answer. The system does not show whether it is still that process"
        run.journal.warn("holder", text, f"end it with `kill -9 {who.pid}`")
        return
    import select
    import signal

    try:
        process = os.pidfd_open(who.pid)
    except OSError:
        return  # it has gone
    try:
        if began(who.pid) != who.start:
            return
        signal.pidfd_send_signal(process, signal.SIGKILL)
        select.select([process], [], [], GONE_SECONDS)
        run.journal.warn("ended", f"{who} had the device and did not answer (asleep or blocked). handctl ended it")
    except OSError as exc:
        run.journal.warn(
            "holder",
            f"{who} does not answer and could not be ended: {exc.strerror or exc}",
            f"end it with `kill -9 {who.pid}`",
        )
    finally:
        os.close(process)


# -- from here ----------------------------------------------------------------------------------------------------


def _from_here(
    run: Run,
    lock: Lock | None,
    talk: Callable[[Aim], Talk] | None,
    *,
    patient: bool,
    otherwise: Callable[[Any], str] | None,
) -> dict[str, Any]:
    """Open the link and send. With `patient` a link that is not free yet is tried again for a second."""
    run.hold = Hold(run, lock)
    until = time.monotonic() + AGAIN_SECONDS if patient else 0.0
    sent: list[Sent] = []
    stopped = None
    while stopped is None or (stopped.error is LinkError and time.monotonic() < until):
        try:
            link = run.open_link(again=stopped is not None, baud=_last_speed(run, run.link_name()))
        except LinkError:
            if time.monotonic() >= until:
                raise
            time.sleep(TRY_SECONDS)
            continue
        sent.clear()
        with run.guide.undisturbed():
            stopped = carry_out(run, link, sent, talk)
    silent = stopped.error is not None and issubclass(stopped.error, (errors.NoAnswer, errors.ProtocolError))
    if silent and otherwise is not None:
        try:
            stopped = stopped._replace(text=otherwise(run.device()), hint="", error=None)
        except HandctlError as exc:
            stopped = stopped._replace(text=errors.joined(stopped.text, exc.text))
    return report(stopped, sent)
