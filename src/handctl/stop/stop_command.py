"""The command `stop` of every family: it sends first and reports afterwards. Works without lock, disk or configuration.

If another handctl command is using the device, it is asked to stop it (`stop.stop_listener`). If it does not reply, it is killed
and the bytes are sent from here. They are also sent to a port that another program has open.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from handctl import errors
from handctl.command.family import load, on_can, wire_in
from handctl.command.options import COMMAND_LINE, NAMED, Source, lacking
from handctl.errors import OTHER_DEVICE, DeviceRefused, HandctlError, Hint, LinkError, UsageError
from handctl.families import FAMILIES
from handctl.link import ByteLink, Deadline, Link
from handctl.link.device_lock import (
    LAST_STOP_SECONDS,
    LIBRARY,
    OURS,
    Holder,
    InUse,
    Lock,
    Reached,
    canonical,
    held_elsewhere,
    remembered,
)
from handctl.model.command_settings import Settings
from handctl.model.param import Step
from handctl.model.result import Column, Row, Table
from handctl.model.stop_sequence import (
    RunningStop,
    Sent,
    StopContext,
    Stopped,
    StopSequence,
    found_again,
    stop_sequence_of,
    writes_without_replies,
)
from handctl.stop.device_access import DeviceAccess, begun_at, context_at, lock_for, report
from handctl.system import clock, processes

if TYPE_CHECKING:
    from handctl.command.run import Run

HEARD_SECONDS = 0.3
"""A holder that does not answer within this is asleep, or blocked."""
GONE_SECONDS = 0.2
"""A process that was ended has let go of the port by then."""
ASKED_SECONDS = 1.0
"""How long a whole program that uses the library has to end by itself: what else it does is not ours to cut off."""
AGAIN_SECONDS = 1.0
"""How long a port or connection is tried again that somebody has just let go of, or is about to."""
TRY_SECONDS = 0.01
OTHERS = Source("another command", "used by another handctl command")
"""Of the id of a device that a handctl command has set going before, or that one of another user is using."""
COLUMNS = (Column("step", "Step", right=True), Column("bytes", "Bytes"), Column("meaning", "Meaning"), Column("answer", "Answer"))  # fmt: skip


def stop(
    run: Run,
    sequence: Callable[[StopContext], StopSequence] | None = None,
    otherwise: Callable[[Any], str] | None = None,
    reached: set[tuple[str, int]] | None = None,
    turns: Turns | None = None,
) -> Table:
    """Stop the device of this run, through its holder or from here. Rows with the bytes sent and received.

    `sequence` replaces the family's stopper. `otherwise` is tried if nothing acknowledged the stop: device -> evidence. Family and id of
    each device that a stop was sent to are added to `reached`. Of several devices, all have their `turns`.
    """
    began = clock.now()
    fall_back(run)
    if run.settings.dry_run:
        return run.dry_run(_plan(run, sequence))
    _as_it_is_now(run)
    name = run.link_name()
    until = None if run.settings.deadline is None else Deadline(clock.now, began + run.settings.deadline)
    for problem in run.said.passed_over:
        run.journal.warn("passed-over", problem.text, problem.hint)
    if run.session is not None and not run.session.has(run):
        run.session = None  # only what a session has open it stops itself
    ours = run.session is not None or run.link is not None  # or it was stopped as another device just before
    lock, told, ended = (None, None, False) if ours else _ask_holder(run, name, until)
    other = None
    if told is not None and told["open"]:
        _take_over(run, told)
        if not told["refused"] and not _is_meant(run, told):
            other, lock = told, _let_go(run, name, until, AGAIN_SECONDS)
            if other["error"]:
                run.journal.warn("other-device", f"the device that it was using: {other['text']}", other["hint"])
    if told is None or other is not None or not (told["open"] or told["refused"]):
        told = _from_here(run, lock, sequence, until, patient=ended, otherwise=otherwise, turns=turns)
        if unheard(told["error"], told["rows"]) and not (until and until.expired):
            again = partial(_from_here, run, lock, sequence, until, patient=False, otherwise=otherwise)
            if former := _back_to_former_id(run):
                told = _with_former_id(told, again(), former)
            elif _drop_stale_id(run):
                told = joined_reports(told, again())
        if other is not None:
            told = joined_reports(other, told)
    if reached is not None:
        reached.update((kind, number) for kind, number in told["devices"])
    table = Table(rows=told["rows"], columns=COLUMNS, plain=("bytes",))
    where = "" if name in told["text"] else f"{name}: "
    assert run.family is not None
    if run.family.ids and told["id"] is not None:
        where += _id_used(run, told["id"]) if told["error"] or _of_others(run) else ""
        run.settings = run.settings._replace(id=told["id"])  # the result names it
    run.journal.counters.sent += sum(row["times"] for row in told["rows"])
    run.journal.counters.received += sum(row["answer"] is not None for row in told["rows"])
    if told["refused"]:
        table.failure = DeviceRefused(f"{where}nothing was sent: {told['text']}", hint=told["hint"], code="not-now")
    elif told["error"]:
        kind: type[HandctlError] = getattr(errors, told["error"], HandctlError)
        code = OTHER_DEVICE if told["stranger"] else ""
        table.failure = kind(f"{where}{told['text']}", hint=told["hint"], code=code)
    else:
        run.journal.info("stopped", f"{where}{told['text']}", told["hint"])
    return table


# -- several devices behind one link ----------------------------------------------------------------------------------


def stop_with_others(run: Run) -> Table:
    """The stop of a device, and where nobody gave its id, of each other one of its family that handctl has set going here."""
    elsewhere = stopped_elsewhere(run)
    reached: set[tuple[str, int]] = set()
    turns = Turns(lambda: _others_going(run))
    table = stop(run, reached=reached, turns=turns)
    table = each_stopped(run, _others_going(run), reached, table, turns) or table
    table.failure = table.failure or elsewhere
    return table


def _others_going(run: Run) -> list[Reached]:
    assert run.family is not None
    return _going(run) if run.family.ids and _any_id(run) and not run.settings.dry_run else []


def _going(run: Run) -> list[Reached]:
    """What handctl has set going on the link of this run, of its family: earlier lines of its session, too."""
    family, name = run.family, run.link_name()
    assert family is not None
    _, moving = remembered(name, family.tcp_port)
    mine = run.session.moving_on(name) if run.session is not None else []
    known = [one.key for one in moving]
    return [one for one in (*moving, *(one for one in mine if one.key not in known)) if one.family == family.kind]


def _as_it_is_now(run: Run) -> None:
    """Reach what handctl has set going as that is reached now: at the id that handctl has given it since, unless another one was typed,
    and through the LINK that was used, where that is another one to the same port (CAN, by an slcan adapter)."""
    assert run.family is not None
    name, number = run.link_name(), run.settings.id or 1
    mine = _going(run)
    link = next((one.settings["port"] for one in mine if "port" in one.settings), name)
    if link != name and not name.startswith("can:") and run.session is None:
        run.journal.warn(
            "other-link", f"{name}: handctl set the device in motion through {link}, so the stop is sent through that"
        )
        run.settings = run.settings._replace(port=link)
    if run.sources.get("id") in (COMMAND_LINE, OTHERS) or number in [one.key[1] for one in mine]:
        return
    for one in [one for one in mine if one.was == number][:1]:
        run.journal.warn(
            "new-id", f"handctl set the {one.family} in motion with id {number}, and has given it id {one.key[1]} since"
        )
        run.settings = run.settings._replace(id=one.key[1])


def tell_gone(run: Run) -> None:
    """Say which devices are no longer remembered as moving, since they seem to be gone from the line."""
    access = run.connection.device_access
    for kind, number in access.gone() if access is not None else ():
        run.journal.warn(
            "gone",
            f"{kind} id {number} has not replied to two stops, and another device on this line has: it may be connected elsewhere now, "
            "and handctl no longer remembers it as moving",
            Hint("{} tries it again", f"{kind} stop --id {number} -p {run.settings.port}"),
        )


def each_stopped(
    run: Run,
    meant: Iterable[Reached],
    reached: set[tuple[str, int]],
    before: Table | None = None,
    turns: Turns | None = None,
) -> Table | None:
    """The stop of each device that is `meant` and not among those that were `reached` until then, behind the steps of the one `before`.

    What went wrong with any of them is the failure; its exit code is the highest. None without any.
    """
    settings, sources = run.settings, run.sources
    failed = [before.failure] if before is not None and before.failure is not None else []
    meant = list(meant)
    turns = turns or Turns(lambda: meant, reached)
    for one in meant:
        if one.key in reached:
            continue
        reached.add(one.key)
        run.settings, said = _settings_for(one, settings, sources)
        run.sources = {**sources, **dict.fromkeys({"id"} & said, OTHERS)}
        try:
            before = stopped_as(run, one.family, reached, before, turns)
        except UsageError as exc:  # one that was reached by another name of this place, which is none of its LINKs
            run.journal.warn("passed-over", exc.text, exc.hint)
            continue
        failed += [before.failure] if before.failure is not None else []
    if before is not None and failed:
        worst = max(failed, key=lambda error: error.exit_code)
        before.failure = worst.reworded(
            errors.joined(*(error.text for error in failed)), hint=worst.hint, code=worst.code
        )
    return before


def _settings_for(one: Reached, settings: Settings, sources: Mapping[str, Source]) -> tuple[Settings, set[str]]:
    """The settings that reach this device, and which of them nobody has given."""
    number = {"id": one.key[1]} if load(one.family, "cli").cli.family.ids else {}
    said = {key: value for key, value in {**one.settings, **number}.items() if not is_said(sources.get(key))}
    return settings.having(said), set(said)


class Turns:
    """Devices on one link that are stopped one after the other: each is begun before the first one is checked.

    waiting   all of them
    reached   those that had their turn, see `stop`
    """

    def __init__(self, waiting: Callable[[], Iterable[Reached]], reached: Container[tuple[str, int]] = ()) -> None:
        self._waiting, self._reached = waiting, reached
        self._begun: dict[tuple[str, int], RunningStop] = {}

    def of(self, run: Run, link: Link, begin: Callable[[], RunningStop], until: Deadline | None) -> RunningStop:
        """The stop of the device of this run, by `begin` where it was not begun before; after it those that wait are begun."""
        assert run.family is not None
        key = (run.family.kind, context_at(run, link).number)
        stop = self._begun.pop(key, None) or begin()
        for one in self._waiting():
            if one.key != key and one.key not in self._begun and one.key not in self._reached:
                with _turned_to(run, link, one) as reachable:
                    if reachable:
                        self._begun[one.key] = begun_at(run, link, [], None, until)
        return stop

    def lost(self) -> None:
        """The link was lost, and is opened again."""
        self._begun.clear()


@contextlib.contextmanager
def _turned_to(run: Run, link: Link, one: Reached) -> Iterator[bool]:
    """Around the steps for another device on the open link of this run; whether any can go out to it now."""
    before, ledger, speed = (run.family, run.settings), run.ledger, getattr(link, "baud", None)
    words = ledger.words, ledger.explain
    try:
        run.family = family = load(one.family, "cli").cli.family
        run.settings, _ = _settings_for(one, run.settings._replace(kind=None), run.sources)
        if family is not before[0]:
            ledger.words = None
        usable = not _held_back(family.kind, run.link_name()) and _trouble(run, run.settings) is None
        yield usable and _at_speed(link, run.settings.baud or family.baud)
    finally:
        run.family, run.settings = before
        ledger.words, ledger.explain = words
        _at_speed(link, speed)


def _at_speed(link: Link, speed: int | None) -> bool:
    """Whether the link has this speed now; where it has none that is ours, it has."""
    if isinstance(link, ByteLink) and link.can_set_baud and speed is not None and link.baud != speed:
        try:
            link.set_baud(speed)
        except LinkError:
            return False
    return True


def is_said(source: Source | None) -> bool:
    """Whether a setting was typed, or is that of the named device: no other one takes its place."""
    return source is not None and (source == COMMAND_LINE or source.level == NAMED)


def stopped_as(
    run: Run,
    kind: str,
    reached: set[tuple[str, int]],
    before: Table | None = None,
    turns: Turns | None = None,
    sequence: Callable[[StopContext], StopSequence] | None = None,
) -> Table:
    """The stop of a device of family `kind`, behind the steps of the one `before`, which was for another device, or its first part."""
    run.family = load(kind, "cli").cli.family
    if before is not None:
        run.settings = run.settings._replace(kind=None)
        run.journal.ledger.words = None
        if run.link is not None:
            _at_speed(run.link, run.settings.baud or run.family.baud)
    then = stop(run, sequence, reached=reached, turns=turns)
    if before is not None:
        then.rows = [{**row, "step": at} for at, row in enumerate([*before.rows, *then.rows], 1)]
    return then


def unheard(error: str, rows: Sequence[Row]) -> bool:
    """Whether nothing acknowledged what was sent: `error` is the kind of the failure, and `rows` what went out."""
    answered = any(row["answer"] is not None for row in rows if not row["reads"])
    return error == "ProtocolError" or (error == "NoAnswer" and not answered)


def joined_reports(first: dict[str, Any], then: dict[str, Any]) -> dict[str, Any]:
    """The report of a stop that followed another one, with the steps of both."""
    rows = [{**row, "step": at} for at, row in enumerate([*first["rows"], *then["rows"]], 1)]
    joined = {key: [*first[key], *then[key]] for key in ("wire", "devices")}
    return {**then, **joined, "rows": rows}


def _is_meant(run: Run, told: dict[str, Any]) -> bool:
    """Whether the device of this run is among those that the holder has stopped; with an id that nobody gave, any of its family."""
    assert run.family is not None
    stopped = [number for kind, number in told["devices"] if kind == run.family.kind]
    return bool(stopped) if _any_id(run) else (run.settings.id or 1) in stopped


def _any_id(run: Run) -> bool:
    """Whether nobody has said which id the device has, or its family has none. That of a variable or of the file is for want of one."""
    assert run.family is not None
    said = is_said(run.sources.get("id")) or _of_others(run) or run.settings.device is not None
    return not said or not run.family.ids


def _id_used(run: Run, number: int) -> str:
    """The id that was used, and where it comes from; "" for the default."""
    source = run.sources.get("id")
    assert run.family is not None
    kind = f"{run.family.kind} " if _of_others(run) else ""
    return f"{kind}id {number} ({source.where or source.level}): " if source is not None else ""


def _of_others(run: Run) -> bool:
    """Whether the id of this run is that of a device that was moving, whoever's, and that nobody has named."""
    return run.sources.get("id") == OTHERS


