"""Every family's screens at 40, 80 and 200 columns, and the same output on a pipe: whole, in bounds, readable.

What is compared is what a person reads: words and numbers. The widest screen says what there is to be said.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from handctl import interrupts
from handctl.families import FAMILIES
from handctl.model.command_settings import Settings
from handctl.model.device_picture import Remedy, highest_of
from handctl.model.reading_limits import Bound
from handctl.model.result import Journal, Sample, Table
from handctl.screen import live_view
from tests.contract.facts import facts_of
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.screen import Screen, screen

WIDTHS = (40, 80, 200)
LINKS = {kind: f"fake://{kind}?seed=1&clock=virtual" for kind in FAMILIES}
VERBS = {kind: facts_of(kind).screens for kind in FAMILIES}
SCREENS = [(kind, verb) for kind, verbs in VERBS.items() for verb in verbs]
OFFLINE = [*((kind, "describe") for kind in VERBS), ("barrett", "errors"), ("exo", "set position_set.little=3 -n")]
FAULTY = [("exo?fault=faults", "status"), ("exo?fault=faults", "dump"), ("wrist?fault=faults", "status"),
          ("barrett?fault=unknown-codes", "status")]  # fmt: skip
BOXES = re.compile(r"[\u2500-\u257f\u2580-\u259f]")
COLOURS = re.compile(r"\x1b\[[0-9;]*(?:3[0-8]|4[0-8]|9[0-7])[0-9;]*m")


@cache
def shown(kind: str, verb: str, columns: int, *more: str, terminal: bool = True) -> Screen:
    link = LINKS[kind] if "?" not in kind else f"fake://{kind}&seed=1&clock=virtual"
    port = () if (kind, verb) in OFFLINE and "-n" not in verb else ("-p", link)
    return screen(kind.partition("?")[0], *verb.split(), *port, *more, columns=columns, terminal=terminal)


def words(text: str) -> Counter[str]:
    """Words and numbers with how often they occur; rules and the colons of stacked headings are none."""
    return Counter(word.rstrip(":") for word in BOXES.sub(" ", text).split())


@each_row(("kind", "verb"), [*SCREENS, *OFFLINE, *FAULTY])
def test_a_screen_at_any_width(kind: str, verb: str) -> None:
    """No line is wider than the window, and a narrow window says all that the widest says."""
    wide, keys = words(shown(kind, verb, 200).text), key_headings(shown(kind, verb, 200).text)
    assert sum(wide.values()) > 10
    for columns in WIDTHS:
        seen = shown(kind, verb, columns)
        assert seen.code == (7 if verb == "diagnose" else 0), seen.err
        assert all(len(line) <= columns for line in seen.text.split("\n")), seen.text
        assert "…" not in seen.text and "Traceback" not in seen.text + seen.err
        assert ("simulated" in seen.text) is ((kind, verb) not in OFFLINE), seen.text
        missing = wide - words(seen.text) - keys
        assert not missing, (columns, missing, seen.text)


def key_headings(text: str) -> Counter[str]:
    """The words of the headings that a narrow window leaves out: the first column's, wherever it stands, and those over nothing."""
    lines = text.split("\n")
    left_out: Counter[str] = Counter()
    for head, rule in pairwise(lines):
        if rule and set(rule) == {"─"}:
            first, *rest = re.split(r"  +", head.strip())
            left_out += words(" ".join([first, *(cell for cell in rest if cell == first)]))
            block = "\n".join(lines[lines.index(head) :]).partition("\n\n")[0].split("\n")[2:]
            left_out += (
                words(rest[-1])
                if rest and all(len(line.rstrip()) < head.rindex(rest[-1]) for line in block)
                else Counter()
            )
    return left_out


@each_row(("kind", "verb"), [*SCREENS, *OFFLINE, *FAULTY])
def test_the_same_on_a_pipe(kind: str, verb: str) -> None:
    """No boxes, no colour, nothing cut, and the width of a window it does not have is of no interest."""
    narrow, wide = (shown(kind, verb, columns, terminal=False) for columns in (40, 200))
    assert narrow.data == wide.data
    assert "\x1b" not in narrow.data and "…" not in narrow.data
    assert not BOXES.search(narrow.data)
    assert all(line == line.rstrip() for line in narrow.data.split("\n"))
    missing = words(shown(kind, verb, 200).text) - words(narrow.data.replace("(simulated)", "simulated"))
    assert not missing, missing


