"""`handctl wrist …`: the commands of the wrist module, on its serial wire and on CAN."""

from __future__ import annotations

from functools import cache, partial
from typing import TYPE_CHECKING, Any

import click

from handctl.command.command_tree import Group
from handctl.command.common_commands import add_map_verbs
from handctl.command.expect import expect, expected
from handctl.command.family import Family
from handctl.command.get_set_watch import ask_released
from handctl.command.options import SECONDS
from handctl.command.run import PlannedAction, Run
from handctl.devices.inspire import common_cli as verbs
from handctl.devices.inspire import eb90, identity
from handctl.devices.inspire.register_map import BAUD_RATES, address_in
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.devices.inspire.wrist.device import Wrist
from handctl.devices.inspire.wrist.register_map import PITCH_RANGE, WRIST, YAW_RANGE
from handctl.link import ByteLink, FrameLink
from handctl.model.command_settings import Settings
from handctl.model.device import limits_of
from handctl.model.result import Journal, Table

if TYPE_CHECKING:
    from handctl.devices.inspire.can_bus import CanBus


def open_wrist(link: ByteLink | FrameLink, settings: Settings, journal: Journal) -> Wrist:
    """A wrist module behind a serial or a CAN link, with the options the user gave."""
    number, limits = settings.id if settings.id is not None else 1, limits_of(settings, link)
    bus: SerialBus | CanBus
    if isinstance(link, FrameLink):
        from handctl.devices.inspire.can_bus import CanBus

        bus = CanBus(link, number, journal, **limits)
    else:
        bus = SerialBus(link, number, journal, family="wrist", **limits)
    bus.across_gaps = settings.own.get("across_gaps") != "no"
    bus.gate = identity.FamilyGate(identity.WRIST, settings.assume_identity)
    return Wrist(bus)


cli = Group(
    "wrist",
    family=Family("wrist", open_wrist, 115200, wires=("serial", "can"), ids=True, speeds=tuple(BAUD_RATES.values())),
    first=("scan", "read"),
    help="Wrist module for Inspire dexterous hands, over RS-232, RS-485 or CAN. For CAN use -p can:INTERFACE:CHANNEL. "
    "Commands that move the wrist do not ask first.",
)

FORCE = verbs.forced(help="Also send a frame that means something else to another device or to the hand's registers.")

add_map_verbs(
    cli, WRIST, example="pitch_actual yaw_actual", setting="yaw_set=10 pitch_set=-10 move_time=1000",
    helps={
        "diff": "Compare set points (needs --setpoints): two snapshots, a snapshot and the device, or two devices.\n\nExit code 7 means that they differ. With -d LEFT,RIGHT and no file, it compares the two devices.",
        "restore": "Write the set points that differ from a snapshot (needs --setpoints).\n\nThey are read back. Shows the plan first. If it is interrupted, you can safely run it again.",
    },
)  # fmt: skip


# -- reading ------------------------------------------------------------------------------------------------------


@cli.verb("read", "Service")
@verbs.SPAN
def read(run: Run, address: str, count: int) -> Table:
    """Read COUNT bytes (1 to 252) from ADDRESS in the wrist. Registers from the manual are decoded."""
    return verbs.read(run, address, count)


@cli.verb("hand-read", "Service")
@verbs.SPAN
def hand_read(run: Run, address: str, count: int) -> Table:
    """Read COUNT bytes (1 to 252) from ADDRESS in the hand, not in the wrist.

    Uses flag 11, on CAN flag 0."""
    from handctl.devices.inspire.wrist import raw as wrist_raw

    place = address_in(address)
    eb90.check_span(place, count)
    return wrist_raw.hand_read(run.device(), place, count)


# -- moving and writing ---------------------------------------------------------------------------------------------


@cli.verb("move", "Move", writes=True)
@click.option(
    "--pitch", metavar="DEG", help=f"Pitch from {PITCH_RANGE[0]:.2f} to {PITCH_RANGE[1]:.2f} degrees, two decimals."
)
@click.option("--yaw", metavar="DEG", help=f"Yaw from {YAW_RANGE[0]:.2f} to {YAW_RANGE[1]:.2f} degrees, two decimals.")
@click.option("--time", metavar="MS", help="Movement time in ms (default: the time set in the wrist).")
@click.option("--wait", type=SECONDS, metavar="S", help="Wait at most S seconds for the wrist to arrive.")
@expect
def move(
    run: Run, pitch: str | None, yaw: str | None, time: str | None, wait: float | None, expect: str | None
) -> PlannedAction:
    """Move to angles in degrees and wait until the wrist has stopped moving.

    Shows the angles it reached. Ctrl-C makes the wrist hold its position. Asks first if an axis that you do not name is off its set angle,
    as after power-on: it may turn too.
    """
    wanted = {"yaw_set": yaw, "pitch_set": pitch, "move_time": time}
    values = {name: WRIST[name].parse(text, name) for name, text in wanted.items() if text is not None}
    return _move(run, values, wait, expect)