def _back_to_former_id(run: Run) -> int | None:
    """Use the id that the device of this run had before handctl gave it another one, which may be lost: with the power, until it is
    saved (exo §2.3.4). None where handctl has set no such device going, or its id was typed."""
    if run.sources.get("id") == COMMAND_LINE:
        return None
    assert run.family is not None
    key = run.family.kind, run.settings.id or 1
    for one in [one for one in _going(run) if one.key == key and one.was]:
        run.journal.warn(
            "former-id", f"no device replied at id {key[1]}, so the one with its former id {one.was} is stopped, too"
        )
        run.settings = run.settings._replace(id=one.was)
        return one.was
    return None


def _with_former_id(told: dict[str, Any], then: dict[str, Any], former: int) -> dict[str, Any]:
    """The report of a stop that nothing heard, followed by the one at the `former` id. That this one was acknowledged does not show that
    it is the same device: it is no success."""
    worse = max(
        (told, then), key=lambda one: getattr(errors, one["error"], HandctlError).exit_code if one["error"] else 0
    )
    text = errors.joined(told["text"], f"id {former}: {then['text']}")
    return {
        **joined_reports(told, then),
        "text": text,
        "id": told["id"],
        **{key: worse[key] for key in ("error", "hint", "stranger")},
    }


def _drop_stale_id(run: Run) -> bool:
    """Whether to try once more with the id that devices are shipped with: nothing replied at one that was not typed.

    A named device keeps its id if the configuration has another device on the same line: that one is not to be stopped.
    """
    source, number = run.sources.get("id"), run.settings.id
    assert run.family is not None
    if not run.family.ids or source in (None, COMMAND_LINE) or _of_others(run) or number in (None, 1):
        return False
    if source is not None and source.level == NAMED and run.shares_line:
        return False
    _drop(run, ["id"], f"no device replied at id {number}")
    return True


