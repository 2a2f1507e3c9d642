"""The commands snapshot, diff and restore of every device with a parameter map, and the snapshot file.

A snapshot contains settings and set points. Writing a set point moves or pushes, so `diff` and `restore` only use them
on request.

    {"schema": "handctl-snapshot/1", "kind": "exo", "device": {…}, "tool": {"name": "handctl", "version": "…"},
     "time": "2026-01-31T12:00:00+00:00", "link": "…", "fake": false,
     "values": {"id": 1, "position_set.little": 151, …}, "checksum": "sha256:…"}

The checksum covers everything else in canonical form (sorted keys, no spaces), so an edited file is noticed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from typing import TYPE_CHECKING, Any

from handctl import __version__
from handctl.command.run import Asked, PlannedAction
from handctl.errors import (
    Aftermath,
    CheckFailed,
    DeviceRefused,
    HandctlError,
    Hint,
    Interrupted,
    OutputError,
    UsageError,
    joined,
)
from handctl.files import PAGE, PAGE_DATA, atomic_write, in_json, in_page, read_text, why_unwritable, writing
from handctl.model.device import NOT_THERE, is_silent, question
from handctl.model.param import COMMAND, MOVES, PUSHES, SETTING, Changes, Element, Number, ParamMap, Step, ValueChange
from handctl.model.result import Column, Row, Table

if TYPE_CHECKING:
    from handctl.command.run import Run
    from handctl.model.device import Device

Change = tuple[Element, Number]
Check = Callable[[Sequence[Change]], None]
"""A device's own look at changes before anything is sent; raises UsageError."""
ACTING = {MOVES: "MOVES the device", PUSHES: "PUSHES with a force until another is commanded"}


def read_values(device: Device, elements: Sequence[Element], needed: Collection[str] = ()) -> dict[str, Number]:
    """The present value of each element, by full name. Raises what kept one from being read.

    What this firmware does not have is left out. Where some of that is `needed`, all of it is named.
    """
    every = device.read(elements) if elements else []
    readings = device.present(every)
    for reading in readings:
        if reading.error is not None:
            exc = reading.error
            raise exc.reworded(f"not all settings could be read: {reading.element.full_name}: {exc.text}")
    there = {reading.element.full_name for reading in readings}
    if lacking := [one for one in every if one.element.full_name in {*needed} - there]:
        names, first = [one.element.full_name for one in lacking], lacking[0].error
        assert first is not None
        lacks = "the device does not reply to reads of" if is_silent(lacking) else "this firmware does not have"
        raise first.reworded(
            f"{device.link.name}: {lacks} {', '.join(whole_names(names, needed))}: {first.text}",
            hint=skipping(names, needed),
            code=NOT_THERE,
        )
    return {reading.element.full_name: reading.value for reading in readings if reading.value is not None}


def whole_names(names: Sequence[str], among: Collection[str]) -> list[str]:
    """The same names, shorter: all elements of a vector that are `among` those of a file are the vector."""
    bases = dict.fromkeys(name.partition(".")[0] for name in names)
    short: list[str] = []
    for base in bases:
        mine = [name for name in names if name.partition(".")[0] == base]
        short += [base] if 1 < len(mine) == sum(name.partition(".")[0] == base for name in among) else mine
    return short


def skipping(names: Sequence[str], among: Collection[str]) -> str:
    """The next step where some of a snapshot cannot be restored here."""
    options = " ".join(f"--skip {name}" for name in whole_names(names, among))
    return f"add {options} to restore the others. Nothing was written."


def kind_of(params: ParamMap[Any], name: str) -> str:
    """The kind of a name in a snapshot; one that this map does not know counts as a setting."""
    try:
        return str(params.find(name)[0].kind)
    except UsageError:
        return SETTING


def counted(params: ParamMap[Any], names: Sequence[str]) -> str:
    """``2 settings and 10 set-points (position_set, force_set)``."""
    setpoints = [name for name in names if kind_of(params, name) == COMMAND]
    number = len(names) - len(setpoints)
    texts = [f"{number} setting{'' if number == 1 else 's'}"] if number or not setpoints else []
    if setpoints:
        whose = ", ".join(dict.fromkeys(name.partition(".")[0] for name in setpoints))
        texts.append(f"{len(setpoints)} set point{'' if len(setpoints) == 1 else 's'} ({whose})")
    return " and ".join(texts)


