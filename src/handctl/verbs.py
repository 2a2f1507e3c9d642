"""The verbs that mean the same for every device, over its parameter map: one implementation, not five.

A device satisfies `MapDevice`; its own peculiarities (an id that answers elsewhere once written) live in its `write`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from handctl.errors import CheckFailed, HandctlError, NoAnswer, ProtocolError, UsageError
from handctl.param import Element, Number, Param, ParamMap, Reading, Step, elements_of
from handctl.result import Column, Journal, Row, Table

if TYPE_CHECKING:
    from handctl.link import Link
    from handctl.run import Run

    class MapDevice(Protocol):
        """What the verbs need of a device."""

        @property
        def kind(self) -> str: ...
        @property
        def map(self) -> ParamMap[Any]: ...
        @property
        def link(self) -> Link: ...
        @property
        def journal(self) -> Journal: ...
        @property
        def columns(self) -> tuple[Column, ...]: ...
        @property
        def live(self) -> tuple[str, ...]: ...
        @property
        def worn(self) -> bool: ...
        @property
        def not_covered(self) -> tuple[str, ...]: ...
        def identity(self) -> dict[str, object]: ...
        def read(self, elements: Sequence[Element]) -> list[Reading]: ...
        def row(self, reading: Reading) -> Row: ...
        def table(self, readings: Sequence[Reading], title: str = "") -> Table: ...
        def plan(self, changes: Sequence[tuple[Element, Number]]) -> list[Step]: ...
        def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]: ...
        def find_for_restore(self, values: dict[str, Number]) -> None: ...


Check = Callable[[Sequence[tuple[Element, Number]]], None]
"""A device's own look at changes before anything is sent; raises UsageError."""


def select(params: ParamMap[Any], names: Sequence[str]) -> list[Element]:
    """Readable elements by name, in the order asked, each once. Raises UsageError."""
    chosen: dict[tuple[str, int], Element] = {}
    for name in names:
        param, elements = params.find(name)
        if not param.readable:
            raise UsageError(f"{param.name} can only be written ({param.source})", code="write-only")
        for element in elements:
            chosen[(param.name, element.index)] = element
    return list(chosen.values())


def get(run: Run, params: ParamMap[Any], names: Sequence[str]) -> Table:
    """Read the named quantities in as few transactions as the device allows."""
    elements = select(params, names)
    device: MapDevice = run.device()
    table = device.table(device.read(elements))
    table.plain = ("value",)
    return table


def set_values(run: Run, params: ParamMap[Any], texts: Sequence[str]) -> Table:
    """Check, confirm where it moves or strands, write, read back."""
    changes = params.assignments(texts)
    planner = run.planner()
    steps = planner.plan(changes)
    if run.settings.dry_run:
        return run.dry_run(steps)
    if any(step.strands or (step.moves and planner.worn) for step in steps):
        run.confirm(f"{_consequence(steps)}: {', '.join(texts)}", steps)
    device: MapDevice = run.device()
    return device.table(device.write(changes))


def _consequence(steps: Sequence[Step]) -> str:
    words = ["moves the device, which may be worn"] if any(step.moves for step in steps) else []
    words += ["may leave it unreachable"] if any(step.strands for step in steps) else []
    return f"This {' and '.join(words) or 'writes'}"


def describe(params: ParamMap[Any], names: Sequence[str]) -> Table:
    """The map itself; needs no device."""
    wanted = (
        list(dict.fromkeys(params.find(name)[0].name for name in names)) if names else [param.name for param in params]
    )
    return Table(rows=[describe_row(params[name]) for name in wanted], columns=DESCRIBE_COLUMNS)


DESCRIBE_COLUMNS = (
    Column("name", "Name"),
    Column("address", "Address", right=True),
    Column("type", "Type"),
    Column("access", "Access"),
    Column("range", "Range"),
    Column("unit", "Unit"),
    Column("persistent", "Kept"),
    Column("source", "Source"),
    Column("doc", "What it is"),
)


