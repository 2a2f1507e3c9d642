"""What holds up no stop: a setting that makes no sense falls back to its default, and that is told."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from handctl.errors import HandctlError, UsageError
from handctl.frame.options import COMMAND_LINE, NAMED

if TYPE_CHECKING:
    from handctl.frame.options import Settings
    from handctl.frame.run import Run

TIMEOUT = (0.01, 2.0)
"""Seconds for an answer: a step goes out for one second in all, and not more often than the line can carry it."""
DEADLINE = 0.1
"""The least that leaves time for the first bytes."""


def fall_back(run: Run) -> None:
    """Leave those settings of the run that a stop of its family can go out with; warn of each of the others."""
    family, settings = run.family, run.settings
    assert family is not None
    place = run.sources.get("port") or run.sources.get("fake")
    if settings.kind not in (None, family.kind) and place is not None and place.level != NAMED:
        source = run.sources["kind"]
        mine = [key for key, found in run.sources.items() if found.level == NAMED]
        _drop(run, mine, f"{settings.device!r} is of family {settings.kind} ({source.where})")
    settings = run.settings
    if settings.id is not None and not family.ids:
        _drop(run, ["id"], f"{family.kind} has no device ids", told=run.sources["id"] == COMMAND_LINE)
    if settings.baud is not None and family.baud is None:
        _drop(run, ["baud"], f"{family.kind} has no serial wire", told=run.sources["baud"] == COMMAND_LINE)
    elif settings.baud is not None and family.speeds and settings.baud not in family.speeds:
        known = ", ".join(map(str, family.speeds))
        _drop(run, ["baud"], f"{family.kind} has no speed {settings.baud} bit/s, but {known}")
    if settings.timeout is not None and not TIMEOUT[0] <= settings.timeout <= TIMEOUT[1]:
        _drop(
            run, ["timeout"], f"{settings.timeout:g} s for an answer: a stop needs {TIMEOUT[0]:g} to {TIMEOUT[1]:g} s"
        )
    if settings.deadline is not None and settings.deadline < DEADLINE:
        _drop(run, ["deadline"], f"{settings.deadline:g} s for the whole stop: it needs {DEADLINE:g} s")
    if settings.port and settings.wire is not None:
        from handctl.frame.family import wire_in

        if not settings.port.startswith("replay:") and wire_in(family, settings.port) != settings.wire:
            _drop(run, ["wire"], f"{settings.wire} does not fit {settings.port}")
    _own(run)
    if family.check is not None:
        family.check(run.settings)  # what is left of that is the LINK: its bytes could reach another device


def _own(run: Run) -> None:
    """The id and the options of the family: as many as the stop can go out with."""
    keys = [*(["id"] if run.settings.id is not None else []), *run.settings.own]
    error = _trouble(run, run.settings) if keys else None
    if error is None:
        return
    alone = next((key for key in keys if _trouble(run, _without(run.settings, [key])) is None), None)
    dropped = [alone] if alone is not None else keys
    if _trouble(run, _without(run.settings, dropped)) is None:  # else it is the LINK
        _drop(run, dropped, error.text)


def _trouble(run: Run, settings: Settings) -> HandctlError | None:
    """Why nothing would go out with these settings, None where it would."""
    from handctl.link import is_can
    from handctl.model.stopping import Aim, talk_of, unheard

    assert run.family is not None
    can = settings.wire == "can" if settings.port is None else is_can(settings.port)
    try:
        if run.family.check is not None:
            run.family.check(settings)
        unheard(talk_of(run.family.kind, Aim(settings, can)), reads=True)
    except HandctlError as exc:
        return exc
    except (ValueError, LookupError, OverflowError, TypeError, AttributeError) as exc:
        return UsageError(f"{type(exc).__name__}: {exc}")
    return None


def _without(settings: Settings, keys: list[str]) -> Settings:
    from handctl.frame.options import Settings as Default

    shared = {key: value for key, value in Default()._asdict().items() if key in keys}
    return settings._replace(**shared, own={key: value for key, value in settings.own.items() if key not in keys})


def _drop(run: Run, keys: list[str], why: str, *, told: bool = True) -> None:
    run.settings = _without(run.settings, keys)
    found: dict[str, Any] = {key: run.sources.get(key, COMMAND_LINE) for key in keys}
    run.sources = {key: source for key, source in run.sources.items() if key not in keys}
    if told:
        names = ", ".join(found)
        where = ", ".join(dict.fromkeys(source.where or source.level for source in found.values()))
        run.journal.warn(
            "passed-over", f"{names} ({where}): {why}", "a stop never waits for a setting: the default was used"
        )