def snapshot(run: Run, path: str) -> Table:
    """Write settings and set-points to a file, atomically; the only file that it replaces is an older snapshot of this kind."""
    check_target(path, run.family.kind)
    device: Device = run.device()
    identity = device.identity()
    values = read_values(device, device.map.kept(further=device.further(identity)))
    content = make(device.kind, identity, values, link=run.link_name(), fake=run.simulated)
    write(path, content)
    for name, value in values.items():
        try:
            device.map.find(name)[0].check(value, name)
        except UsageError as exc:
            run.journal.warn(
                "out-of-range",
                f"the device has {exc.text}: `restore` will refuse this file",
                hint=f"`handctl {device.kind} set {name}=…`, then take the snapshot again",
            )
    run.journal.info("written", f"{path}: {counted(device.map, list(values))} of {device.kind}")
    rows: list[Row] = [
        {"name": name, "kind": kind_of(device.map, name), "value": value} for name, value in values.items()
    ]
    columns = [Column("name", "Name"), Column("kind", "Kind"), Column("value", "Value", right=True)]
    return Table(rows=rows, columns=_in_words(device.map, rows, columns))


def diff(run: Run, params: ParamMap[Any], a: str | None, b: str | None, *, setpoints: bool = False) -> Table:
    """Compare two snapshots, or a snapshot with the live device: settings, and with `setpoints` what was commanded.

    Exit 7 when they differ.
    """
    if a is None:
        raise UsageError(
            "diff needs a snapshot",
            hint=f"`handctl {params.kind} snapshot A` makes one. -d LEFT,RIGHT compares two devices",
        )
    content = load(a, params.kind)
    left = content["values"]
    _need_settings(params, setpoints)
    if b is not None:
        right = load(b, params.kind)["values"]
    else:
        device: Device = run.device()
        device.find_for_restore(left)
        _tell_other_device(run, a, content, device)
        right = read_values(device, params.kept(setpoints=setpoints, further=left))
    hint = Hint("{} writes those of the file", f"{params.kind} restore {a}{' --setpoints' if setpoints else ''}")
    return compared(
        run, params, [(a, left), (b or "device", right)], setpoints=setpoints, hint=hint if b is None else ""
    )


def compared(
    run: Run, params: ParamMap[Any], sides: Sequence[tuple[str, Mapping[str, Any]]], *, setpoints: bool, hint: str = ""
) -> Table:
    """What differs between two `sides`, values by name each; exit 7 where anything does."""
    (_, left), (_, right) = sides
    names = list(dict.fromkeys([*left, *right]))
    chosen = [name for name in names if setpoints or kind_of(params, name) != COMMAND]
    rows: list[Row] = [
        {"name": name, "kind": kind_of(params, name), "a": left.get(name), "b": right.get(name)}
        for name in chosen
        if left.get(name) != right.get(name)
    ]
    titles = (Column(key, title, right=True) for key, (title, _) in zip("ab", sides, strict=True))
    table = Table(rows=rows, columns=_in_words(params, rows, (Column("name", "Name"), *titles)))
    _tell_left_out(run, params, [name for name in names if name not in chosen], "compared")
    if rows:
        table.failure = CheckFailed(f"{len(rows)} of {len(chosen)} values differ", hint=hint, code="differ")
    else:
        run.journal.info("equal", f"equal: {counted(params, chosen)}")
    return table


def held(run: Run, *, setpoints: bool) -> Table:
    """What a device holds, to be compared with another one."""
    device: Device = run.device()
    _need_settings(device.map, setpoints)
    values = read_values(device, device.map.kept(setpoints=setpoints, further=device.further(device.identity())))
    rows: list[Row] = [{"name": name, "value": value} for name, value in values.items()]
    return Table(rows=rows, columns=(Column("name", "Name"), Column("value", "Value", right=True)))


def _need_settings(params: ParamMap[Any], setpoints: bool) -> None:
    """Refuse what could only be empty: a device that was never asked is not equal to anything. Raises UsageError."""
    if not params.kept(setpoints=setpoints):
        names = [element.full_name for element in params.kept()]
        raise UsageError(
            f"{params.kind} has no settings, only {counted(params, names)}",
            hint="add --setpoints to include them. Nothing was sent.",
            code="no-settings",
        )