@each_row(("kind", "verb", "rows", "columns"), [
    ("exo", "status", 6, 8), ("exo", "dump", 13, 10), ("wrist", "dump", 11, 5), ("barrett", "dump", 22, 7),
    ("ekso", "settings", 22, 5), ("aidin", "dump", 19, 7), ("exo", "describe", 14, 10),
])  # fmt: skip
def test_columns_line_up_on_a_pipe(kind: str, verb: str, rows: int, columns: int) -> None:
    """Between two columns there are two blanks from the heading to the last row."""
    lines = shown(kind, verb, 40, terminal=False).data.split("\n")
    start = next(i for i, line in enumerate(lines) if len(re.split(r"  +", line.strip())) >= columns - 1)
    block = lines[start : start + rows + 1]
    width = max(map(len, block))
    profile = "".join(" " if all(line.ljust(width)[i] == " " for line in block) else "x" for i in range(width))
    assert len(re.split(r" {2,}", profile.strip())) == columns, "\n".join([*block, profile])
    assert len(block) == rows + 1 and all(line.strip() for line in block)


# -- word for word ------------------------------------------------------------------------------------------------


def test_a_table_that_fits_is_a_table() -> None:
    lines = shown("exo", "status", 80).lines
    assert lines[0] == "id 1, 115200 bit/s (code 0), supply 558 (raw, scale unknown)  simulated"
    assert lines[1] == "Finger    Position  Set  Force  Set  mA  °C  Errors"
    assert set(lines[2]) == {"─"}
    assert lines[3] == "little         110  151    -11  -61  21  31  ok"


def test_a_table_that_does_not_fit_names_every_value() -> None:
    lines = shown("exo", "status", 40).lines
    assert lines[2:8] == [
        "little  Position: 110  Set: 151",
        "  Force: -11  Set: -61  mA: 21  °C: 31",
        "  Errors: ok",
        "ring  Position: 220  Set: 252  Force: 12",
        "  Set: 62  mA: 22  °C: 32  Errors: ok",
        "middle  Position: 330  Set: 353",
    ]
    assert lines[-4:-1] == [
        "Position: 0 bent to 1000 open. Force",
        "  (raw): set + opens the hand, measured",
        "  + means that the user closes it.",
    ]


def test_two_lists_side_by_side_become_one() -> None:
    lines = shown("ekso", "status", 40).lines
    place = lines.index("upper_leg_length  16.80 in")
    assert lines[place + 1] == "stand_mode  Auto Lean"
    assert lines[place + 2] == "lower_leg_length  16.40 in"


def test_prose_is_wrapped_in_its_column_before_the_table_is_given_up() -> None:
    lines = shown("barrett", "diagnose", 80).lines
    place = next(i for i, line in enumerate(lines) if line.startswith("odometer.F1"))
    column = lines[1].index("Evidence")
    assert lines[place] == "odometer.F1             fail    worm.F1: 5956 strokes, no greasing recorded,"
    assert lines[place + 1] == " " * column + "counted from new; overdue by 956"
    narrow = shown("barrett", "diagnose", 40).lines
    place = narrow.index("odometer.F1  Status: fail")
    assert narrow[place + 1 : place + 4] == [
        "  Evidence: worm.F1: 5956 strokes, no",
        "    greasing recorded, counted from new;",
        "    overdue by 956",
    ]


def test_the_longest_name_is_never_broken() -> None:
    """40 characters: it gets a line without indent in a window of 40."""
    assert "loop_feedback_delta_position_coefficient" in shown("barrett", "dump", 40).lines


# -- the live view ------------------------------------------------------------------------------------------------


