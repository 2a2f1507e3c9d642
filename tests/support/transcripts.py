"""Reading tests/transcripts: cases of bytes that go out and come in, whoever plays which side."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from handctl.link.transcript import parse
from tests.support.places import TRANSCRIPTS
from tests.support.scripted import Reply, unhex

FOLDER = TRANSCRIPTS
KINDS = ("accept", "twin", "resync", "reject", "never")
WORDS = ("host", "id", "gives", "fails", "notes", "sim", "not")
EXIT_CODES = {
    "no-answer": 4,
    **dict.fromkeys(("bad-checksum", "cut-short", "stale", "fewer-bytes", "wrong-id", "echo", "garbage"), 5),
    **dict.fromkeys(("refused", "save-failed"), 6),
    **dict.fromkeys(("read-back", "errors-remain"), 7),
}
"""Of the codes of `# fails`, cli contract section 5."""
BEFORE, AFTER = unhex("00 FF 7E 90"), unhex("90 EB 33")
"""Junk that ends and begins like a header, but holds no frame."""


@dataclass
class Exchange:
    """One request and what came before the next one, with the delay of each piece."""

    request: bytes
    replies: list[Reply] = field(default_factory=list)


@dataclass
class Case:
    """One case of a transcript file."""

    name: str
    kind: str
    says: dict[str, str] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    @property
    def exchanges(self) -> list[Exchange]:
        found: list[Exchange] = []
        asked = 0.0
        for entry in parse(self.lines, self.name):
            if entry.mark == ">":
                asked = entry.time or 0.0
                found.append(Exchange(entry.data))
            elif entry.mark == "<":
                found[-1].replies.append(((entry.time or asked) - asked, entry.data))
        return found

    @property
    def device_id(self) -> int:
        return int(self.says.get("id", "1"))


def read_cases(path: Path) -> list[Case]:
    cases: list[Case] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("# case "):
            name, _, kind = line.removeprefix("# case ").partition(": ")
            cases.append(Case(f"{path.stem}/{name}", kind))
        elif cases and line.startswith("# "):
            word, _, rest = line[2:].partition(" ")
            if word in WORDS:
                cases[-1].says[word] = rest
        elif cases and line:
            cases[-1].lines.append(line)
    return cases
