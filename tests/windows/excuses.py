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


NO_SECOND_PROCESS = (
    "handctl starts no second process there that stops a device when handctl is killed: a warning says so"
)
UNGUARDED = re.compile(
    rb"handctl: warning: [^\n]*: no second process watches this link[^\n]*\n( +Next: [^\n]*\n)?"
    rb'|(, )?\{"level": "warning", "code": "unguarded"[^{}]*\}'
)
ALL = re.compile(rb"(?s).+")
"""Nothing of it is the same on two machines."""
EXCUSES = (
    Excuse(re.compile(r"(ports|doctor)( |$)(?!-h)"), "it shows the machine that it runs on", ALL),
    Excuse(re.compile(r"completion bash --install"), "Windows has one folder where Linux has three", ALL),
    Excuse(re.compile(r"sim exo --pty"), "Windows has no pseudo terminals: it says so", ALL, 3),
    Excuse(
        re.compile(r"(exo position|wrist move|hand angle|aidin home) .*-p '\{port\}'"), NO_SECOND_PROCESS, UNGUARDED
    ),
    Excuse(
        re.compile(r"scan -p '\{port\}'"),
        "its table is as wide as the name of the port",
        re.compile(rb"[ \xe2\x94\x80-]{2,}"),
    ),
    Excuse(
        re.compile(r"exo status .*--fault disconnect\]"),
        "the driver says in its own words that the port is gone",
        re.compile(rb"(?<=the port is gone): [^\n\"]*"),
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