def _tell_left_out(run: Run, params: ParamMap[Any], names: Sequence[str], done: str) -> None:
    if names:
        run.journal.info("setpoints", f"not {done}: {counted(params, names)}", hint="add --setpoints to include them")


# -- restore ------------------------------------------------------------------------------------------------------


def restore(
    run: Run,
    params: ParamMap[Any],
    path: str,
    *,
    check: Check | None = None,
    setpoints: bool = False,
    skip: Sequence[str] = (),
) -> PlannedAction:
    """Write what differs from a snapshot, in an order that keeps the device reachable; read back; say what is left out.

    Settings; with `setpoints` also what was commanded, forces after a question of their own. Everything is asked before
    the first byte is written. What this device does not have, or what may mean something else to it, is refused before
    that, all of it by name, unless `skip` names it: parameters, or elements of them.
    """
    content = load(path, params.kind)
    values = _unskipped(run, content["values"], path, [_as_kept(params, name) for name in skip])
    _need_settings(params, setpoints)
    found = _checked(params, values, path)
    changes = [change for change in found if setpoints or change[0].param.kind != COMMAND]
    if check is not None:
        check(changes)
    left = [element.full_name for element, _ in found if not setpoints and element.param.kind == COMMAND]
    _tell_left_out(run, params, left, "written")
    if run.settings.dry_run:
        tell_all_listed(run)
    live: dict[str, Number] = {}
    differing: list[Change] = []

    def look(device: Device) -> Asked:
        with nothing_written():
            return read_and_ask(device)

    def read_and_ask(device: Device) -> Asked:
        device.find_for_restore(values)
        device.identify()
        _tell_other_device(run, path, content, device)
        _refuse_other_meaning(device, path, content, changes)
        live.update(read_values(device, params.kept(setpoints=setpoints, further=values), needed=values))
        differing.extend(change for change in changes if live.get(change[0].full_name) != change[1])
        for text in device.not_covered:
            run.journal.info("not-covered", f"not covered by a snapshot: {text}")
        absent = [
            element.full_name
            for element in params.kept(setpoints=setpoints)
            if element.full_name not in content["values"]
        ]
        if absent:
            text = f"{path} does not contain {', '.join(absent)}. The device keeps its own values for these"
            run.journal.warn("absent", text)
        if differing:
            _ask(run, params, device, differing, live)
        else:
            what = counted(params, [element.full_name for element, _ in changes])
            text = f"the device already has {what} from the snapshot" if changes else "nothing to write"
            run.journal.info("equal", f"{text}. Nothing was written")
        return Asked()

    def write(device: Device) -> Table:
        from handctl.command.envelope import interrupted

        after: dict[str, Number | None] = {}
        failure: HandctlError | None = None
        acts = any(element.param.acts for element, _ in differing)
        try:
            with device.guarded() if acts else nullcontext():
                for group in _groups(differing):
                    after |= {reading.element.full_name: reading.value for reading in device.write(group)}
        except DeviceRefused as exc:  # only a write shows what can be read here and not set
            exc.hint = joined(exc.hint, "--skip NAME leaves a setting of the snapshot out")
            raise
        except (KeyboardInterrupt, Interrupted) as exc:
            failure = exc if isinstance(exc, Interrupted) else interrupted(run)
            with run.prompts.without_interrupts(), suppress(HandctlError):
                readings = device.read([element for element, _ in differing])
                after = {reading.element.full_name: reading.value for reading in readings}
        table = _restored(params, differing, live, after)
        return table if failure is None else _unfinished(table, differing, failure)

    question = f"{_restoring(params, changes)}, where they differ" if changes else ""
    return PlannedAction(lambda: _steps(run.planner(), changes), write, question, look=look)


@contextmanager
def nothing_written() -> Iterator[None]:
    """Around what comes before the first write: Ctrl-C says that there was none. Raises Interrupted."""
    try:
        yield
    except KeyboardInterrupt as exc:
        raise Interrupted(left=Aftermath("nothing was written")) from exc


