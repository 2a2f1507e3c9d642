"""handctl sim …: simulated devices as servers, and control of a running one. Loaded by the root by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from handctl.digits import number_in
from handctl.sim import folder_of, kinds, model_class


class SimError(click.ClickException):
    """The place to serve at, or the running simulator, cannot be reached: exit code of a link error."""

    exit_code = 3

    def __init__(self, message: str, *, hint: str) -> None:
        super().__init__(message)
        self.hint = hint


SERVING = "check that the place to serve at is free, and check the files named in the options"
CONTROL = "start the simulator with --control PATH and give the same PATH here"
COMMANDS = "use `help` as COMMAND to list the commands of this simulator"


@click.group("sim", context_settings={"help_option_names": ["-h", "--help"]})
def cli() -> None:
    """Serve a simulated device to any client.

    Serves on a pseudo terminal or a TCP port, CAN through a simulated slcan adapter. Results with a simulator prove nothing
    about a real device.

    When it is ready, a simulator prints one JSON line: {"ready": true, "link": LINK}. SIGTERM or SIGINT ends it, and
    SIGUSR1 power-cycles it. On Windows, end it with Ctrl-C and power-cycle it with `handctl sim control`.
    """


class _ServerCommand(click.Command):
    """Shows the faults and the further options of the device in its help; imports the model only then."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        from handctl.sim.engine.line import LINE_FAULTS, LINE_OPTIONS

        model = model_class(str(self.name))
        flags = {option.lstrip("-") for param in self.params for option in param.opts} | {"clock", "power-cycle"}
        options = {name: text for name, text in LINE_OPTIONS.items() if name not in flags}
        sections: tuple[tuple[str, dict[str, Any]], ...] = (
            ("Faults of the line", LINE_FAULTS),
            ("Faults and states of the device", model.FAULTS),
            ("Further options, for --set", {"power-cycle": LINE_OPTIONS["power-cycle"], **options, **model.OPTIONS}),
        )
        for title, rows in sections:
            with formatter.section(title):
                formatter.write_dl([(name, row if isinstance(row, str) else row[1]) for name, row in rows.items()])
        if "--modbus-tcp" in {option for param in self.params for option in param.opts}:
            there = model_class(str(self.name), "modbus-tcp")
            with formatter.section("Further faults with --modbus-tcp"):
                formatter.write_dl([row for row in there.FAULTS.items() if row not in model.FAULTS.items()])
        if "--slcan-pty" in {option for param in self.params for option in param.opts}:
            from handctl.sim.engine.can import CAN_FAULTS, CAN_OPTIONS
            from handctl.sim.engine.slcan import ADAPTER_FAULTS

            new = {name: row for name, row in CAN_OPTIONS.items() if LINE_OPTIONS.get(name, ("", ""))[1] != row[1]}
            on_can = {**new, **model_class(str(self.name), "can").OPTIONS}
            with formatter.section("Faults of the line with --slcan-pty, --slcan-tcp"):
                formatter.write_dl(list(CAN_FAULTS.items()))
            with formatter.section("Faults of the adapter there"):
                formatter.write_dl(list(ADAPTER_FAULTS.items()))
            with formatter.section("Further options there"):
                formatter.write_dl([(name, row[1]) for name, row in on_can.items() if model.OPTIONS.get(name) != row])


def _address(ctx: click.Context, param: click.Parameter, text: str | None) -> tuple[str, int] | None:
    """HOST:PORT; an IPv6 host in brackets."""
    if text is None:
        return None
    host, colon, port = text.rpartition(":")
    number = number_in(port)
    if not colon or number is None or number > 65535:
        raise click.BadParameter("give HOST:PORT, for example 127.0.0.1:0 (0 takes any free port)")
    return host.removeprefix("[").removesuffix("]") or "127.0.0.1", number


