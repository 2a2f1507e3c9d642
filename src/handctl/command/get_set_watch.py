"""get, set, describe and watch, the same for every device with a parameter map.

snapshot, diff and restore are in `snapshots`. What they need of a device is `model.device.Device`; its own peculiarities (an id that answers elsewhere once written) live in its `write`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from handctl.command.run import Asked, PlannedAction
from handctl.errors import CheckFailed, HandctlError, Hint, NoAnswer, ProtocolError, UsageError, joined
from handctl.model.device import pending_table, question
from handctl.model.param import PUSHES, SETTING, Changes, Element, Number, Param, ParamMap, Reading, Step, ValueChange
from handctl.model.result import Column, Grid, Journal, Row, Sample, Table

if TYPE_CHECKING:
    from handctl.command.run import Run
    from handctl.model.device import Device
    from handctl.model.reading_limits import Bound, Named


@lru_cache(256)
def select(params: ParamMap[Any], names: tuple[str, ...]) -> Sequence[Element]:
    """Readable elements by name, in the order asked, each once. Raises UsageError."""
    chosen: dict[str, Element] = {}
    for name in names:
        param, elements = params.find(name)
        if not param.readable:
            raise UsageError(
                f"{param.name} can only be written ({param.source})",
                hint=Hint("{} lists the readable quantities", f"{params.kind} describe"),
                code="write-only",
            )
        for element in elements:
            chosen[element.path] = element
    return list(chosen.values())


def meant(run: Run, params: ParamMap[Any], names: Sequence[str]) -> ParamMap[Any]:
    """The map in which `names` are looked up: `params`, unless one of them is known only to another kind of device of this family.

    Then the device is asked which kind it is. A dry run asks nobody.
    """
    unknown = [name for name in names if not _knows(params, name)]
    others = run.family.other_maps(run.settings)
    if run.settings.dry_run or not unknown or not any(all(_knows(other, name) for name in unknown) for other in others):
        return params
    device: Device = run.device()
    return device.own_map()


@lru_cache(256)
def _knows(params: ParamMap[Any], name: str) -> bool:
    try:
        params.find(name)
    except UsageError:
        return False
    return True


def get(run: Run, params: ParamMap[Any], names: tuple[str, ...], limits: Sequence[str] = ()) -> Table:
    """Read the named quantities in as few transactions as the device allows."""
    params = run.mapped(params)
    bounds = bounds_of(run, params, limits)
    try:
        elements = select(params, names)
    except UsageError:  # perhaps known to another kind of device of this family
        elements = select(meant(run, params, names), names)
    device: Device = run.device()
    table = device.table(device.read(device.of_this_device(elements)))
    table.plain = ("value",)
    return within(bounds, table)


Change = tuple[Element, Number]


def set_values(run: Run, params: ParamMap[Any], texts: Sequence[str], *, always: bool = False) -> PlannedAction:
    """Check, look what is there already, confirm where it moves or strands, write, read back."""
    changes = params.assignments(texts)
    planner = run.planner()
    steps = planner.plan(changes)
    asks, these = _asks(planner, steps), Unequal(run, changes, always)
    tell_listed(run, changes, always)

    def look(device: Device) -> Asked:
        wanted = these.look(device, _places(device, changes).values() if asks and run.asks else ())
        steps = device.plan(wanted)
        if _asks(device, steps):
            return Asked(_consequence(steps), steps, _from_to(device, wanted, these.held))
        return Asked()

    def write(device: Device) -> Table:
        ask_released(run, device, these.wanted, device.plan(these.wanted))
        return these.written(device)

    return PlannedAction(steps, write, f"{_consequence(steps)}: {', '.join(texts)}" if asks else "", look=look)


def tell_listed(run: Run, changes: Sequence[Change], always: bool) -> None:
    """Of a dry run: that it lists what the device may hold already."""
    if run.settings.dry_run and not (always or all(_acts(element) for element, _ in changes)):
        from handctl.command.snapshots import tell_all_listed

        tell_all_listed(run)


def _asks(device: Device, steps: Sequence[Step]) -> bool:
    return any(step.strands or (step.moves and device.worn) for step in steps)


Held = dict[str, Reading]
"""What a device holds, by path."""


class Unequal:
    """The changes of a `set`. A setting that is there already is not written, unless `always`.

    What moves or commands is written whatever the device holds: a set point that is equal does not mean that the axis is there.
    """

    def __init__(self, run: Run, changes: Sequence[Change], always: bool) -> None:
        self._run, self._changes, self._always = run, changes, always
        self.held: Held = {}
        self.wanted = list(changes)

    def look(self, device: Device, further: Iterable[Element] = ()) -> list[Change]:
        """Those that are to be written, from one read, of `further` elements too."""
        device.identify()
        elements = dict.fromkeys((*(element for element, _ in self._changes if element.param.readable), *further))
        self.held = {reading.element.path: reading for reading in device.read(list(elements))}
        self.wanted = [change for change in self._changes if self._always or not self._there(*change)]
        ledger = self._run.ledger
        ledger.forget()  # what was planned before the device was known
        ledger.plan(device.plan(self.wanted))
        if equal := [element for element, value in self._changes if (element, value) not in self.wanted]:
            partly = {element.param.name for element, _ in self.wanted}
            names = dict.fromkeys(one.full_name if one.param.name in partly else one.param.name for one in equal)
            hint = "" if self.wanted else "--always writes it anyway"
            self._run.journal.info("equal", f"already set, so not written: {', '.join(names)}", hint)
        return self.wanted

    def _there(self, element: Element, value: Number) -> bool:
        reading = self.held.get(element.path)
        return not _acts(element) and reading is not None and reading.error is None and reading.value == value

    def written(self, device: Device) -> Table:
        """Write them, read them back, and show all changes with what was there before.

        `changed` is true where the value is another one, and of what acts whenever it is written.
        """
        now = {reading.element.path: reading for reading in (device.write(self.wanted) if self.wanted else ())}
        table = device.table([now.get(element.path) or self.held[element.path] for element, _ in self._changes])
        for row, (element, _) in zip(table.rows, self._changes, strict=True):
            before = self.held[element.path].value if element.path in self.held else None
            row |= {"before": before, "changed": element.path in now and (_acts(element) or before != row.get("value"))}
        table.plain = table.plain or tuple(column.key for column in table.columns)
        table.columns = (*table.columns, Column("before", "Before", right=True), Column("changed", "Changed"))
        return table


def _acts(element: Element) -> bool:
    return element.param.kind != SETTING or element.param.moves


def going(run: Run, device: Device, changes: Sequence[Change], what: str = "Setting") -> Changes:
    """The table of a question: what is set, from and to. It is read only where somebody will see it."""
    held: Held = {}
    if run.asks:
        device.identify()
        begins = [one for one in _places(device, changes).values() if one.param.readable]
        held = {reading.element.path: reading for reading in device.read(begins)}
    return _from_to(device, changes, held, what)


def _places(device: Device, changes: Sequence[Change]) -> dict[str, Element]:
    """Where each begins: a set point where its axis is, as far as the device can tell; by path."""
    places = {course.target: device.map[course.actual] for course in device.setpoint_pairs}
    return {one.path: Element(places.get(one.param.name, one.param), one.index) for one, _ in changes}


def _from_to(device: Device, changes: Sequence[Change], held: Held, what: str = "Setting") -> Changes:
    """The lines of that table. With another word than "Setting" a line has the part alone."""
    begins = {path: held.get(one.path) for path, one in _places(device, changes).items()}
    now = {path: reading.value for path, reading in begins.items() if reading is not None}
    units = {element.param.unit for element, _ in changes}
    rows = [
        ValueChange((what != "Setting" and one.part) or one.full_name, now.get(one.path), value)
        for one, value in changes
    ]
    return Changes(what, (len(units) == 1 and units.pop()) or "", rows)


def ask_released(run: Run, device: Device, changes: Sequence[Change], steps: Sequence[Step]) -> None:
    """Ask before a write that lets the device go on to targets that it holds. Raises NotConfirmed; nothing was written."""
    if waiting := device.lets_go(changes):
        moving = [step._replace(moves=True) for step in steps]
        run.confirm(question(waiting), moving, changes=pending_table(waiting))
        device.will_move()


def _consequence(steps: Sequence[Step]) -> str:
    words = ["moves a device that someone may be wearing"] if any(step.moves for step in steps) else []
    words += ["may leave it unreachable"] if any(step.strands for step in steps) else []
    return f"This {' and '.join(words) or 'writes'}"


def describe(params: ParamMap[Any], names: Sequence[str]) -> Table:
    """The map itself; needs no device."""
    found = [params.find(name)[0] for name in names] if names else params.every
    wanted = {param.path: param for param in found}.values()
    table = Table(rows=[describe_row(param, params.kind) for param in wanted], columns=DESCRIBE_COLUMNS)
    if names:
        table.view = described
    return table


def described(rows: list[Row]) -> list[Grid]:
    """The quantities, then what the bits and codes of each mean and what to do."""
    from handctl.screen.render import default_view

    keys = ("name", "meaning", "next")
    lines = [tuple(str(one[key]) for key in keys) for row in rows for one in row["remedies"]]
    grids = default_view(Table(rows=rows, columns=DESCRIBE_COLUMNS))
    return [*grids, Grid(("Bit or code", "Meaning", "Next step"), tuple(lines))] if lines else grids


DESCRIBE_COLUMNS = (
    Column("name", "Name"),
    Column("address", "Address", right=True),
    Column("type", "Type"),
    Column("access", "Access"),
    Column("kind", "Kind"),
    Column("range", "Range"),
    Column("unit", "Unit"),
    Column("persistent", "Kept"),
    Column("source", "Source"),
    Column("doc", "What it is"),
)


def describe_row(param: Param, kind: str) -> Row:
    """One parameter of a map as data."""
    from handctl.model.device_picture import remedies_of

    table = remedies_of(kind) if param.alarms or param.choices else {}
    words = [*param.alarms.values(), *param.choices.values()]
    return {
        "name": param.name,
        "address": getattr(param, "place", getattr(param, "address", None)),  # as the manual counts
        "type": getattr(param, "type_name", None),
        "elements": list(param.elements),
        "access": "trigger" if param.trigger else param.access,
        "kind": param.kind,
        "range": param.range_text,
        "unit": param.unit,
        "persistent": param.persistent,
        "moves": param.moves,
        "pushes": param.acts == PUSHES,
        "strands": param.strands,
        "source": param.source,
        "doc": param.doc + (f"; {param.note}" if param.note else ""),
        "remedies": [
            {"name": word, "meaning": table[word].meaning, "next": table[word].step, "source": table[word].source}
            for word in words
            if word in table
        ],
    }


# -- the picture of status -----------------------------------------------------------------------------------------


def picture(kind: str, by: str) -> Callable[[list[Row]], list[Grid]]:
    """How rows are seen as the outline of a family; `by` "" = its usual colours. Raises UsageError for what it has not."""
    from handctl.model.device_picture import outline_grid, outline_of

    outline = outline_of(kind)
    if outline is None:
        raise UsageError(f"{kind} has no picture", hint="leave out --picture", code="no-picture")
    if by and by not in outline.measures:
        text = f"{kind} has no {by!r} to draw"
        raise UsageError(text, hint=f"use {' or '.join(outline.measures)}. Nothing was sent.", code="no-picture")
    return lambda rows: [outline_grid(outline, by or next(iter(outline.measures)), rows)]


# -- watch --------------------------------------------------------------------------------------------------------

BESIDE_COLUMNS = 60
"""A narrower window has no room for what the device shows beside."""
SLOWLY_SECONDS = 1.0
"""Between two reads of what the live view reads slowly."""
SLOWLY_FAILED_SECONDS = 10.0
"""The same after a read that failed: waiting for it holds the view up."""


def watch(
    run: Run,
    params: ParamMap[Any],
    names: tuple[str, ...],
    *,
    rate: float,
    count: int | None,
    duration: float | None,
    seen: bool = False,
) -> Table:
    """Sample quantities until `count` samples or `duration` seconds, or until Ctrl-C. `rate` 0 = as fast as it goes.

    `seen`: a person looks at the live view, and sees what the device shows beside. That may fail.
    """

    from handctl.model.sampling import Sampler

    params = meant(run, params, names)
    elements = select(params, names)  # a wrong name is told before the link is opened
    device: Device = run.device()
    more, slowly = (
        select(params, names) if seen and not elements and names else () for names in (device.additional, device.slowly)
    )
    elements = device.of_this_device(elements or select(params, device.live))
    ranges = {
        element.param.name: (float(element.param.low), float(element.param.high))
        for element in elements
        if element.param.low is not None and element.param.high is not None
    }

    device.ready()
    unread: dict[str, HandctlError | None] = dict.fromkeys(one.path for one in elements)  # never read so far, and why

    turn = device.link.now()

    def read() -> tuple[Callable[[], list[Row]], HandctlError | None]:
        nonlocal turn
        late = slowly if slowly and device.link.now() >= turn else []
        wanted = [*elements, *more, *late]
        try:
            readings = device.read(wanted)
        except (NoAnswer, ProtocolError) as exc:
            readings = [Reading(element, None, b"", exc) for element in wanted]
        if late:
            turn = device.link.now() + (SLOWLY_FAILED_SECONDS if readings[-1].error else SLOWLY_SECONDS)
        errors = [reading.error for reading in readings[: len(elements)]]
        for reading in readings if unread else ():
            if reading.error is None:
                unread.pop(reading.element.path, None)
            elif reading.element.path in unread:
                unread[reading.element.path] = reading.error
        return lambda: [device.row(reading) for reading in readings], errors[0] if all(errors) else None

    ask_ahead = getattr(device, "ask_ahead", None)
    sampler = Sampler(
        device.link,
        read,
        rate=rate,
        count=count,
        duration=duration,
        ahead=ask_ahead(elements) if ask_ahead is not None else None,
    )
    table = Table(
        columns=device.columns,
        samples=_all_read(sampler.samples(), unread),
        summary=sampler.summary,
        ranges=ranges,
        scales=device.scales,
        decimals={e.param.name: e.param.decimals for e in (*elements, *more, *slowly) if e.param.decimals},
        flags=frozenset(element.param.name for element in elements if element.param.bits),
    )
    if seen:
        from handctl.model.device_picture import highest_of, remedies_of

        table.remedies, table.highest = remedies_of(params.kind), highest_of(params.kind)
    return table


class Bounds:
    """What a person set for one command: `limits` decide the exit code, and `until` where it ends."""

    def __init__(self, limits: Sequence[Bound], until: Sequence[Bound], where: str, journal: Journal) -> None:
        self.limits = tuple(limits)
        from handctl.model.reading_limits import Watchdog

        self._dog, self._end = Watchdog(limits), Watchdog(until)
        self._where, self._journal = where, journal

    def over(self, rows: Iterable[Row], t: float | None = None) -> bool:
        """Take the rows of a moment, as in `Watchdog.look`; whether they are the last ones."""
        rows = list(rows)
        self._dog.look(rows, t)
        if over := self._end.look(rows, t):
            self._journal.info("until", f"ended by --until: {'; '.join(self._end.findings())}")
        return over

    def failure(self) -> CheckFailed | None:
        """See `Watchdog`."""
        return self._dog.failure(self._where)

    def kept(self, table: Table) -> Table:
        """The table, or the stream, with an end where `until` is passed, and exit 7 where one of `limits` is."""
        if table.samples is None:
            self.over(table.rows)
            table.failure = table.failure or self.failure()
            return table
        samples = table.samples

        def looked() -> Iterator[Sample]:
            try:
                for sample in samples:
                    over = self.over(sample.rows, sample.t)
                    yield sample
                    if over:
                        break
            finally:
                if close := getattr(samples, "close", None):
                    close()  # so that a device is left
                table.failure = table.failure or self.failure()

        table.samples = looked()
        table.bounds = self.limits
        return table


def bounds_of(
    run: Run, named: ParamMap[Any] | Named, limits: Sequence[str], until: Sequence[str] = ()
) -> Bounds | None:
    """What --limit and --until give, None where neither is there. Raises UsageError, before anything is read for the command."""
    if not (limits or until):
        return None
    from handctl.model.reading_limits import bound_in

    if isinstance(named, ParamMap):
        params = meant(run, named, [text.partition("=")[0].strip() for text in (*limits, *until)])
        named = lambda name: [element.path for element in select(params, (name,))]  # noqa: E731
    kept = [bound_in(text, named, "--limit") for text in limits], [bound_in(text, named, "--until") for text in until]
    return Bounds(*kept, run.link_name(), run.journal)


def within(bounds: Bounds | None, table: Table) -> Table:
    """The table, compared with the bounds."""
    return table if bounds is None else bounds.kept(table)


def _all_read(samples: Iterator[Sample], unread: dict[str, HandctlError | None]) -> Iterator[Sample]:
    """The samples; then raise what kept quantities from being read in any of them, as `get` would end."""
    yield from samples
    errors = {error.text: error for error in unread.values() if error is not None}
    if errors:
        first, *more = errors.values()
        if more:
            first.text = joined(first.text, f"{len(more)} more could not be read either")
        raise first