def _unfinished(table: Table, differing: Sequence[Change], failure: HandctlError) -> Table:
    """The table of a restore that was interrupted: each row says whether it has been restored."""
    done = 0
    for row, (_, wanted) in zip(table.rows, differing, strict=True):
        if row["value"] == wanted:
            done += 1
        elif row["value"] is None:
            row["error"] = "not read back"
        row["restored"] = row["value"] == wanted
    table.columns = (*table.columns, Column("restored", "Restored"))
    text = f"{done} of {len(table.rows)} values have been restored and read back"
    failure.add_aftermath(Aftermath(text, "run the same command again: it writes the values that still differ"))
    table.failure = failure
    return table


def _tell_other_device(run: Run, path: str, content: Mapping[str, Any], device: Device) -> None:
    """Warn where the snapshot is of a device with another serial number."""
    said = content.get("device")
    theirs = said.get("serial_number") if isinstance(said, dict) else None
    ours = device.identity().get("serial_number") if theirs else None
    if ours and ours != theirs:
        text = f"{path} is a snapshot of another device: serial number {theirs}, and this one has {ours}"
        run.journal.warn("other-device", text)


def tell_all_listed(run: Run) -> None:
    """Of a dry run of what leaves out what the device has."""
    run.journal.info(
        "plan",
        "all values are listed: without reading the device, handctl cannot tell which are already set",
    )


def _as_kept(params: ParamMap[Any], name: str) -> str:
    """A name as a file has it, for one that `get` takes too, such as the manual's mnemonic; one of no parameter as it is."""
    try:
        param, elements = params.find(name)
    except UsageError:
        return name
    return elements[0].full_name if "." in name else param.name


def _unskipped(run: Run, values: dict[str, Number], path: str, skip: Sequence[str]) -> dict[str, Number]:
    """The values without those that `skip` names, which are told. Raises UsageError for a name that is not in the file."""
    for name in skip:
        if name not in {known for full in values for known in (full, full.partition(".")[0])}:
            raise UsageError(f"--skip {name}: {path} does not contain it", hint=UNTOUCHED, code="unknown-name")
    skipped = [name for name in values if name in skip or name.partition(".")[0] in skip]
    if skipped:
        text = f"not restored: {', '.join(whole_names(skipped, values))}. The device keeps what it has"
        run.journal.info("skipped", text)
    return {name: value for name, value in values.items() if name not in skipped}


def _refuse_other_meaning(device: Device, path: str, content: Mapping[str, Any], changes: Sequence[Change]) -> None:
    """Refuse values that are of another scale or range on the device that the file is of. Raises UsageError."""
    said = content.get("device")
    theirs, ours = device.map_of(said if isinstance(said, dict) else {}), device.own_map()
    other = [
        element.full_name
        for element, _ in changes
        if (own := ours.get(element.param.name)) is None
        or own.meaning != getattr(theirs.get(own.name), "meaning", None)
    ]
    if other:
        values = content["values"]
        raise UsageError(
            f"{path} is of another model, on which {', '.join(whole_names(other, values))} may mean something else",
            hint=skipping(other, values),
            code="other-meaning",
        )


def _checked(params: ParamMap[Any], values: dict[str, Number], path: str) -> list[Change]:
    """The changes that the values are. Raises UsageError, which names everything that cannot be set here."""
    changes, foreign, out_of_range = [], list[str](), list[str]()
    for name, value in values.items():
        try:
            param, elements = params.find(name)
        except UsageError:
            foreign.append(name)
            continue
        if len(elements) != 1 or not param.writable:
            foreign.append(name)
            continue
        try:
            param.check(value, name)
        except UsageError as exc:
            out_of_range.append(exc.text)
        changes.append((elements[0], value))
    if foreign:
        text = f"{path}: {params.kind} has no setting {', '.join(whole_names(foreign, values))}"
        raise UsageError(text, hint=f"the file does not match this device: {skipping(foreign, values)}", code="foreign")
    if out_of_range:
        raise UsageError(
            f"{path}: {'; '.join(out_of_range)}",
            hint="the file does not match this device. --skip NAME leaves a value out. Nothing was written.",
            code="out-of-range",
        )
    return sorted(
        changes,
        key=lambda change: (change[0].param.strands, -getattr(change[0].param, "address", 0) * change[0].param.strands),
    )


