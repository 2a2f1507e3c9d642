"""`handctl service --demo`: a simulated device has a fault, the trainee says which, and it is checked and explained.

The faults of a family are those of TRAINING_FAULTS in its module `remedies`; what each of them is the simulator says.
"""

from __future__ import annotations

import random

from handctl.command.family import load
from handctl.command.run import Run
from handctl.errors import CheckFailed, UsageError
from handctl.families import FAMILIES
from handctl.link.fake import meaning_of
from handctl.model.check_rows import FAIL, OK, SKIPPED, Check
from handctl.model.result import Row, Table
from handctl.tools.service_steps import Service, ServiceOptions, findings, said_of
from handctl.wording import sentence

MOST = 1_000_000


def practise(run: Run, kind: str, finding: str | None, seed: int | None, wishes: ServiceOptions) -> Table:
    """One round. Raises UsageError for a finding that is none of the choices."""
    seed = random.randrange(MOST) if seed is None else seed
    draw = random.Random(seed)
    kind = kind or draw.choice(list(FAMILIES))
    practice: dict[str, str] = load(kind, "remedies").TRAINING_FAULTS
    faults = tuple(practice)
    if finding is not None and finding not in faults:
        raise UsageError(
            f"--finding {finding}: not a fault in a demo of {kind}", hint=f"give one of {', '.join(faults)}"
        )
    fault = draw.choice(faults)
    run.settings = run.settings._replace(
        port="&".join(filter(None, (f"fake://{kind}?fault={fault}&clock=virtual", practice[fault])))
    )
    run.prompts.moving = False  # progress names the LINK, and that the fault
    return Demo(run, kind, wishes._replace(written=False), (fault, seed, faults, finding)).carried_out()


class Demo(Service):
    """A service without a report, whose next step is found by the trainee first."""

    def __init__(
        self, run: Run, kind: str, wishes: ServiceOptions, task: tuple[str, int, tuple[str, ...], str | None]
    ) -> None:
        super().__init__(run, kind, wishes)
        self.fault, self.seed, self.faults, self.finding = task
        self.family = kind

    def _declined(self, name: str) -> bool:
        return False

    def _next(self) -> Row:
        """Ask for the finding, and explain what it was."""
        prompts = self.run.prompts
        if self.finding is None and prompts.interactive:
            for row in findings(self.rows):  # whose LINK would say which fault it is
                prompts.say(f"{row['step']}: {said_of(row).replace(self.run.link_name(), 'the device')}")
            for number, name in enumerate(self.faults, 1):
                prompts.say(f"  {number}  {name}: {meaning_of(self.family, name)}")
            answer = prompts.text("Which fault does this device have? Type its number or name.")
            names = dict(zip(map(str, range(1, len(self.faults) + 1)), self.faults, strict=False))
            self.finding = names.get(answer, answer) or None
        right = self.finding == self.fault
        text = f"the fault is {self.fault}: {meaning_of(self.family, self.fault)}"
        if self.finding is not None:
            text = f"{'right' if right else f'not {self.finding}'}: {text}"
        status = SKIPPED if self.finding is None else OK if right else FAIL
        proposal = self.proposal()
        self._add("finding", Check("finding", status, text, proposal))
        self.steps["finding"] = {"state": "done", "code": None} if self.finding else {"state": "skipped", "code": None}
        prompts.say(f"{sentence(text)} Next: {sentence(proposal)}")
        return {"text": sentence(proposal), "command": None, "state": "proposed"}

    def _report(self, path: str, old: dict[str, object] | None, before: dict[str, object]) -> Table:
        """The rows; what decides is whether the finding is right."""
        right = self.finding == self.fault
        told = {"family": self.family, "fault": self.fault, "seed": self.seed, "finding": self.finding}
        self.more["service"]["demo"] = {**told, "right": right if self.finding is not None else None}
        table = super()._report(path, old, before)
        if self.ended is None:
            wrong = CheckFailed(
                f"the fault is {self.fault}, not {self.finding}",
                hint=f"--seed {self.seed} repeats it",
                code="wrong-finding",
            )
            table.failure = None if right or self.finding is None else wrong
        return table
