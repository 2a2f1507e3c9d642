"""The verbs that mean the same for every device, over its parameter map: one implementation, not five.

snapshot, diff and restore are in `stored`. What they need of a device is `model.device.Device`; its own peculiarities (an id that answers elsewhere once written) live in its `write`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from handctl.errors import HandctlError, NoAnswer, ProtocolError, UsageError, joined
from handctl.model.device import pending, question, released
from handctl.model.param import PUSHES, Changes, Element, FromTo, Number, Param, ParamMap, Reading, Step
from handctl.model.result import Column, Grid, Row, Sample, Table

if TYPE_CHECKING:
    from handctl.frame.run import Run
    from handctl.model.device import Device


def select(params: ParamMap[Any], names: Sequence[str]) -> list[Element]:
    """Readable elements by name, in the order asked, each once. Raises UsageError."""
    chosen: dict[str, Element] = {}
    for name in names:
        param, elements = params.find(name)
        if not param.readable:
            raise UsageError(
                f"{param.name} can only be written ({param.source})",
                hint=f"`handctl {params.kind} describe` lists the readable quantities",
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
    family = run.family
    others = family.other_maps(run.settings) if family is not None and family.other_maps is not None else ()
    if run.settings.dry_run or not unknown or not any(all(_knows(other, name) for name in unknown) for other in others):
        return params
    device: Device = run.device()
    return device.own_map()


def _knows(params: ParamMap[Any], name: str) -> bool:
    try:
        params.find(name)
    except UsageError:
        return False
    return True


def get(run: Run, params: ParamMap[Any], names: Sequence[str]) -> Table:
    """Read the named quantities in as few transactions as the device allows."""
    elements = select(meant(run, params, names), names)
    device: Device = run.device()
    table = device.table(device.read(device.here(elements)))
    table.plain = ("value",)
    return table


def set_values(run: Run, params: ParamMap[Any], texts: Sequence[str]) -> Table:
    """Check, confirm where it moves or strands, write, read back."""
    changes = params.assignments(texts)
    planner = run.planner()
    steps = planner.plan(changes)
    if (plan := run.planned(steps)) is not None:
        return plan
    asks = any(step.strands or (step.moves and planner.worn) for step in steps)
    if asks:
        run.need_answer(f"{_consequence(steps)}: {', '.join(texts)}")
    device: Device = run.device()
    if asks:
        run.confirm(_consequence(steps), steps, changes=going(run, device, changes))
    ask_released(run, device, changes, steps)
    return device.table(device.write(changes))


def going(run: Run, device: Device, changes: Sequence[tuple[Element, Number]], what: str = "Setting") -> Changes:
    """The table of a question: what is set, from and to. It is read only where somebody will see it.

    A set point begins where its axis is, as far as the device can tell. With another word than "Setting" a line has the part alone.
    """
    now: dict[str, Number | None] = {}
    if run.asks:
        device.identify()
        places = {course.target: device.map[course.actual] for course in device.courses}
        begins = {one.path: Element(places.get(one.param.name, one.param), one.index) for one, _ in changes}
        read = device.read([one for one in begins.values() if one.param.readable])
        found = {reading.element.path: reading.value for reading in read}
        now = {path: found.get(one.path) for path, one in begins.items()}
    units = {element.param.unit for element, _ in changes}
    rows = [
        FromTo((what != "Setting" and one.part) or one.full_name, now.get(one.path), value) for one, value in changes
    ]
    return Changes(what, (len(units) == 1 and units.pop()) or "", rows)


def ask_released(run: Run, device: Device, changes: Sequence[tuple[Element, Number]], steps: Sequence[Step]) -> None:
    """Ask before a write that lets the device go on to targets that it holds. Raises NotConfirmed; nothing was written."""
    names = {element.param.name for element, _ in changes}
    if not any(release.by in names for release in device.releases):
        return
    device.identify()
    if waiting := released(device, changes):
        moving = [step._replace(moves=True) for step in steps]
        run.confirm(question(waiting), moving, changes=pending(waiting))
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
    from handctl.model.remedy import remedies_of

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
    from handctl.model.outline import drawn, outline_of

    outline = outline_of(kind)
    if outline is None:
        raise UsageError(f"{kind} has no picture", hint="leave out --picture", code="no-picture")
    if by and by not in outline.measures:
        text = f"{kind} has no {by!r} to draw"
        raise UsageError(text, hint=f"use {' or '.join(outline.measures)}. Nothing was sent.", code="no-picture")
    return lambda rows: [drawn(outline, by or next(iter(outline.measures)), rows)]


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
    names: Sequence[str],
    *,
    rate: float,
    count: int | None,
    duration: float | None,
    seen: bool = False,
) -> Table:
    """Sample quantities until `count` samples or `duration` seconds, or until Ctrl-C. `rate` 0 = as fast as it goes.

    `seen`: a person looks at the live view, and sees what the device shows beside. That may fail.
    """
    from functools import partial

    from handctl.model.remedy import remedies_of
    from handctl.model.sampling import Sampler

    params = meant(run, params, names)
    elements = select(params, names)  # a wrong name is told before the link is opened
    device: Device = run.device()
    more, slowly = (
        select(params, names) if seen and not elements and names else [] for names in (device.beside, device.slowly)
    )
    elements = device.here(elements or select(params, device.live))
    ranges = dict(device.scales) | {
        element.param.name: (float(element.param.low), float(element.param.high))
        for element in elements
        if element.param.low is not None and element.param.high is not None
    }

    unread: dict[str, HandctlError | None] = dict.fromkeys(one.path for one in elements)  # never read so far, and why

    turn = device.link.now()

    def read() -> tuple[list[Row], HandctlError | None]:
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
        return [device.row(reading) for reading in readings], errors[0] if all(errors) else None

    ask_ahead = getattr(device, "ask_ahead", None)
    sampler = Sampler(
        device.link,
        read,
        rate=rate,
        count=count,
        duration=duration,
        ahead=partial(ask_ahead, elements) if ask_ahead is not None else None,
    )
    return Table(
        columns=device.columns,
        samples=_all_read(sampler.samples(), unread),
        summary=sampler.summary,
        ranges=ranges,
        decimals={e.param.name: e.param.decimals for e in (*elements, *more, *slowly) if e.param.decimals},
        remedies=remedies_of(params.kind) if seen else {},
        flags=frozenset(element.param.name for element in elements if element.param.bits),
    )


def bounded(
    run: Run, params: ParamMap[Any], read: Callable[[], Table], limits: Sequence[str], until: Sequence[str] = ()
) -> Table:
    """What `read` returns, compared with the bounds that --limit and --until give. Raises UsageError before anything is read."""
    if not (limits or until):
        return read()
    from handctl.model.bound import bounds_in, within

    kept = bounds_in(limits, params, "--limit"), bounds_in(until, params, "--until")
    return within(read(), *kept, run.link_name(), run.journal)


def _all_read(samples: Iterator[Sample], unread: dict[str, HandctlError | None]) -> Iterator[Sample]:
    """The samples; then raise what kept quantities from being read in any of them, as `get` would end."""
    yield from samples
    errors = {error.text: error for error in unread.values() if error is not None}
    if errors:
        first, *more = errors.values()
        if more:
            first.text = joined(first.text, f"{len(more)} more could not be read either")
        raise first