def _plan(run: Run, sequence: Callable[[StopContext], StopSequence] | None) -> list[Step]:
    """What goes out where nothing answers."""
    assert run.family is not None
    port, can = run.settings.port, on_can(run.settings)
    fixed = can or run.family.baud is None or (port or "").startswith(("tcp://", "socket://", "replay:"))
    speed = None if fixed else run.settings.baud or _last_speed(run, port or "") or run.family.baud
    context = StopContext(run.settings, can, speed)
    return writes_without_replies(
        sequence(context) if sequence is not None else stop_sequence_of(run.family.kind, context), reads=True
    )


def _last_speed(run: Run, name: str) -> int | None:
    """The speed at which the device was found last, where its family keeps that."""
    return run.family.recall(name) if run.family is not None and run.family.recall is not None else None


# -- who has it ---------------------------------------------------------------------------------------------------


def _ask_holder(run: Run, name: str, bound: Deadline | None) -> tuple[Lock | None, dict[str, Any] | None, bool]:
    """The lock if it is free; otherwise the holder's report, or None; and whether a holder has just ended."""
    try:
        return lock_for(run, name), None, False
    except InUse as exc:
        busy = exc
    except LinkError as exc:
        run.journal.warn(exc.code, exc.text, exc.hint)
        return None, None, False
    from handctl.stop.stop_listener import STOP_SECONDS, ask

    assert run.family is not None
    meant = run.family.kind + ("" if _any_id(run) else f" {run.settings.id or 1}")
    until = clock.now() + HEARD_SECONDS
    who = busy.holder
    if who is None or not processes.sleeps(who.pid):
        while True:
            heard, told = ask(busy.path, until, _left(bound, STOP_SECONDS), meant)
            if told is not None:
                told.setdefault("devices", [])  # of a version before this one
                by = str(who) if who is not None else "another handctl"
                run.journal.info("asked", f"{by} is using the device and was asked to stop it")
                return None, told, True
            if heard or clock.now() >= until:
                break
            with contextlib.suppress(LinkError):
                return lock_for(run, name), None, True  # it has let go meanwhile
            clock.sleep(TRY_SECONDS)
    if (
        who is not None
        and who.use == "stops"  # killed in the middle, it would report to nobody what it has stopped
        and not processes.sleeps(who.pid)
        and (lock := _let_go(run, name, bound, LAST_STOP_SECONDS)) is not None
    ):
        return lock, None, True
    # A suspended download can still be continued, and killing it leaves the hand without firmware: only a second stop does that.
    for family in dict.fromkeys((run.family.kind, who.family if who is not None else "")):
        if family in FAMILIES and (why := _held_back(family, name)):
            return None, report(Stopped(why), (), refused=True), False
    _end(run, who)
    with contextlib.suppress(LinkError):
        # Its last stop goes out first: two on one port take each other's answers, and collide on two wires.
        return lock_for(run, name, _left(bound, LAST_STOP_SECONDS) if who is not None else 0.0), None, True
    return None, None, True


