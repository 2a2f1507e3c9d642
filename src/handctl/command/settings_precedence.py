"""The settings of a command: from the command line, the environment, a named device and the configuration file, in that order.

A device that the environment or the file names stands back when a level above it says where the device is.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import click

from handctl.command.options import (
    COMMAND_LINE,
    ENVIRONMENT,
    FACTS,
    FILE,
    NAMED,
    WITHOUT_DEVICE,
    WITHOUT_FILE,
    SharedOption,
    Source,
    command_line,
    lasting_options,
    words_of,
)
from handctl.errors import UsageError
from handctl.model.command_settings import Settings
from handctl.system.user_folders import config_path


def resolve(ctx: click.Context, wires: tuple[str, ...] = (), device: str = "", *, urgent: bool = False) -> Settings:
    """The settings of this command; with `device`, as `-d` with that name would have them. Where each comes from is
    kept in its `CommandLine`.

    Raises UsageError for an environment variable or a configuration file that cannot be understood. With `urgent` they
    are passed over, each with its error in `CommandLine.passed_over`, as long as it is said which device it is.
    """
    told = command_line(ctx)
    given, unfit, told.unfit = told.given, told.unfit, []
    if unfit and not urgent:
        raise unfit[0]
    chosen = _Chosen()
    for key, value in given.items():
        chosen.offer(key, value, COMMAND_LINE)
    if device:
        chosen.values["device"], chosen.sources["device"] = device, COMMAND_LINE
    options = lasting_options(wires)
    passed = told.passed_over
    passed += [exc if isinstance(exc, UsageError) else UsageError(exc.format_message()) for exc in unfit]
    _take_environment(ctx, chosen, options, passed if urgent else None)
    command = " ".join(words_of(ctx))
    if command != WITHOUT_FILE:
        try:
            _from_file(chosen, options, passed if urgent else None, with_device=command not in WITHOUT_DEVICE)
        except UsageError as exc:
            if not urgent or not chosen.linked:
                raise
            passed.append(exc)
    try:
        if "facts" in chosen.values:
            _take_facts(ctx, chosen, told.own)
    except UsageError as exc:
        if not urgent:
            raise
        passed.append(exc)
    if urgent:
        _ignore_dry_run(chosen, passed)
    told.sources = chosen.sources
    return Settings().having({**chosen.values, "own": told.own})


def _take_facts(ctx: click.Context, chosen: _Chosen, own: Mapping[str, Any]) -> None:
    """What the facts file says where nothing else does. Raises UsageError for a file of another family."""
    from handctl.model import facts_file

    path = chosen.values["facts"]
    content = facts_file.read(path)
    family = getattr(ctx.command, "family", None)
    if family is not None and family.kind != content["family"]:
        raise UsageError(
            f"{path}: the facts of a device of family {content['family']}, not {family.kind}",
            hint=f"use the file of this device: `handctl prove {family.kind} -o FILE` makes one. Nothing was sent.",
            code="facts",
        )
    for key, value in facts_file.settings_of(content, path).items():
        if key not in own:
            chosen.offer(key, value, Source(FACTS, path))


def _ignore_dry_run(chosen: _Chosen, passed: list[UsageError]) -> None:
    """A dry run that a variable or the file has set is a safety catch: it keeps things from moving, and so does a stop."""
    source = chosen.sources.get("dry_run", COMMAND_LINE)
    if source != COMMAND_LINE:
        del chosen.values["dry_run"], chosen.sources["dry_run"]
        hint = "give -n on the command line to see the bytes and send nothing"
        passed.append(UsageError(f"dry_run, set in {source.where}, is ignored: a stop is always sent", hint=hint))


def _take_environment(
    ctx: click.Context, chosen: _Chosen, options: Sequence[SharedOption], passed: list[UsageError] | None
) -> None:
    """What the environment says where the command line does not; what makes no sense goes to `passed`, if there is one."""
    named = passed is not None and "device" in chosen.values  # it says where the device is, and no variable elsewhere
    linked = chosen.linked or named
    found: dict[str, tuple[SharedOption, Any]] = {}
    present = {name for name in os.environ if name.startswith("HANDCTL_")}
    for option in options if present else ():
        variable = f"HANDCTL_{str(option.name).upper()}"
        text = os.environ.get(variable)
        if not text or option.key in chosen.values or (linked and option.key in ("device", "port", "fake")):
            if text and passed is not None and named and not chosen.linked and option.key in ("port", "fake"):
                passed.append(UsageError(f"{variable} selects another link", hint=f"unset {variable}"))
            continue
        try:
            value = _from_environment(ctx, option, text)
        except UsageError as exc:
            if passed is None:
                raise
            passed.append(exc)
            continue
        if option.fixed is None or value:
            found[variable] = option, value if option.fixed is None else option.fixed
    for name in found and _pairs(
        {name: option.key for name, (option, value) in found.items() if value}, "environment", passed
    ):
        del found[name]
    for variable, (option, value) in found.items():
        chosen.offer(option.key, value, Source(ENVIRONMENT, variable))


class _Chosen:
    """The settings so far, from the highest level down: a setting that is present is kept."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {}
        self.sources: dict[str, Source] = {}

    @property
    def linked(self) -> bool:
        """Whether it is said where the device is."""
        return self.values.get("port") is not None or bool(self.values.get("fake"))

    def offer(self, key: str, value: Any, source: Source) -> None:
        """A value of a lower level, where no higher one has said anything."""
        if key not in self.values and not (key in ("port", "fake") and self.linked):
            self.values[key] = value
            self.sources[key] = source