def _groups(changes: Sequence[Change]) -> list[list[Change]]:
    """What concerns the whole device first, then its parts, then set-points, then forces; then one by one what may strand
    the device (its id or speed last).
    """
    calm = [change for change in changes if not change[0].param.strands]
    settings = [change for change in calm if change[0].param.kind == SETTING]
    commands = [change for change in calm if change[0].param.kind == COMMAND]
    groups = [
        [change for change in settings if not change[0].param.elements],
        [change for change in settings if change[0].param.elements],
        [change for change in commands if change[0].param.acts != PUSHES],
        [change for change in commands if change[0].param.acts == PUSHES],
    ]
    return [group for group in groups if group] + [[change] for change in changes if change[0].param.strands]


def _steps(device: Device, changes: Sequence[Change]) -> list[Step]:
    """The bytes of a plan; what moves or pushes is called that."""
    steps = []
    for group in _groups(changes):
        acting = next((element.param.acts.upper() for element, _ in group if element.param.acts), "")
        planned = device.plan(group)
        steps += [step._replace(meaning=f"{acting}: {step.meaning}") for step in planned] if acting else planned
    return steps


def _ask(run: Run, params: ParamMap[Any], device: Device, differing: Sequence[Change], live: dict[str, Number]) -> None:
    """One question for all, a further one for forces; nothing has been written. Raises NotConfirmed."""
    forces = [change for change in differing if change[0].param.acts == PUSHES]
    others = [change for change in differing if change not in forces]
    waiting = device.lets_go(differing)
    if others:
        asked = joined(_restoring(params, others), question(waiting) if waiting else "")
        rows = [*_from_to(others, live), *(one.row() for one in waiting)]
        run.confirm(asked, _steps(device, others), changes=Changes("Setting", rows=rows))
    if forces:
        changes = Changes("Setting", rows=_from_to(forces, live))
        run.confirm(f"This {ACTING[PUSHES]}", _steps(device, forces), changes=changes)


def _from_to(changes: Sequence[Change], live: dict[str, Number]) -> list[ValueChange]:
    return [ValueChange(element.full_name, live.get(element.full_name), value) for element, value in changes]


def _restoring(params: ParamMap[Any], changes: Sequence[Change]) -> str:
    """What is about to be written, and what of it acts or strands the device."""
    names = [element.full_name for element, _ in changes]
    text = f"Restore {counted(params, names)}"
    for acts, verb in ACTING.items():
        acting = [element.full_name for element, _ in changes if element.param.acts == acts]
        text += f"; {verb}: {', '.join(acting)}" if acting else ""
    stranding = [element.full_name for element, _ in changes if element.param.strands]
    return text + (f"; may leave it unreachable: {', '.join(stranding)}" if stranding else "")


def _restored(
    params: ParamMap[Any], differing: Sequence[Change], before: dict[str, Number], after: dict[str, Number | None]
) -> Table:
    rows: list[Row] = [
        {
            "name": element.full_name,
            "kind": element.param.kind,
            "before": before.get(element.full_name),
            "value": after.get(element.full_name),
            "moves": element.param.moves,
            "pushes": element.param.acts == PUSHES,
        }
        for element, _ in differing
    ]
    columns = [
        Column("name", "Name"),
        Column("kind", "Kind"),
        Column("before", "Before", right=True),
        Column("value", "Now", right=True),
        Column("moves", "Moves"),
    ]
    return Table(rows=rows, columns=_in_words(params, rows, columns))


def _in_words(params: ParamMap[Any], rows: Sequence[Row], columns: Sequence[Column]) -> tuple[Column, ...]:
    """Add the meaning of codes to each row, and return the columns with one more after each that has any."""
    names = {"value": "label", "before": "before_label", "a": "a_label", "b": "b_label"}
    for row in rows:
        try:
            param = params.find(row["name"])[0]
        except UsageError:
            continue  # the name of another version
        for key, told in names.items():
            if row.get(key) is not None and (label := param.label(row[key])):
                row[told] = label
    shown: list[Column] = []
    for column in columns:
        shown.append(column)
        told = names.get(column.key, "")
        if any(told in row for row in rows):
            shown.append(Column(told, "Meaning"))
    return tuple(shown)


# -- the file: settings of one device as JSON, whole or not there at all --------------------------------------------


