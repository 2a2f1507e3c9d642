"""Typed bytes that never reach an EksoNR: command 157, which starts a movement, and what writes without an audit log.

Every way on which bytes of one's own go out, and every way to hide a command: cut, glued, damaged, in another length convention.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.devices.ekso.frames import LENGTH_MODES, OVERHEAD, crc
from handctl.tools import terminal
from tests.contract.facts import facts_of, passed
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.person import person

START, SET, CANCEL, GET_TIME = 157, 155, 156, 150
BODIES = {START: b"\1\0", SET: b"\0\xca\6\x0e", CANCEL: b"\1\0"}
LINK = facts_of("ekso").link("ekso", "")


def frame(command: int, mode: str = "body", msg_id: int = 9, body: bytes | None = None) -> str:
    found = BODIES[command] if body is None else body
    head = bytes([command, len(found) + LENGTH_MODES[mode]]) + msg_id.to_bytes(2, "big") + found
    return (head + crc(head).to_bytes(2, "big")).hex(" ").upper()


def cut(text: str, at: int) -> list[str]:
    """The same in two lines: behind so many bytes."""
    return [text[: 3 * at - 1], text[3 * at :]]


READ = frame(GET_TIME, body=b"")
HIDDEN: dict[str, list[str]] = {
    **{f"{mode} {command}": [frame(command, mode)] for mode in LENGTH_MODES for command in BODIES},
    **{f"cut at {at}, {command}": cut(frame(command), at) for at in range(1, OVERHEAD + 2) for command in BODIES},
    **{f"behind a request to read, {command}": [f"{READ} {frame(command)}"] for command in BODIES},
    **{f"behind its half, {command}": [*cut(READ, 3), frame(command)] for command in BODIES},
    **{f"behind stray bytes, {command}": ["2A 00", f"00 01 {frame(command)}"] for command in BODIES},
    **{f"begun, {command}": [f"{command:02X}"] for command in BODIES},
    **{f"with a bad sum, {command}": [frame(command)[:-2] + "00"] for command in BODIES},
    **{f"in a damaged request to read, {command}": [f"96 04 {frame(command)}"] for command in BODIES},
    **{f"in one line of digits, {command}": [frame(command).replace(" ", "").lower()] for command in BODIES},
    "as a msgID": [frame(GET_TIME, msg_id=0x9D02, body=b"")],
}
WAYS = ("arguments", "stdin", "batch", "dry run", "HANDCTL_YES")


@each_row("name", HIDDEN)
def test_what_hides_a_command_is_refused(name: str, tmp_path: Path) -> None:
    result = run("ekso", "terminal", *HIDDEN[name], "-y", "--trace", tmp_path / "t", "-p", LINK)
    assert (result.code, list(passed(tmp_path / "t"))) == (2, []), result


@each_row(
    "way, name", [(way, name) for way in WAYS for name in ("body 157", "cut at 1, 157", "cut at 4, 157", "body 155")]
)
def test_no_way_leads_around_it(way: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines, shared = HIDDEN[name], ("--trace", tmp_path / "t", "-p", LINK)
    if way == "HANDCTL_YES":
        monkeypatch.setenv("HANDCTL_YES", "1")
    if way == "batch":
        text = "ekso terminal " + " ".join(f'"{line}"' for line in lines) + "\n"
        result = run("batch", "-y", *shared, stdin=text)
    elif way == "stdin":
        result = run("ekso", "terminal", "-y", *shared, stdin="\n".join(lines))
    else:
        more = {"dry run": ("-n",), "HANDCTL_YES": ()}.get(way, ("-y",))
        result = run("ekso", "terminal", *lines, *more, *shared)
    assert result.code == 2 and ("never-sent" in result.said or name == "body 155"), result
    assert not any({START, SET} & set(one.data) for one in passed(tmp_path / "t")), "not a byte that may begin it"


def test_a_person_cannot_type_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terminal.keys, "typed_line", lambda stream: stream.readline())
    trace = tmp_path / "t"
    typed = [*HIDDEN["cut at 1, 157"], frame(START), READ]
    shown = person("ekso", "terminal", "-y", "--trace", trace, "-p", LINK, answers=typed)
    gone = b"".join(one.data for one in passed(trace) if one.mark == ">")
    assert START not in gone and bytes.fromhex(READ) in gone, shown


STRANGERS = [("exo", "raw"), ("wrist", "raw"), ("hand", "raw"), ("exo", "terminal"), ("wrist", "terminal"), ("aidin", "terminal"), ("hand", "terminal")]  # fmt: skip
OF_ANOTHER = {
    **{mode: [frame(START, mode)] for mode in LENGTH_MODES},
    "another body": [frame(START, body=b"\0\0\1\1")],
    "behind stray bytes": [f"2A 00 9D {frame(START)} 00"],
    "in a write of an exo": [f"EB 90 01 0B 12 D4 05 {frame(START)} 00"],
    "cut": cut(frame(START), 3),
}
OTHERWISE = ("in a write of an exo", "cut")
"""Refused for the value that the write sets, by some families; and a line without a reply ends the terminal before the next."""


@each_row("family, verb", STRANGERS)
@each_row("name", OF_ANOTHER)
def test_no_other_family_sends_it_to_a_device_that_is_only_assumed(
    family: str, verb: str, name: str, tmp_path: Path
) -> None:
    """The port may lead to an EksoNR. What is no whole frame goes out as before, and so does all to a device that has said who it is."""
    lines = OF_ANOTHER[name]
    lines = [f"hex {line}" for line in lines] if family == "aidin" else lines
    if verb == "raw":
        lines = [" ".join(lines)]
    more = ("--force-ambiguous",) if verb == "raw" else ()
    words = (family, verb, *lines, *more, "-y", "--trace", tmp_path / "t", "-p", facts_of(family).link(family, ""))
    model = ("--model", "df") if family == "hand" else ()  # without, an RH56 is looked at all the same
    result = run(*words, "--assume-identity", *model)
    trace = passed(tmp_path / "t") if (tmp_path / "t").exists() else ()
    gone = b"".join(one.data for one in trace if one.mark == ">")
    assert result.code and bytes.fromhex(frame(START)) not in gone, result
    if name not in OTHERWISE:
        assert (result.code, "never-sent" in result.said, START in gone) == (2, True, False), result
    assert "never-sent" not in run(*words).said
