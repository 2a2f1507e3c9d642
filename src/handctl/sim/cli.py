"""handctl sim …: simulated devices as servers, and control of a running one. Loaded by the root by name."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from functools import partial
from typing import Any

import click

from handctl.number_parsing import number_in, real_in
from handctl.sim import create, folder_of, kinds, model_class
from handctl.sim.bus import whole_of

Address = tuple[str, int]
LONGEST = 10**9
"""Seconds."""


class SimError(click.ClickException):
    """The place to serve at, or the running simulator, cannot be reached: exit code of a link error."""

    exit_code = 3

    def __init__(self, message: str, *, hint: str) -> None:
        super().__init__(message)
        self.hint = hint


SERVING = "check that the endpoint is free, and check the files named in the options"
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


class _Command(click.Command):
    """A server, with what can be said to it in its help; that is imported only then."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, rows in _of_bus() if self.name == "bus" else _of_device(self):
            with formatter.section(title):
                formatter.write_dl([(name, row if isinstance(row, str) else row[1]) for name, row in rows.items()])
        if self.name == "bus":
            from handctl.sim.bus.bus_file import EXAMPLE

            with formatter.section("Example of a file"):
                for line in EXAMPLE.splitlines():
                    formatter.write(f"{'':{formatter.current_indent}}{line}".rstrip() + "\n")


Sections = list[tuple[str, dict[str, Any]]]