def stopped_elsewhere(run: Run) -> HandctlError | None:
    """Have each command stop its device that reached it by the name of this LINK, when that led to another port; what went wrong.

    Whoever types the name means what that command is moving, or what is there now: both are stopped.
    """
    link, failure = run.settings.port or "", None
    for busy in () if run.settings.dry_run else held_elsewhere(link):
        from handctl.stop.stop_listener import STOP_SECONDS, ask

        who = busy.holder
        assert who is not None
        led = f"{link} led to another port when {who} opened it"
        told = None
        if not processes.sleeps(who.pid):
            seconds = min(run.settings.deadline or STOP_SECONDS, STOP_SECONDS)
            _, told = ask(busy.path, clock.now() + HEARD_SECONDS, seconds)
        if told is not None:
            text = errors.joined(f"{led}. It was asked to stop its device", told["text"])
            run.journal.warn("elsewhere", text, told["hint"])
            if told["error"]:
                failure = getattr(errors, told["error"], HandctlError)(
                    told["text"], hint=told["hint"], code="elsewhere"
                )
        elif who.family in FAMILIES and (why := _held_back(who.family, who.link)):
            run.journal.warn("elsewhere", errors.joined(led, why))
        else:
            _end(run, who)
            failure = errors.NoAnswer(
                f"{led}. It is not known whether its device is still moving",
                hint="switch the power off if the device is still moving",
                code="elsewhere",
            )
    return failure


