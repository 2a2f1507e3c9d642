"""`handctl prove`: the open points of a family's documents, asked of one device; the facts file, and two of them compared.

The experiments are rows of the families, in their module `proofs`; when an answer counts is in `model.proofs`. Reading is the default.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import click

from handctl.command.command_tree import Command
from handctl.command.family import load
from handctl.command.options import FamilyOption, FiniteRange, InFile, WholeRange
from handctl.command.run import PlannedAction, Run
from handctl.errors import DeviceRefused, HandctlError, Hint, Interrupted, UsageError
from handctl.families import FAMILIES
from handctl.model import facts_file
from handctl.model.param import Step
from handctl.model.proofs import LEVELS, LISTED, PERMANENT, READ, REPETITIONS, Outcome, Proof, carry_out, table_of
from handctl.model.result import Table
from handctl.tools.family_probe import family_of, probe_of

DIFF = "diff"
LISTS = "`--list --level permanent` lists all experiments, and --only names one"


def _own_of_writing(body: Callable[..., Any]) -> Callable[..., Any]:
    """The options that a family's own writing commands ask for: an experiment that writes needs them too."""
    for family, row in FAMILIES.items():
        for option in row.options:
            if option.asked:
                body = click.option(f"--{option.name}", cls=FamilyOption, of=family)(body)
    return body


def _opens_none(params: Mapping[str, Any]) -> bool:
    return bool(params["listing"]) or params["what"] == DIFF


@click.command("prove", cls=Command, writes=True, asks="with any --level but read", offline_when=_opens_none)
@click.argument("what", type=click.Choice([*FAMILIES, DIFF]), metavar=f"FAMILY|{DIFF}", required=False)
@click.argument("files", nargs=-1, type=InFile(), metavar="[A B]")
@click.option("--list", "listing", is_flag=True, help="List the experiments and send nothing. Needs no device.")
@click.option(
    "--level",
    type=click.Choice(LEVELS),
    default=READ,
    show_default=True,
    help="The most that an experiment may do: read, write and put back, move the device, or write what cannot be put back, such as flash. The last kind also has to be named with --only.",
)
@click.option("--only", multiple=True, metavar="NAME", help="Only this fact. Can be repeated.")
@click.option(
    "--repeat",
    type=WholeRange(2, 20),
    default=REPETITIONS,
    show_default=True,
    metavar="N",
    help="Repeat each experiment N times. All of them must agree.",
)
@click.option(
    "--meter", type=FiniteRange(0.1, 100), metavar="V", help="The reading of a voltmeter at the supply of the device."
)
@_own_of_writing
@click.option("--identify", is_flag=True, help="Keep the serial number and other identifying data in the facts file.")
def cli(
    run: Run, what: str | None, files: tuple[str, ...], listing: bool, level: str, only: tuple[str, ...], repeat: int, meter: float | None, identify: bool
) -> Table | PlannedAction:  # fmt: skip
    """Find out what the documents leave open about one device.

    Each experiment compares what the device does with what handctl assumes. The result is one of: as assumed, differs,
    not shown (inconclusive), refused. A disturbed line never gives a fact. With -o FILE the facts go to FILE (JSON), for --facts on later commands, and the table is
    still printed. `handctl prove diff A B` compares two such files.
    """
    what = what or run.settings.kind
    if what is None:
        raise UsageError("no family given", hint=f"add one of {', '.join(FAMILIES)}, or `{DIFF} A B`")
    if what == DIFF:
        if len(files) != 2:
            raise UsageError(
                "`handctl prove diff` compares two facts files", hint="give both: `handctl prove diff A B`"
            )
        return facts_file.compared(*files, measured=_measured)
    if files:
        raise UsageError(f"{files[0]!r} is not expected here", hint="only `handctl prove diff A B` takes files")
    proofs = _chosen(what, level, only)
    if listing:
        return Table(rows=[proof.listed(what) for proof in proofs], columns=LISTED, plain=("fact", "assumed"))
    run.family = family_of(what)
    if run.family.check is not None:
        run.family.check(run.settings)
    proofs = _asked_by_name(proofs, only)
    if meter is not None and not any(proof.typed for proof in proofs):
        raise UsageError("none of these experiments needs --meter", hint=f"leave it out. {LISTS}")
    proofs = [_with_reading(run, proof, meter) if proof.typed else proof for proof in proofs]
    path, run.settings = run.settings.output, run.settings._replace(output=None)
    prove = partial(_prove, run, proofs, repeat, path, identify)
    if level == READ:
        run.only_reads("--level")
        return prove(run.device())
    module = load(what, "proofs")
    equip = module.writer_for(run) if hasattr(module, "writer_for") else None
    prove = partial(_prove, run, proofs, repeat, path, identify, equip=equip)
    questions = ". ".join(dict.fromkeys(proof.question for proof in proofs if proof.question))
    return PlannedAction(partial(_plan, run, proofs), prove, questions)


