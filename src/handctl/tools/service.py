"""`handctl service`: guided service of one device, from an unknown port to a report that says what to do next. Only reads."""

from __future__ import annotations

from typing import Any

import click

from handctl.command.command_tree import Command
from handctl.command.options import FiniteRange, InFile, OutFile, WholeRange, page_options, reads_option
from handctl.command.run import Run
from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.model.result import Table

STEPS = {
    "doctor": "check this computer, the link and the replies of the device",
    "status": "read its health",
    "diagnose": "run the diagnosis of its manual",
    "watch": "watch its values for some seconds",
    "dump": "read every quantity, and keep its settings for comparison",
}
"""Step -> what it does. Each of them only reads."""


@click.command("service", cls=Command)
@click.argument("link", required=False)
@click.option(
    "--family",
    type=click.Choice(list(FAMILIES)),
    metavar="FAMILY",
    help="The family of the device, so that handctl need not detect it.",
)
@click.option("--complaint", metavar="TEXT", help="What is wrong, in the words of whoever uses the device.")
@click.option("--ticket", metavar="TEXT", help="The number of the service ticket.")
@click.option(
    "--report",
    "path",
    type=OutFile(),
    metavar="FILE.html",
    help="The report (default: service-TIME.html in this folder, or the file given with --resume).",
)
@click.option(
    "--skip",
    type=click.Choice(list(STEPS)),
    multiple=True,
    help="Skip this step. Can be repeated. On a terminal, press s.",
)
@click.option(
    "--resume",
    type=InFile(),
    metavar="FILE",
    help="Continue an earlier service: steps that its report contains are not repeated.",
)
@click.option("--against", type=InFile(), metavar="OLD", help="Show what differs from an older report.")
@click.option(
    "--watch", type=FiniteRange(0.1, 600), default=3.0, show_default=True, metavar="S", help="Watch for S seconds."
)
@reads_option
@click.option("--follow", is_flag=True, help="Carry out the proposed step without asking, if it only reads.")
@page_options
@click.option(
    "--demo",
    is_flag=False,
    flag_value="any",
    type=click.Choice(["any", *FAMILIES]),
    metavar="[FAMILY]",
    help="Practise finding the fault of a simulated device.",
)
@click.option("--finding", metavar="FAULT", help="Your finding in a demo. Without it, handctl asks.")
@click.option("--seed", type=WholeRange(min=0), metavar="N", help="Choose the fault of a demo by this number.")
def cli(
    run: Run,
    link: str | None,
    family: str | None,
    demo: str | None,
    finding: str | None,
    seed: int | None,
    **given: Any,
) -> Table:
    """Guided service: find the device, check it, and write one report with the next step.

    Finds port and device, then runs doctor, the family's diagnosis, status and some seconds of watching, and proposes one next step.
    It only reads: a step that writes or moves is shown as the command to type. If a step fails, the report says so, and the others
    still run. On a terminal it asks for the complaint, and for confirmation before each step. `diff` compares two reports, and `-p replay:FILE.html`
    plays one. Exit code 7 means that something was found or could not be read.
    """
    from handctl.tools.service_steps import Service, ServiceOptions, practise

    run.reach(link)
    if demo is None and (finding is not None or seed is not None):
        raise UsageError("--finding and --seed belong to --demo", hint="add --demo")
    run.said.include_ids = given["include_ids"]
    wishes = ServiceOptions(STEPS, reads=given.pop("count"), **given)
    if demo is not None:
        if link is not None or family is not None or run.settings.port or run.settings.fake:
            raise UsageError("a demo has a simulated device of its own", hint="leave out LINK and --family")
        return practise(run, "" if demo == "any" else demo, finding, seed, wishes)
    return Service(run, family or run.settings.kind, wishes).carried_out()