@cache
def last_sample(kind: str) -> list[dict[str, Any]]:
    """The rows of the second of two, whatever the window."""
    samples, _ = run(kind, "watch", "--count", "2", "-p", LINKS[kind], "--json").stream
    return samples[len(samples) // 2 :]


@each_row(("columns", "rows"), [(40, 24), (40, 70), (80, 24), (200, 50), (30, 8)])
@each_row("kind", LINKS)
def test_live_view_at_any_size(kind: str, columns: int, rows: int) -> None:
    """Head and counters stay in the window, every value is there whole, or the view says what has no room."""
    seen = screen(kind, "watch", "--count", "2", "-p", LINKS[kind], columns=columns, rows=rows)
    assert seen.code == 0, seen.err
    display = seen.display
    text = "\n".join(display)
    assert display[0].startswith(f"handctl {kind} watch") and "simulated" in text and "2 samples" in text
    assert "Ctrl-C ends" in " ".join(display[-3:])
    assert "…" not in text and "Traceback" not in text + seen.err
    hidden = re.findall(r"^\+ (\d+) lines", text, re.MULTILINE)
    assert bool(hidden) is (rows == 8 or (kind in ("aidin", "hand") and (columns, rows) == (40, 24))), text
    if hidden:
        return
    numbers = [word for word in re.split(r"[\s▕▏]+", text) if re.fullmatch(r"-?\d+(\.\d+)?", word)]
    for row in last_sample(kind):
        assert all(part in text for part in row["name"].split("_")), row
        if row.get("label") == "ok" or (row.get("label") and row["label"] in " ".join(text.split())):
            continue  # told in words
        assert any(float(number) == row.get("scaled", row["value"]) for number in numbers), (row, text)


def test_live_view_of_fingers_with_several_elements() -> None:
    """A column per finger: m1 of the thumb is not overwritten by its m3."""
    lines = screen("aidin", "watch", "--count", "1", "-p", LINKS["aidin"]).display
    place = next(i for i, line in enumerate(lines) if line.startswith("motor_pos [cts]"))
    assert lines[place].split()[2:] == ["thumb", "index", "middle", "ring", "little"]
    assert lines[place + 1].split() == ["m1", "70110", "110440", "150770", "220115", "201445"]
    assert lines[place + 3].split() == ["m3", "52330", "41660", "30990", "60335", "70665"]
    assert len({len(line) for line in lines[place : place + 4]}) == 1


def test_live_view_names_units_and_words() -> None:
    exo = screen("exo", "watch", "--count", "1", "-p", LINKS["exo"], rows=40).display
    assert any(line.split()[-4:] == ["actual", "actual", "[mA]", "[°C]"] for line in exo)
    barrett = " ".join(screen("barrett", "watch", "--count", "1", "-p", LINKS["barrett"], columns=40).display)
    assert "status F1, F2, F3, SPREAD: Motor not initialized (4)" in " ".join(barrett.split())
    assert "temperature [°C]" in barrett and "41.2" in barrett
    ekso = screen("ekso", "watch", "--count", "1", "-p", LINKS["ekso"]).display
    assert any(line.split() == ["state", "standing", "(0x2040)"] for line in ekso)


def test_the_live_view_of_an_eksonr_shows_bars_hips_and_steps_at_80x24() -> None:
    display = screen("ekso", "watch", "--count", "2", "-p", LINKS["ekso"]).display
    bars = [line.split()[0] for line in display if "▕" in line]
    sides = [f"{side}_{part}" for side in ("left", "right") for part in ("hip_x", "hip_y", "hip_angle", "toe_pressure")]
    assert len(bars) == 18 and {*sides, "torso_pitch", "left_knee_current"} <= set(bars), bars
    assert any(line.split() == ["steps_taken", "214", "steps"] for line in display), display
    assert not any(line.startswith("+ ") for line in display)


def test_single_values_share_lines_before_any_is_hidden() -> None:
    display = screen("ekso", "watch", "--count", "1", "-p", LINKS["ekso"], columns=60, rows=17).display
    assert not any(line.startswith("+ ") for line in display), display
    assert sum("▕" in line for line in display) >= 6
    assert any("left_hip_x" in line and "right_hip_x" in line and "▕" not in line for line in display), display


def test_a_motor_without_a_gauge_has_no_bar() -> None:
    """255 is "no gauge" (barrett §5.3.2), and was a full bar."""
    display = screen("barrett", "watch", "SG", "--count", "1", "-p", LINKS["barrett"]).display
    bars = {line.split("▕")[0].split()[-1]: line.split("▕")[1].split("▏")[0] for line in display if "▕" in line}
    assert "█" in bars["F1"] and "█" not in bars["SPREAD"] and "no gauge" in bars["SPREAD"], display


def test_live_view_in_a_low_window_keeps_the_errors() -> None:
    link = "fake://exo?fault=faults&clock=virtual"
    lines = screen("exo", "watch", "--count", "1", "-p", link, columns=60, rows=12).display
    assert lines[1].startswith("error ") and "locked_rotor" in lines[1]
    assert any(line.startswith("+ ") for line in lines)


def test_a_bar_reaches_to_a_lowest_or_highest_value_of_zero() -> None:
    series = live_view.Series({"name": "x"}, (5.0, 9.0), 0)
    series.add({"name": "x", "value": 0}, 0.0)
    assert series.scale() == (0.0, 9.0)
    below = live_view.Series({"name": "x"}, (-9.0, -5.0), 0)
    below.add({"name": "x", "value": 0}, 0.0)
    assert below.scale() == (-9.0, 0.0)


def test_a_whole_number_of_any_length_is_whole() -> None:
    series = live_view.Series({"name": "uptime", "value": 7345678, "unit": "s"}, None, 0)
    assert [series.text(value) for value in (7345678, 4294967295, 0.35, -0.0001, None)] == [
        "7345678", "4294967295", "0.35", "-0.0001", "?",
    ]  # fmt: skip


class Context:
    """As much of a running command as a view without a head needs."""

    command = "exo watch"
    simulated = False
    stop_key = ""
    journal = Journal()
    settings = Settings()

    def link_name(self) -> str:
        return "fake://exo"


@each_row("width", [40, 69, 70, 75, 80, 100])
def test_long_numbers_take_the_room_of_the_bar(width: int) -> None:
    view = live_view.View(Table(ranges={"odometer": (0.0, 2.0**32)}), Context())  # type: ignore[arg-type]
    for value in (1234567890, 4294967295):
        view.add(Sample(0.0, ({"name": "odometer", "motor": "SPREAD", "unit": "1000 cts", "value": value},)))
    lines = [line.plain for line in view._body(width, 20)]
    assert all(len(line) <= width for line in lines), lines
    bar = next(line for line in lines if "▏" in line)
    assert "4294967295" in bar.partition("▏")[2] and "[1000 cts]" in lines[0]
    assert ("1234567890..4294967295" in lines[0]) is (width >= 75)  # 20 + 7 + 15 + 10 + 23 cells


def test_a_label_without_a_unit_replaces_the_number_and_ok_is_told() -> None:
    view = live_view.View(Table(), Context())  # type: ignore[arg-type]
    rows = (
        {"name": "mode", "motor": "F1", "value": 0, "label": "ok"},
        {"name": "mode", "motor": "F2", "value": 3, "label": "lost"},
    )
    view.add(Sample(0.0, rows))
    assert [line.plain for line in view._body(40, 20)] == ["mode F1 ok F2 lost"]


def test_the_most_urgent_error_is_named_with_its_remedy() -> None:
    table = Table(
        flags=frozenset({"error"}),
        remedies={word: Remedy(f"it is {word}", f"mend {word}", "§1") for word in ("hot", "stuck")},
    )
    view = live_view.View(table, Context())  # type: ignore[arg-type]
    said = {"little": ["stuck"], "ring": ["hot", "stuck"], "index": ["hot"]}
    view.add(
        Sample(
            0.0,
            tuple(
                {"name": "error", "finger": f, "value": 1, "label": ", ".join(e), "errors": e} for f, e in said.items()
            ),
        )
    )
    assert [line.plain for line in view._footer(80)] == ["ring, index: It is hot. Mend hot (§1).", "Ctrl-C ends"]
    assert [line.plain.split(":")[0] for line in view._by_word(list(view._series.values()), 80)] == ["error ring"]


def test_a_failed_read_is_seen() -> None:
    rows = ({"name": "current", "finger": "ring", "unit": "mA", "error": "no answer from id 1; more"},)
    view = live_view.View(Table(ranges={"current": (0.0, 1000.0)}), Context())  # type: ignore[arg-type]
    view.add(Sample(0.0, rows))
    assert [line.plain for line in view._footer(12)] == ["no answer", "from id 1", "Ctrl-C ends"]
    assert [line.plain.split() for line in view._body(40, 20)] == [["current", "[mA]"], ["ring", "▕", "▏", "?"]]


# -- colour -------------------------------------------------------------------------------------------------------


@each_row(("terminal", "env", "more", "coloured"), [
    (True, {}, (), True), (True, {"NO_COLOR": "1"}, (), False), (True, {}, ("--color", "never"), False),
    (True, {"NO_COLOR": "1"}, ("--color", "always"), True), (False, {}, (), False),
    (False, {}, ("--color", "always"), True), (False, {}, ("--color", "never"), False),
    (False, {"NO_COLOR": "1"}, ("--color", "always"), True), (True, {"HANDCTL_COLOR": "never"}, (), False),
])  # fmt: skip
@each_row("kind", ["exo", "wrist", "barrett"])
def test_colour(kind: str, terminal: bool, env: dict[str, str], more: tuple[str, ...], coloured: bool) -> None:
    link = LINKS[kind] + ("&initialized=1" if kind == "barrett" else "")
    seen = screen(kind, "status", "-p", link, *more, env=env, terminal=terminal)
    assert seen.code == 0, seen.err
    assert bool(COLOURS.search(seen.data)) is coloured
    assert ("\x1b[" in seen.data) is (terminal or coloured)
    assert words(seen.text) == words(shown(kind, "status", 80).text) or kind == "barrett" or not (terminal or coloured)


@pytest.mark.parametrize("kind", LINKS)
def test_the_live_view_without_colour(kind: str) -> None:
    for env, more in (({"NO_COLOR": "1"}, ()), ({}, ("--color", "never"))):
        seen = screen(kind, "watch", "--count", "1", "-p", LINKS[kind], *more, env=env)
        assert not COLOURS.search(seen.data)
    piped = screen(kind, "watch", "--count", "1", "-p", LINKS[kind], "--color", "always", terminal=False)
    assert "\x1b" not in piped.data and not BOXES.search(piped.data), "a stream on a pipe is lines of text"
    assert "1 sample in" in piped.err and piped.err.rstrip().endswith(", simulated")


@each_row("kind", list(FAMILIES))
def test_a_map_is_a_table_at_80_columns_with_its_prose_below(kind: str) -> None:
    """Names stand in the first column, their numbers side by side; sentences stand below, indented."""
    lines = shown(kind, "describe", 80).lines
    head, rule = lines[:2]
    assert set(rule) == {"─"} and len(rule) <= 80
    assert len(re.split(r"  +", head.strip())) >= 4
    firsts = [line for line in lines[2:] if line and not line.startswith(" ")]
    assert len(firsts) == len(run(kind, "describe", "--json").rows)
    assert all(line[head.index("Access") :].split()[0] in ("r", "w", "rw", "trigger") for line in firsts)


@each_row(
    ("value", "drawn"),
    [(0, "     │     "), (-40, "     │     "), (40, "     │     "), (100, "     │█    "), (-1000, "█████│     "), (1000, "     │█████")],
)  # fmt: skip
def test_a_bar_has_its_zero_line_and_is_the_same_on_both_sides(value: float, drawn: str) -> None:
    assert live_view.bar(value, -1000, 1000, 11) == drawn


def test_a_course_of_several_lines() -> None:
    history = [(float(second), float(second)) for second in range(4)]
    assert live_view.chart(history, 3.0, 4.0, 4, 2) == ["  ▃█", "▁▆██"]
    assert live_view.chart([(0.0, 5.0)], 3.0, 4.0, 4, 2) == ["    ", "▁   "]


@each_row(
    ("kind", "columns", "rows", "name"),
    [("wrist", 80, 24, "temperature_1"), ("wrist", 160, 50, "pitch_actual"), ("ekso", 160, 50, "steps_taken"), ("barrett", 80, 24, "strain")],
)  # fmt: skip
def test_what_room_is_left_shows_how_it_went(kind: str, columns: int, rows: int, name: str) -> None:
    display = screen(kind, "watch", "--count", "3", "-p", LINKS[kind], columns=columns, rows=rows).display
    assert len([line for line in display if line.startswith(name)]) >= 2 or kind == "barrett"
    assert any(line.endswith(" now") for line in display) and len(display) <= rows
    assert sum(any(cell in line for cell in "▁▂▃▄▅▆▇") for line in display) >= 3


def test_a_column_per_finger_has_its_course_in_a_wide_window() -> None:
    narrow, wide = (
        screen("aidin", "watch", "--count", "3", "-p", LINKS["aidin"], columns=columns, rows=40).display for columns in (80, 120)
    )  # fmt: skip
    assert not any("▁" in line for line in narrow)
    assert sum(line.count("▁") >= 5 for line in wide) == 3 + 4 + 3 + 6
    assert sum(line.count("-30 s") for line in wide) == 4 * 5


@each_row(
    ("value", "bound", "state"),
    [(62, None, 0), (63, None, 1), (70, None, 2), (70, 100.0, 0), (90, 100.0, 1), (101, 100.0, 2)],
)
def test_a_documented_highest_value_colours_unless_a_limit_was_set(value: int, bound: float | None, state: int) -> None:
    bounds = () if bound is None else (Bound("temperature", frozenset({"temperature.ring"}), None, bound),)
    view = live_view.View(Table(highest={"temperature.ring": 70.0}, bounds=bounds), Context())  # type: ignore[arg-type]
    view.add(Sample(0.0, ({"name": "temperature", "finger": "ring", "path": "temperature.ring", "value": value},)))
    assert [one.state for one in view._series.values()] == [state]


def test_highest_values_are_those_by_which_the_picture_is_coloured() -> None:
    assert highest_of("hand")["temperature.ring"] == 70 and highest_of("barrett") == {"temperature": 65.0}
    assert highest_of("ekso") == {}


def test_only_a_documented_range_can_be_left() -> None:
    view = live_view.View(Table(ranges={"a": (0.0, 5.0)}, scales={"b": (0.0, 0.0)}), Context())  # type: ignore[arg-type]
    view.add(Sample(0.0, ({"name": "a", "value": 7}, {"name": "b", "value": 7})))
    assert [one.state for one in view._series.values()] == [1, 0]
    assert screen("ekso", "watch", "--count", "1", "-p", LINKS["ekso"], "--color", "always").data.count("[1;33m") == 0


def test_a_course_keeps_the_peaks_between_its_cells() -> None:
    """A walk whose period is that of the cells was a flat line."""
    history = [(tick / 10, 100.0 if tick % 10 == 4 else 0.0) for tick in range(40)]
    assert live_view.spark(history, 3.9, 4.0, 4) == "████"


@each_row(
    ("moments", "drawn"),
    [
        ((0, 2, 4, 6), "▁▁▃▃▅▅██"),  # read every second cell
        ((0, 2, 6), "▁▁▃   ██"),  # one was lost
        ((0, 1, 2), "▁▄█     "),  # and the last ones
        ((1,), " ▁      "),
    ],
)
def test_a_value_that_is_read_seldom_is_shown_until_the_next(moments: tuple[int, ...], drawn: str) -> None:
    history = [(float(t), float(t)) for t in moments]
    assert live_view.spark(history, 7.0, 8.0, 8) == drawn


def test_counts_of_values_are_said_in_words() -> None:
    assert set(live_view.SEEN) == {"bad", "missing", "skipped"}


def test_a_row_at_which_the_view_is_ended_is_recorded_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    tape = live_view.LiveRecorder(live_view.View(Table(), Context()), "exo")  # type: ignore[arg-type]
    tape.switch()
    flush = tape._file.flush  # type: ignore[union-attr]

    def pressed() -> None:
        flush()
        interrupts._end(2, None)  # what the key q calls

    monkeypatch.setattr(interrupts, "_state", interrupts._State())
    monkeypatch.setattr(tape, "_file", Flushed(tape._file, pressed))
    with pytest.raises(KeyboardInterrupt):
        tape.add(Sample(0.0, ({"name": "a", "value": 7},)))
    assert "1 row " in tape.end() and len((tmp_path / tape.path).read_text().splitlines()) == 2


class Flushed:
    """A file with another `flush`."""

    def __init__(self, file: Any, flush: Callable[[], None]) -> None:
        self.write, self.close, self.flush = file.write, file.close, flush
