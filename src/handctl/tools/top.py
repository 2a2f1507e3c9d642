"""`handctl top`: all named devices at once, those that need attention at the top. A silent device stays, and is tried again."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator, Sequence

import click

from handctl.command.command_lines import parse_line
from handctl.command.command_tree import Command
from handctl.command.config_file import read_config
from handctl.command.get_set_watch import bounds_of
from handctl.command.options import LIMIT, streaming
from handctl.command.run import Run
from handctl.command.several_devices import DEVICE, LEAVE_SECONDS, POLL_SECONDS, EachDevice, EveryAccess
from handctl.errors import CheckFailed, UsageError, joined
from handctl.model.reading_limits import Bound, Watchdog
from handctl.model.result import Column, Row, Sample, Table
from handctl.system import clock

AGAIN_SECONDS = 2.0
"""After so long a silent device is tried again."""
COLUMNS = (
    DEVICE,
    Column("name", "Name"),
    Column("finger", "Finger"),
    Column("value", "Value", right=True),
    Column("unit", "Unit"),
    Column("label", "Meaning"),
    Column("error", "Error"),
)


@click.command("top", cls=Command, streams=True)
@click.argument("names", nargs=-1, metavar="[DEVICE]...")
@streaming(5.0)
@LIMIT
def cli(
    run: Run, names: tuple[str, ...], rate: float, count: int | None, duration: float | None, limits: tuple[str, ...]
) -> Table:
    """Show all named devices live, those that need attention at the top.

    Without DEVICE: every device in the configuration file. Read-only. If a device stops replying, its card stays and
    handctl keeps trying. In a pipe, prints a stream of rows. `handctl devices add` names a device.
    """
    config = read_config()
    chosen = list(dict.fromkeys(names or ([run.settings.device] if run.settings.device else config.devices)))
    if not chosen:
        raise UsageError("no devices are named", hint="`handctl devices add NAME FAMILY -p LINK` adds one")
    watched = [_Watched(name, config.find(name).kind, rate) for name in chosen]
    _set_limits(watched, limits)
    run.connection.device_access = access = EveryAccess(run, lambda: [one.each for one in watched])
    return _table(watched, count, duration, access.pressed_once)


class _Watched:
    """One device, in a thread of its own, for as long as anybody looks."""

    def __init__(self, name: str, kind: str, rate: float) -> None:
        self.name = name
        self._words = [kind, "watch", "-d", name, "--rate", str(rate)]
        self.each = self._begun()
        self.bounds: tuple[Bound, ...] = ()
        self.came = 0

    def _begun(self) -> EachDevice:
        return EachDevice(self.name, parse_line(self._words, {}))

    def limits(self, text: str) -> tuple[Bound, ...]:
        """The limit for this device. Raises UsageError where it has no such quantity."""
        kept = bounds_of(self.each.run, self.each.run.planner().map, [text])
        return tuple(kept.limits) if kept is not None else ()

    def work(self, take: queue.SimpleQueue[tuple[_Watched, list[Row]]], ended: threading.Event) -> None:
        """Hand over its samples, and why there are none. Never raises."""
        while not ended.is_set():
            self.each.work(lambda _, rows: take.put((self, rows)))
            if ended.is_set():
                return
            failure = self.each.run.outcome.failure
            take.put((self, [{"error": failure.text if failure is not None else "the stream has ended"}]))
            if not ended.wait(AGAIN_SECONDS):
                self.each = self._begun()

    def own_table(self) -> Table:
        """What is known of its quantities, with the limits."""
        table = self.each.table
        table.bounds = self.bounds
        return table


def _set_limits(watched: Sequence[_Watched], texts: Sequence[str]) -> None:
    """Each limit for the devices that have such a quantity. Raises UsageError where none has it."""
    for text in texts:
        wrong: list[UsageError] = []
        for one in watched:
            try:
                one.bounds += one.limits(text)
            except UsageError as exc:
                wrong.append(exc)
        if len(wrong) == len(watched):
            raise wrong[0]


def _table(watched: Sequence[_Watched], count: int | None, duration: float | None, ended: threading.Event) -> Table:
    table = Table(columns=COLUMNS, cards={one.name: one.own_table for one in watched})
    dogs = {one.name: Watchdog(one.bounds) for one in watched}

    def samples() -> Iterator[Sample]:
        came: queue.SimpleQueue[tuple[_Watched, list[Row]]] = queue.SimpleQueue()
        threads = [threading.Thread(target=one.work, args=(came, ended), daemon=True) for one in watched]
        for thread in threads:
            thread.start()
        began = clock.now()
        try:
            while (duration is None or clock.now() - began < duration) and (
                count is None or any(one.came < count for one in watched)
            ):
                try:
                    one, rows = came.get(timeout=POLL_SECONDS)
                except queue.Empty:
                    continue
                one.came += 1
                t = clock.now() - began
                dogs[one.name].look(rows, t)
                yield Sample(t, tuple({"device": one.name, **row, "t": round(t, 6)} for row in rows))
        finally:
            ended.set()
            for one in watched:
                one.each.silence()
            for thread in threads:
                thread.join(LEAVE_SECONDS)
            failures = [failure for name, dog in dogs.items() if (failure := dog.failure(name)) is not None]
            if failures and table.failure is None:  # every device is named, not the first one alone
                text = joined(*(failure.text for failure in failures))
                table.failure = CheckFailed(text, hint=failures[0].hint, code=failures[0].code)

    table.samples = samples()
    return table
