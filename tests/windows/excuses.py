"""What may differ between Linux and Windows, with its reason. Whatever else differs is wrong, and so is a reason that no line needs."""

from __future__ import annotations

import re
from typing import NamedTuple


class Mask(NamedTuple):
    """What differs from one run to the next on one system too: it is left out on both before they are compared."""

    pattern: re.Pattern[bytes]
    put: bytes
    reason: str


MASKS = (
    Mask(
        re.compile(rb"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?( ?(UTC|Z|[+-]\d\d:?\d\d))?"),
        b"TIME",
        "the time of day",
    ),
    Mask(re.compile(rb"sha256:[0-9a-f]{64}"), b"sha256:SUM", "a sum over a file with the time of day in it"),
    Mask(re.compile(rb'"(round_trip_ms|spread_ms)": [\d.]+'), rb'"\1": MS', "a time that is measured"),
    Mask(re.compile(rb"(?m)^[0-9.]+ (?=[<>] )"), b"TIME ", "the time of a byte"),
    Mask(re.compile(rb"\b1[0-9]{9}\.[0-9]{6}\b|(?<=\"offset_s\": )-?[0-9.]+"), b"EPOCH", "the time of day, in seconds"),
    Mask(
        re.compile(rb"<dl><dt>system</dt>.*?</dl>"),
        b"<dl>SYSTEM</dl>",
        "what a report says of the system it was made on",
    ),
    Mask(re.compile(rb'(report\.html(?:", "size":)? +)[0-9]+'), rb"\1SIZE", "the size of such a report"),
    Mask(re.compile(rb"\b[0-9a-f]{64}\b"), b"SUM", "the sum over such a report"),
    Mask(
        re.compile(rb"\b73456\d\d\b"),
        b"SECONDS",
        "how long a simulated BarrettHand has been on: it goes on in real time",
    ),
)


class Excuse(NamedTuple):
    """What may differ.

    lines    pattern that a line's text must match from its beginning
    reason   why, as the table shows it
    text     what of the output and the files the reason is about: it is left out on both, and the rest must be equal
    code     the exit code on Windows, None = as on Linux
    """

    lines: re.Pattern[str]
    reason: str
    text: re.Pattern[bytes]
    code: int | None = None


GAPS = rb"[ \xe2\x94\x80-]{2,}"
"""What fills a table whose columns are as wide as what they hold."""
EXCUSES = (
    Excuse(
        re.compile(r"ports( |$)(?!-h)"),
        "it lists the ports of the machine that it runs on",
        re.compile(
            rb'(?s)\A(Link .*|\n)\Z|"rows": \[.*?\],\n  "messages": \[.*?\],\n|\Ahandctl: note: No serial port [^\n]*\n  Next: [^\n]*\s+\Z'
        ),
    ),
    Excuse(
        re.compile(r"(\w+ )?doctor( |$)(?!-h)"),
        "six of its checks are of the machine that it runs on",
        re.compile(rb'(?m)^(\{"check": ")?(python|permissions|modemmanager|brltty|clock|disk)\b[^\n]*\n|' + GAPS),
    ),
    Excuse(
        re.compile(r"completion bash --install"),
        "the folder for data of a user has another name there",
        re.compile(rb"HERE[\w./-]*/bash-completion/|" + GAPS),
    ),
    Excuse(
        re.compile(r"sim exo --pty"),
        "Windows has no pseudo terminals: it says so",
        re.compile(
            rb'\{"ready": true, "link": "/dev/pts/\d+"\}\n'
            rb"|handctl: error: Cannot open a pty: this system has no pseudo terminals.\n  Next: Serve on TCP: [^\n]*\s+\Z"
        ),
        3,
    ),
    Excuse(re.compile(r"scan -p '\{port\}'"), "its table is as wide as the name of the port", re.compile(GAPS)),
    Excuse(
        re.compile(r"exo status .*--fault disconnect\]"),
        "the driver says in its own words that the port is gone",
        re.compile(rb"(?<=the port is gone)(: [^\n\"]*|\.)"),
    ),
)


def masked(text: bytes) -> bytes:
    """A text without what differs from run to run."""
    for mask in MASKS:
        text = mask.pattern.sub(mask.put, text)
    return text


def excuse_for(line: str) -> Excuse | None:
    """The reason why this line may differ."""
    return next((excuse for excuse in EXCUSES if excuse.lines.match(line)), None)