def _number(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """No range keeps nan out."""
    if value is not None and value != value:
        raise click.BadParameter("not a number")
    return value


def _some(ctx: click.Context, param: click.Parameter, text: str | None) -> str | None:
    """A path: an empty one, as from an unset variable of a shell, is no file and no socket that anybody finds."""
    if text == "":
        raise click.BadParameter("it is empty")
    return text


def _raw_options(given: dict[str, Any], fault: tuple[str, ...], settings: tuple[str, ...]) -> dict[str, str]:
    """The options as a fake:// link would spell them."""
    raw: dict[str, str] = {}
    for text in settings:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise click.UsageError(f"--set {text}: give KEY=VALUE")
        raw[name.strip().replace("_", "-")] = value.strip()
    raw.update({name: str(value) for name, value in given.items() if value is not None})
    if fault:
        raw["fault"] = ",".join([*([raw["fault"]] if "fault" in raw else []), *fault])
    return raw


def _no_options(function: Callable[..., None]) -> Callable[..., None]:
    return function


def _slcan_options(function: Callable[..., None]) -> Callable[..., None]:
    tcp = click.option(
        "--slcan-tcp", metavar="HOST:PORT", callback=_address, help="Serve CAN as an slcan adapter on a TCP port."
    )
    return click.option("--slcan-pty", is_flag=True, help="Serve CAN as an slcan adapter on a new pseudo terminal.")(
        tcp(function)
    )


def _pty_option(function: Callable[..., None]) -> Callable[..., None]:
    by_id = click.option(
        "--by-id",
        metavar="PATH",
        callback=_some,
        help="Make PATH a symbolic link to the pseudo terminal. It stays valid when the port is unplugged and replugged.",
    )
    return click.option("--pty", "on_pty", is_flag=True, help="Serve on a new pseudo terminal.")(by_id(function))


def _modbus_options(function: Callable[..., None]) -> Callable[..., None]:
    pty = click.option("--modbus-pty", is_flag=True, help="Serve Modbus RTU alone on a new pseudo terminal.")
    tcp = click.option(
        "--modbus-tcp",
        metavar="HOST:PORT",
        callback=_address,
        help="Serve Modbus TCP to several clients. Can be combined with a serial port of the same device.",
    )
    return pty(tcp(function))


def _model_option(models: tuple[str, ...]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    return click.option("--model", type=click.Choice(models), help="The model to simulate.") if models else _no_options


def _server(kind: str) -> click.Command:
    """The command that serves one kind of device: bytes, and of one on a CAN bus frames through an slcan adapter as well.

    A device without a serial wire is served on a TCP port only.
    """
    folder = folder_of(kind)
    summary: str = folder.SUMMARY
    can, serial, modbus = "can" in folder.WIRES, "serial" in folder.WIRES, "modbus-tcp" in folder.WIRES

    @click.command(kind, cls=_ServerCommand, short_help=f"Serve a simulated {summary}")
    @(_pty_option if serial else _no_options)
    @click.option(
        "--tcp", metavar="HOST:PORT", callback=_address, help="Serve on a TCP port. Port 0 takes any free port."
    )
    @(_modbus_options if modbus else _no_options)
    @(_slcan_options if can else _no_options)
    @_model_option(getattr(folder, "MODELS", ()))
    @click.option("--seed", metavar="N", help="Seed of the random generator.")
    @click.option(
        "--fault", metavar="NAME[,NAME]", multiple=True, help="Faults and states, listed below. Can be repeated."
    )
    @click.option("--after", metavar="N", help="Answer the first N requests without the fault.")
    @click.option("--every", metavar="N", help="Apply the fault only to every N-th request after that.")
    @click.option(
        "--wire",
        metavar="BAUD",
        help="Simulate the transmission time of this baud rate in bit/s (auto: the device's baud rate).",
    )
    @click.option(
        "--state", metavar="FILE", callback=_some, help="Keep memory, flash and positions in this file between runs."
    )
    @click.option(
        "--duration",
        metavar="S",
        type=click.FloatRange(0.0, 1e9),
        callback=_number,
        help="Stop after S seconds.",
    )
    @click.option(
        "--control", metavar="PATH", callback=_some, help="Open a local socket at PATH for `handctl sim control`."
    )
    @click.option(
        "--set",
        "settings",
        metavar="KEY=VALUE",
        multiple=True,
        help="Set a further option, listed below. Can be repeated.",
    )
    def command(
        tcp: tuple[str, int] | None,
        fault: tuple[str, ...],
        duration: float | None,
        control: str | None,
        settings: tuple[str, ...],
        on_pty: bool = False,
        slcan_pty: bool = False,
        slcan_tcp: tuple[str, int] | None = None,
        modbus_pty: bool = False,
        modbus_tcp: tuple[str, int] | None = None,
        by_id: str | None = None,
        **given: str | None,
    ) -> None:
        on_can = slcan_pty or slcan_tcp is not None
        given_places = [on_pty, tcp is not None, slcan_pty, slcan_tcp is not None, modbus_pty].count(True)
        if given_places != 1 and (given_places or modbus_tcp is None):
            first = "either --pty or --tcp HOST:PORT" if serial else "--tcp HOST:PORT"
            more = ", or --slcan-pty or --slcan-tcp HOST:PORT" if can else ""
            more += ", or --modbus-pty or --modbus-tcp HOST:PORT" if modbus else ""
            raise click.UsageError(f"{'More than one' if given_places else 'No'} place to serve at. Give {first}{more}")
        if by_id is not None and not (on_pty or modbus_pty):
            raise click.UsageError("--by-id needs --pty")
        raw = _raw_options(given, fault, settings)
        if modbus_pty and raw.setdefault("speaks", "modbus") != "modbus":
            raise click.UsageError(f"speaks={raw['speaks']}: --modbus-pty serves Modbus RTU alone")
        if can and modbus_tcp is None and (raw.setdefault("bus", "can" if on_can else "serial") == "can") != on_can:
            raise click.UsageError(
                f"bus={raw['bus']}: serve CAN with --slcan-pty or --slcan-tcp, serial with --pty or --tcp"
            )
        from handctl.sim import places
        from handctl.sim.engine.serve import ServeError

        where = places.Places(on_pty or modbus_pty, tcp, slcan_pty, slcan_tcp, modbus_tcp, by_id, modbus)
        try:
            serve = places.wires(kind, raw, where) if modbus_tcp is not None else places.one(kind, raw, where)
        except ValueError as exc:
            raise click.UsageError(str(exc)) from exc
        try:
            serve(duration, control)
        except (ServeError, OSError) as exc:
            raise SimError(str(exc), hint=SERVING) from exc

    command.help = f"Serve a simulated {summary}\n\nPrints one JSON line when it is ready, and serves until SIGTERM, SIGINT or --duration."
    return command


class _BusCommand(click.Command):
    """Shows what may stand in the file; imports that only then."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        from handctl.sim.bus.file import DEVICE_KEYS, EXAMPLE, LINE_KEYS, MASTER_KEYS
        from handctl.sim.bus.models import SAID

        for title, rows in (
            ("Keys of [line]", LINE_KEYS),
            ("Keys of each [[device]]", DEVICE_KEYS),
            ("Keys of each [[master]]", MASTER_KEYS),
            ("Values of model", SAID),
        ):
            with formatter.section(title):
                formatter.write_dl(list(rows.items()))
        with formatter.section("Example of a file"):
            for line in EXAMPLE.splitlines():
                formatter.write(f"{'':{formatter.current_indent}}{line}".rstrip() + "\n")


@cli.command("bus", cls=_BusCommand, short_help="Serve several simulated devices on one RS-485, RS-232 or CAN bus.")
@click.argument("file", callback=_some)
@_pty_option
@click.option("--tcp", metavar="HOST:PORT", callback=_address, help="Serve on a TCP port. Port 0 takes any free port.")
@click.option("--slcan-pty", is_flag=True, help="Serve CAN as an slcan adapter on a new pseudo terminal.")
@click.option(
    "--slcan-tcp", metavar="HOST:PORT", callback=_address, help="Serve CAN as an slcan adapter on a TCP port."
)
@click.option("--seed", metavar="N", help="Seed of the random generator.")
@click.option(
    "--duration", metavar="S", type=click.FloatRange(0.0, 1e9), callback=_number, help="Stop after S seconds."
)
@click.option(
    "--control", metavar="PATH", callback=_some, help="Open a local socket at PATH for `handctl sim control`."
)
def bus(
    file: str,
    on_pty: bool,
    tcp: tuple[str, int] | None,
    slcan_pty: bool,
    slcan_tcp: tuple[str, int] | None,
    seed: str | None,
    duration: float | None,
    control: str | None,
    by_id: str | None,
) -> None:
    """Serve several simulated devices on one RS-485, RS-232 or CAN bus.

    FILE (TOML) describes the line, its devices and other masters. --tcp and --slcan-tcp take several clients, and you can
    combine the options: each client receives everything on the line. The LINK fake://bus?file=FILE works without a server.

    Prints one JSON line when it is ready, with several links under "links", and serves until SIGTERM, SIGINT or --duration.
    """
    on_line, on_can = on_pty or tcp is not None, slcan_pty or slcan_tcp is not None
    if not on_line and not on_can:
        raise click.UsageError(
            "No place to serve at. Give --pty, --tcp HOST:PORT, --slcan-pty or --slcan-tcp HOST:PORT"
        )
    if by_id is not None and not on_pty and not slcan_pty:
        raise click.UsageError("--by-id needs --pty or --slcan-pty")
    from handctl.sim.bus.file import read

    try:
        plan = read(file, seed)
        if on_line if plan.wire == "can" else on_can:
            places = "--slcan-pty or --slcan-tcp HOST:PORT" if plan.wire == "can" else "--pty or --tcp HOST:PORT"
            raise click.UsageError(f'{file}: wire = "{plan.wire}" needs {places}')
        whole, link = _whole(plan)
    except ValueError as exc:
        raise click.UsageError(str(exc)) from exc
    from handctl.sim.engine import ports, serve

    try:
        server = serve.Server(whole)
        if on_pty or slcan_pty:
            server.at(ports.PtyPort(plan.baud if on_line else None, by_id), link)
        if (place := tcp or slcan_tcp) is not None:
            server.behind(ports.TcpDoor(*place), link)
        server.run(duration, control)
    except (serve.ServeError, OSError) as exc:
        raise SimError(str(exc), hint=SERVING) from exc


def _whole(plan: Any) -> tuple[Any, Any]:
    """The bus for several clients, and how a link to it is written."""
    if plan.wire == "can":
        from handctl.sim.bus.can import CanBus
        from handctl.sim.engine import slcan
        from handctl.sim.engine.can import Hub

        return slcan.Adapters(Hub(CanBus(plan)), plan.adapter_faults), slcan.link
    from handctl.sim.bus.line import Bus

    return Bus(plan), str


@cli.command(
    "control",
    short_help="Send a command to a running simulator and print its answer.",
    context_settings={"ignore_unknown_options": True},  # -100 is a value of the simulator's command
)
@click.argument("path")
@click.argument("command", nargs=-1, required=True)
def control(path: str, command: tuple[str, ...]) -> None:
    """Send COMMAND to a running simulator and print its answer.

    PATH is the --control PATH that the simulator was started with.

    \b
    power-cycle            Switch off and on.
    power off | power on   Switch off, or on.
    fault NAME[,NAME]      Set these faults from now on. `fault none` ends them.
    unplug [SECONDS]       Unplug the port, for SECONDS or until `replug`. On a bus: the adapters of all clients.
    `replug`               Plug the port in again.
    requests               Count the requests that the device understood.
    heard                  Show the data that clients have sent since the last `heard`, with times.
    help                   List these commands and those of the device.
    """
    from handctl.sim.engine import serve

    try:
        answer = serve.send_control(path, " ".join(command))
    except serve.ServeError as exc:
        raise SimError(str(exc), hint=CONTROL) from exc
    status, _, text = answer.partition(" ")
    if status != "ok":
        raise SimError(text, hint=COMMANDS)
    click.echo(text)


for _kind in kinds():
    cli.add_command(_server(_kind))