def _from_file(
    chosen: _Chosen, options: Sequence[SharedOption], passed: list[UsageError] | None, with_device: bool
) -> None:
    path = config_path()
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        if os.environ.get("HANDCTL_CONFIG") and with_device:
            raise UsageError(
                f"HANDCTL_CONFIG={path}: no such file",
                hint="correct or unset HANDCTL_CONFIG, or make the file with `handctl devices add`",
                code="config",
            ) from None
        if not (with_device and "device" in chosen.values):
            return
    except OSError:
        pass  # it may not be looked at, so it is there: reading it will say why
    from handctl.command.config import read_config

    config = read_config(path, passed)
    values = {
        option: entry
        for option in options
        if (entry := config.values.get(str(option.name))) and (option.fixed is None or entry.value)
    }
    twice = _pairs({str(option.name): option.key for option, entry in values.items() if entry.value}, path, passed)
    values = {option: entry for option, entry in values.items() if option.name not in twice}
    if with_device:
        if "device" in config.values and not chosen.linked:
            name, line = config.values["device"]
            chosen.offer("device", name, Source(FILE, f"{path}:{line}"))
        if "device" in chosen.values:
            device = config.find(chosen.values["device"])
            if device.kind:
                chosen.offer("kind", device.kind, Source(NAMED, f"{path}:{device.line}"))
            for key, entry in device.entries.items():
                chosen.offer(key, entry.value, Source(NAMED, f"{path}:{entry.line}"))
    for option, entry in values.items():
        if option.key == "device" or (option.key == "wire" and chosen.values.get("port")):
            continue  # the LINK says which wire it is
        value = entry.value if option.fixed is None else option.fixed
        chosen.offer(option.key, value, Source(FILE, f"{path}:{entry.line}"))


def _pairs(keys: dict[str, str], where: str, passed: list[UsageError] | None) -> list[str]:
    """Two entries of the file, or two variables, that speak of one setting: UsageError, or with `passed` the later ones."""
    said: dict[str, str] = {}
    later: list[str] = []
    for name, key in keys.items():
        about = "port" if key == "fake" else key
        if about in said:
            text = f"{where}: {said[about]} and {name} exclude each other"
            error = UsageError(text, hint="keep one of the two", code="config")
            if passed is None or about == "port":
                raise error
            passed.append(error)
            later.append(name)
            continue
        said[about] = name
    return later


def _from_environment(ctx: click.Context, option: SharedOption, text: str) -> Any:
    try:
        return (click.BOOL if option.is_flag else option.type).convert(text, option, ctx)
    except click.UsageError as exc:
        raise UsageError(
            f"environment variable HANDCTL_{str(option.name).upper()}={text}: {exc.message}", hint="correct or unset it"
        ) from exc