@cli.verb("center", "Move", writes=True)
@click.option("--time", metavar="MS", help="Movement time in ms (default: the time set in the wrist).")
@expect
def center(run: Run, time: str | None, expect: str | None) -> PlannedAction:
    """Move both axes to 0 degrees and wait until they have stopped moving."""
    values = {"yaw_set": 0.0, "pitch_set": 0.0}
    if time is not None:
        values["move_time"] = WRIST["move_time"].parse(time, "move_time")
    return _move(run, values, None, expect)


def _move(run: Run, values: dict[str, Any], wait: float | None, expect: str | None) -> PlannedAction:
    planner: Wrist = run.planner()
    changes = planner.targets(values.get("pitch_set"), values.get("yaw_set"), values.get("move_time"))
    steps = planner.plan(changes)
    ending = expected(expect)

    def act(wrist: Wrist) -> Table:
        ask_released(run, wrist, changes, steps)
        return wrist.move(changes, run.prompts, wait=wait, expect=ending)

    return PlannedAction(steps, act)


@cli.verb("write", "Service", writes=True)
@verbs.BYTES
def write(run: Run, address: str, data: str) -> PlannedAction:
    """Write 2, 4 or 6 bytes to addresses 1038 to 1043 and read them back.

    Low byte first. This moves the wrist."""
    from handctl.devices.inspire import raw as by_number
    from handctl.devices.inspire.wrist import raw as wrist_raw

    place, payload = address_in(address), by_number.parse_hex(data)
    step = wrist_raw.plan_write(run.planner(), place, payload)

    def act(wrist: Wrist) -> Table:
        ask_released(run, wrist, by_number.changes_of(WRIST, place, payload), [step])
        return wrist_raw.write(wrist, place, payload)

    return PlannedAction([step], act)


@cli.verb("hand-write", "Service", writes=True, asks=True)
@verbs.BYTES
@verbs.UNDOCUMENTED
@FORCE
def hand_write(run: Run, address: str, data: str, undocumented: bool, force_ambiguous: bool) -> PlannedAction:
    """Write bytes to registers of the hand, not of the wrist, and read them back. Asks first.

    Refuses and asks the same as `write` of `handctl hand`: the wrist manual does not document these registers."""
    from handctl.devices.inspire import raw as by_number
    from handctl.devices.inspire.hand.cli import write_bytes
    from handctl.devices.inspire.wrist import raw as wrist_raw

    place, payload, planner = address_in(address), by_number.parse_hex(data), run.planner()
    hand_of = cache(wrist_raw.carrier)
    plan = partial(
        wrist_raw.plan_hand_writes, address=place, data=payload, force=force_ambiguous, undocumented=undocumented
    )
    return write_bytes(hand_of(planner), place, payload, plan, wrist_raw.hand_write, hand_of)


@cli.verb("raw", "Service", writes=True, asks=True)
@verbs.FRAME
@FORCE
def raw(run: Run, data: tuple[str, ...], wait: float, force_ambiguous: bool) -> PlannedAction:
    """Send exactly these bytes (on CAN: IDENTIFIER#DATA) and show the decoded reply.

    Everything except a read asks first. With -n it only explains the frame, even if it is an example that the manual misprints.
    """
    from handctl.devices.inspire import raw as by_number
    from handctl.devices.inspire.can_bus import CanBus
    from handctl.devices.inspire.wrist import raw as wrist_raw

    can = isinstance(run.planner().bus, CanBus)
    dry = run.settings.dry_run
    frame = wrist_raw.parse_can(" ".join(data)) if can else None
    payload = b"" if can else by_number.parse_hex(" ".join(data))
    step = (
        wrist_raw.plan_can(frame, force_ambiguous, only_explain=dry)
        if frame is not None
        else wrist_raw.plan_raw(payload, force_ambiguous, only_explain=dry)
    )
    if wrist_raw.explained(step) and not dry:
        run.journal.warn("misprint", step.meaning)

    def exchange(wrist: Wrist) -> Table:
        if frame is not None:
            return wrist_raw.exchange_can(wrist, frame, wait)
        return by_number.exchange(wrist, payload, wait)

    return verbs.send_raw(step, by_number.DEVICE_ITSELF, exchange)
