"""What the shared code knows about one device family. Each family's command group has one; `families` lists them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from handctl.families import COMMANDS, FAMILIES
from handctl.fast_classes import NamedTuple

if TYPE_CHECKING:
    from handctl.errors import HandctlError
    from handctl.model.command_settings import Settings
    from handctl.model.param import ParamMap
    from handctl.model.result import Journal, Table


class Family(NamedTuple):
    """How the shared machinery handles one device family.

    kind      command name, and the simulator's name
    open      (link, settings, journal) -> device
    baud      speed of a serial port unless --baud says otherwise, None = none
    speeds    those that its device can have, () = any; a stop takes no other
    wires     the kinds of wire it has, the default first; () = bytes only
    tcp_port  port of tcp://HOST without one, None = it must be given; a family that has one and no `wires` has no serial wire
    ids       its protocol has device ids
    recall    LINK -> the speed at which its device was found last, None = not known; not needed, never an error
    holds_back  LINK -> why a stop would do harm there and sends nothing, "" = it may be sent
    check     settings -> raises UsageError for what does not fit together
    map_of    settings -> the parameter map, where it depends on them; None = there is one
    other_maps  settings -> further maps that its devices may have, as far as that was not typed
    simulated  settings -> what they say of the simulator of plain --fake, as KEY=VALUE of its LINK, "" = nothing
    checks    (run) -> what looks deeper by reading alone, as rows of findings: a diagnosis for a report; None = nothing
    explain_silence  (device, error) -> a better error when nothing valid ever came; read-only
    """

    kind: str
    open: Callable[[Any, Settings, Journal], Any]
    baud: int | None = None
    explain_silence: Callable[[Any, HandctlError], HandctlError] | None = None
    wires: tuple[str, ...] = ()
    tcp_port: int | None = None
    ids: bool = False
    check: Callable[[Settings], object] = lambda _settings: None
    recall: Callable[[str], int | None] | None = None
    holds_back: Callable[[str], str] | None = None
    map_of: Callable[[Settings], ParamMap[Any]] | None = None
    simulated: Callable[[Settings], str] = lambda _settings: ""
    speeds: tuple[int, ...] = ()
    other_maps: Callable[[Settings], Sequence[ParamMap[Any]]] = lambda _settings: ()
    checks: Callable[[Any], Table] | None = None


NO_FAMILY = Family("", lambda *_: None)
"""That of a command which belongs to none."""


def opener(device: Callable[[Any], Any], line: Callable[..., Any]) -> Callable[[Any, Settings, Journal], Any]:
    """The `open` of a family whose line takes what the options of everybody say, and no more."""
    from handctl.model.device import limits_of

    return lambda link, settings, journal: device(
        line(link, journal, assumed=settings.assume_identity, **limits_of(settings, link))
    )


def load(kind: str, role: str) -> Any:
    """The module of a role of a family, see `FamilyRow`."""
    return import_module(FAMILIES[kind].module(role))


def page_of(kind: str) -> Any:
    """What the pages say of a family, see `docgen.man_pages`; None where it has no such module."""
    from importlib.util import find_spec

    return load(kind, "manpage") if find_spec(FAMILIES[kind].module("manpage")) else None


def implied(kind: str) -> dict[str, bool]:
    """Options of a family that are set for every command that writes."""
    return {option.key: True for option in FAMILIES[kind].options if option.implied}


def on_can(settings: Settings) -> bool:
    """Whether these settings lead to a CAN bus."""
    from handctl.link import is_can

    return settings.wire == "can" if settings.port is None else is_can(settings.port)


def wire_in(family: Family, link: str) -> str:
    """The wire of a family that a LINK uses. TCP is a separate wire if the family has one."""
    from handctl.link import is_can

    if is_can(link):
        return "can"
    over_tcp = next((wire for wire in family.wires if wire.endswith("-tcp")), "")
    found = link.startswith("tcp://") or f"bus={over_tcp}" in link.partition("?")[2].split("&")
    return over_tcp if over_tcp and found else "serial"


def in_words(kind: str, data: bytes, can_id: int | None) -> str:
    """What a frame of the host says, by the family's own explainer."""
    from handctl.model.explainer import HOST

    return "; ".join(piece.meaning for piece in load(kind, "explain_bytes").explainer().decode(data, HOST, can_id))


def map_of(name: str) -> ParamMap[Any] | None:
    """The parameter map of a top-level command."""
    from handctl.model.param import ParamMap

    maps = (value for value in vars(import_module(COMMANDS[name][0])).values() if isinstance(value, ParamMap))
    return next((found for found in maps if found.kind == name), None)
