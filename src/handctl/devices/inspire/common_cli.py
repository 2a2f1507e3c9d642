"""Commands that all three families have: read, raw, id, baud, save, clear-errors, factory-reset.

A family's `cli` has their words, its device what differs. What a command needs is imported when it runs.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from handctl.command import get_set_watch
from handctl.command.options import REPLY_WAIT, OutFile, combined_options
from handctl.command.run import PlannedAction, Run
from handctl.devices.inspire.register_map import address_in
from handctl.errors import HandctlError, Hint, UsageError
from handctl.model.param import Element, ParamMap, Step
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.inspire.register_device import RegisterDevice

RATE = combined_options(
    click.argument("rate", required=False, type=int),
    click.option(
        "--save",
        "save_too",
        is_flag=True,
        help="Then save to flash. The new baud rate takes effect only after a save and a power-cycle.",
    ),
    click.option(
        "--verify",
        is_flag=True,
        help="Wait up to 120 s for the power-cycle, then check that the hand replies at the new baud rate.",
    ),
)
SPAN = combined_options(click.argument("address"), click.argument("count", type=int))
BYTES = combined_options(click.argument("address"), click.argument("data", metavar="HEX"))
FRAME = combined_options(click.argument("data", nargs=-1, required=True, metavar="HEX..."), REPLY_WAIT)
"""Of `read`, `write` and `raw`."""
UNDOCUMENTED = click.option("--undocumented", is_flag=True, help="Allow an address that is not in the manual.")


forced = partial(click.option, "--force-ambiguous", is_flag=True)
"""Its help says what it sends as well."""
backup_option = partial(click.option, "--backup", metavar="FILE", type=OutFile())
"""Of `factory_reset`."""
BACKUP_HELP = "Write the snapshot to FILE (default: {}-before-reset.json). An existing file is never overwritten."


def explain_silence(device: RegisterDevice, error: HandctlError) -> HandctlError:
    """Whether the silent hand is there at another speed."""
    from handctl.devices.inspire import id_baud_save_reset

    return id_baud_save_reset.explain_silence(device, error)


def read(run: Run, address: str, count: int) -> Table:
    """Bytes from any address."""
    from handctl.devices.inspire import eb90, raw

    place = address_in(address)
    eb90.check_span(place, count)
    device: RegisterDevice = run.device()
    device.know()
    return device.answered(lambda: raw.read(device, place * device.bus.per, count))


def send_raw(step: Step, question: str, exchange: Callable[[Any], Table]) -> PlannedAction:
    """`exchange` the bytes with the device; asks unless it only reads."""
    from handctl.devices.inspire import raw

    def act(device: RegisterDevice) -> Table:
        if step.moves:
            device.will_move()  # what comes behind it in a batch, a shell or a program can be interrupted
        with raw.goes_on(device, step):
            return exchange(device)

    _, question = raw.asked(step, question)
    return PlannedAction([step], act, f"{question}: {step.meaning}" if question else "")


def change_id(run: Run, params: ParamMap[Any], new: int | None) -> Table | PlannedAction:
    """Show the id, or give the hand a new one."""
    if new is None:
        run.only_reads("a value")
        return get_set_watch.get(run, params, ("id",))
    params["id"].check(new, "id")
    steps = run.planner().plan([(Element(params["id"], 0), new)])
    question = f"This changes the id to {new} at once, on every hand on this line that has the old id"
    return PlannedAction(steps, lambda device: device.change_id(new), question)


def change_baud(run: Run, rate: int | None, question: str, *, save: bool, verify: bool) -> Table | PlannedAction:
    """Show the speed code, or write the one that counts after a save and a power cycle, and see to both where that is wanted."""
    if rate is None:
        run.only_reads("a value")
        device: RegisterDevice = run.device()
        device.know()
        return device.show_speed()
    planner: RegisterDevice = run.planner()
    code = planner.speed_code(rate)
    if verify and not save:
        raise UsageError("--verify needs --save: without a save the hand keeps its old baud rate", hint="add --save")
    if verify and not planner.bus.serial:
        raise UsageError("--verify needs a serial line", hint="leave out --verify, and scan after the power-cycle")
    steps = planner.plan([(Element(planner.map["baud_code"], 0), code)])
    if save:
        steps.append(planner.trigger_step("save", "save to flash"))
    return PlannedAction(steps, lambda device: _change_speed(run, device, rate, save=save, verify=verify), question)


def _change_speed(run: Run, device: RegisterDevice, rate: int, *, save: bool, verify: bool) -> Table:
    from handctl.devices.inspire import id_baud_save_reset

    device.confirm_identity(keeps=False)
    table = device.change_speed(rate)
    if save or run.offer("Save it to flash now"):
        device.confirm_identity()
        written = [(Element(device.map["baud_code"], 0), device.speed_code(rate))]
        table.rows += id_baud_save_reset.save(device, run.prompts, written).rows
        wait = "Wait for the power-cycle and check the hand at the new baud rate"
        if verify or (device.bus.serial and run.offer(wait)):
            _verify_speed(run, device, rate, table)
        else:
            run.journal.info(
                "power-cycle",
                "the hand keeps its old baud rate until you power-cycle it",
                hint=f"power-cycle the hand, then use --baud {rate}",
            )
    else:
        already = any(message.code == "already" for message in run.journal.messages)
        run.journal.warn(
            "not-saved",
            f"{rate} bit/s {'was perhaps not saved. If so,' if already else 'is not saved, so'} the hand keeps its old baud rate",
            hint=Hint("run {}, then power-cycle the hand", f"{device.kind} save --id {device.bus.id}"),
        )
    return table


def _verify_speed(run: Run, device: RegisterDevice, rate: int, table: Table) -> None:
    from handctl.devices.inspire import id_baud_save_reset

    if id_baud_save_reset.wait_for_speed(device, rate, run.prompts):
        table.rows.append(
            {"name": "verified_baud", "finger": None, "address": None, "value": rate, "unit": "baud", "raw": None}
        )
    else:
        table.failure = device.not_at(rate)


def clear_errors(run: Run) -> PlannedAction:
    """Clear actuator errors and show which remain. Asks first if a finger may move.

    A finger that an error stopped may then continue to its target.
    No command clears an over-temperature error. It goes away once the actuator has cooled down.
    """

    def steps(device: RegisterDevice) -> Sequence[Step]:
        return [device.trigger_step("clear_errors", "clear errors")]

    def clear(device: RegisterDevice) -> Table:
        from handctl.devices.inspire import id_baud_save_reset

        device.confirm_identity(keeps=False)
        get_set_watch.ask_released(run, device, [(Element(device.map["clear_errors"], 0), 1)], steps(device))
        return id_baud_save_reset.clear_errors(device)

    return PlannedAction(steps(run.planner()), clear)


def save(run: Run, question: str, *, looks: bool = True) -> PlannedAction:
    """Save to flash. `looks` first who is there, as far as the family does more than any write."""

    def act(device: RegisterDevice) -> Table:
        from handctl.devices.inspire import id_baud_save_reset

        device.confirm_identity(keeps=looks)
        return id_baud_save_reset.save(device, run.prompts)

    return PlannedAction([run.planner().trigger_step("save", "save to flash")], act, question)


def factory_reset(run: Run, meaning: str, question: str, backup: str | None, *, looks: bool = True) -> PlannedAction:
    """Restore the factory defaults, after a snapshot into the file `backup`. The user types the word."""
    planner: RegisterDevice = run.planner()
    steps = [planner.trigger_step("factory_reset", meaning)]
    path = backup or f"{planner.kind}-before-reset.json"
    if not run.settings.dry_run and os.path.exists(path):
        raise UsageError(
            f"{path}: this file already exists, and handctl does not overwrite it",
            hint="choose another file with --backup FILE",
        )

    def reset(device: RegisterDevice) -> Table:
        from handctl.command import snapshots
        from handctl.devices.inspire import id_baud_save_reset

        device.confirm_identity(keeps=looks)
        snapshots.snapshot(run, path)
        return id_baud_save_reset.factory_reset(device)

    return PlannedAction(steps, reset, question, word="reset")


# -- for the manual pages -------------------------------------------------------------------------------------------


def settings_examples(kind: str, rate: int) -> list[tuple[str, str]]:
    """Of the commands that change what a hand keeps, with a baud `rate` that this one has."""
    port, dry = "-p /dev/ttyUSB0", "-n --fake"
    rows = (
        ("id --fake", "Show the id of the hand."),
        (f"id 2 {port}", "Give the hand another id. Asks first."),
        ("baud --fake", "Show the baud rate code of the hand."),
        (
            f"baud {rate} --save --verify {port}",
            "Change the baud rate, save it, and check the hand after a power-cycle.",
        ),
        (f"save {port}", "Save the present settings. Asks first."),
        (f"save {dry}", "Show the bytes and send nothing."),
        (f"factory-reset --backup before-reset.json {port}", "Write a snapshot, then reset. Asks first."),
        (f"clear-errors {port}", "Clear the errors and show which remain."),
        (f"clear-errors {dry}", "Show the bytes and send nothing."),
    )
    return [(f"handctl {kind} {words}", does) for words, does in rows]