def _held_back(family: str, name: str) -> str:
    """Why a stop would do harm at this LINK, as far as this user has noted; "" where it may be sent."""
    holds_back = load(family, "cli").cli.family.holds_back
    return holds_back(name) if holds_back is not None else ""


def _unbroken(link: str) -> str:
    """Why a stop would do harm at this LINK: somebody else is running a command there that must not be interrupted; "" if nobody is."""
    from handctl.link.port_users import handctl_commands

    if link.startswith(OURS):
        return ""
    for pid, words in handctl_commands(at_place(link)):
        for family, row in FAMILIES.items():
            typed = iter(words)
            if row.unbroken and all(word in typed for word in (family, *row.unbroken.split())):
                return f"another handctl (pid {pid}) is running `{family} {row.unbroken}` here, and a stop would interrupt it. If the device moves, end that process first, or switch the power off"
    return ""


def at_place(link: str) -> Callable[[str], bool]:
    """Whether a LINK leads where this one does."""
    place = canonical(link, None)

    def is_there(other: str) -> bool:
        try:
            return canonical(other, None) == place
        except (HandctlError, ValueError, OSError):
            return False  # whatever somebody has typed

    return is_there


def _let_go(run: Run, name: str, bound: Deadline | None, seconds: float) -> Lock | None:
    """The lock, once a holder that stops, or has stopped another device than this one, has let go of the link; None where it does not."""
    until = clock.now() + _left(bound, seconds)
    while clock.now() < until:
        try:
            return lock_for(run, name)
        except InUse:
            clock.sleep(TRY_SECONDS)
        except LinkError:
            break
    return None


