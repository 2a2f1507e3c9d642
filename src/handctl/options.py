"""The options that every command, group and the root accept, and how they become settings. Imports click only.

Precedence: command line (the level nearest the verb wins), then the environment, then the default.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, NamedTuple

import click

from handctl.errors import UsageError

FORMATS = ("table", "plain", "json", "ndjson", "csv")
GIVEN = "handctl.given"
"""Key in click's shared meta: the options given so far; a later (deeper) level overwrites an earlier one."""


class Settings(NamedTuple):
    """The shared options after precedence: command line (the level nearest the verb), environment, default."""

    port: str | None = None
    fake: bool = False
    wire: str | None = None
    id: int | None = None
    baud: int | None = None
    timeout: float | None = None
    deadline: float | None = None
    retries: int | None = None
    format: str = "table"
    output: str | None = None
    trace: str | None = None
    dry_run: bool = False
    yes: bool = False
    quiet: bool = False
    verbose: bool = False
    color: str = "auto"
    debug: bool = False


class SharedOption(click.Option):
    """An option that means the same at root, group and leaf. It writes `settings key = value` into the shared meta."""

    def __init__(self, names: Sequence[str], section: str, key: str = "", fixed: Any = None, **more: Any) -> None:
        self.section = section
        self.fixed = fixed
        super().__init__(list(names), expose_value=False, callback=self._remember, **more)
        self.key = key or str(self.name)

    def _remember(self, ctx: click.Context, param: click.Parameter, value: Any) -> None:
        source = ctx.get_parameter_source(param.name or "")
        if source is not click.core.ParameterSource.COMMANDLINE or (not value and isinstance(value, bool)):
            return
        given: dict[str, Any] = ctx.meta.setdefault(GIVEN, {})
        level = len(ctx.command_path.split())
        if self.key in ("port", "fake"):
            other = "fake" if self.key == "port" else "port"
            if given.get(f"{other}@") == level:
                raise UsageError("--port and --fake exclude each other", hint="give one of them")
            given.pop(other, None)
        given[self.key] = value if self.fixed is None else self.fixed
        given[f"{self.key}@"] = level


def shared_options(wires: Sequence[str] = ()) -> list[click.Parameter]:
    """A fresh set of the options that every command, group and the root accept; `wires` of a family that has several."""
    connect, output, safety = "Connection", "Output", "Writing"
    number = click.FloatRange(min=0, min_open=True)
    return [
        SharedOption(["-p", "--port"], connect, metavar="LINK", help="Where the device is: /dev/ttyUSB0, COM3, usb:VID:PID[:SERIAL], tcp://HOST:PORT, fake://…, replay:FILE, any pyserial URL."),
        SharedOption(["--fake"], connect, is_flag=True, help="Talk to the built-in simulator of this device."),
        *(SharedOption([f"--{wire}"], connect, key="wire", fixed=wire, is_flag=True, help=f"With --fake or --dry-run: the {wire} wire (default: {wires[0]}).") for wire in wires),
        SharedOption(["--id"], connect, type=int, metavar="N", help="Device id, as the protocol has it."),
        SharedOption(["--baud"], connect, type=click.IntRange(min=1), metavar="N", help="Speed of the serial port in bit/s."),
        SharedOption(["--timeout"], connect, type=number, metavar="S", help="Seconds of silence allowed per reply."),
        SharedOption(["--deadline"], connect, type=number, metavar="S", help="Seconds for the whole command."),
        SharedOption(["--retries"], connect, type=click.IntRange(min=0, max=100), metavar="N", help="Repetitions of a read without a valid answer (writes are never repeated)."),
        SharedOption(["--trace"], connect, metavar="FILE", help="Record every byte with its time; play it back with -p replay:FILE."),
        SharedOption(["--format"], output, type=click.Choice(FORMATS), help="How results are written (default: table)."),
        SharedOption(["--json"], output, key="format", fixed="json", is_flag=True, help="Same as --format json; for a stream one row a line."),
        SharedOption(["--csv"], output, key="format", fixed="csv", is_flag=True, help="Same as --format csv."),
        SharedOption(["-o", "--output"], output, metavar="FILE", help="Write the data there instead of stdout, whole or not at all."),
        SharedOption(["--color"], output, type=click.Choice(["auto", "always", "never"]), help="Colour (default: auto; NO_COLOR is honoured)."),
        SharedOption(["-q", "--quiet"], output, is_flag=True, help="No messages but errors."),
        SharedOption(["-v", "--verbose"], output, is_flag=True, help="Show every byte on stderr, as --trace records it."),
        SharedOption(["--debug"], output, is_flag=True, help="Show tracebacks."),
        SharedOption(["-n", "--dry-run"], safety, is_flag=True, help="Print the exact bytes of a command that writes or moves; send nothing."),
        SharedOption(["-y", "--yes"], safety, is_flag=True, help="Answer the confirmation."),
    ]  # fmt: skip


def resolve(ctx: click.Context, wires: Sequence[str] = ()) -> Settings:
    """The settings of this command. Raises UsageError for an environment variable that cannot be understood."""
    given: dict[str, Any] = ctx.meta.get(GIVEN, {})
    values = {key: given[key] for key in Settings._fields if key in given}
    for option in shared_options(wires):
        assert isinstance(option, SharedOption)
        text = os.environ.get(f"HANDCTL_{str(option.name).upper()}")
        if not text or option.key in values:
            continue
        if option.key in ("port", "fake") and ({"port", "fake"} & values.keys()):
            continue
        value = _from_environment(ctx, option, text)
        if option.fixed is None:
            values[option.key] = value
        elif value:
            values[option.key] = option.fixed
    return Settings(**values)


def _from_environment(ctx: click.Context, option: SharedOption, text: str) -> Any:
    try:
        return (click.BOOL if option.is_flag else option.type).convert(text, option, ctx)
    except click.UsageError as exc:
        raise UsageError(
            f"environment variable HANDCTL_{str(option.name).upper()}={text}: {exc.message}", hint="correct or unset it"
        ) from exc


def from_click(exc: click.UsageError) -> UsageError:
    """click's usage error as ours, with the command's own help as the next step."""
    path = exc.ctx.command_path if exc.ctx is not None else "handctl"
    return UsageError(exc.format_message(), hint=f"`{path} -h` shows what it takes")
