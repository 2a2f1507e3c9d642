"""The table of who speaks first: whole, without dead ends, and drawn as it is."""

from __future__ import annotations

from handctl.devices.aidin import exchange_settings as table

SEEN_IN = {
    table.LISTENED: {table.FEEDBACK, table.DAMAGED, table.OTHER, table.NOTHING},
    table.ASKED: set(table.SEEN),
    table.AGAIN: set(table.SEEN),
    table.DOUBTED: {table.FEEDBACK, table.NOTHING},
}


def test_every_state_knows_what_may_be_seen_there() -> None:
    assert {state: set(row) for state, row in table.NEXT.items()} == SEEN_IN
    after = {state for row in table.NEXT.values() for state in row.values()}
    assert after == (set(table.STATES) | set(table.ENDS)) - {table.LISTENED}


def test_no_way_is_longer_than_two_questions() -> None:
    def ways(state: str, asked: int) -> list[int]:
        asked += state in (table.ASKED, table.AGAIN)
        if state in table.ENDS:
            return [asked]
        return [count for seen in SEEN_IN[state] for count in ways(table.NEXT[state][seen], asked)]

    assert set(ways(table.LISTENED, 0)) == {0, 1, 2}


def test_where_nothing_may_be_asked_any_more_there_is_an_end() -> None:
    rows = table.NEXT.values()
    asking = {seen for row in rows for seen, state in row.items() if state in (table.ASKED, table.AGAIN)}
    assert asking == set(table.UNASKED)
    assert set(table.UNASKED.values()) <= set(table.ENDS)


def test_the_page_shows_every_line() -> None:
    title, _, items = table.section()
    assert title == "WHO SPEAKS FIRST"
    shown = [(state, *line.split()) for state, _, lines in items for line in lines]
    assert shown == [(state, *line) for state, row in table.NEXT.items() for line in row.items()]
    assert {name for name, _, _ in items} == set(table.STATES) | set(table.SEEN) | set(table.ENDS)