def _left(bound: Deadline | None, seconds: float) -> float:
    """So many seconds, or what the deadline leaves of them."""
    return seconds if bound is None else min(seconds, max(0.001, bound.remaining))


def _take_over(run: Run, told: dict[str, Any]) -> None:
    """Note in the ledger of this command what another one has sent for it, from the report of that one."""
    for one in told.get("wire", ()):
        step = Step(one["meaning"], bytes.fromhex(one["data"]), moves=True, can_id=one["can_id"])
        run.ledger.plan([step])
        with run.ledger.stopping():
            for _ in range(one["times"]):
                run.ledger.passed(0.0, ">", step.data, step.can_id)
        if one["came"] or not told["error"]:  # on CAN an acknowledgement may have no data
            run.ledger.passed(0.0, "<", bytes.fromhex(one["came"]), step.can_id)
        if told["evidence"]:
            run.ledger.confirm(told["evidence"], step)


def _end(run: Run, who: Holder | None) -> None:
    """End a holder that does not answer, if it is surely the one and this user's."""
    if who is None:
        run.journal.warn(
            "holder",
            "another program is using the device and does not respond. Its lock does not identify it",
            Hint("find the program with {} and end it", "ports"),
        )
        return
    if who.pid == os.getpid():
        return  # another command of this session, under another name of the port
    hint = f"end it with `{processes.ENDS} {who.pid}`"
    try:
        asking = ASKED_SECONDS if who.command == LIBRARY and not processes.sleeps(who.pid) else 0.0
        ended = processes.end(who.pid, who.start, GONE_SECONDS, asking)
    except OSError as exc:
        run.journal.warn("holder", f"{who} does not respond and could not be ended: {exc.strerror or exc}", hint)
        return
    if not ended:
        text = f"{who} is using the device and does not respond. The system does not show whether process {who.pid} is still that program"
        run.journal.warn("holder", text, hint)
    elif ended == processes.ASKED:
        run.journal.warn("ended", f"{who} was using the device and did not respond. It ended after SIGTERM")
    elif ended == processes.KILLED:
        why = f"not end within {asking:g} s of SIGTERM" if asking else "not respond (asleep or blocked)"
        run.journal.warn("ended", f"{who} was using the device and did {why}. handctl ended it by force")


