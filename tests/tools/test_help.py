"""`handctl help`: every topic as plain text, with nothing but the package."""

from __future__ import annotations

import json
import re

import click

from handctl import guides
from handctl.command.command_tree import root
from handctl.docgen.roff import plain
from handctl.families import COMMANDS
from tests.support.cli import run
from tests.support.each_row import each_row

TOPICS = run("help", "--format", "plain").lines


def test_the_list_has_every_command_and_every_guide() -> None:
    pages = {guides.title(guides.source(name))[0].removeprefix("handctl-") for name in guides.names()}
    assert set(TOPICS) == {"options", "handctl", *COMMANDS, *pages}
    assert all(re.search(r"\S  +\S", line) for line in run("help").lines)


@each_row("topic", TOPICS)
def test_a_topic_is_plain_text(topic: str) -> None:
    done = run("help", topic)
    assert (done.code, done.err) == (0, "")
    assert len(done.lines) > 20
    assert not re.search(r"\\f[BIR]|\\\((?:aq|ga|ha|ti|bu)|^\.[A-Z]{2}", done.out, re.MULTILINE)
    if topic in COMMANDS:
        assert run("help", f"handctl-{topic}").out == done.out
        assert f"handctl {topic}" in done.out and "EXAMPLES" in done.out


def test_a_command_is_its_own_help() -> None:
    for words in (("exo", "status"), ("barrett", "firmware", "check"), ("devices", "add")):
        assert run("help", *words).out == run(*words, "-h").out


def test_the_common_options_are_all_explained() -> None:
    text = " ".join(run("help", "options").out.split())
    for option in root.get_params(click.Context(root)):
        if isinstance(option, click.Option) and hasattr(option, "section"):
            assert option.opts[-1] in text and " ".join((option.help or "").split()) in text


@each_row(
    ("words", "near"),
    [
        (("lnks",), "'links'"),
        (("report",), "'exo report'"),
        (("gcl",), "'barrett gcl'"),
        (("exo", "statsu"), "'exo status'"),
        (("nothing-like-it",), "lists"),
    ],
)
def test_an_unknown_topic_is_a_usage_error_with_what_is_near(words: tuple[str, ...], near: str) -> None:
    done = run("help", *words)
    assert (done.code, done.out) == (2, "")
    assert near in done.err


def test_for_a_script() -> None:
    answer = json.loads(run("help", "links", "--json").out)
    assert answer["rows"][0]["topic"] == "links" and "SERIAL PORTS" in answer["rows"][0]["text"]


def test_a_page_as_text() -> None:
    page = ".TH A 1\n.nh\n.SH NAME\na \\- b\n.TP\n\\fB\\-x\\fR\nfirst\nsecond\n.RS\n.TP\n\\fBy\\fR\nthird\n.RE\n.nf\n  c\\e\n.fi\n"
    assert plain(page).splitlines() == [
        "NAME", "    a - b", "", "    -x  first second", "", "        y   third", "      c\\",
    ]  # fmt: skip
