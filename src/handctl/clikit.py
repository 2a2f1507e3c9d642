"""What every command shares: options at any level, the link, confirmations, progress, and the result on its way out.

A command body gets a `Run`, asks it for a device, and returns a `Table`. Nobody else opens links, asks questions or
decides where output goes. Imports click only; the rest is loaded when a command runs.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Sequence
from functools import update_wrapper
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from handctl import __version__
from handctl.errors import HandctlError, Interrupted, NotConfirmed, OutputError, UsageError
from handctl.families import COMMANDS
from handctl.guide import Guide

if TYPE_CHECKING:
    from handctl.link import ByteLink
    from handctl.param import Step
    from handctl.result import Journal, Message, Table

FORMATS = ("table", "plain", "json", "ndjson", "csv")
GIVEN = "handctl.given"
"""Key in click's shared meta: the options given so far; a later (deeper) level overwrites an earlier one."""


# -- options ------------------------------------------------------------------------------------------------------


class Settings(NamedTuple):
    """The shared options after precedence: command line (the level nearest the verb), environment, default."""

    port: str | None = None
    fake: bool = False
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


def shared_options() -> list[click.Parameter]:
    """A fresh set of the options that every command, group and the root accept."""
    connect, output, safety = "Connection", "Output", "Writing"
    number = click.FloatRange(min=0, min_open=True)
    return [
        SharedOption(["-p", "--port"], connect, metavar="LINK", help="Where the device is: /dev/ttyUSB0, COM3, usb:VID:PID[:SERIAL], tcp://HOST:PORT, fake://…, replay:FILE, any pyserial URL."),
        SharedOption(["--fake"], connect, is_flag=True, help="Talk to the built-in simulator of this device."),
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


def resolve(ctx: click.Context) -> Settings:
    """The settings of this command. Raises UsageError for an environment variable that cannot be understood."""
    given: dict[str, Any] = ctx.meta.get(GIVEN, {})
    values = {key: given[key] for key in Settings._fields if key in given}
    for option in shared_options():
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


class _SharedOptions(click.Command):
    """Accepts the shared options, and lists them by section after the command's own.

    They are made when a command is parsed, not when it is defined: most commands of a family are never used in a run.
    """

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        if self._shared is None:
            self._shared = shared_options()
        own = super().get_params(ctx)
        return [*own, *self._shared]

    _shared: list[click.Parameter] | None = None

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        sections: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if record is not None:
                sections.setdefault(getattr(param, "section", "Options"), []).append(record)
        for title in ("Options", *(name for name in sections if name != "Options")):
            if title in sections:
                with formatter.section(title):
                    formatter.write_dl(sections[title])


class Command(_SharedOptions):
    """A leaf command with the shared options. `writes`: --dry-run makes sense for it; `streams`: --json means NDJSON."""

    def __init__(
        self, *args: Any, writes: bool = False, streams: bool = False, family: Family | None = None, **more: Any
    ) -> None:
        super().__init__(*args, **more)
        self.writes = writes
        self.streams = streams
        self.family = family

    def invoke(self, ctx: click.Context) -> Any:
        run = Run(ctx, resolve(ctx), self.family)
        if run.settings.dry_run and not self.writes:
            raise run.failed(UsageError(
                f"`handctl {run.command}` only reads: --dry-run is for commands that write or move",
                hint="run it without -n: it changes nothing",
            ))  # fmt: skip
        ctx.obj = run
        return run.execute(lambda: super(Command, self).invoke(ctx))


class Group(_SharedOptions, click.Group):
    """A group with the shared options."""

    command_class = Command

    def __init__(self, *args: Any, family: Family | None = None, **more: Any) -> None:
        super().__init__(*args, **more)
        self.family = family

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        self.format_commands(ctx, formatter)
        super().format_options(ctx, formatter)

    def verb(
        self, name: str, *, writes: bool = False, streams: bool = False
    ) -> Callable[[Callable[..., Any]], Command]:
        """Decorator: add a leaf command whose body gets the Run first and returns a Table (or None)."""

        def decorate(body: Callable[..., Any]) -> Command:
            def call(*args: Any, **more: Any) -> Any:
                return body(click.get_current_context().obj, *args, **more)

            made: Command = click.command(name, cls=Command, writes=writes, streams=streams, family=self.family)(
                update_wrapper(call, body)
            )
            self.add_command(made)
            return made

        return decorate


class Root(Group):
    """The root: lists its commands from `families` and imports the module of the one that is used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command = importlib.import_module(COMMANDS[cmd_name][0]).cli
        assert isinstance(command, click.Command)
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            from difflib import get_close_matches

            near = get_close_matches(args[0], list(COMMANDS), cutoff=0.3)
            meant = f" Did you mean {' or '.join(map(repr, near))}?" if near else ""
            raise click.UsageError(f"No such command {args[0]!r}.{meant}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[Any]:
        from click.shell_completion import CompletionItem

        names = [CompletionItem(name, help=text) for name, (_, text) in COMMANDS.items() if name.startswith(incomplete)]
        return names or click.Command.shell_complete(self, ctx, incomplete)


root = Root(
    "handctl",
    help="Diagnostics and configuration of hand and exoskeleton devices.",
    epilog="Options work at any level; the one nearest the verb wins. Each has an environment variable, e.g. "
    "HANDCTL_PORT. Exit codes: 0 done, 2 usage, 3 link, 4 no answer, 5 no valid answer, 6 refused by the device, "
    "7 check failed, 8 not confirmed, 130 interrupted.",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _show_version(ctx: click.Context, _param: click.Parameter, value: bool) -> None:
    if value:
        click.echo(f"handctl {__version__}")
        ctx.exit()


root.params.append(
    click.Option(
        ["-V", "--version"],
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=_show_version,
        help="Show the version.",
    )
)


# -- running a command --------------------------------------------------------------------------------------------


class Family(NamedTuple):
    """How the shared machinery handles one device family.

    kind      command name, and the simulator's name
    open      (link, settings, journal) -> device
    baud      speed of a serial port unless --baud says otherwise, None = none
    explain   (device, error) -> a better error when nothing valid ever came; read-only
    """

    kind: str
    open: Callable[[ByteLink, Settings, Journal], Any]
    baud: int | None = None
    explain: Callable[[Any, HandctlError], HandctlError] | None = None


class Run:
    """One run of one command."""

    def __init__(self, ctx: click.Context, settings: Settings, family: Family | None) -> None:
        from handctl.result import Journal

        self.settings = settings
        self.family = family
        self.command = " ".join(ctx.command_path.split()[1:])
        self.guide = TerminalGuide(settings.quiet)
        self.journal = Journal(self._show_message)
        self.live = False
        self.streams = bool(getattr(ctx.command, "streams", False))
        self._held: list[Message] = []
        self._link: ByteLink | None = None
        self._trace: Any = None
        self._device: Any = None

    # -- what bodies ask for --

    def device(self) -> Any:
        """The device behind the link; opens it on first use. Raises UsageError, LinkError."""
        if self._device is None:
            assert self.family is not None
            self._device = self.family.open(self.open_link(), self.settings, self.journal)
        return self._device

    def planner(self) -> Any:
        """The device without a link: can check and plan writes, cannot send."""
        from handctl.link import NoLink

        assert self.family is not None
        return self.family.open(NoLink(), self.settings, self.journal)

    def open_link(self) -> ByteLink:
        """The link the user asked for, tapped when --trace or -v is given."""
        if self._link is None:
            from handctl.link import open_link

            assert self.family is not None
            name = self.link_name()
            tap = self._tap()
            self._link = open_link(name, baud=self.settings.baud or self.family.baud, tap=tap)
        return self._link

    def link_name(self) -> str:
        """The LINK: --port, or the simulator for --fake. Raises UsageError when neither is given; never picks one."""
        if self.settings.port:
            return self.settings.port
        kind = self.family.kind if self.family is not None else ""
        if self.settings.fake:
            return f"fake://{kind}"
        raise UsageError(
            "no device: where is it?",
            hint=f"-p /dev/ttyUSB0 (see `ls /dev/serial/by-id`), -p tcp://HOST:PORT, or --fake for the simulated {kind}",
            code="no-link",
        )

    def confirm(self, question: str, steps: Sequence[Step] = (), *, word: str = "") -> None:
        """Ask before something that moves, persists or strands; --yes answers. Raises NotConfirmed.

        With `word` the user must type it.
        """
        if self.settings.yes:
            return
        if not self.guide.interactive:
            raise NotConfirmed(
                f"{question} needs a confirmation, and nobody is at a terminal to give it",
                hint="add --yes if that is meant; --dry-run shows the bytes. Nothing was sent.",
            )
        for step in steps:
            self.guide.say(f"  {step.meaning}: {step.data.hex(' ').upper()}")
        if not self.guide.ask(question, word):
            raise NotConfirmed("not confirmed", hint="nothing was sent")

    def offer(self, question: str) -> bool:
        """Ask for an optional further step; no terminal or --yes means no."""
        return self.guide.interactive and not self.settings.yes and self.guide.ask(question, "")

    def dry_run(self, steps: Sequence[Step]) -> Table:
        """The exact bytes of a plan as a Table; sends nothing."""
        from handctl.result import Column, Table, hex_bytes

        rows = [
            {
                "step": number,
                "bytes": hex_bytes(step.data),
                "meaning": step.meaning,
                "moves": step.moves,
                "strands": step.strands,
            }
            for number, step in enumerate(steps, 1)
        ]
        columns = (Column("step", "Step", right=True), Column("bytes", "Bytes"), Column("meaning", "Meaning"))
        self.journal.info("dry-run", "dry run: nothing was sent")
        return Table(rows=rows, columns=columns, plain=("bytes",))

    # -- the life of a command --

    def execute(self, body: Callable[[], Table | None]) -> None:
        """Run the body, show its table while the link is open, close, and raise what went wrong."""
        import signal

        failure: HandctlError | None = None
        table: Table | None = None
        # SIGINT too: a script's background job starts with it ignored, and must be stoppable all the same.
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), _terminate)
        try:
            table = body()
            if table is not None and table.samples is not None:
                failure = self._stream(table)
        except HandctlError as exc:
            failure = self._explained(exc)
        except click.UsageError as exc:
            failure = from_click(exc)
        except KeyboardInterrupt:
            failure = Interrupted("interrupted")
        failure = self._close(failure)
        if table is None or table.samples is None:
            self._show(table, failure)
            failure = failure or (table.failure if table is not None else None)
        if failure is not None:
            failure.shown = True
            raise failure

    def _stream(self, table: Table) -> HandctlError | None:
        from handctl import render

        self.live = True
        with render.Sink(self.settings) as sink:
            return render.stream(table, sink, self)

    def _show(self, table: Table | None, failure: HandctlError | None) -> None:
        from handctl import render

        if table is not None or self.settings.format in ("json", "ndjson"):
            with render.Sink(self.settings) as sink:
                render.show(table, failure, sink, self)
        for message in self._held:
            self._print_message(message)
        self._held.clear()

    def failed(self, error: HandctlError) -> HandctlError:
        """Show an error that arose before the body could run (as JSON too); returns it to be raised."""
        self._show(None, error)
        error.shown = True
        return error

    def _explained(self, error: HandctlError) -> HandctlError:
        explain = self.family.explain if self.family is not None else None
        silent = error.exit_code in (4, 5) and self.journal.counters.received == 0
        if self._device is None or explain is None or not silent or self.settings.baud is not None:
            return error
        try:
            return explain(self._device, error)
        except (HandctlError, KeyboardInterrupt):
            return error

    def _close(self, failure: HandctlError | None) -> HandctlError | None:
        try:
            if self._link is not None:
                self._link.close()
            if self._trace is not None:
                self._trace.close()
        except HandctlError as exc:
            return failure or exc
        except OSError as exc:
            return failure or OutputError(f"{self.settings.trace}: the trace cannot be written: {exc.strerror or exc}")
        return failure

    def _tap(self) -> Any:
        if not self.settings.trace and not self.settings.verbose:
            return None
        from handctl.link.tap import Tap

        if self.settings.trace:
            try:
                self._trace = open(self.settings.trace, "w", encoding="utf-8", buffering=1)  # noqa: SIM115 - until _close
            except OSError as exc:
                raise UsageError(f"{self.settings.trace}: the trace cannot be written: {exc.strerror or exc}") from exc
            self._trace.write(f"# handctl {__version__} {self.command}, {self.link_name()}\n")
        return Tap(self._write_trace)

    def _write_trace(self, line: str) -> None:
        if self._trace is not None:
            try:
                self._trace.write(line)
            except OSError as exc:
                raise OutputError(f"{self.settings.trace}: the trace cannot be written: {exc.strerror or exc}") from exc
        if self.settings.verbose:
            sys.stderr.write(line)

    # -- envelope and messages --

    def envelope(self, failure: HandctlError | None, extra: dict[str, Any] | None = None) -> dict[str, Any]:
        """The JSON envelope without rows (cli contract, section 4)."""
        return make_envelope(
            self.command, failure, self._device_row(), self.journal.messages, self.journal.counters.as_row(), extra
        )

    def _device_row(self) -> dict[str, Any] | None:
        if self.family is None:
            return None
        link = self._link
        name = (
            link.name
            if link is not None
            else (self.settings.port or (f"fake://{self.family.kind}" if self.settings.fake else None))
        )
        fake = link.fake if link is not None else bool(name and name.startswith("fake://"))
        bus = getattr(self._device, "bus", None)
        return {"kind": self.family.kind, "link": name, "fake": fake, "id": getattr(bus, "id", self.settings.id)}

    @property
    def simulated(self) -> bool:
        """Whether a simulator answered."""
        return self._link is not None and self._link.fake

    def _show_message(self, message: Message) -> None:
        if self.live:
            self._print_message(message)
        else:
            self._held.append(message)

    def _print_message(self, message: Message) -> None:
        if not self.settings.quiet and self.settings.format not in ("json", "ndjson"):
            self.guide.done()
            hint = f"\n  next: {message.hint}" if message.hint else ""
            print_stderr(f"handctl: {message.level if message.level != 'info' else 'note'}: {message.text}{hint}")


class TerminalGuide(Guide):
    """Talks with the person on stderr; asks only when stdin and stderr are terminals."""

    def __init__(self, quiet: bool) -> None:
        self.interactive = _is_terminal(sys.stdin) and _is_terminal(sys.stderr)
        self._moving = _is_terminal(sys.stderr) and not quiet
        self._quiet = quiet
        self._width = 0

    def say(self, text: str) -> None:
        """A line that stays."""
        if not self._quiet:
            self.done()
            print_stderr(text)

    def progress(self, text: str) -> None:
        """A line that replaces the last one; only on a terminal."""
        if self._moving:
            columns = os.get_terminal_size(sys.stderr.fileno()).columns
            shown = text[: columns - 1]
            sys.stderr.write(f"\r{shown.ljust(self._width)}")
            sys.stderr.flush()
            self._width = len(shown)

    def done(self) -> None:
        """Remove the progress line."""
        if self._width:
            sys.stderr.write(f"\r{' ' * self._width}\r")
            sys.stderr.flush()
            self._width = 0

    def ask(self, question: str, word: str) -> bool:
        """Yes or no, or a word to be typed. End of input is a no."""
        self.done()
        sys.stderr.write(f"{question}. Type {word!r} to go on: " if word else f"{question}? [y/N] ")
        sys.stderr.flush()
        answer = sys.stdin.readline().strip()
        return answer == word if word else answer.casefold() in ("y", "yes")


def run_root(args: Sequence[str]) -> int:
    """Parse and run; every error becomes one message on stderr and an exit code."""
    debug = "--debug" in args or bool(os.environ.get("HANDCTL_DEBUG"))
    streams = False
    error: HandctlError
    try:
        root.main(args=list(args), prog_name="handctl", standalone_mode=False)
        return 0
    except click.exceptions.Exit as exc:
        return exc.exit_code
    except (BrokenPipeError, SystemExit):
        return 0  # a closed pipe is quiet; click ends so when it meets one
    except OSError as exc:  # help that cannot be written; links and files translate their own
        error = OutputError(f"stdout cannot be written: {exc.strerror or exc}")
    except HandctlError as exc:
        error = exc
    except (click.Abort, KeyboardInterrupt):
        error = Interrupted("interrupted")
    except click.exceptions.NoArgsIsHelpError as exc:
        print_stderr(exc.format_message())
        return exc.exit_code
    except click.UsageError as exc:
        error = from_click(exc)
        streams = exc.ctx is not None and getattr(exc.ctx.command, "streams", False)
    except click.ClickException as exc:
        error = HandctlError(exc.format_message())
        error.exit_code = exc.exit_code
    except Exception as exc:
        error = HandctlError(
            f"internal error: {type(exc).__name__}: {exc}", hint="this is a bug: --debug shows where", code="internal"
        )
        error.__cause__ = exc
    if debug:
        import traceback

        traceback.print_exception(error)
    if not error.shown:
        _late_envelope(args, error, streams)
    if error.text != "interrupted":  # who pressed Ctrl-C knows; what it left behind is told
        print_stderr(f"handctl: error: {error.text}" + (f"\n  next: {error.hint}" if error.hint else ""))
    return error.exit_code


def from_click(exc: click.UsageError) -> UsageError:
    """click's usage error as ours, with the command's own help as the next step."""
    path = exc.ctx.command_path if exc.ctx is not None else "handctl"
    return UsageError(exc.format_message(), hint=f"`{path} -h` shows what it takes")


def _late_envelope(args: Sequence[str], error: HandctlError, streams: bool) -> None:
    """JSON on stdout also when the command line itself was wrong, if JSON was asked for."""
    words = list(args)
    wanted = os.environ.get("HANDCTL_FORMAT", "") or ("json" if os.environ.get("HANDCTL_JSON") else "")
    for position, word in enumerate(words):
        if word == "--json":
            wanted = "json"
        elif word == "--format" and position + 1 < len(words):
            wanted = words[position + 1]
        elif word.startswith("--format="):
            wanted = word.partition("=")[2]
    if wanted not in ("json", "ndjson"):
        return
    import json

    command = " ".join(word for word in words[:2] if word.replace("-", "").isalpha() and not word.startswith("-"))
    envelope = make_envelope(command, error, None, (), None, None)
    try:
        sys.stdout.write(
            json.dumps({"end": envelope} if streams or wanted == "ndjson" else {**envelope, "rows": []}) + "\n"
        )
        sys.stdout.flush()
    except OSError:
        return  # the error itself is still told on stderr


def make_envelope(
    command: str,
    failure: HandctlError | None,
    device: dict[str, Any] | None,
    messages: Sequence[Message],
    counters: dict[str, int] | None,
    extra: dict[str, Any] | None,
) -> dict[str, Any]:
    """The JSON envelope without rows."""
    from handctl.result import SCHEMA, Counters

    rows = [message.as_row() for message in messages]
    if failure is not None:
        rows.append({"level": "error", "code": failure.code, "text": failure.text, "hint": failure.hint})
    return {
        "schema": SCHEMA,
        "version": __version__,
        "command": command,
        "device": device,
        "ok": failure is None,
        "exit_code": failure.exit_code if failure is not None else 0,
        **(extra or {}),
        "messages": rows,
        "counters": counters if counters is not None else Counters().as_row(),
    }


def print_stderr(text: str) -> None:
    """One message, wrapped at words on a terminal; a closed stderr is not worth a second error."""
    try:
        if _is_terminal(sys.stderr):
            text = _wrapped(text, os.get_terminal_size(sys.stderr.fileno()).columns)
        sys.stderr.write(text + "\n")
        sys.stderr.flush()
    except OSError:
        return


def _wrapped(text: str, columns: int) -> str:
    """Lines longer than the terminal are broken at words, continued with an indent; frames of bytes are kept whole."""
    import textwrap

    lines = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip())]
        lines += textwrap.wrap(
            line, max(columns, 20), subsequent_indent=indent + "  ", break_long_words=False, break_on_hyphens=False
        ) or [""]
    return "\n".join(lines)


def _is_terminal(stream: Any) -> bool:
    try:
        return bool(stream.isatty())
    except (AttributeError, ValueError):
        return False


def _terminate(_number: int, _frame: Any) -> None:
    raise KeyboardInterrupt