# -- from here ----------------------------------------------------------------------------------------------------


def _from_here(
    run: Run,
    lock: Lock | None,
    sequence: Callable[[StopContext], StopSequence] | None,
    bound: Deadline | None,
    *,
    patient: bool,
    otherwise: Callable[[Any], str] | None,
    turns: Turns | None = None,
) -> dict[str, Any]:
    """Open the link and send. With `patient` a link that is not free yet is tried again for a second."""
    assert run.family is not None
    if why := _held_back(run.family.kind, run.link_name()) or _unbroken(run.settings.port or ""):
        if lock is not None:
            lock.release()
        return report(Stopped(why), (), refused=True)
    if run.session is None and run.link is None:
        run.connection.device_access = DeviceAccess(run, lock)
        run.connection.device_access.note_stop()
    until = clock.now() + _left(bound, AGAIN_SECONDS) if patient else 0.0
    sent: list[Sent] = []
    stopped = None
    while stopped is None or (stopped.error is LinkError and clock.now() < until):
        try:
            if stopped is not None and turns is not None:
                turns.lost()
            link = run.open_link(again=stopped is not None, baud=_last_speed(run, run.link_name()))
        except LinkError:
            if clock.now() >= until:
                raise
            clock.sleep(TRY_SECONDS)
            continue
        if run.session is not None and run.connection.device_access is not None:
            run.connection.device_access.note_stop()
        end = None if bound is None else link.deadline(bound.remaining)
        with run.prompts.stopping():
            begin = partial(begun_at, run, link, [], sequence, end)
            going = begin() if turns is None else turns.of(run, link, begin, end)
            stopped, sent = going.finish(), going.sent
            if stopped.error is LinkError and not (end and end.expired) and found_again(link):
                if turns is not None:
                    turns.lost()
                stopped = begun_at(run, link, sent, sequence, end).finish()
            if (access := run.connection.device_access) is not None:
                device = run.family.kind, context_at(run, link).number
                stopped = access.judged(stopped, [device])
                if stopped.error is errors.NoAnswer and not stopped.heard and not any(one.came for one in sent):
                    access.silent(device)
    expired = end is not None and end.expired
    silent = (
        not (expired or stopped.heard)
        and stopped.error is not None
        and issubclass(stopped.error, (errors.NoAnswer, errors.ProtocolError))
    )
    if silent and otherwise is not None:
        try:
            stopped = stopped._replace(text=otherwise(run.device()), hint="", error=None)
        except HandctlError as exc:
            stopped = stopped._replace(text=errors.joined(stopped.text, exc.text))
    return report(stopped, sent, run, context_at(run, link))


