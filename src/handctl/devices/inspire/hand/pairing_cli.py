"""`handctl hand pair`: tell two hands apart and save a name for each in the configuration file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from handctl.command.command_tree import Group
from handctl.command.options import COMMAND_LINE, checks, config_path, read_config
from handctl.command.run import Run
from handctl.errors import UsageError
from handctl.model.result import Column, Row, Table

if TYPE_CHECKING:
    from handctl.command.config import Config
    from handctl.devices.inspire.hand.device import Hand
    from handctl.devices.inspire.hand.pairing import Paired
    from handctl.model.param import Step

SIDES = ("left", "right")
COLUMNS = (
    Column("name", "Name"),
    Column("side", "Side"),
    Column("link", "Link"),
    Column("id", "Id", right=True),
    Column("model", "Model"),
    Column("network", "IP address"),
    Column("file", "File"),
)


def add_pairing(group: Group) -> None:
    """Add the command to the family's group."""

    @group.verb("pair", "Settings", writes=True, asks=True)
    @click.argument("links", nargs=-1, metavar="[LINK] [LINK]")
    @click.option(
        "--first", type=click.Choice(SIDES), help="The side of the first hand. With this option nothing moves."
    )
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
        found = pairing.pair(_Bench(run), own, other, first=first, address=address)
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
    from handctl.command.config import NAME_HELP, is_name

    for name in names.values():
        if not is_name(name):
            raise UsageError(f"{name!r} cannot be the name of a device", hint=f"allowed: {NAME_HELP}")
    if names["left"] == names["right"]:
        raise UsageError("both hands would have the same name", hint="give --left and --right different names")
    taken = [name for name in names.values() if name in read_config(config_path()).devices]
    if taken and not force:
        raise UsageError(
            f"{' and '.join(map(repr, taken))} already named in {config_path()}",
            hint="add --force to replace them, or choose other names with --left and --right",
            code="name-taken",
        )


def _steps(run: Run, other: str | None, octets: list[int] | None, *, moving: bool) -> list[Step]:
    """What can be said of the bytes before a hand is read: angles and speeds depend on where the finger is."""
    from handctl.devices.inspire.hand.motion import NUDGE_SPEED, NUDGED
    from handctl.model.param import elements_of

    planner: Hand = run.planner()
    steps: list[Step] = []
    if moving:
        run.journal.info(
            "open-plan",
            "the plan leaves out the angles of the movement and the speed afterwards, because they are read from the hand first",
            hint="the command's question shows every frame before it is sent",
        )
        steps += planner.plan([(planner.map.find(f"speed_set.{NUDGED}")[1][0], NUDGE_SPEED)])
    if octets is not None:
        from handctl.devices.inspire.hand.baud_and_network import address_plan

        steps += planner.plan(address_plan(planner, octets))
    elif other is None:
        steps += planner.plan([(elements_of(planner.map["id"])[0], 2)])
    return [*steps, planner.trigger_step("save", "save to flash")] if other is None else steps


class _Bench:
    """The run, as `pairing` needs it."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self.prompts, self.elsewhere, self.confirm = run.prompts, run.device_at, run.confirm

    def hand(self, number: int | None = None) -> Hand:
        run = self._run
        if run.opened is None:
            run.device()
        assert run.family is not None and run.link is not None
        settings = run.settings._replace(id=number) if number is not None else run.settings
        hand: Hand = run.family.open(run.link, settings, run.journal)
        return hand

    def again(self) -> Hand:
        self._run.open_link(again=True)
        return self.hand()


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
    config_edit.put_all(path, checks(), wanted, allow)
    run.journal.info("next", "you can now use both names", hint=f"try `handctl -d {names['left']} hand status`")
    return Table(rows=rows, columns=COLUMNS, plain=("name", "side", "link", "id"))


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
    return {
        "name": name,
        "side": one.side,
        "link": values["port"],
        "id": one.hand.bus.id,
        "model": model,
        "network": ".".join(map(str, baud_and_network.held(one.hand)))
        if baud_and_network.over_network(one.hand)
        else None,
        "file": path,
    }
