"""What must hold before a command begins: which device is meant, and that no file is written over another.

Sends nothing and opens no link.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from handctl.errors import OutputError, UsageError
from handctl.files import why_unwritable
from handctl.frame.console import print_message
from handctl.frame.family import Family, refuse_missing, refuse_serial, wire_in
from handctl.frame.filetypes import Named, refuse_clashes
from handctl.frame.options import COMMAND_LINE, ENVIRONMENT, FILE, config_path

if TYPE_CHECKING:
    from handctl.frame.run import Run
    from handctl.model.param import Step
    from handctl.model.result import Journal


UNASKED = "yes-unasked"
"""The message that no -q silences."""


def check_before(run: Run) -> None:
    """Raise UsageError or OutputError where this command line cannot be meant."""
    if run.stops:
        _let_pass(run)
        return
    _check_named_device(run)
    _check_files(run)
    _check_output(run)
    _check_format(run)
    if run.family is not None:
        _check_protocol(run, run.family)


def _let_pass(run: Run) -> None:
    """No file and no format holds up a stop. What its family has to say is `stop.falling_back`."""
    if run.settings.format == "openmetrics":
        run.settings = run.settings._replace(format="table")
    path = run.settings.output
    if path and run.sources["output"] != COMMAND_LINE and (why := why_unwritable(path)):
        run.settings = run.settings._replace(output=None)
        run.journal.warn("passed-over", f"{path} ({run.sources['output'].where}): cannot be written: {why}")
    try:
        _check_files(run)  # what clashes is written nowhere then
    except UsageError as exc:
        run.journal.warn("passed-over", exc.text)


def _check_format(run: Run) -> None:
    """A format that only some commands have."""
    if run.settings.format == "openmetrics":
        from handctl.screen.metrics import refuse

        refuse(run.command)


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
        if wire is not None and run.family is not None and wire_in(run.family, port) != wire:
            raise UsageError(f"--{wire} does not fit {port}", hint="leave it out: the LINK already selects the wire")
        if run.family is not None:
            refuse_serial(run.family, port)
    if port:
        return port
    if run.settings.fake:
        return simulated_link(run)
    where = "-p LINK (`handctl ports` lists the serial ports, -p tcp://HOST:PORT is a TCP device)"
    if run.family is not None and run.family.tcp_port is not None and not run.family.wires:
        where = f"-p tcp://HOST (port {run.family.tcp_port} when not given)"
    raise UsageError(
        "no device given",
        hint=f"give {where}, -d NAME (see `handctl devices list`), or --fake for the simulated {kind}",
        code="no-link",
    )


def simulated_link(run: Run) -> str:
    """The LINK of plain --fake: the simulator of the family on the wire that was asked for."""
    family, wire = run.family, run.settings.wire
    said = [family.simulated(run.settings)] if family is not None and family.simulated is not None else []
    if family is not None and wire is not None and wire != family.wires[0]:
        said.append(f"bus={wire}")
    text = "&".join(filter(None, said))
    return f"fake://{family.kind if family is not None else ''}{'?' if text else ''}{text}"


def _check_files(run: Run) -> None:
    """Raise UsageError when an output of this run would replace an input, the configuration file or another output."""
    settings = run.settings
    outputs = [
        Named(label, path) for label, path in (("--output", settings.output), ("--trace", settings.trace)) if path
    ]
    if not outputs and not run.outputs:
        return
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
    if path and (why := why_unwritable(path)):
        raise OutputError(f"{path}: cannot be written: {why}", hint="choose another file for -o. Nothing was sent.")


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
            hint=f"unset {source.where}, or run the command without -d",
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


def unsent(journal: Journal) -> str:
    """What is certain where the answer to a question was no: some questions are made of what was read."""
    return "nothing was written" if journal.counters.sent else "nothing was sent"


def tell_unasked(run: Run, question: str, steps: Sequence[Step]) -> None:
    """Say it when a variable or a file answered; where that moves a worn device, at once and whatever -q says."""
    from handctl.model.result import Message

    source = run.sources["yes"]
    if source == COMMAND_LINE:
        return
    device = run.opened if run.opened is not None else run.planner()
    moves = not steps or any(step.moves for step in steps)  # a question without steps tells of them by itself
    if getattr(device, "worn", False) and moves:
        text = f"a device that someone may be wearing moves without asking, because of {source.where}: {question}"
        if not any(message.code == UNASKED for message in run.journal.messages):
            run.journal.messages.append(Message("warning", UNASKED, text))
            print_message("warning", text, "")
    elif source.level == FILE:
        run.journal.warn("yes-from-file", f"not asked, because of yes = true in {source.where}")