def describe_row(param: Param) -> Row:
    """One parameter of a map as data."""
    return {
        "name": param.name,
        "address": getattr(param, "address", None),
        "type": getattr(param, "type_name", None),
        "elements": list(param.elements),
        "access": "trigger" if param.trigger else param.access,
        "range": param.range_text,
        "unit": param.unit,
        "persistent": param.persistent,
        "moves": param.moves,
        "strands": param.strands,
        "source": param.source,
        "doc": param.doc + (f"; {param.note}" if param.note else ""),
    }


# -- watch --------------------------------------------------------------------------------------------------------


def watch(
    run: Run, params: ParamMap[Any], names: Sequence[str], *, rate: float, count: int | None, duration: float | None
) -> Table:
    """Sample quantities until `count` samples or `duration` seconds, or until Ctrl-C. `rate` 0 = as fast as it goes."""
    from functools import partial

    from handctl.sampling import Sampler

    elements = select(params, names)  # a wrong name is told before the link is opened
    device: MapDevice = run.device()
    elements = elements or select(params, device.live)
    ranges = {
        element.param.name: (float(element.param.low), float(element.param.high))
        for element in elements
        if element.param.low is not None and element.param.high is not None
    }

    def take() -> tuple[list[Row], HandctlError | None]:
        try:
            readings = device.read(elements)
        except (NoAnswer, ProtocolError) as exc:
            readings = [Reading(element, None, b"", exc) for element in elements]
        errors = [reading.error for reading in readings]
        return [device.row(reading) for reading in readings], errors[0] if all(errors) else None

    ask_ahead = getattr(device, "ask_ahead", None)
    sampler = Sampler(
        device.link,
        take,
        rate=rate,
        count=count,
        duration=duration,
        ahead=partial(ask_ahead, elements) if ask_ahead is not None else None,
    )
    return Table(
        columns=device.columns,
        samples=sampler.samples(),
        summary=sampler.summary,
        ranges=ranges,
        decimals={element.param.name: element.param.decimals for element in elements if element.param.decimals},
        flags=frozenset(element.param.name for element in elements if element.param.bits),
    )


# -- snapshot, diff, restore --------------------------------------------------------------------------------------


def settings_of(params: ParamMap[Any]) -> list[Element]:
    """Every read-write quantity except triggers: what a snapshot holds."""
    return [
        element
        for param in params
        if param.writable and param.readable and not param.optional
        for element in elements_of(param)
    ]


def take(device: MapDevice) -> dict[str, Number]:
    """The present value of every setting, by full name. Raises what kept one from being read."""
    readings = device.read(settings_of(device.map))
    for reading in readings:
        if reading.error is not None:
            exc = reading.error
            text = f"not all settings could be read: {reading.element.full_name}: {exc.text}"
            raise type(exc)(text, hint=exc.hint, code=exc.code)
    return {reading.element.full_name: reading.value for reading in readings if reading.value is not None}


def snapshot(run: Run, path: str) -> Table:
    """Write the whole configuration to a file, atomically; the only file that it replaces is an older snapshot of this kind."""
    from handctl import snapshot as files

    files.check_target(path, run.family.kind if run.family is not None else "")
    device: MapDevice = run.device()
    values = take(device)
    content = files.make(device.kind, device.identity(), values, link=run.link_name(), fake=run.simulated)
    files.write(path, content)
    for name, value in values.items():
        try:
            device.map.find(name)[0].check(value, name)
        except UsageError as exc:
            run.journal.warn(
                "out-of-range",
                f"the device holds {exc.text}: `restore` will refuse this file",
                hint=f"`handctl {device.kind} set {name}=…`, then take the snapshot again",
            )
    run.journal.info("written", f"{path}: {len(values)} values of {device.kind}")
    rows = [{"name": name, "value": value} for name, value in values.items()]
    return Table(rows=rows, columns=(Column("name", "Name"), Column("value", "Value", right=True)))


