"""The live view of `top`: a card for each device, also of a silent one; or one of them whole. Imported only when a person looks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text

from handctl.fast_classes import replace
from handctl.model.result import Sample, Table
from handctl.screen.live_view import View
from handctl.screen.sanitize import text_shown
from handctl.screen.terminal_tables import flowing

if TYPE_CHECKING:
    from handctl.screen.render import Context

WHOLE = 9
"""Lines from which on a card shows its device as a view of its own."""


class TopCards(View):
    """Several devices, each as a card of some lines, the one that needs a person first; or one of them whole."""

    def __init__(self, table: Table, context: Context) -> None:
        super().__init__(table, context)
        self._tables = table.cards
        self._views: dict[str, View] = {}
        self._silent: dict[str, tuple[float, str]] = {}
        self._shown = ""
        """The device that is seen whole; "" = all of them, as cards."""

    @property
    def keys(self) -> tuple[tuple[str, str, str], ...]:
        """With Tab among them, and a stop of all devices: the one that moves need not be the one that is shown."""
        stop, all_ = self._context.stop_key, "stop all these devices at once, without asking (capital S)"
        head, *rest = (
            (key, "stop all", all_) if key == stop else (key, word, text) for key, word, text in super().keys
        )
        return (head, ("Tab", "device", "show the next device in full, and after the last one all cards again"), *rest)

    def next(self) -> None:
        """Show the next device whole; behind the last one all of them."""
        names = ["", *self._views]
        self._shown = names[(names.index(self._shown) + 1) % len(names)]

    def zoom(self, step: int) -> None:
        """Show a longer time (1) or a shorter one (-1)."""
        super().zoom(step)
        for view in self._views.values():
            view.zoom(step)

    def add(self, sample: Sample) -> None:
        """Take a sample of one device, or why there is none."""
        self._count += 1
        if self.frozen:
            return
        self._seconds = sample.t
        name = str(sample.rows[0].get("device")) if sample.rows else ""
        if all(row.get("error") and "name" not in row for row in sample.rows):
            began = self._silent.get(name, (sample.t, ""))[0]
            self._silent[name] = began, text_shown(str(sample.rows[0]["error"]))
            return
        self._silent.pop(name, None)
        if name not in self._views:
            self._views[name] = View(replace(self._tables[name](), cards=self._tables), self._context)
        self._views[name].add(sample)

    def _body(self, width: int, height: int) -> list[Text]:
        if self._shown and self._shown not in self._silent:
            return [Text(self._shown, style="bold"), *self._views[self._shown]._body(width, height - 1)]
        long = max(map(len, self._tables)) + 2
        names = sorted(self._tables, key=lambda name: -self.urgency(name))
        cards = [self._card(name, long, width) for name in names]
        heard = [name for name in names if name in self._views and name not in self._silent]
        quiet = sum(len(card) for name, card in zip(names, cards, strict=True) if name not in heard)
        room = (height - quiet) // max(1, len(heard)) - 1
        for number, name in enumerate(names):
            whole = self._views[name]._body(width, room - 1) if name in heard else []
            if whole and len(whole) < room and room > WHOLE:
                cards[number] = [cards[number][0], *whole, Text("")]
        lines = [line for card in cards for line in card]
        return lines if len(lines) <= height else [card[0] for card in cards]

    def urgency(self, name: str) -> int:
        """3 = something is wrong, 2 = silent, 1 = near a limit, 0 = neither."""
        view = self._views.get(name)
        return 2 if name in self._silent or view is None else (0, 1, 3)[view.state]

    def _card(self, name: str, long: int, width: int) -> list[Text]:
        """What is wrong in the first line, or that nothing is; then where its quantities are."""
        head = f"{name:<{long}}"
        if name in self._silent:
            began, why = self._silent[name]
            words = f"silent for {self._seconds - began:.0f} s: {why}".split()
            return flowing([Text(word, style="bold red") for word in words], width, head=head)
        view = self._views.get(name)
        if view is None:
            return flowing([Text("connecting", style="dim")], width, head=head)
        first = flowing(view.wrong() or [Text("ok", style="green")], width, head=head, gap=2)
        return [*first, *flowing(view.spans(), width, head=" " * long, gap=2)]
