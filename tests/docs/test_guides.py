"""The subset of Markdown in which the guides are written: each construct by literal lines, and what is not one."""

from __future__ import annotations

import pytest

from handctl import guides
from handctl.docgen import man_pages as pages
from handctl.guides import Code, Heading, Item, Para, Table

TEXT = """# handctl-some-guide(7): how to do it

One line,
and its second. See handctl-links(7).

## A heading

- first
- second,
  which goes on
- third
A paragraph behind a list.
| a | b |
|---|---|
| `x` | 1 \\| 2 |

```sh
$ handctl -h

    deep
```
<!-- links: generated -->
### Below
<!-- end -->
"""


def test_blocks() -> None:
    assert list(guides.blocks(TEXT)) == [
        Para("One line, and its second. See handctl-links(7)."),
        Heading(2, "A heading"),
        Item("first"),
        Item("second, which goes on"),
        Item("third"),
        Para("A paragraph behind a list."),
        Table((("a", "b"), ("`x`", "1 | 2"))),
        Code(("$ handctl -h", "", "    deep"), "sh"),
        Heading(3, "Below"),
    ]


def test_title() -> None:
    assert guides.title(TEXT) == ("handctl-some-guide", "how to do it")
    for first in ("how to do it", "# handctl-some-guide: how", "# other(7): how", "# handctl-a(1): how"):
        with pytest.raises(ValueError, match="a guide begins with"):
            guides.title(f"{first}\ntext\n")


def test_names_are_those_of_the_package() -> None:
    assert set(guides.names()) >= {"exo", "links", "safety", "changes"} and list(guides.names()) == sorted(
        guides.names()
    )
    for name in guides.names():
        page, summary = guides.title(guides.source(name))
        assert page in (f"handctl-{name}", f"handctl-{name}-guide") and len(summary) <= 90 and not summary.endswith(".")
    with pytest.raises(FileNotFoundError):
        guides.source("none")


def test_page() -> None:
    body = pages.guide(TEXT).partition(".SH DESCRIPTION\n")[2].partition(".SH SEE ALSO")[0]
    assert body == (
        "One line, and its second.\nSee \\%\\fBhandctl\\-links\\fR(7).\n.SH A HEADING\n.IP \\(bu 2\nfirst\n"
        ".IP \\(bu 2\nsecond, which goes on\n.IP \\(bu 2\nthird\n.PP\nA paragraph behind a list.\n"
        ".TP\n\\fBx\\fR\n1 | 2\n.PP\n.nf\n    $ handctl \\-h\n\\&\n        deep\n.fi\n.SS Below\n"
    )


def test_further_columns_of_a_table_say_what_they_are() -> None:
    text = "# handctl-a(7): a\n| figure | value | goal |\n|---|---|---|\n| dump | 1 ms | |\n| scan | 2 s | 3 s |\n"
    body = pages.guide(text).partition(".SH DESCRIPTION\n")[2].partition(".SH SEE ALSO")[0]
    assert body == ".TP\n\\fBdump\\fR\nValue: 1 ms.\n.TP\n\\fBscan\\fR\nValue: 2 s.\nGoal: 3 s.\n"
