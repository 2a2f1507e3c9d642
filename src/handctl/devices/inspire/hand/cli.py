"""`handctl hand …`: how an RH56 hand is opened, and its commands.

Each body key_checks its arguments, asks a device, returns a Table.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from shutil import get_terminal_size
from typing import TYPE_CHECKING, Any

import click

from handctl.command.command_tree import Group
from handctl.command.common_commands import add_map_verbs
from handctl.command.expect import expect, expected
from handctl.command.family import Family
from handctl.command.get_set_watch import Unequal, ask_released, bounds_of, tell_listed, within
from handctl.command.options import ALWAYS, BOUNDS, COMMAND_LINE, NEGATIVE_NUMBERS, SECONDS, streaming
from handctl.command.run import Asked, PlannedAction, Run
from handctl.devices.inspire import common_cli as verbs
from handctl.devices.inspire.hand.detect_generation import ModelGate
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.hand.model_and_protocol import (
    asks_rtu,
    check_model_and_port,
    map_of,
    other_maps,
    over_tcp,
    protocol_of,
    simulator_options,
    typed_model,
)
from handctl.devices.inspire.hand.register_map import BYTE_MAP, DG2, HAND_BAUD_RATES
from handctl.devices.inspire.register_bus import POWER_OFF, RegisterBus
from handctl.devices.inspire.register_map import ALONE, address_in
from handctl.errors import Hint, UsageError
from handctl.families import FAMILIES
from handctl.link import ByteLink, FrameLink
from handctl.model.command_settings import Settings
from handctl.model.device import limits_of
from handctl.model.param import COMMAND, Element, Number, Step, given
from handctl.model.result import Column, Journal, Row, Table
from handctl.system.user_folders import config_path

if TYPE_CHECKING:
    from handctl.command.config_file import Config
    from handctl.devices.inspire.hand.pairing import Paired


def open_hand(link: ByteLink | FrameLink, settings: Settings, journal: Journal) -> Hand:
    """An RH56 hand behind `link`, on the wire that LINK and --protocol name."""
    gate = ModelGate(typed_model(settings), settings.assume_identity)
    bus, *others = _wires(link, settings, journal)
    for one in (bus, *others):
        one.gate = gate
        one.across_gaps = settings.own.get("across_gaps") != "no"
    return Hand(bus, gate, *others, side=settings.own.get("side") or "")


def _wires(link: ByteLink | FrameLink, settings: Settings, journal: Journal) -> list[RegisterBus]:
    """The wire, and behind EB90 the one that is asked where it is silent."""
    number, limits = settings.id if settings.id is not None else 1, limits_of(settings, link)
    if isinstance(link, FrameLink):
        from handctl.devices.inspire.can_bus import CanBus

        return [CanBus(link, number, journal, family="hand", **limits)]
    from handctl.devices.inspire.modbus_bus import ModbusBus

    protocol = protocol_of(settings)
    modbus = ModbusBus(link, number, journal, tcp=over_tcp(settings), **limits)
    if modbus.tcp or protocol == "modbus":
        return [modbus]
    from handctl.devices.inspire.serial_bus import SerialBus

    line = SerialBus(link, number, journal, family="hand", **limits)
    return [line, modbus] if protocol == "auto" and asks_rtu(link) else [line]


cli = Group(
    "hand",
    family=Family(
        "hand",
        open_hand,
        115200,
        verbs.explain_silence,
        wires=("serial", "can", "modbus-tcp"),
        tcp_port=FAMILIES["hand"].tcp_port,
        ids=True,
        check=check_model_and_port,
        map_of=map_of,
        other_maps=other_maps,
        simulated=simulator_options,
        speeds=tuple(HAND_BAUD_RATES.values()),
    ),
    first=("angle", "position", "speed", "force", "clear-errors", "calibrate", "scan"),
    help="Inspire RH56 dexterous hands, over RS-232, RS-485, CAN or Modbus. For Modbus TCP use -p tcp://HOST. "
    "A hand closes in less than a second. Commands that move it or change it permanently ask first.",
)

add_map_verbs(cli, BYTE_MAP, part="FINGER", example="angle_actual.index temperature", without=("set",))


@cli.verb("set", "Settings", writes=True, asks="(for an angle or a stroke); (for anything else)")
@click.argument("assignments", nargs=-1, required=True, metavar="NAME[.FINGER]=VALUE...")
@ALWAYS
def set_(run: Run, assignments: tuple[str, ...], always: bool = False) -> PlannedAction:
    """Write values by name and read them back. Example: `speed_set.index=300 force_limit.index=500`."""
    return write_asked(run, map_of(run.settings).assignments(assignments), always=always)


# -- what moves it ------------------------------------------------------------------------------------------------

FINGERS = "LITTLE RING MIDDLE INDEX THUMB ROTATION | FINGER=VALUE..."
WAIT = click.option(
    "--wait",
    type=SECONDS,
    metavar="S",
    help="Wait up to S seconds for the fingers to stop moving. Ctrl-C sets their speed to 0.",
)


@cli.verb("angle", "Move", writes=True, asks=True, context_settings=NEGATIVE_NUMBERS)
@click.argument("values", nargs=-1, required=True, metavar=FINGERS)
@WAIT
@expect
def angle(run: Run, values: tuple[str, ...], wait: float | None, expect: str | None) -> PlannedAction:
    """Command angles from 0 (closed) to 1000 (open). Asks first.

    An RH56F1 or RH5DG2 takes angles in 0.1 degrees instead.

    Give a value for every finger (an RH5DG2 has 13, m1 to m13), where -1 leaves it as it is,
    or name individual fingers: `angle ring=500 index=300`.
    The prompt shows the present speed and force limit. Change them with `speed` and `force`.
    """
    return write_asked(run, _changes(run, "angle_set", values), wait, expect)


@cli.verb("position", "Move", writes=True, asks=True, context_settings=NEGATIVE_NUMBERS)
@click.argument("values", nargs=-1, required=True, metavar=FINGERS)
@WAIT
@expect
def position(run: Run, values: tuple[str, ...], wait: float | None, expect: str | None) -> PlannedAction:
    """Command strokes from 0 (open) to 2000 (closed). Asks first.

    Give a value for every finger (an RH5DG2 has 13, m1 to m13), where -1 leaves it as it is,
    or name individual fingers: `position ring=900`.
    The manufacturer recommends `angle` instead.
    """
    return write_asked(run, _changes(run, "stroke_set", values), wait, expect)


@cli.verb("force", "Move", writes=True, context_settings=NEGATIVE_NUMBERS)
@click.argument("values", nargs=-1, required=True, metavar=FINGERS)
def force(run: Run, values: tuple[str, ...]) -> PlannedAction:
    """Set the force limit in grams. Asks first if a finger may move.

    Give a value for every finger (an RH5DG2 has 13, m1 to m13), where -1 leaves it as it is,
    or name individual fingers: `force index=300`.
    A closing finger stops when it reaches the limit. It does not hold that force.
    The limit applies from the next movement on. With a higher limit, a finger that stopped may continue to its target.
    """
    return write_asked(run, _changes(run, "force_limit", values))


@cli.verb("speed", "Move", writes=True, context_settings=NEGATIVE_NUMBERS)
@click.argument("values", nargs=-1, required=True, metavar=FINGERS)
def speed(run: Run, values: tuple[str, ...]) -> PlannedAction:
    """Set the speed of all movements from now on, 0 to 1000. Asks first if a finger may move.

    The hand keeps it until you set another speed or switch the power off.

    Give a value for every finger (an RH5DG2 has 13, m1 to m13), where -1 leaves it as it is,
    or name individual fingers: `speed index=300`.
    At 1000 a finger closes in less than a second. Speed 0 stops a finger, which keeps moving a little before it stops.
    With a new speed, a finger that was stopped continues to its target.
    """
    changes = _changes(run, "speed_set", values)
    table = write_asked(run, changes)
    if any(value == 0 for _, value in changes) and not run.settings.dry_run:
        run.journal.warn(
            "speed-0",
            "a finger with speed 0 does not move again until you set another speed",
            hint="speed 0 does not replace the power switch",
        )
    return table


@cli.verb("calibrate", "Service", writes=True, asks=True)
def calibrate(run: Run) -> PlannedAction:
    """Calibrate the force sensors. The whole hand moves for about 6 s.

    Ctrl-C does not stop the hand. To stop it, switch its power off.
    The hand must be open and empty, with nothing touching it.
    """
    from handctl.devices.inspire.hand import calibration, motion

    def steps(hand: Hand) -> list[Step]:
        return [hand.trigger_step("calibrate_force", "calibrate the force sensors")]

    def look(hand: Hand) -> Asked:
        motion.fit_to_move(hand)
        return Asked(question, steps(hand))

    question = f"{POWER_OFF} The whole hand opens and closes. It must be open and empty"
    return PlannedAction(
        steps(run.planner()), lambda hand: calibration.calibrate(hand, run.prompts), question, look=look
    )


def _changes(run: Run, name: str, texts: Sequence[str]) -> list[tuple[Element, Number]]:
    """What is typed for the fingers of the generation that is meant. Raises UsageError."""
    register = map_of(run.settings)[name]
    more = "" if typed_model(run.settings) == DG2 else ". An RH5DG2 has 13: add --model dg2"
    found = given(texts, register.elements, what=run.command, more=f". -1 leaves one as it is{more}")
    elements = [Element(register, index) for index in found]
    return [
        (element, register.parse(text, element.full_name))
        for element, text in zip(elements, found.values(), strict=True)
    ]


def write_asked(
    run: Run,
    every: Sequence[tuple[Element, Number]],
    wait: float | None = None,
    expect: str | None = None,
    always: bool | None = None,
) -> PlannedAction:
    """Write what was checked, and read it back. What moves the hand is shown with speed and force limit, and asked.

    With `always` it is a `set`: see `command.get_set_watch.Unequal`.
    """
    from handctl.devices.inspire.hand import motion

    ending = expected(expect, waits=wait is not None)
    changes = every = _without_left(every)
    planner: Hand = run.planner()
    steps = planner.plan(changes)
    before: motion.Before | None = None
    asks = any(step.moves or step.strands for step in steps)
    only = None if always is None else Unequal(run, every, always)
    if always is not None:
        tell_listed(run, every, always)

    def look(hand: Hand) -> Asked:
        nonlocal before, changes
        hand.identify()
        if only is not None:
            changes = only.look(hand)
        steps = hand.plan(changes)
        if any(step.moves for step in steps):
            before = motion.fit_to_move(hand)
            question, shown = motion.question(hand, changes, before)
            return Asked(question, steps, shown)
        if any(step.strands for step in steps):
            return Asked(_consequence(steps), steps)
        ask_released(run, hand, changes, steps)
        return Asked()

    def act(hand: Hand) -> Table:
        if wait is not None:
            name = changes[0][0].param.name
            return motion.move(hand, name, changes, run.prompts, wait=wait, expect=ending, before=before)
        table = hand.table(hand.write(changes)) if only is None else only.written(hand)
        if before is not None:
            motion.tell_no_speed(hand, changes, before)
        return table

    return PlannedAction(steps, act, _consequence(steps) if asks else "", look=look)


def _consequence(steps: Sequence[Step]) -> str:
    what = "; ".join(step.meaning for step in steps)
    return f"This moves the hand: {what}" if any(step.moves for step in steps) else f"This changes the hand: {what}"


def _without_left(changes: Sequence[tuple[Element, Number]]) -> list[tuple[Element, Number]]:
    """Without the fingers that are left as they are: nothing is written for them (rh56 §9)."""
    wanted = [(element, value) for element, value in changes if element.param.kind != COMMAND or value != ALONE]
    if not wanted:
        raise UsageError(
            "all values are -1, so every finger stays as it is", hint="give at least one value. Nothing was sent."
        )
    return wanted


# -- what it keeps ------------------------------------------------------------------------------------------------


@cli.verb("id", "Settings", writes=True, asks=True)
@click.argument("new", required=False, type=int)
def id_(run: Run, new: int | None) -> Table | PlannedAction:
    """Show the id, or give the hand a NEW one (1 to 254).

    A new id is active at once, and `save` makes it permanent. Connect only one hand. Modbus calls the id the unit.
    """
    return verbs.change_id(run, map_of(run.settings), new)


@cli.verb("baud", "Settings", writes=True, asks=True)
@verbs.RATE
def baud(run: Run, rate: int | None, save_too: bool, verify: bool) -> Table | PlannedAction:
    """Show the baud rate code, or set a new RATE in bit/s.

    A serial hand takes 115200, 57600 or 19200, and some take 921600. On CAN it is 1000000 or 500000.
    The new rate takes effect after `save` and a power-cycle.
    """
    question = f"After a save and a power-cycle the hand uses {rate} bit/s only"
    return verbs.change_baud(run, rate, question, save=save_too, verify=verify)


cli.verb("clear-errors", "Service", writes=True)(verbs.clear_errors)


@cli.verb("save", "Settings", writes=True, asks=True)
def save(run: Run) -> PlannedAction:
    """Save the present settings to flash and wait for the result (about 1 s)."""
    return verbs.save(run, "This saves the present settings to flash")


@cli.verb("factory-reset", "Settings", writes=True, asks=True)
@verbs.backup_option(help=verbs.BACKUP_HELP.format("hand"))
def factory_reset(run: Run, backup: str | None) -> PlannedAction:
    """Restore the factory defaults, after a snapshot of the present settings.

    This may set the id to 1, the baud rate to 115200 bit/s and the network address to 192.168.11.210.
    """
    return verbs.factory_reset(run, "factory reset", "This restores the factory defaults permanently", backup)


# -- by number ----------------------------------------------------------------------------------------------------


@cli.verb("read", "Service")
@verbs.SPAN
def read(run: Run, address: str, count: int) -> Table:
    """Read COUNT bytes (1 to 252) from any ADDRESS. Registers from the manual are decoded.

    On an RH56F1 or RH5DG2 each address holds a word of two bytes.
    """
    return verbs.read(run, address, count)


@cli.verb("write", "Service", writes=True, asks=True)
@verbs.BYTES
@verbs.UNDOCUMENTED
def write(run: Run, address: str, data: str, undocumented: bool) -> PlannedAction:
    """Write bytes to ADDRESS, low byte first, and read them back. Asks first.

    The values are checked against the documented ranges before anything is sent."""
    from handctl.devices.inspire import raw as by_number
    from handctl.devices.inspire.hand import raw as hand_raw

    payload, planner = by_number.parse_hex(data), run.planner()
    place = address_in(address) * planner.bus.per

    def plan(hand: Hand) -> list[Step]:
        return [hand_raw.plan_write(hand, place, payload, undocumented)]

    return write_bytes(planner, place, payload, plan, by_number.write)


def write_bytes(
    planner: Hand,
    place: int,
    data: bytes,
    plan: Callable[[Hand], list[Step]],
    write: Callable[[Hand, int, bytes], Table],
    hand_of: Callable[[Any], Hand] = lambda device: device,
) -> PlannedAction:
    """Write bytes into the registers of an RH56 hand. Asks, with the fingers that this moves or lets go.

    place    the first address, in bytes
    plan     its frames, by what the hand is known to be
    write    sends them and reads back
    hand_of  the hand of the device of this command
    """
    from handctl.devices.inspire import raw as by_number
    from handctl.devices.inspire.hand import motion

    steps, shown = plan(planner), None
    question = f"This writes to the hand: {', then '.join(step.meaning for step in steps)}"

    def look(device: Any) -> Asked:
        nonlocal shown
        hand = hand_of(device)
        hand.confirm_identity()
        asked, changes = question, by_number.changes_of(hand.map, place, data)
        if any(step.moves for step in steps):
            before = motion.fit_to_move(hand)
            if changes:
                asked, shown = motion.question(hand, changes, before)
        else:
            asked, shown = motion.releasing(hand, changes, question)
        return Asked(asked, plan(hand), shown)

    def act(device: Any) -> Table:
        hand = hand_of(device)
        if shown is not None:
            hand.will_move()
        return write(hand, place, data)

    return PlannedAction(steps, act, question, look=look)


@cli.verb("raw", "Service", writes=True, asks=True)
@verbs.FRAME
@verbs.forced(help="Also send a frame that resets the hand, starts a stored movement or has a value out of range.")
def raw(run: Run, data: tuple[str, ...], wait: float, force_ambiguous: bool) -> PlannedAction:
    """Send exactly these EB90 or Modbus bytes and show the decoded reply.

    Everything except a read asks first."""
    from handctl.devices.inspire import raw as by_number
    from handctl.devices.inspire.hand import raw as hand_raw

    frame = by_number.parse_hex(" ".join(data))
    hand_raw.choose_wire(run, frame)
    step = hand_raw.plan(run.planner(), frame, force_ambiguous)
    return verbs.send_raw(step, by_number.HAND, lambda hand: hand_raw.exchange(hand, frame, wait))


# -- its network, its pair -----------------------------------------------------------------------------------------


@cli.verb("network", "Settings", writes=True, asks=True)
@click.argument("address", required=False)
def network(run: Run, address: str | None) -> Table | PlannedAction:
    """Show the IP address of a tactile hand, or give it a new ADDRESS.

    First switch off every other hand that has the old address. handctl asks you to type the new one to confirm.
    The new address is saved and takes effect after a power-cycle. This computer then needs an address in the same network.
    """
    from handctl.devices.inspire.hand import baud_and_network as place

    if address is None:
        run.only_reads("a value")
        return place.show_network(run.device())
    octets = place.octets_of(address)
    planner = run.planner()
    steps = planner.plan(place.address_plan(planner, octets))
    steps.append(planner.trigger_step("save", "save to flash"))

    def look(hand: Hand) -> Asked:
        hand.identify()
        before = ".".join(map(str, place.held(hand)))
        question = f"This changes the IP address of the hand from {before} to {address}, after a power-cycle"
        computer = f"This computer must then have an address such as {place.laptop_for(octets)}, mask 255.255.255.0"
        return Asked(f"{question}. {computer}. To go back, run `handctl hand network {before}`", steps)

    question = f"This changes the IP address of the hand to {address}, after a power-cycle"
    return PlannedAction(
        steps, lambda hand: place.change_network(hand, octets, run.prompts), question, word=address, look=look
    )


SIDES = ("left", "right")
PAIR_COLUMNS = (
    Column("name", "Name"),
    Column("side", "Side"),
    Column("link", "Link"),
    Column("id", "Id", right=True),
    Column("model", "Model"),
    Column("network", "IP address"),
    Column("file", "File"),
)


@cli.verb("pair", "Settings", writes=True, asks=True)
@click.argument("links", nargs=-1, metavar="[LINK] [LINK]")
@click.option("--first", type=click.Choice(SIDES), help="The side of the first hand. With this option nothing moves.")
@click.option(
    "--address", metavar="ADDRESS", help="New IP address if both hands have the same one (default: the next one)."
)
@click.option("--left", default="left", show_default=True, metavar="NAME", help="Name of the left hand.")
@click.option("--right", default="right", show_default=True, metavar="NAME", help="Name of the right hand.")
@click.option("--force", is_flag=True, help="Replace devices that already have these names.")
def pair(
    run: Run, links: tuple[str, ...], first: str | None, address: str | None, left: str, right: str, force: bool
) -> Table:
    """Find out which of two hands is left and which is right, and name both.

    After you confirm, each hand moves its index finger a little, and you say which hand moved. Give two LINKs for two
    ports or two IP addresses. Give one LINK if both hands are on one bus or have the same IP address. If they share an
    id or an address, handctl takes you through changing it for one hand. Ctrl-C stops the movement, and no hand is named.
    """
    from handctl.devices.inspire.hand import baud_and_network, pairing

    own, other = _links(run, links)
    names = {"left": left, "right": right}
    _check_names(names, force)
    octets = baud_and_network.octets_of(address) if address is not None else None
    if run.settings.dry_run:
        return run.dry_run(_steps(run, other, octets, moving=first is None))
    found = pairing.pair(pairing.Bench(run), own, other, first=first, address=address)
    return _named(run, found, names, force)


def _links(run: Run, links: Sequence[str]) -> tuple[str, str | None]:
    """The first LINK, which becomes that of the run, and the second. Raises UsageError."""
    if len(links) > 2:
        raise UsageError(f"{len(links)} LINKs given", hint="give one or two: a pair has two hands")
    if links:
        if COMMAND_LINE in (run.sources.get("port"), run.sources.get("fake"), run.sources.get("device")):
            raise UsageError(
                "a LINK was given both as an argument and as an option",
                hint="leave out -p, -d and --fake, and give the LINKs as arguments",
            )
        run.settings = run.settings._replace(port=links[0], fake=False, device=None, kind=None, wire=None)
    if len(links) == 2 and links[0] == links[1]:
        raise UsageError(f"{links[0]} is given twice", hint="give it only once if both hands are on the same LINK")
    return run.link_name(), links[1] if len(links) == 2 else None


def _check_names(names: dict[str, str], force: bool) -> None:
    """Whether these names can be given, before anything moves. Raises UsageError."""
    from handctl.command.config_file import check_name, read_config

    for name in names.values():
        check_name(name)
    if names["left"] == names["right"]:
        raise UsageError("both hands would have the same name", hint="give --left and --right different names")
    taken = [name for name in names.values() if name in read_config().devices]
    if taken and not force:
        raise UsageError(
            f"already named in {config_path()}: {' and '.join(map(repr, taken))}",
            hint="add --force to replace them, or choose other names with --left and --right",
            code="name-taken",
        )


def _steps(run: Run, other: str | None, octets: list[int] | None, *, moving: bool) -> list[Step]:
    """What can be said of the bytes before a hand is read: angles and speeds depend on where the finger is."""
    from handctl.devices.inspire.hand.motion import NUDGE_SPEED, NUDGED

    planner: Hand = run.planner()
    steps: list[Step] = []
    if moving:
        run.journal.info(
            "open-plan",
            "the plan does not show the angles of the movement or the speed set after it, because handctl reads them from the hand first",
            hint="the confirmation prompt shows every frame before it is sent",
        )
        steps += planner.plan([(planner.map.find(f"speed_set.{NUDGED}")[1][0], NUDGE_SPEED)])
    if octets is not None:
        from handctl.devices.inspire.hand.baud_and_network import address_plan

        steps += planner.plan(address_plan(planner, octets))
    elif other is None:
        steps += planner.plan([(planner.map["id"].each[0], 2)])
    return [*steps, planner.trigger_step("save", "save to flash")] if other is None else steps


# -- names --------------------------------------------------------------------------------------------------------------


def _named(run: Run, found: Sequence[Paired], names: dict[str, str], force: bool) -> Table:
    """Write both into the configuration file, at once."""
    from handctl.command import config_edit

    wanted = {names[one.side]: _values(run, one) for one in found}

    def allow(config: Config) -> None:
        taken = [name for name in wanted if name in config.devices]
        if taken and not force:
            raise UsageError(
                f"{taken[0]!r} has been named in the meantime", hint="add --force to replace it", code="name-taken"
            )

    path = config_path()
    rows = [_row(one, names[one.side], wanted[names[one.side]], path) for one in found]
    config_edit.put_all(path, wanted, allow)
    run.journal.info("next", "you can now use both names", hint=Hint("try {}", f"-d {names['left']} hand status"))
    return Table(rows=rows, columns=PAIR_COLUMNS, plain=("name", "side", "link", "id"))


def _values(run: Run, one: Paired) -> dict[str, Any]:
    """What the configuration file says of a hand."""
    from handctl.command.config_edit import stable_name

    settings, bus = run.settings, one.hand.bus
    values: dict[str, Any] = {"kind": "hand", "port": stable_name(one.link) or one.link}
    if not getattr(bus, "tcp", False):
        values["id"] = bus.id
    if settings.baud is not None:
        values["baud"] = settings.baud
    own = {"model": one.hand.found().model, "side": one.side, "protocol": settings.own.get("protocol")}
    return {**values, **{key: value for key, value in own.items() if value is not None}}


def _row(one: Paired, name: str, values: dict[str, Any], path: str) -> Row:
    from handctl.devices.inspire.hand import baud_and_network

    model = one.hand.found().model
    address = baud_and_network.held(one.hand) if baud_and_network.over_network(one.hand) else None
    return {
        "name": name,
        "side": one.side,
        "link": values["port"],
        "id": one.hand.bus.id,
        "model": model,
        "network": ".".join(map(str, address)) if address is not None else None,
        "file": path,
    }


# -- its skin ----------------------------------------------------------------------------------------------------

SIDE_BY_SIDE = 60
"""Columns of a window in which the fingers stand side by side."""


@cli.verb("tactile", "Inspect")
@click.argument("zones", nargs=-1, metavar="[ZONE]...")
@click.option(
    "--watch", "live", is_flag=True, help="Keep reading: a live picture on a terminal, otherwise a stream of rows."
)
@streaming(5.0)
@BOUNDS
def tactile(
    run: Run,
    zones: tuple[str, ...],
    live: bool,
    limits: tuple[str, ...] = (),
    until: tuple[str, ...] = (),
    **timing: Any,
) -> Table:
    """Show the tactile sensors of an RH56DFTP. Only reads.

    It has 17 zones with 1062 values from 0 to 4095. ZONE is a zone such as `index_tip`, a finger, or `palm`.
    On a terminal this draws a picture, otherwise it prints a row for each value. `--watch -o FILE.csv` records a log.
    """
    from handctl.devices.inspire.hand import tactile as skin

    chosen = skin.chosen(zones)
    if not live and (timing["count"] is not None or timing["duration"] is not None or until):
        raise UsageError("--count, --duration and --until need --watch", hint="add --watch")
    run.streams = live
    bounds = bounds_of(run, skin.named, limits, until)
    hand = run.device()
    if live:
        return within(bounds, skin.watch(hand, chosen, **timing))
    return within(bounds, skin.tactile(hand, chosen, wide=get_terminal_size().columns >= SIDE_BY_SIDE))