def _measured(family: str) -> list[str]:
    return [proof.name for proof in load(family, "proofs").PROOFS if proof.measured]


def _asked_by_name(proofs: Sequence[Proof], only: Sequence[str]) -> list[Proof]:
    """Without those that write what stays, unless they are named. Raises UsageError where nothing is left."""
    left = [proof for proof in proofs if proof.level != PERMANENT or proof.name in only]
    if not left:
        raise UsageError("no experiment is left", hint=LISTS)
    return left


def _with_reading(run: Run, proof: Proof, meter: float | None) -> Proof:
    """The proof with what a person reads from an instrument: --meter, or typed now."""
    if meter is None and run.asks and not run.settings.dry_run:
        try:
            meter = float(run.prompts.text(f"{proof.typed} Press Enter to skip.").replace(",", "."))
        except ValueError:
            meter = None
    return proof._replace(ask=partial(proof.ask, meter))


def _plan(run: Run, proofs: Sequence[Proof]) -> list[Step]:
    """The writes of a dry run. What writes the value that it reads first is named."""
    planner, steps = run.planner(), list[Step]()
    for proof in proofs:
        steps += proof.steps(planner)
        if proof.question and not proof.steps(planner):
            run.journal.info("plan-open", f"not in this plan: {proof.name}, which writes the value that it first reads")
    return steps


def _chosen(family: str, level: str, only: Sequence[str]) -> list[Proof]:
    """The rows of a family up to a level, or those of these names. Raises UsageError."""
    try:
        every: Sequence[Proof] = load(family, "proofs").PROOFS
    except ModuleNotFoundError:
        raise UsageError(f"no experiments are known for {family}", hint=Hint("see {}", "prove -h")) from None
    if unknown := [name for name in only if name not in {proof.name for proof in every}]:
        raise UsageError(f"no fact {unknown[0]!r} of {family}", hint=f"known: {', '.join(dict.fromkeys(proof.name for proof in every))}")  # fmt: skip
    most = LEVELS.index(level)
    found = [proof for proof in every if LEVELS.index(proof.level) <= most and (not only or proof.name in only)]
    if missing := set(only) - {proof.name for proof in found}:
        raise UsageError(f"the experiment {min(missing)} does more than {level}", hint=f"give its --level. {LISTS}")
    return found


def _prove(
    run: Run,
    proofs: Sequence[Proof],
    repeat: int,
    path: str | None,
    identify: bool,
    device: Any,
    equip: Callable[[Any], None] | None = None,
) -> Table:
    """Carry the proofs out, one after the other; keep the facts in `path`. `equip` gives the device what its family writes with."""
    kind = device.kind
    module, probe = load(kind, "proofs"), probe_of(kind)
    if hasattr(module, "prepare"):
        module.prepare(device)
    ping = partial(probe.ping, device)
    ping()
    if hasattr(probe, "identify") and not run.settings.assume_identity:
        status, evidence, remedy = probe.identify(device)
        if status == "fail":
            raise DeviceRefused(evidence, hint=remedy, code="other-device")
    if equip is not None:
        equip(device)
    outcomes: list[Outcome] = []
    failure: HandctlError | None = None
    for number, proof in enumerate(proofs, 1):
        run.prompts.progress(f"{number} of {len(proofs)}: {proof.name}")
        try:
            outcomes.append(carry_out(proof, device, ping, repeat, run.prompts))
        except KeyboardInterrupt:
            failure = Interrupted()
            break
        except HandctlError as exc:
            failure = exc
            break
    run.prompts.done()
    lost = facts_file.keep(path, device, outcomes, identify=identify) if path is not None and outcomes else None
    table = table_of(outcomes, kind)
    table.failure = failure or lost
    return table
