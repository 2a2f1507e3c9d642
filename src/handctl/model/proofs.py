"""Proofs: the open points of a device's documents as small experiments, and the facts that they show.

A row is an experiment; what it asks is known by its family. Here is when an answer counts: only between two healthy exchanges,
with no damage on the line meanwhile, twice running and the same every time. Anything else is "not shown", never a fact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import Any

from handctl.errors import CheckFailed, DeviceRefused, HandctlError, Hint, LinkError, ProtocolError
from handctl.fast_classes import NamedTuple
from handctl.model.param import Step
from handctl.model.prompts import Prompts
from handctl.model.result import Cell, Column, Counters, Grid, Row, Table
from handctl.model.stop_on_interrupt import stopped_by_ctrl_c

READ, WRITE_BACK, MOVE, PERMANENT = LEVELS = ("read", "write-back", "move", "permanent")
"""What an experiment does to the device at the most. `permanent` writes what cannot be put back, such as flash: it is asked for by name."""
AS_ASSUMED, DIFFERS, NOT_SHOWN, REFUSED = "as-assumed", "differs", "not-shown", "refused"
SHOWN = (AS_ASSUMED, DIFFERS)
"""Verdicts on a value that was shown."""
TONES = {AS_ASSUMED: "good", DIFFERS: "warn", REFUSED: "bad", NOT_SHOWN: "dim"}
NONE = "none"
"""The value of a list that is empty."""
REPETITIONS = 3
"""How often each experiment is carried out unless told otherwise."""
SPARE = 2
"""Attempts beyond those asked for: so many may be spoiled. What moves or stays is not done again after a disturbance."""
CLOSE = 0.5
"""Share by which two measurements of one quantity may differ, and the least difference that counts."""
LEAST = 3.0
COLUMNS = (
    Column("fact", "Fact"),
    Column("level", "Level"),
    Column("verdict", "Verdict"),
    Column("value", "This device"),
    Column("assumed", "handctl assumes"),
    Column("evidence", "Evidence"),
)
LISTED = (
    *COLUMNS[:2],
    COLUMNS[4],
    Column("says", "Documents"),
    Column("how", "Experiment"),
    Column("verdicts", "Verdict drawn"),
)


class Observation(NamedTuple):
    """What one experiment showed: `value` is a number or a text, None = it does not show."""

    value: Any
    evidence: str


class Disturbed(ProtocolError):
    """What came, or stayed away, is damage: it shows nothing of the device."""

    def __init__(self, text: str) -> None:
        super().__init__(text, hint=Hint("check the cable with {}, then run it again", "doctor"), code="disturbed")


class SignOfHarm(CheckFailed):
    """What may harm the device or a person: whatever the proof, nothing is asked again, and the run ends."""

    default_code = "harm"
    stopped = False
    """Whether the device was stopped for it."""


class Proof(NamedTuple):
    """One open point.

    says     what the manual or the dossier says, with its source
    assumed  the value that handctl goes by; a tuple = any of these; () = any at all
    how      the experiment in words
    ask      carries it out on the device; what moves or stays gets the prompts as well. Raises NoAnswer or ProtocolError where the line failed; what the device's silence or refusal means it knows itself
    level    what it does to the device
    limit    the value is a number: as assumed up to it ("most"), or from it on ("least")
    measured the value is a measurement: attempts need only come close, and their median counts
    steps    what it writes, for the plan
    question what is asked before, for a level other than reading
    typed    what a person reads from an instrument for it, as a question; `ask` gets that number, None = nobody typed one
    alone    it happens once and nothing may be sent next to it: it is asked once, between no other exchanges
    """

    name: str
    says: str
    assumed: Any
    how: str
    ask: Callable[..., Observation]
    level: str = READ
    limit: str = ""
    measured: bool = False
    steps: Callable[[Any], Sequence[Step]] = lambda _: ()
    question: str = ""
    typed: str = ""
    alone: bool = False

    @property
    def expected(self) -> str:
        """What handctl assumes, in words."""
        values = self.assumed if isinstance(self.assumed, tuple) else (self.assumed,)
        prefix = {"most": "at most ", "least": "at least "}.get(self.limit, "")
        return prefix + (" or ".join(map(in_words, values)) or "any value")

    def verdict(self, value: Any) -> str:
        """Of a value that was shown."""
        if self.limit:
            fits = value <= self.assumed if self.limit == "most" else value >= self.assumed
        else:
            fits = (
                not self.assumed or value in self.assumed if isinstance(self.assumed, tuple) else value == self.assumed
            )
        return AS_ASSUMED if fits else DIFFERS

    def listed(self, family: str) -> Row:
        """The row of --list."""
        drawn = f"as assumed: {self.expected}. Any other value differs" if self.assumed != () else "any value is a fact"
        return {
            "fact": self.name, "family": family, "level": self.level, "assumed": self.expected,
            "says": self.says, "how": self.how, "verdicts": drawn,
        }  # fmt: skip


class Outcome(NamedTuple):
    """What became of a proof: `times` good attempts agree on `value`; `why` is the code of what kept it from being shown."""

    proof: Proof
    verdict: str
    value: Any
    evidence: str
    times: int = 0
    why: str = ""

    def row(self, family: str) -> Row:
        """Its row."""
        return {
            "fact": self.proof.name, "family": family, "level": self.proof.level, "verdict": self.verdict, "value": self.value,
            "assumed": self.proof.expected, "evidence": self.evidence, "repetitions": self.times, "why": self.why or None,
        }  # fmt: skip

    def fact(self) -> dict[str, Any]:
        """Its entry of the facts file: nothing in it names the device or the link, as messages of errors do."""
        shown = self.verdict in SHOWN
        more = {"evidence": self.evidence} if shown else {"why": self.why}
        return {"verdict": self.verdict, "value": self.value, "assumed": self.proof.expected, "level": self.proof.level, "repetitions": self.times, **more}  # fmt: skip


def in_words(value: Any) -> str:
    """A value for people."""
    return "–" if value is None else str(value)


def carry_out(proof: Proof, device: Any, healthy: Callable[[], object], repeat: int, prompts: Prompts) -> Outcome:
    """Carry one proof out `repeat` times, what stays or is `alone` once. `healthy` is the cheapest documented read.

    Between two movements Ctrl-C stops the device as in one. Raises LinkError, SignOfHarm, and whatever a proof that writes or moves raises: then it is not known that the value was put back, or it is a
    sign of harm.
    """
    repeat = 1 if proof.alone or proof.level == PERMANENT else repeat
    spare = SPARE if proof.level in (READ, WRITE_BACK) else 0
    found: list[Observation] = []
    spoiled: list[Outcome] = []
    while len(found) < repeat and len(spoiled) <= spare:
        try:
            with stopped_by_ctrl_c(device.stop, prompts) if proof.level == MOVE else nullcontext():
                seen = _attempt(proof, device, healthy, prompts)
        except (LinkError, SignOfHarm):
            raise
        except HandctlError as exc:
            if proof.level != READ or exc.code == "deadline":
                raise
            verdict = REFUSED if isinstance(exc, DeviceRefused) else NOT_SHOWN
            spoiled.append(Outcome(proof, verdict, None, exc.text, why=exc.code))
        else:
            if seen is None:
                text = "the line was disturbed: data came that belongs to no reply, or the experiment did not end alike twice"
                spoiled.append(Outcome(proof, NOT_SHOWN, None, text, why="disturbed"))
            elif seen.value is None:
                return Outcome(proof, NOT_SHOWN, None, seen.evidence, why="no-sign")
            else:
                found.append(seen)
    if len(found) < repeat:
        why = next((one for one in spoiled if one.verdict == NOT_SHOWN), spoiled[0])
        return why._replace(verdict=NOT_SHOWN) if found else why
    if not all(alike(proof, found[0].value, seen.value) for seen in found):
        told = ", ".join(dict.fromkeys(in_words(seen.value) for seen in found))
        return Outcome(proof, NOT_SHOWN, None, f"repetitions disagree: {told}", why="disagrees")
    middle = sorted(found, key=lambda seen: seen.value)[len(found) // 2] if proof.measured else found[0]
    return Outcome(proof, proof.verdict(middle.value), middle.value, middle.evidence, len(found))


def _attempt(proof: Proof, device: Any, healthy: Callable[[], object], prompts: Prompts) -> Observation | None:
    """The experiment between two healthy exchanges; None where the line was disturbed meanwhile.

    What reads is done twice running: of a fault that meets every second request, never both are hit and no healthy one.
    """
    if proof.alone:
        return proof.ask(device, prompts)
    counters = device.journal.counters
    healthy()
    before = _damage(counters, proof)
    first = proof.ask(device, prompts) if proof.level in (MOVE, PERMANENT) else proof.ask(device)
    second = proof.ask(device) if proof.level == READ else first
    healthy()
    if _damage(counters, proof) != before or not alike(proof, first.value, second.value):
        return None
    return first


def _damage(counters: Counters, proof: Proof) -> tuple[int, ...]:
    """What writes looks for free ids and the like by silence, which is asked twice."""
    return damage(counters, retries=proof.level == READ)


def damage(counters: Counters, *, retries: bool = True) -> tuple[int, ...]:
    """What shows a disturbed line, where it has changed."""
    again = counters.retries if retries else 0
    return counters.bad_frames, counters.stray_bytes, again, counters.quality().get("bad", 0)


def alike(proof: Proof, one: Any, other: Any) -> bool:
    """Whether two attempts show the same."""
    return close(one, other) if proof.measured and one is not None and other is not None else bool(one == other)


def close(one: float, other: float) -> bool:
    """Whether two measurements may be of one quantity."""
    return abs(one - other) <= max(LEAST, CLOSE * max(abs(one), abs(other)))


def put_back(do: Callable[[], object]) -> None:
    """Put back what was written, and read it back. Ctrl-C meanwhile does not end that: it is done once more first."""
    try:
        do()
    except KeyboardInterrupt:
        do()
        raise


def view(rows: list[Row]) -> list[Grid]:
    """Fact, verdict and value side by side."""
    lines = tuple(
        (row["fact"], Cell(row["verdict"].replace("-", " "), TONES[row["verdict"]]), in_words(row["value"]), row["assumed"], row["evidence"])
        for row in rows
    )  # fmt: skip
    return [Grid(("Fact", "Verdict", "This device", "handctl assumes", "Evidence"), lines)]


def table_of(outcomes: Sequence[Outcome], family: str) -> Table:
    """The rows, one a proof."""
    return Table(
        rows=[one.row(family) for one in outcomes], columns=COLUMNS, view=view, plain=("fact", "verdict", "value")
    )
