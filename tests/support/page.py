"""A report's page, read as a browser would."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from typing import Any

VOID = {"meta", "path", "polyline", "circle", "br"}


class Page(HTMLParser):
    """A page as a browser takes it: tags must nest, ids be unique, nothing may be fetched or run."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.count: dict[str, int] = {}
        self.words: list[str] = []
        self.data: Any = None
        self.feed(text)
        self.close()
        assert self.open == []
        assert len(set(self.ids)) == len(self.ids)
        assert {link.removeprefix("#") for link in self.links} <= set(self.ids)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        known = dict(attrs)
        assert tag not in ("link", "iframe", "img", "object", "embed", "form")
        assert tag != "script" or known == {"type": "application/json", "id": "data"}, "data for a program alone"
        assert not {key for key in known if key.startswith("on")} | ({"src", "style"} & known.keys())
        self.count[tag] = self.count.get(tag, 0) + 1
        self.ids += [known["id"] or ""] if "id" in known else []
        self.links += [known["href"] or ""] if "href" in known else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] == ["script"]:
            self.data = json.loads(data)
        elif self.open[-1:] != ["style"]:
            self.words.append(data)

    @property
    def text(self) -> str:
        """What can be read, white space as it is written."""
        return "".join(self.words)
