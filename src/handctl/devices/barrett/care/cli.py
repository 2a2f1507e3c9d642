"""`handctl barrett maintenance | strain | fingertips | diagnose`: the commands of care. Bodies live in their modules."""

from __future__ import annotations

import click

from handctl.devices.barrett.gcl.language import motor_prefix
from handctl.errors import UsageError
from handctl.frame.clikit import Group, stream_options
from handctl.frame.run import Run
from handctl.model.result import Column, Table

PROCEDURE_NAMES = ("lubrication", "fasteners", "pretension", "strain", "firmware")
HAND_NAME = click.option(
    "--hand", "name", default="", metavar="NAME", help="Whose journal, when serial numbers are not unique (0)."
)


def add_care_commands(group: Group) -> None:
    """Add the commands to the family's group."""
    _add_maintenance(group)
    _add_strain(group)
    _add_fingertips(group)
    _add_diagnose(group)


def _live(run: Run, live: bool, count: int | None, duration: float | None) -> None:
    """Make this run a stream, or refuse a stream's options without --live. Raises UsageError."""
    if not live and (count is not None or duration is not None):
        raise UsageError("--count and --duration are for a stream", hint="add --live")
    run.streams = live


def _add_maintenance(group: Group) -> None:
    @group.verb("maintenance", "Service")
    @click.option("--greased", metavar="POINT", is_flag=False, flag_value="all", help=GREASED_HELP)
    @click.option("--steps", type=click.Choice(PROCEDURE_NAMES), help="How to do it, with sections. Needs no device.")
    @click.option("--check", is_flag=True, help="Exit 7 when anything is due or too hot.")
    @HAND_NAME
    def maintenance(run: Run, greased: str | None, steps: str | None, check: bool, name: str) -> Table:
        """Strokes and cycles per motor, greasing due by point, fasteners, pretension, temperatures (§7).

        The journal of greasing is a file of this machine; nothing is written to the hand.
        """
        if steps is not None:
            return _procedure(steps)
        from handctl.devices.barrett.care import upkeep

        points = upkeep.chosen_points(greased) if greased is not None else []
        hand = run.device()
        care = upkeep.Care(hand, simulated=run.simulated, name=name)
        if points:
            care.grease(points)
        return upkeep.table_of(hand, care, check=check)


GREASED_HELP = "Record as greased now: all, worm, spur, motor-spur, palm, one finger as in spur.F1, several by comma."


def _procedure(name: str) -> Table:
    from handctl.devices.barrett.care import procedures

    found = procedures.PROCEDURES[name]
    rows = [
        {"step": number, "text": text, "source": f"barrett {source}"}
        for number, (text, source) in enumerate(found.steps, 1)
    ]
    return Table(
        rows=rows,
        columns=(Column("step", "Step", right=True), Column("text", found.title), Column("source", "Section")),
        text=lambda _: "\n".join(procedures.lines(name)) + "\n",
    )


def _add_strain(group: Group) -> None:
    @group.verb("strain", "Service", writes=True)
    @click.option(
        "--open", "open_first", is_flag=True, help="MOVES: initialize, free the spread, open the fingers first."
    )
    @click.option(
        "--live", is_flag=True, help="Watch it while the potentiometer is turned; the bar's ends are 100 and 140."
    )
    @click.option("--check", is_flag=True, help="Exit 7 when a reading is not within 100 to 140.")
    @stream_options
    def strain(
        run: Run, open_first: bool, live: bool, check: bool, rate: float, count: int | None, duration: float | None
    ) -> Table:
        """Strain without load: 20 readings per finger against 100 to 140, and how to adjust them (§7.4).

        Only reads; no load is only sure with open fingers, which --open moves (HI, ST, GO).
        """
        from handctl.devices.barrett.care import procedures
        from handctl.devices.barrett.care import strain as gauges

        _live(run, live, count, duration)
        if live and check:
            raise UsageError("--check judges readings, --live shows them", hint="leave one out")
        if run.settings.dry_run:
            if not open_first:
                raise UsageError("`handctl barrett strain` without --open only reads", hint="run it without -n")
            run.streams = False
            return run.dry_run(gauges.preparation_steps())
        if not open_first:
            run.only_reads()
        hand = run.device()
        if open_first:
            gauges.prepare(hand, run.guide)
        if not live:
            return gauges.table(hand, check=check)
        for line in procedures.lines("strain") if run.settings.format == "table" else []:
            run.guide.say(line)
        return gauges.stream(hand, rate=rate, count=count, duration=duration)