# -- what holds up no stop ------------------------------------------------------------------------------------------


TIMEOUT = (0.01, 2.0)
"""Seconds for an answer: a step goes out for one second in all, and not more often than the line can carry it."""
DEADLINE = 0.1
"""The least that leaves time for the first bytes."""


def fall_back(run: Run) -> None:
    """Leave those settings of the run that a stop of its family can go out with; warn of each of the others."""
    family, settings = run.family, run.settings
    assert family is not None
    place = run.sources.get("port") or run.sources.get("fake")
    if settings.kind not in (None, family.kind) and place is not None and place.level != NAMED:
        source = run.sources["kind"]
        mine = [key for key, found in run.sources.items() if found.level == NAMED]
        _drop(run, mine, f"{settings.device!r} is of family {settings.kind} ({source.where})")
    settings, kind = run.settings, family.kind
    for key, what in lacking(family).items():
        if getattr(settings, key) is not None:
            _drop(run, [key], f"{kind} has no {what}", told=run.sources[key] == COMMAND_LINE)
    port, wire, baud, (least, most) = settings.port, settings.wire, settings.baud, TIMEOUT
    if family.speeds and baud is not None and baud not in family.speeds:
        _drop(run, ["baud"], f"{kind} does not support {baud} bit/s, only {', '.join(map(str, family.speeds))}")
    if settings.timeout is not None and not least <= settings.timeout <= most:
        _drop(run, ["timeout"], f"{settings.timeout:g} s for a reply: a stop needs {least:g} to {most:g} s")
    if settings.deadline is not None and settings.deadline < DEADLINE:
        _drop(run, ["deadline"], f"{settings.deadline:g} s for the whole stop: it needs {DEADLINE:g} s")
    if port and wire is not None and not port.startswith("replay:") and wire_in(family, port) != wire:
        _drop(run, ["wire"], f"{wire} does not fit {port}")
    _own(run)
    if family.check is not None:
        family.check(run.settings)  # what is left of that is the LINK: its bytes could reach another device


def _own(run: Run) -> None:
    """The id and the options of the family: as many as the stop can go out with."""
    keys = [*(["id"] if run.settings.id is not None else []), *run.settings.own]
    error = _trouble(run, run.settings) if keys else None
    if error is None:
        return
    alone = next((key for key in keys if _trouble(run, _without(run.settings, [key])) is None), None)
    dropped = [alone] if alone is not None else keys
    if _trouble(run, _without(run.settings, dropped)) is None:  # else it is the LINK
        _drop(run, dropped, error.text)


def _trouble(run: Run, settings: Settings) -> HandctlError | None:
    """Why nothing would go out with these settings, None where it would."""
    assert run.family is not None
    try:
        if run.family.check is not None:
            run.family.check(settings)
        writes_without_replies(stop_sequence_of(run.family.kind, StopContext(settings, on_can(settings))), reads=True)
    except HandctlError as exc:
        return exc
    except (ValueError, LookupError, OverflowError, TypeError, AttributeError) as exc:
        return UsageError(f"{type(exc).__name__}: {exc}")
    return None


def _without(settings: Settings, keys: list[str]) -> Settings:
    shared = {key: value for key, value in Settings()._asdict().items() if key in keys}
    return settings._replace(**shared, own={key: value for key, value in settings.own.items() if key not in keys})


def _drop(run: Run, keys: list[str], why: str, *, told: bool = True) -> None:
    run.settings = _without(run.settings, keys)
    found: dict[str, Any] = {key: run.sources.get(key, COMMAND_LINE) for key in keys}
    run.sources = {key: source for key, source in run.sources.items() if key not in keys}
    if told:
        names = ", ".join(found)
        where = ", ".join(dict.fromkeys(source.where or source.level for source in found.values()))
        run.journal.warn(
            "passed-over", f"{names} ({where}): {why}", "a stop never waits for a setting: the default was used"
        )