def diff(run: Run, params: ParamMap[Any], a: str, b: str | None) -> Table:
    """Compare two snapshots, or a snapshot with the live device. Exit 7 when they differ."""
    from handctl import snapshot as files

    left = files.load(a, params.kind)["values"]
    if b is not None:
        right = files.load(b, params.kind)["values"]
    else:
        device: MapDevice = run.device()
        device.find_for_restore(left)
        right = take(device)
    names = list(dict.fromkeys([*left, *right]))
    rows: list[Row] = [{"name": n, "a": left.get(n), "b": right.get(n)} for n in names if left.get(n) != right.get(n)]
    table = Table(
        rows=rows, columns=(Column("name", "Name"), Column("a", a, right=True), Column("b", b or "device", right=True))
    )
    if rows:
        hint = f"`handctl {params.kind} restore {a}` writes those of the file" if b is None else ""
        table.failure = CheckFailed(f"{len(rows)} of {len(names)} values differ", hint=hint, code="differ")
    else:
        run.journal.info("equal", f"all {len(names)} values are equal")
    return table


def restore(run: Run, params: ParamMap[Any], path: str, *, check: Check | None = None) -> Table:
    """Write what differs from a snapshot, in an order that keeps the device reachable; read back; say what is left out."""
    from handctl import snapshot as files

    values: dict[str, Number] = files.load(path, params.kind)["values"]
    changes = _checked(params, values, path)
    if check is not None:
        check(changes)
    if run.settings.dry_run:
        run.journal.info("plan", "all values are listed: which of them already hold is only known with the device")
        return run.dry_run(_restore_steps(run.planner(), changes))
    device: MapDevice = run.device()
    device.find_for_restore(values)
    live = take(device)
    differing = [(element, value) for element, value in changes if live.get(element.full_name) != value]
    for text in device.not_covered:
        run.journal.info("not-covered", f"not covered by a snapshot: {text}")
    absent = [element.full_name for element in settings_of(params) if element.full_name not in values]
    if absent:
        run.journal.warn("absent", f"{path} does not hold {', '.join(absent)}; left as they are")
    if not differing:
        run.journal.info("equal", "the device already holds every value of the snapshot; nothing was written")
        return _restored([], live, {})
    run.confirm(_restore_question(differing), _restore_steps(device, differing))
    after: dict[str, Number] = {}
    for group in _restore_groups(differing):
        for reading in device.write(group):
            if reading.value is not None:
                after[reading.element.full_name] = reading.value
    return _restored(differing, live, after)


def _checked(params: ParamMap[Any], values: dict[str, Number], path: str) -> list[tuple[Element, Number]]:
    changes = []
    for name, value in values.items():
        try:
            param, elements = params.find(name)
            param.check(value, name)
        except UsageError as exc:
            raise UsageError(f"{path}: {exc.text}", hint=f"the file does not fit this device. {exc.hint}") from exc
        if len(elements) != 1 or not param.writable:
            raise UsageError(f"{path}: {name} is not a single setting", hint="the file does not fit this device")
        changes.append((elements[0], value))
    return sorted(
        changes,
        key=lambda change: (change[0].param.strands, -getattr(change[0].param, "address", 0) * change[0].param.strands),
    )


def _restore_groups(changes: Sequence[tuple[Element, Number]]) -> list[list[tuple[Element, Number]]]:
    """What concerns the whole device first, then its parts, then one by one what may strand it (its id or speed last)."""
    calm = [change for change in changes if not change[0].param.strands]
    whole = [change for change in calm if not change[0].param.elements]
    parts = [change for change in calm if change[0].param.elements]
    return [group for group in (whole, parts) if group] + [[change] for change in changes if change[0].param.strands]


def _restore_steps(device: MapDevice, changes: Sequence[tuple[Element, Number]]) -> list[Step]:
    return [step for group in _restore_groups(changes) for step in device.plan(group)]


def _restore_question(differing: Sequence[tuple[Element, Number]]) -> str:
    moving = [element.full_name for element, _ in differing if element.param.moves]
    text = f"Restore {len(differing)} values"
    return f"{text}; MOVES the device: {', '.join(moving)}" if moving else text


def _restored(
    differing: Sequence[tuple[Element, Number]], before: dict[str, Number], after: dict[str, Number]
) -> Table:
    rows: list[Row] = [
        {
            "name": element.full_name,
            "before": before.get(element.full_name),
            "value": after.get(element.full_name),
            "moves": element.param.moves,
        }
        for element, _ in differing
    ]
    columns = (
        Column("name", "Name"),
        Column("before", "Before", right=True),
        Column("value", "Now", right=True),
        Column("moves", "Moves"),
    )
    return Table(rows=rows, columns=columns)