def _add_fingertips(group: Group) -> None:
    @group.verb("fingertips", "Look")
    @click.option(
        "--positions",
        nargs=4,
        type=click.IntRange(0, 20000),
        metavar="F1 F2 F3 SPREAD",
        help="Counts to calculate with instead of the hand's. Needs no device.",
    )
    @click.option(
        "--breakaway", multiple=True, metavar="FINGER=COUNTS", help="With --positions: the clutch let go at COUNTS."
    )
    @click.option("--live", is_flag=True, help="Again and again: live view on a terminal, a stream elsewhere.")
    @stream_options
    def fingertips(
        run: Run,
        positions: tuple[int, int, int, int] | None,
        breakaway: tuple[str, ...],
        live: bool,
        rate: float,
        count: int | None,
        duration: float | None,
    ) -> Table:
        """Fingertips in mm from the palm's centre, joint angles and their limits (§9.5, §9.6). Only reads.

        From where a clutch let go (firmware 4.34 and later tell), the angles after breakaway; else before is assumed.
        """
        from handctl.devices.barrett.care import fingertips as tips

        _live(run, live, count, duration)
        if positions is not None:
            if live:
                raise UsageError("--positions are given once, --live asks the hand", hint="leave one out")
            return tips.offline(positions, tips.breakaways(breakaway))
        if breakaway:
            raise UsageError("--breakaway is for --positions", hint="a hand with firmware 4.34 tells its own")
        if live:
            return tips.stream(run.device(), rate=rate, count=count, duration=duration)
        return tips.now(run.device())


def _add_diagnose(group: Group) -> None:
    @group.verb("diagnose", "Service", writes=True)
    @click.argument("symptom", required=False)
    @click.option("--list", "listed", is_flag=True, help="The symptoms of the manual. Needs no device.")
    @click.option("--move", is_flag=True, help="MOVES: also try the symptom's movements (asks first).")
    @click.option("--motors", metavar="123", default="G", show_default=True, help="Fingers to move with --move.")
    @HAND_NAME
    def diagnose(run: Run, symptom: str | None, listed: bool, move: bool, motors: str, name: str) -> Table:
        """Troubleshooting (§8): what can be checked, then for a SYMPTOM what is left to hands, with sections.

        Exit 7 when a check is a warning or a fail; also when the hand does not answer at all.
        """
        from handctl.devices.barrett.care import diagnose as doctor
        from handctl.devices.barrett.care import trials
        from handctl.devices.barrett.care.checks import Patient

        if listed:
            return doctor.list_table()
        entry = doctor.symptom_of(symptom) if symptom is not None else None
        names = entry.trials if entry is not None else ()
        digits = motor_prefix(motors)
        if move and (not names or "4" in digits):
            raise UsageError(
                "--move needs a symptom that has movements, and fingers to move",
                hint="`handctl barrett diagnose --list`; --motors 1 2 3 G. Nothing was sent.",
            )
        steps = trials.steps(names, digits) if move else []
        if run.settings.dry_run:
            if not move:
                raise UsageError("`handctl barrett diagnose` without --move only reads", hint="run it without -n")
            return run.dry_run(steps)
        if move:
            run.confirm("This moves the hand: nobody and nothing within its reach", steps)
        else:
            run.only_reads()
        hand = run.device()
        patient = Patient(hand, simulated=lambda: run.simulated, name=name)
        wanted = [*doctor.USUAL, *(entry.checks if entry is not None else ())]
        findings, failure = doctor.examine(patient, wanted, run.settings.baud)
        answers = findings[0].status == "ok" and failure is None
        if move and answers:
            findings += trials.run_all(patient, names, digits, run.guide)
        else:
            findings += trials.not_run(names, "no communication" if not answers else "moves the hand: --move")
        return doctor.table_of(hand, findings, symptom, failure)
