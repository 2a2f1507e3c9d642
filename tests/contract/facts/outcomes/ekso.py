"""The EksoNR under the faults of its simulator; exit codes by the contract and the dossier (4 to 6), by hand."""

from __future__ import annotations

import json
from typing import Any

from handctl.sim.engine.line_and_faults import LINE_FAULTS
from tests.contract.facts.outcomes import RIGHT, Codes, Outcomes, Variant, Wire
from tests.ekso.commands import CANCEL, PLACES, POWER_ON, READING, SET, WRITES

ROWS = (*READING, *WRITES)
SETS = tuple(command.name for command in WRITES if command.kind == "set")
NO_ANSWER: dict[str, Codes] = {
    **{key: {4} for key in ("silent", "deaf", "reboot")},
    **{key: {5} for key in ("late", "wrong-id", "wrong-command", "truncate", "bad-checksum", "short-body", "loopback", "acknowledge")},
    "twin-id": {0, 5},  # the AND of two frames may be the one frame, by chance; then its values are right
    "disconnect": {3},
}  # fmt: skip
"""No valid answer to anything."""
ON_SETS: dict[str, Codes] = {
    **{key: {6} for key in ("refuse", "stands-up")},
    **{
        key: {7}
        for key in ("not-taken", "neighbour", "pendant", "fidget", "unknown-state", "frozen-clock", "clock-jump")
    },
    **dict.fromkeys(("acknowledge-set", "set-unanswered", "unlisted-codes", "hip-offset"), RIGHT),
}
"""What each `set` and `restore` comes to; reading is not befallen."""
SPECIAL: dict[tuple[str, str, str], Codes] = {
    **{("", "unlisted-codes", name): {7} for name in ("diff", "set-label", "set-percent", "set-twice", "restore")},
    ("", "refuse", "cancel"): {6},
    **{("", fault, "status-check"): {7} for fault in ("hip-offset", "frozen-clock", "clock-jump")},
}  # fmt: skip
ANSWER_LOST = ("acknowledge-set", "set-unanswered")
"""Applied, and said so with a warning (dossier 5)."""
STILLNESS = ("fidget", "unknown-state", "frozen-clock", "clock-jump", "pendant")
"""Seen before the write: nothing goes out."""
OWN = (*("reboot", "wrong-command", "short-body", "acknowledge", "unsolicited", "stray-zero", "stuck-sensor"), *ON_SETS)
NEVER = {
    **{key: {6} for key in ("refuse", "stands-up", "unknown-state")},
    **{key: {7} for key in ("not-taken", "neighbour")},
}
WRITE: dict[str, Codes] = {"disconnect": {3}, "deaf": {4}, "reboot": {4}, "loopback": {5}, "twin-id": {0, 5}, **NEVER}
BOTH: dict[str, Codes] = {**NO_ANSWER, **NEVER, "unlisted-codes": {7}}
READ_BACK: dict[str, Codes] = {"disconnect": {3}, "loopback": {5}, "unlisted-codes": {7}}
ON_CANCEL: dict[str, Codes] = {**NO_ANSWER, "late": {4}, "refuse": {6}}  # never repeated, so that nothing had come yet
ONCE = (*("silent", "deaf", "truncate", "bad-checksum", "wrong-id", "twin-id", "late", "acknowledge", "wrong-command"),
        "short-body", "reboot")  # fmt: skip
FAULTS = (*LINE_FAULTS, *OWN)
ONE = [command.name for command in WRITES[:3]]