def _of_device(command: click.Command) -> Sections:
    """Its faults, and its options beyond those of the command line."""
    from handctl.sim.engine.line_and_faults import LINE_FAULTS, LINE_OPTIONS

    kind, model = str(command.name), model_class(str(command.name))
    flags = {option for param in command.params for option in param.opts}
    options = {
        name: row
        for name, row in LINE_OPTIONS.items()
        if f"--{name}" not in flags and name not in ("clock", "power-cycle")
    }
    sections: Sections = [
        ("Faults of the line", LINE_FAULTS),
        ("Faults and states of the device", model.FAULTS),
        ("Further options, for --set", {"power-cycle": LINE_OPTIONS["power-cycle"], **options, **model.OPTIONS}),
    ]

    def new(rows: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
        return {name: row for name, row in rows.items() if known.get(name) != row}

    if "--modbus-tcp" in flags:
        there = model_class(kind, "modbus-tcp")
        sections.append(("Further faults with --modbus-tcp", new(there.FAULTS, model.FAULTS)))
    if "--slcan-pty" in flags:
        from handctl.sim.engine.can_line import CAN_FAULTS, CAN_OPTIONS
        from handctl.sim.engine.slcan import ADAPTER_FAULTS

        on_can = {**new(CAN_OPTIONS, LINE_OPTIONS), **new(model_class(kind, "can").OPTIONS, model.OPTIONS)}
        sections += [
            ("Faults of the line with --slcan-pty, --slcan-tcp", CAN_FAULTS),
            ("Faults of the adapter there", ADAPTER_FAULTS),
            ("Further options there", on_can),
        ]
    return sections


def _of_bus() -> Sections:
    """What may stand in its file."""
    from handctl.sim.bus.bus_file import DEVICE_KEYS, LINE_KEYS, MASTER_KEYS, SAID

    return [
        ("Keys of [line]", LINE_KEYS),
        ("Keys of each [[device]]", DEVICE_KEYS),
        ("Keys of each [[master]]", MASTER_KEYS),
        ("Values of model", SAID),
    ]


def _address(ctx: click.Context, param: click.Parameter, text: str | None) -> Address | None:
    """HOST:PORT; an IPv6 host in brackets."""
    if text is None:
        return None
    host, colon, port = text.rpartition(":")
    number = number_in(port)
    if not colon or number is None or number > 65535:
        raise click.BadParameter("give HOST:PORT, for example 127.0.0.1:0 (0 takes any free port)")
    return host.removeprefix("[").removesuffix("]") or "127.0.0.1", number


def _seconds(ctx: click.Context, param: click.Parameter, text: str | None) -> float | None:
    """A time, if one was given. No range has nan in it."""
    if text is None:
        return None
    if 0 <= (seconds := real_in(text)) <= LONGEST:
        return seconds
    raise click.BadParameter(f"{text} is not a number from 0 to {LONGEST}.")


def _some(ctx: click.Context, param: click.Parameter, text: str | None) -> str | None:
    """A path: an empty one, as from an unset variable of a shell, is no file and no socket that anybody finds."""
    if text == "":
        raise click.BadParameter("it is empty")
    return text


def _raw_options(given: dict[str, Any], fault: tuple[str, ...], settings: tuple[str, ...]) -> dict[str, str]:
    """The options as a fake:// link would spell them."""
    raw = {name: str(value) for name, value in given.items() if value is not None}
    for text in settings:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise click.UsageError(f"--set {text}: give KEY=VALUE")
        name, value = name.strip().replace("_", "-"), value.strip()
        if raw.setdefault(name, value) != value:
            raise click.UsageError(f"{name} is given twice, as {raw[name]} and {value}")
    if fault:
        raw["fault"] = ",".join([*([raw["fault"]] if "fault" in raw else []), *fault])
    return raw


def _option(*names: str, **more: Any) -> click.Option:
    return click.Option(names, **more)


BY_ID = "Make PATH a symbolic link to the pseudo terminal. It stays valid when the port is unplugged and replugged."
MODBUS_TCP = "Serve Modbus TCP to several clients. Can be combined with a serial port of the same device."
WIRE = "Simulate the transmission time of this baud rate in bit/s (auto: the device's baud rate)."
OF_PTY = (
    _option("--pty", "on_pty", is_flag=True, help="Serve on a new pseudo terminal."),
    _option("--by-id", metavar="PATH", callback=_some, help=BY_ID),
)
TCP = "Serve on a TCP port. Port 0 takes any free port."
OF_TCP = (_option("--tcp", metavar="HOST:PORT", callback=_address, help=TCP),)
OF_MODBUS = (
    _option("--modbus-pty", is_flag=True, help="Serve only Modbus RTU on a new pseudo terminal."),
    _option("--modbus-tcp", metavar="HOST:PORT", callback=_address, help=MODBUS_TCP),
)
OF_CAN = (
    _option("--slcan-pty", is_flag=True, help="Serve CAN as an slcan adapter on a new pseudo terminal."),
    _option("--slcan-tcp", metavar="HOST:PORT", callback=_address, help="Serve CAN as an slcan adapter on a TCP port."),
)
SEED = _option("--seed", metavar="N", help="Seed of the random generator.")
OF_DEVICE = (
    SEED,
    _option("--fault", metavar="NAME[,NAME]", multiple=True, help="Faults and states, listed below. Can be repeated."),
    _option("--after", metavar="N", help="Answer the first N requests without the fault."),
    _option("--every", metavar="N", help="Apply the fault only to every N-th request after that."),
    _option("--wire", metavar="BAUD", help=WIRE),
    _option(
        "--facts",
        metavar="FILE",
        callback=_some,
        help="Become like the device of a facts file (`handctl prove -o FILE`).",
    ),
    _option(
        "--state", metavar="FILE", callback=_some, help="Keep memory, flash and positions in this file between runs."
    ),
)
OF_SERVER = (
    _option("--duration", metavar="S", callback=_seconds, help=f"Stop after S seconds.  [0 to {LONGEST}]"),
    _option("--control", metavar="PATH", callback=_some, help="Open a local socket at PATH for `handctl sim control`."),
)
SET = "Set one of the options listed below. Can be repeated."
OF_SET = (_option("--set", "settings", metavar="KEY=VALUE", multiple=True, help=SET),)


def _server(kind: str) -> click.Command:
    """The command that serves one kind of device: bytes, and of one on a CAN bus frames through an slcan adapter as well.

    A device without a serial wire is served on a TCP port only.
    """
    folder = folder_of(kind)
    models = getattr(folder, "MODELS", ())
    params: list[click.Parameter] = [
        *(OF_PTY if "serial" in folder.WIRES else ()),
        *OF_TCP,
        *(OF_MODBUS if "modbus-tcp" in folder.WIRES else ()),
        *(OF_CAN if "can" in folder.WIRES else ()),
        *([_option("--model", type=click.Choice(models), help="The model to simulate.")] if models else ()),
        *OF_DEVICE,
        *OF_SERVER,
        *OF_SET,
    ]
    said = f"Serve a simulated {folder.SUMMARY}"
    more = "Prints one JSON line when it is ready, and serves until SIGTERM, SIGINT or --duration."
    return _Command(kind, params=params, callback=partial(_serve, kind), short_help=said, help=f"{said}\n\n{more}")


def _serve(
    kind: str,
    fault: tuple[str, ...],
    duration: float | None,
    control: str | None,
    settings: tuple[str, ...],
    **given: Any,
) -> None:
    on_pty, slcan_pty, modbus_pty = (given.pop(name, False) for name in ("on_pty", "slcan_pty", "modbus_pty"))
    tcp, slcan_tcp, modbus_tcp, by_id = (given.pop(name, None) for name in ("tcp", "slcan_tcp", "modbus_tcp", "by_id"))
    wires = folder_of(kind).WIRES
    on_can = slcan_pty or slcan_tcp is not None
    given_places = [on_pty, tcp is not None, slcan_pty, slcan_tcp is not None, modbus_pty].count(True)
    if given_places != 1 and (given_places or modbus_tcp is None):
        first = "either --pty or --tcp HOST:PORT" if "serial" in wires else "--tcp HOST:PORT"
        more = ", or --slcan-pty or --slcan-tcp HOST:PORT" if "can" in wires else ""
        more += ", or --modbus-pty or --modbus-tcp HOST:PORT" if "modbus-tcp" in wires else ""
        raise click.UsageError(f"{'More than one' if given_places else 'No'} endpoint given. Give {first}{more}")
    if by_id is not None and not (on_pty or modbus_pty):
        raise click.UsageError("--by-id needs --pty")
    raw = _raw_options(given, fault, settings)
    if modbus_pty and raw.setdefault("speaks", "modbus") != "modbus":
        raise click.UsageError(f"speaks={raw['speaks']}: --modbus-pty serves only Modbus RTU")
    one = "can" in wires and modbus_tcp is None
    if one and (raw.setdefault("bus", "can" if on_can else "serial") == "can") != on_can:
        raise click.UsageError(
            f"bus={raw['bus']}: serve CAN with --slcan-pty or --slcan-tcp, serial with --pty or --tcp"
        )
    from handctl.sim.engine import slcan
    from handctl.sim.engine.serve import Alone, PtyPort, ServeError, Server, TcpDoor, Wires

    try:
        twin: Any = None
        if "facts" in raw or "values" in raw:
            from handctl.sim.engine.facts_file import Twin

            twin = Twin(kind, raw)
            raw = twin.raw
        adapter = _adapter(raw) if on_can else []
        whole: Any = None
        if modbus_tcp is not None:
            wire = ["can"] if on_can else ["serial"] if given_places else []
            whole = Wires(kind, raw, ["modbus-tcp", *wire])
        line: Any = create(kind, raw) if whole is None else whole.lines[-1]
        if twin is not None:
            click.echo(twin.words(line.values), err=True)
    except ValueError as exc:
        raise click.UsageError(str(exc)) from exc
    if not on_can:
        place: Any = Alone(line)
    elif slcan_pty and whole is None:
        place = Alone(slcan.Adapter(line, adapter))
    else:
        place = slcan.Hub(line, adapter)

    def link(address: str) -> str:
        """What a client passes to --port; tcp:// is Modbus TCP where there is that."""
        if on_can:
            return slcan.link(address)
        return address.replace("tcp://", "socket://") if "modbus-tcp" in wires else address

    try:
        server = Server(whole or place)
        if modbus_tcp is not None:
            door = TcpDoor(*modbus_tcp)
            server.behind(door)
            whole.door = door if door.host == whole.lines[0].device.host else None
        if on_pty or modbus_pty or slcan_pty:
            server.at(PtyPort(None if on_can else line.device.speed, by_id), link, place)
        elif (where := tcp or slcan_tcp) is not None:
            server.behind(TcpDoor(*where), link, place)
        server.run(duration, control)
    except (ServeError, OSError) as exc:
        raise SimError(str(exc), hint=getattr(exc, "hint", "") or SERVING) from exc


def _adapter(raw: dict[str, str]) -> list[str]:
    """Takes the faults of an slcan adapter out of the options."""
    from handctl.sim.engine import slcan

    adapter, others = slcan.split_faults(raw.pop("fault", ""))
    raw.update({"fault": others} if others else {})
    return adapter


def _bus(
    file: str, seed: str | None, duration: float | None, control: str | None, by_id: str | None, **given: Any
) -> None:
    """Serve several simulated devices on one RS-485, RS-232 or CAN bus.

    FILE (TOML) describes the line, its devices and other masters. --tcp and --slcan-tcp take several clients, and you can
    combine the options: each client receives everything on the line. The LINK fake://bus?file=FILE works without a server.

    Prints one JSON line when it is ready, with several links under "links", and serves until SIGTERM, SIGINT or --duration.
    """
    on_pty, slcan_pty, place = given["on_pty"], given["slcan_pty"], given["tcp"] or given["slcan_tcp"]
    on_line, on_can = on_pty or given["tcp"] is not None, slcan_pty or given["slcan_tcp"] is not None
    if not on_line and not on_can:
        raise click.UsageError("No endpoint given. Give --pty, --tcp HOST:PORT, --slcan-pty or --slcan-tcp HOST:PORT")
    if by_id is not None and not on_pty and not slcan_pty:
        raise click.UsageError("--by-id needs --pty or --slcan-pty")
    from handctl.sim.bus.bus_file import read
    from handctl.sim.engine import serve, slcan

    try:
        plan = read(file, seed)
        if on_line if plan.wire == "can" else on_can:
            wanted = "--slcan-pty or --slcan-tcp HOST:PORT" if plan.wire == "can" else "--pty or --tcp HOST:PORT"
            raise click.UsageError(f'{file}: wire = "{plan.wire}" needs {wanted}')
        whole = whole_of(plan)
    except ValueError as exc:
        raise click.UsageError(str(exc)) from exc
    if plan.wire == "can":
        whole = slcan.Hub(whole, plan.adapter_faults)
    link = slcan.link if on_can else str
    try:
        server = serve.Server(whole)
        if on_pty or slcan_pty:
            server.at(serve.PtyPort(plan.baud if on_line else None, by_id), link)
        if place is not None:
            server.behind(serve.TcpDoor(*place), link)
        server.run(duration, control)
    except (serve.ServeError, OSError) as exc:
        raise SimError(str(exc), hint=getattr(exc, "hint", "") or SERVING) from exc


cli.add_command(
    _Command(
        "bus",
        params=[click.Argument(["file"], callback=_some), *OF_PTY, *OF_TCP, *OF_CAN, SEED, *OF_SERVER],
        callback=_bus,
        short_help="Serve several simulated devices on one RS-485, RS-232 or CAN bus.",
        help=inspect.cleandoc(_bus.__doc__ or ""),
    )
)


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
