"""What the tests of the BarrettHand share: a hand made of a table from command to answer, and the simulated one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.line import GclLine
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.link import ByteLink, Deadline, open_link
from handctl.model.param import Element
from handctl.model.result import Journal
from tests.support.scripted import RecordedLink, ScriptedLink

Script = Mapping[str, "str | bytes | Sequence[str | bytes | None] | None"]
ABORT, CR, PROMPT = b"\x03", b"\r", b"\n\r=> "
QUESTION = b"!\0\r"
MET = b"!\0\n\rERR 32\n\r=> "
REST = bytes(8) + QUESTION
EIGHT = (ABORT, CR, QUESTION, REST, b"\0\x03")


def gcl(command: str, *lines: str, end: bytes = b"\n\r", prompt: bytes = b"=> ") -> bytes:
    """An answer as it stands on the line: echo, line ends, prompt. Made by hand, not by the code under test."""
    return command.encode() + b"".join(end + line.encode() for line in lines) + end + prompt


class ScriptedHand(ScriptedLink):
    """Answers commands from a table, prompts to ^C, CR and the question of a connect; everything else is a failure of the test.

    A text is the lines of the answer, separated by ``|`` (empty for none); bytes are the whole answer as it stands;
    None is silence; ``*`` answers all reads that are not in the table, every value with its text; a list is used up one by one, its last entry stays. `speed` is the hand's own: bytes of any other
    speed meet `garble`. With `dribble` every byte arrives by itself; `thinks` is the time
    between the echo and the rest.
    """

    def __init__(self, script: Script | None = None, *, speed: int = 9600, baud: int | None = 9600) -> None:
        super().__init__(self._reply, baud)
        self.script = {name: list(v) if isinstance(v, list | tuple) else [v] for name, v in (script or {}).items()}
        self.speed = speed
        self.garble = b""
        self.dribble = 0.0
        self.delay = 0.0
        self.thinks = 0.0
        self.deaf = False
        self.on_abort: bytes | None = PROMPT

    def _reply(self, request: bytes) -> list[tuple[float, bytes]]:
        if self.deaf:
            return []
        if self.baud is not None and self.baud != self.speed:
            return [(self.delay, self.garble)] if self.garble else []
        data = self._data(request)
        if not self.dribble:
            echo = len(request) - 1 if data.startswith(request[:-1]) else 0
            pieces = ((0.0, data[:echo]), (self.thinks, data[echo:]))
            return [(self.delay + after, piece) for after, piece in pieces if piece]
        return [(self.delay + self.dribble * place, bytes([byte])) for place, byte in enumerate(data)]

    def _data(self, request: bytes) -> bytes:
        if request == ABORT:
            return self.on_abort or b""
        if request == CR:
            return PROMPT
        if request in (QUESTION, REST):
            return request.removesuffix(QUESTION) + MET
        command = request.removesuffix(CR).decode()
        if command not in self.script and "*" in self.script and "GET " in command:
            prefix, *names = command.split()
            motors = 1 if prefix == "PGET" else len(prefix) - 4 or 4
            return gcl(command, *[" ".join([str(self.script["*"][0])] * motors)] * len(names))
        assert command in self.script, f"never expected: {command!r}"
        answers = self.script[command]
        answer = answers.pop(0) if len(answers) > 1 else answers[0]
        if command.startswith("PSET BAUD ") and isinstance(answer, str) and "ERR" not in answer:
            self.speed = int(command.split()[-1]) * 100
            return command.encode()  # what follows has the new speed: unusable
        if answer is None or isinstance(answer, bytes):
            return answer or b""
        return gcl(command, *(answer.split("|") if answer else []))

    @property
    def commands(self) -> list[str]:
        """The command lines sent, without ^C and empty lines."""
        return commands(self.sent)


class Simulated(RecordedLink):
    """The simulator on virtual time, recorded; `control` reaches the body of the hand."""

    def __init__(self, query: str = "", baud: int | None = 9600) -> None:
        super().__init__(open_link(f"fake://barrett?clock=virtual{'&' if query else ''}{query}", baud=baud))  # type: ignore[arg-type]

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        data = self.inner.read(
            Deadline(self.now, min(deadline.at, self.interrupt_at)), size
        )  # not beyond the interrupt
        if not data:
            self._check()
        return data

    def feed(self, data: bytes) -> None:
        """Bytes that somebody else typed."""
        self.inner.write(data, Deadline(self.now, self.now() + 1))

    @property
    def commands(self) -> list[str]:
        return commands(self.sent)


def commands(sent: Sequence[bytes]) -> list[str]:
    return [data.removesuffix(CR).decode() for data in sent if data not in EIGHT]


def hand_on(link: ByteLink, **options: object) -> BarrettHand:
    """A hand behind `link`; options are those of GclLine."""
    return BarrettHand(GclLine(link, Journal(), **options))  # type: ignore[arg-type]


def scripted(script: Script | None = None, **options: object) -> tuple[BarrettHand, ScriptedHand]:
    """A connected hand behind a table of answers; what the connection sent is forgotten."""
    link = ScriptedHand(script)
    hand = hand_on(link, **options)
    hand.line.connect()
    link.sent.clear()
    link.sent_at.clear()
    return hand, link


def simulated(query: str = "initialized=1", **options: object) -> tuple[BarrettHand, Simulated]:
    """A connected hand in front of the simulator."""
    link = Simulated(query)
    hand = hand_on(link, **options)
    hand.line.connect()
    link.sent.clear()
    return hand, link


def elements(*names: str) -> list[Element]:
    """``P SG.F1`` -> elements."""
    return [element for name in names for element in BARRETT.find(name)[1]]


def changes(*texts: str) -> list[tuple[Element, int | float]]:
    """``HSG.F1=150`` -> checked changes."""
    return BARRETT.assignments_on(texts, ["F1", "F2", "F3", "SPREAD"])


def codes(hand: BarrettHand) -> list[str]:
    """Codes of the messages that were left."""
    return [message.code for message in hand.journal.messages]