def also(cell: Any) -> None:
    """Each SetValue and CancelAction went out once, and the audit log has it with what became of it."""
    sent = [entry.data for entry in cell.passed if entry.mark == ">"]
    written = [data[4:-2] for data in sent if data[0] == SET]
    cancels = [data for data in sent if data[0] == CANCEL]
    assert written == cell.row.frames[: len(written)], (written, cell)
    assert len(cancels) <= (cell.row.kind == "cancel") and all(150 <= data[0] <= 156 for data in sent), cell
    assert not sent or cell.spy.lines[-1].device.violations == 0, cell
    log = cell.folder / "state" / "handctl" / "ekso-audit.jsonl"
    audit = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    frames = [bytes.fromhex(entry["frame"]) for entry in audit if entry["event"] in ("intent", "cancel")]
    if cell.row.kind == "cancel":
        assert [entry["event"] for entry in audit] == ["cancel", "cancel-result"] * len(cancels), (audit, cell)
        assert frames == cancels, (audit, cell)
    else:
        assert [entry["event"] for entry in audit] == ["intent", "result"] * len(written), (audit, cell)
        assert [frame[4:-2] for frame in frames] == written, (audit, cell)
        assert all(entry["operator"] == "me" and entry["simulated"] is True for entry in audit), audit
        if audit and len(cell.row.writes) == 1:
            assert (audit[-1]["verdict"] == "applied") == (cell.result.code == 0), (audit, cell)
    wanted = {name: raw % 65536 for _, raw, name in cell.row.writes[: len(written)]}
    for name, place in PLACES.items() if cell.spy.lines else ():
        now = cell.spy.lines[-1].device.settings[place]
        assert now in (POWER_ON[name] % 65536, wanted.get(name)) or _by_itself(cell.link), (name, now, cell)
    fault = cell.link.partition("fault=")[2].partition("&")[0]
    lost = any(message["code"] == "answer-lost" for message in cell.envelope["messages"])
    if fault in ANSWER_LOST and cell.row.name in SETS and cell.result.code == 0:
        assert lost or "every=8" in cell.link, cell
    if fault in STILLNESS and cell.row.name in SETS and "every" not in cell.link and "after" not in cell.link:
        assert written == [], cell


def _by_itself(link: str) -> bool:
    """Whether the fault itself changes settings."""
    return "fault=neighbour" in link or "fault=pendant" in link


OUTCOMES = Outcomes(
    rows=ROWS,
    wires={"serial": Wire(
        {fault: NO_ANSWER.get(fault, RIGHT) for fault in LINE_FAULTS},
        {fault: (dict.fromkeys([row.name for row in ROWS], NO_ANSWER[fault]) if fault in NO_ANSWER
                 else dict.fromkeys(SETS, ON_SETS.get(fault, RIGHT))) for fault in OWN},
    )},
    state="sway=0",
    words=(),
    variants={
        # One SetValue is the seventh request of a `set`: after stillness, before the read-back. What if just that one is hit?
        "write": Variant("every=7", WRITE, FAULTS, ONE),
        "read-back": Variant("every=8", READ_BACK, FAULTS, ONE),
        "both": Variant("after=6", BOTH, FAULTS, ONE),
        "cancel": Variant("after=1", ON_CANCEL, FAULTS, ("cancel",)),
        # reads are repeated with a new msgID and come to the same values
        "every-2": Variant("every=2", {}, ONCE, [one.name for one in READING if one.name not in ("status-check", "diff")]),
        "deadline": Variant("", {fault: {0, 4, 5, *NO_ANSWER.get(fault, ())} for fault in FAULTS}, (*NO_ANSWER, "dribble", "split", "noise"),
                            ("status", "restore", "log", "set", "time"), words=("--deadline", "0.25"), bound=0.4),
    },
    exceptions={**SPECIAL, **{("", "refuse", name): {6} for name in SETS}},
    untold=frozenset({("unlisted-codes", ""), ("pendant", ""), ("fidget", ""), ("neighbour", ""), ("reboot", "")}),
    timed=("boot_", "upright_time", "clock_offset", "time", "date", "host"),
    changed={
        "unknown-state": {"state": 0x5040}, "stuck-sensor": {"left_toe_pressure": 333}, "hip-offset": {"right_hip_x": 9.9},
    },
    again=frozenset(row.name for row in ROWS),  # `also` knows better: a frame has another number each time
    also=also,
    seconds=20.0,
)  # fmt: skip