SCHEMA = "handctl-snapshot/1"
MOST_BYTES = 1_000_000
UNTOUCHED = "Nothing was sent to the device."


def _checksum(content: Mapping[str, Any]) -> str:
    import hashlib
    import json

    text = json.dumps(
        {key: value for key, value in content.items() if key != "checksum"}, sort_keys=True, separators=(",", ":")
    )
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def make(
    kind: str, identity: Mapping[str, object], values: dict[str, Number], *, link: str, fake: bool
) -> dict[str, Any]:
    """The content of a snapshot file, with its checksum."""
    import json
    from datetime import datetime, timezone

    content: dict[str, Any] = {
        "schema": SCHEMA,
        "kind": kind,
        "device": dict(identity),
        "tool": {"name": "handctl", "version": __version__},
        "time": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "link": link,
        "fake": fake,
        "values": values,
    }
    content = json.loads(in_json(json.dumps(content, ensure_ascii=False)))  # as it is read back
    return {**content, "checksum": _checksum(content)}


def write(path: str, content: Mapping[str, Any]) -> None:
    """Write a snapshot, whole or not at all. Raises OutputError."""
    import json

    with writing(path, "the snapshot "), atomic_write(path) as file:
        json.dump(content, file, indent=2, ensure_ascii=False)
        file.write("\n")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    # Of two entries of one name the checksum would cover the last only, while a person reads the first.
    content = dict(pairs)
    if len(content) != len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{next(name for name in names if names.count(name) > 1)!r} is given twice")
    return content


def _refuse(name: str) -> None:
    raise ValueError(f"{name} is not a JSON number")


def _parsed(path: str, kind: str) -> dict[str, Any]:
    """What a file that says to be a snapshot holds. Raises UsageError."""
    import json

    text = read_text(path, "a snapshot", MOST_BYTES, hint=Hint("{} makes one", f"{kind} snapshot {path}"))
    page = text.startswith(PAGE)
    try:
        content = json.loads(
            in_page(text, PAGE_DATA) if page else text, parse_constant=_refuse, object_pairs_hook=_once
        )
        if page:
            content = content.get("snapshot")
    except (ValueError, RecursionError) as exc:
        raise UsageError(f"{path}: not a snapshot: {exc}", hint=UNTOUCHED) from exc
    if not isinstance(content, dict) or not str(content.get("schema", "")).startswith("handctl-snapshot/"):
        raise UsageError(f"{path}: not a handctl snapshot", hint=UNTOUCHED)
    return content


def check_target(path: str, kind: str) -> None:
    """Look at FILE before anything is sent. Raises OutputError where none can be written, UsageError for a file that is no
    older snapshot of a `kind` device: only such a one may be replaced.
    """
    if why := why_unwritable(path):
        raise OutputError(f"{path}: the snapshot cannot be written: {why}", hint=f"choose another file. {UNTOUCHED}")
    if not os.path.isfile(path):  # what else it may be is told when it is written
        return
    try:
        found = _parsed(path, kind).get("kind")
    except UsageError:
        found = None
    if found != kind:
        what = f"a snapshot of {found}" if found else "no snapshot"
        raise UsageError(
            f"{path} exists and is {what}: not replaced",
            hint=f"choose another file, or remove it first. {UNTOUCHED}",
            code="exists",
        )


def load(path: str, kind: str) -> dict[str, Any]:
    """Read and check a snapshot of a `kind` device. Raises UsageError for anything that is not whole and ours."""
    content = _parsed(path, kind)
    if content["schema"] != SCHEMA:
        raise UsageError(
            f"{path}: schema {content['schema']}, but handctl {__version__} reads {SCHEMA}",
            hint=f"use the handctl that wrote it ({content.get('tool')}). {UNTOUCHED}",
        )
    if content.get("checksum") != _checksum(content):
        raise UsageError(f"{path}: corrupted: its checksum is wrong", hint=f"take a new snapshot. {UNTOUCHED}")
    if content.get("kind") != kind:
        raise UsageError(f"{path}: a snapshot of {content.get('kind')}, not of {kind}", hint=UNTOUCHED)
    values = content.get("values")
    if not isinstance(values, dict) or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < float("inf") for v in values.values()
    ):
        raise UsageError(f"{path}: corrupted: its values are not pairs of name and number", hint=UNTOUCHED)
    return content
