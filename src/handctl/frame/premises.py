"""What must hold before a command begins: which device is meant, and that no file is written over another.

Sends nothing and opens no link.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handctl.errors import OutputError, UsageError
from handctl.files import why_unwritable
from handctl.frame.family import Family, refuse_missing, refuse_serial
from handctl.frame.filetypes import Named, refuse_clashes
from handctl.frame.options import COMMAND_LINE, ENVIRONMENT, config_path

if TYPE_CHECKING:
    from handctl.frame.run import Run


def check_before(run: Run) -> None:
    """Raise UsageError or OutputError where this command line cannot be meant."""
    _check_named_device(run)
    _check_files(run)
    _check_output(run)
    if run.family is not None:
        _check_protocol(run, run.family)


def link_name(run: Run) -> str:
    """The LINK: --port, or the simulator for --fake. Raises UsageError when neither is given; never picks one."""
    from handctl.link import is_can

    refuse_other_family(run)
    port, wire = run.settings.port, run.settings.wire
    kind = run.family.kind if run.family is not None else ""
    if port and not port.startswith("replay:"):
        if is_can(port) and (run.family is None or "can" not in run.family.wires):
            raise UsageError(
                f"{port}: this device has no CAN wire", hint="give a serial port, usb:VID:PID or tcp://HOST:PORT"
            )
        if wire is not None and is_can(port) != (wire == "can"):
            raise UsageError(f"--{wire} does not fit {port}", hint="leave it out: the LINK determines the wire")
        if run.family is not None:
            refuse_serial(run.family, port)
    if port:
        return port
    if run.settings.fake:
        return f"fake://{kind}?bus=can" if wire == "can" else f"fake://{kind}"
    where = "-p LINK (`handctl ports` lists the serial ports, -p tcp://HOST:PORT is a TCP device)"
    if run.family is not None and run.family.tcp_port is not None:
        where = f"-p tcp://HOST (port {run.family.tcp_port} when not given)"
    raise UsageError(
        "no device given",
        hint=f"give {where}, -d NAME (see `handctl devices list`), or --fake for the simulated {kind}",
        code="no-link",
    )


def _check_files(run: Run) -> None:
    """Raise UsageError when an output of this run would replace an input, the configuration file or another output."""
    settings = run.settings
    outputs = [
        Named(label, path) for label, path in (("--output", settings.output), ("--trace", settings.trace)) if path
    ]
    replayed = (settings.port or "").partition("replay:")
    inputs = [Named("--port", replayed[2])] if replayed[1] and not replayed[0] else []
    own = Named("the configuration file", config_path())
    try:
        refuse_clashes([*run.inputs, *inputs, own], [*outputs, *run.outputs])
    except UsageError:
        run.settings = settings._replace(output=None, trace=None)  # the envelope of the error must not go there either
        raise


def _check_output(run: Run) -> None:
    """Raise OutputError now when -o cannot be written, not when the device has been served."""
    path = run.settings.output
    if path and not run.stops and (why := why_unwritable(path)):
        raise OutputError(f"{path}: cannot be written: {why}", hint="name another place for -o. Nothing was sent.")


def _check_named_device(run: Run) -> None:
    """Whether the device that -d names is meant; a default device is judged when its link is needed."""
    if run.sources.get("device") == COMMAND_LINE:
        refuse_other_family(run)
    source = run.sources.get("port") or run.sources.get("fake")
    if run.settings.kind is None or source is None or source.level != ENVIRONMENT:
        return
    text = f"{source.where} replaces the port of {run.settings.device!r}"
    if run.writes and not run.settings.dry_run:
        raise UsageError(
            f"{text}, so it is unclear which device is meant",
            hint=f"unset {source.where}, or leave out -d",
            code="two-devices",
        )
    run.journal.warn("other-port", text, f"unset {source.where} to reach {run.settings.device}")


def _check_protocol(run: Run, family: Family) -> None:
    """Refuse what was asked for on the command line and this protocol does not have."""
    refuse_missing(family, [key for key, source in run.sources.items() if source == COMMAND_LINE])
    if family.check is not None:
        family.check(run.settings)


def refuse_other_family(run: Run) -> None:
    """Raise UsageError where the name of the device says another family than the command."""
    kind = run.settings.kind
    if kind is None or run.family is None or kind == run.family.kind:
        return
    name = run.settings.device
    raise UsageError(
        f"{name!r} is of family {kind} ({run.sources['kind'].where}), not {run.family.kind}",
        hint=f"use `handctl {kind} …` for {name}, or see `handctl devices list` for the others",
        code="wrong-family",
    )
