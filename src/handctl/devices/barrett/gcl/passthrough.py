"""Send any GCL: as arguments, from a script, or at a prompt. Shows the hand's own text and explains its errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import TYPE_CHECKING, NamedTuple

from handctl.devices.barrett import eeprom_saves
from handctl.devices.barrett.device import BarrettHand, check_line
from handctl.devices.barrett.gcl.codec import COMMANDS, KINDS, Answer, encode, kind_of, split, whole
from handctl.devices.barrett.gcl.status_codes import OVER_TEMPERATURE, explain_status
from handctl.devices.barrett.motion import check_standing_after, refuse_typed_harm
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError, UsageError
from handctl.files import refuse_controls, unmarked
from handctl.interrupts import reset_interrupts
from handctl.model.param import Step
from handctl.model.prompts import Prompts
from handctl.model.result import Column, Row, Table
from handctl.model.stop_on_interrupt import interrupt_error

if TYPE_CHECKING:
    from handctl.command.run import Run

COLUMNS = (Column("command", "Command"), Column("text", "Answer"), Column("status", "Status", right=True))


def saves(texts: Iterable[str]) -> bool:
    """Whether one of the commands writes the EEPROM."""
    return any(kind_of(text) == "save" for text in texts)


SILENT = Prompts()
DELAY = "DELAY"
MOST_MS = 600_000
"""The longest DELAY."""
LONGEST_SCRIPT = 1_000_000
"""Bytes of a file."""


class ScriptLine(NamedTuple):
    """A command, or a pause of `wait` seconds, with the line of the script that it is, 0 = none."""

    text: str
    number: int = 0
    wait: float | None = None

    def named(self, text: str) -> str:
        """A text with the number of this line."""
        return f"line {self.number}: {text}" if self.number else text


def script(lines: Iterable[str], *, force: bool = False) -> list[ScriptLine]:
    """Lines of a script: a command each, or ``DELAY ms``. Empty lines and `#` comments are left out. Raises UsageError."""
    texts = ((number, line.partition("#")[0].strip(" \t\r\n")) for number, line in enumerate(unmarked(lines), 1))
    return [line_of(text, number, force=force) for number, text in texts if text]


def line_of(text: str, number: int = 0, *, force: bool = False) -> ScriptLine:
    """One line. Raises UsageError for what is not sent as it is typed (`check_line`)."""
    line, (name, *words) = ScriptLine(text, number), text.upper().split() or [""]
    try:
        refuse_controls(text)
        if name != DELAY:
            check_line(text, force=force)
            encode(text)
            return line
        if len(words) != 1 or not (words[0].isascii() and words[0].isdecimal()) or int(words[0]) > MOST_MS:
            raise UsageError(
                f"{text!r} is not {DELAY} with a number of milliseconds up to {MOST_MS}",
                hint=f"write for example {DELAY} 500, for half a second",
            )
    except UsageError as exc:
        raise exc.reworded(line.named(exc.text)) from exc
    return line._replace(wait=int(words[0]) / 1000)


def run_all(
    hand: BarrettHand,
    commands: Iterable[ScriptLine],
    *,
    keep_going: bool,
    prompts: Prompts = SILENT,
    force: bool = False,
) -> Table:
    """Send commands one after the other; stops at the first error unless `keep_going`, and without `force` before an opening that may harm.

    An answer that did not come, and Ctrl-C, also in a DELAY, end it in any case: what was carried out before is told all the same.
    """
    rows: list[Row] = []
    failure: HandctlError | None = None
    with DeathGuard(hand) as guard:
        for line in commands:
            text, place = line.text, {"line": line.number} if line.number else {}
            lost: HandctlError | None = None
            try:
                if line.wait is not None:
                    hand.link.sleep(line.wait)
                    continue
                if not force:
                    refuse_typed_harm(hand, text)
                guard.before(text)
                answer = ask(hand, text, prompts)
            except KeyboardInterrupt:
                lost = interrupt_error(hand.abort(), f"in {text}: ")
            except HandctlError as exc:
                exc.text = line.named(exc.text)
                lost = exc
            if lost is not None:
                rows.append({"command": text, "lines": [], "text": "", "status": None, "error": lost.text, **place})
                failure = lost
                break
            rows.append(row_of(answer) | place)
            error = objection(hand, answer)
            if error is not None:
                error.text = line.named(error.text)
                failure = failure or error
                if not keep_going:
                    break
    return Table(rows=rows, columns=COLUMNS, text=as_text, plain=("text",), failure=failure)


class DeathGuard(ExitStack):
    """From the first line that may move something on, the death of this process stops the hand, as in a movement.

    A line that may change the baud rate ends it until the next movement: the child is to know the new one.
    """

    def __init__(self, hand: BarrettHand) -> None:
        super().__init__()
        self._hand = hand
        self._on = False

    def before(self, text: str) -> None:
        """This line goes out next. Of a command that handctl does not know, nobody knows that it moves nothing. Raises LinkError."""
        kind = kind_of(text, "motion")
        if kind == "speed":
            self.close()
            self._on = False
        elif KINDS[kind].moves and not self._on:
            self._hand.line.connect()
            self.enter_context(self._hand.guarded())
            self._on = True


def ask(hand: BarrettHand, text: str, prompts: Prompts) -> Answer:
    """One command once; the hand is looked for again after one that may have changed its speed.

    A movement whose reply does not come is stopped, and the hand is looked at. When it has, the rest of the answer is unusable (dossier 1.2): the status is then taken for 0 once a prompt is found.
    """
    if kind_of(text) != "speed":
        with hand.stopped_by_error(hand.abort, prompts, "The hand"):
            answer = hand.line.ask(text)
            if KINDS[kind_of(text)].moves:
                hand.line.check_ended(text)
                check_standing_after(hand, answer)
            return answer
    hand.line.connect()
    before = hand.line.link.baud
    try:
        answer = hand.line.ask(text)
    except (NoAnswer, ProtocolError):
        hand.line.reconnect()
        if hand.line.link.baud == before:
            raise
        hand.journal.ledger.confirm(f"now replies at {hand.line.link.baud} bit/s", Step(text, encode(text)))
        hand.journal.info(
            "speed-changed",
            f"{text} changed the baud rate to {hand.line.link.baud} bit/s. Its reply was lost in the change",
        )
        return Answer(text, (), 0, b"")
    hand.line.reconnect()
    return answer


def objection(hand: BarrettHand, answer: Answer) -> HandctlError | None:
    """What speaks against an answer: its status, or a character that was corrupted on the line."""
    if answer.status:
        return hand.name_heat(hand.refusal(answer))
    try:
        whole(answer)
    except ProtocolError as exc:
        exc.text = f"{hand.link.name}: {exc.text}"
        return exc
    return None


def row_of(answer: Answer) -> Row:
    """A command with the lines of its answer, its status, and the error in words."""
    row: Row = {
        "command": answer.command,
        "lines": list(answer.lines),
        "text": "\n".join(answer.lines),
        "status": answer.status,
    }
    if answer.status:
        row["error"] = f"ERR {answer.status}: {explain_status(answer.status)}"
    return row


def as_text(rows: list[Row]) -> str:
    """What a terminal at the hand would show."""
    parts = []
    for row in rows:
        parts.append(f"=> {row['command']}\n")
        parts += [f"{line}\n" for line in row["lines"]]
        if "error" in row:
            parts.append(f"{row['error']}\n")
    return "".join(parts)


# -- the interactive prompt -----------------------------------------------------------------------------------------


def candidates(line: str, word: str) -> list[str]:
    """Completions of `word` in `line`: commands first (a motor prefix is kept), then parameters."""
    first = not line.strip() or (not line[: len(line) - len(word)].strip())
    if first:
        size = len(word) - len(word.lstrip("1234GSgs"))
        prefix, rest = word[:size].upper(), word[size:].upper()
        return [
            prefix + name + " "
            for name, command in COMMANDS.items()
            if name.startswith(rest) and (command.prefix or not prefix)
        ]
    return [param.mnemonic + " " for param in BARRETT if param.mnemonic.startswith(word.upper())]


def explain_help(text: str) -> str:
    """The manual's description, in addition to the hand's own help."""
    _, _, arguments = split(text)
    if not arguments:
        return "\n".join(f"  {name:<8} {command.doc}" for name, command in COMMANDS.items())
    name = arguments[0]
    command = COMMANDS.get(name)
    if command is not None:
        span = f" [{command.argument[0]}..{command.argument[1]}]" if command.argument else ""
        return f"  {name}{span}: {command.doc} ({command.source})"
    try:
        param = BARRETT.find(name)[0]
    except UsageError:
        return ""
    return f"  {param.mnemonic}: {param.doc}, {param.range_text} ({param.source})"


def interactive(run: Run, hand: BarrettHand, read_line: Callable[[str], str], before: Callable[[str], None]) -> Table:
    """A prompt like the hand's own: history, completion, ? for help, Ctrl-C stops a movement, Ctrl-D ends.

    `before` checks and asks, where a line needs it, and raises UsageError, NotConfirmed.
    """
    hand.line.connect()
    run.prompts.say("Ctrl-C stops a movement. Ctrl-D ends this GCL prompt. ?NAME explains a command or parameter.")
    with DeathGuard(hand) as guard:
        while True:
            try:
                text = read_line("=> ").strip()
            except EOFError:
                return Table()
            except KeyboardInterrupt:
                run.prompts.say("^C")
                continue
            if text:
                reset_interrupts()  # a Ctrl-C at the prompt must not swallow the next one, which is to stop what begins here
                _one(run, hand, text, before, guard)


def _one(run: Run, hand: BarrettHand, text: str, before: Callable[[str], None], guard: DeathGuard) -> None:
    try:
        before(text)
        guard.before(text)
        ledger = eeprom_saves.Ledger(hand) if saves([text]) else None
        answer = ask(hand, text, run.prompts)
        if ledger is not None and not answer.status:
            ledger.count({})
        for line in answer.lines:
            run.out(line)
        error = objection(hand, answer)
        if answer.status:
            run.out(f"ERR {answer.status}: {explain_status(answer.status)}")
        if error is not None and (not answer.status or answer.status & OVER_TEMPERATURE):
            run.prompts.say(f"{'' if answer.status else error.text}\n  Next: {error.hint}".lstrip("\n"))
        if text.startswith("?") or text.upper().startswith("A?"):
            run.out(explain_help(text))
    except KeyboardInterrupt:
        run.prompts.say(hand.abort().text)
    except DeviceRefused as exc:
        run.prompts.say(exc.text)
    except HandctlError as exc:
        if exc.exit_code == 3:
            raise
        run.prompts.say(f"{exc.text}\n  Next: {exc.hint}" if exc.hint else exc.text)
