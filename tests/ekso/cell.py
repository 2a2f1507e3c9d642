"""One cell of the fault matrix of the EksoNR: one command under one fault, and all it must show."""

from __future__ import annotations

import json
import time
from functools import cached_property
from pathlib import Path
from typing import Any

from tests.ekso.commands import (
    BOOT,
    CANCEL,
    PLACES,
    POWER_ON,
    SCALES,
    SET,
    Command,
    unit,
)
from tests.support.cli import Result, Spy, run, sent, spying

REAL_SECONDS, VIRTUAL_SECONDS = 30.0, 20.0


class Cell:
    """One command line against one fault."""

    def __init__(self, tmp_path: Path, command: Command, fault: str, *more: str, **options: object) -> None:
        self.command, self.fault = command, fault
        trace = tmp_path / "trace.txt"
        log = tmp_path / "handctl" / "ekso-audit.jsonl"
        for path in (tmp_path / "new.csv", tmp_path / "new.csv.json", tmp_path / "new.json", trace, log):
            path.unlink(missing_ok=True)
        self.link = unit(posture=command.posture, fault=fault, seed=1, **options)
        args = ["ekso", *command.words(tmp_path), "-p", self.link, "--json", "--trace", str(trace), *more]
        began = time.monotonic()
        with spying() as spy:
            self.result: Result = run(*args, env={"XDG_STATE_HOME": str(tmp_path)})
        self.seconds = time.monotonic() - began
        self.spy: Spy = spy
        self.sent = sent(trace) if trace.exists() else []
        self.audit = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
        self.csv = (tmp_path / "new.csv").read_text() if (tmp_path / "new.csv").exists() else ""

    def __repr__(self) -> str:
        return f"ekso {' '.join(self.command.args)} -p '{self.link}': {self.result!r}"

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The rows, whatever the format; the output is valid by the schema."""
        return self.result.stream[0] if self.command.kind == "stream" else self.result.rows

    @cached_property
    def messages(self) -> list[dict[str, Any]]:
        """The messages of the envelope."""
        envelope = self.result.stream[1] if self.command.kind == "stream" else self.result.json
        return list(envelope["messages"])

    @property
    def written(self) -> list[bytes]:
        """Bodies of the SetValue requests on the wire."""
        return [data[4:-2] for data in self.sent if data[0] == SET]

    @property
    def device(self) -> Any:
        """The simulated unit."""
        return self.spy.lines[-1].device

    def changed(self) -> dict[str, int]:
        """The unit's settings that are not those of power-on any more, in their own sign."""
        now = {name: self.device.settings[place] for name, place in PLACES.items()}
        return {
            name: raw - 65536 if raw >= 32768 else raw for name, raw in now.items() if raw != POWER_ON[name] % 65536
        }

    def sound(self) -> None:
        """No traceback, valid JSON, one error with a hint, bounded time, each write once and none that was not asked."""
        assert self.result.code != 1 and "Traceback" not in self.result.err, self
        errors = [message for message in self.messages if message["level"] == "error"]
        assert len(errors) == (self.result.code != 0), self
        for error in errors:
            assert self.command.kind == "none" or "fake://ekso" in error["text"] or error["code"] == "differ", error
            assert error["hint"] or self.result.code in (6, 7), error
        assert self.seconds < REAL_SECONDS and (not self.spy.lines or self.spy.now < VIRTUAL_SECONDS), self
        assert self.written == self.command.frames[: len(self.written)], (self.written, self)
        cancels = [data for data in self.sent if data[0] == CANCEL]
        assert len(cancels) <= (self.command.kind == "cancel"), self
        assert all(150 <= data[0] <= 156 for data in self.sent), self
        assert not self.sent or self.device.violations == 0, self
        if self.command.kind == "none":
            assert self.sent == [] and not self.spy.lines, self

    def audited(self) -> None:
        """Every write has its intent with the frame, and what became of it; nothing else is in the log."""
        if self.command.kind == "cancel":
            frames = [data for data in self.sent if data[0] == CANCEL]
            assert [entry["event"] for entry in self.audit] == ["cancel", "cancel-result"] * len(frames), self
            assert [bytes.fromhex(entry["frame"]) for entry in self.audit[::2]] == frames, (self.audit, self)
            return
        assert [entry["event"] for entry in self.audit] == ["intent", "result"] * len(self.written), (self.audit, self)
        frames = [bytes.fromhex(entry["frame"])[4:-2] for entry in self.audit if entry["event"] == "intent"]
        assert frames == self.written, self
        assert all(entry["operator"] == "me" and entry["simulated"] is True for entry in self.audit), self.audit

    def harmless(self) -> None:
        """The unit's settings are those of before, but for what was written, and what the fault itself changes."""
        if not self.spy.lines:
            return
        own = {"neighbour": {"step_height", "lateral_shift", "upper_leg_length", "right_swing_assist", "swing_complete",
                             "lower_leg_length", "stand_time", "right_stance_support"}, "pendant": {"target_sounds"}}  # fmt: skip
        wanted = {name: raw for _, raw, name in self.command.writes[: len(self.written)]}
        for name, raw in self.changed().items():
            assert wanted.get(name) == raw or name in own.get(self.fault, ()), (name, raw, self)

    def truth(self, name: str) -> set[int] | None:
        """The raw values that a word may have in a row; None when it moves by itself."""
        if name in BOOT or name not in POWER_ON:
            return None
        if self.fault == "fidget" and ("hip" in name or "knee" in name) and "stance" not in name:
            return None
        fixed = {("unknown-state", "state"): 0x5040, ("stuck-sensor", "left_toe_pressure"): 333,
                 ("hip-offset", "right_hip_x"): POWER_ON["right_hip_x"] + 30}  # fmt: skip
        if name == "upright_time":  # goes on counting
            return set(range(POWER_ON[name], POWER_ON[name] + int(VIRTUAL_SECONDS)))
        values = {fixed.get((self.fault, name), POWER_ON[name])}
        values |= {raw for _, raw, key in self.command.writes if key == name}
        if self.fault == "unlisted-codes" and 10 <= PLACES.get(name, 0) != PLACES["pilot_id"]:
            values.add(40 + PLACES[name])
        if self.fault == "pendant" and name == "target_sounds":
            values |= {0, 1, 2, 3}
        return values

    def truthful(self) -> None:
        """No value that is not the unit's; raw and value belong together."""
        for row in self.rows:
            allowed = self.truth(str(row.get("name")))
            if allowed is None or row.get("value") is None:
                continue
            scale = SCALES[row["name"]]
            assert row["value"] in {raw / scale for raw in allowed}, (row, self)
            if "raw" in row:
                assert row["raw"] == round(row["value"] * scale), (row, self)

    def complete(self) -> None:
        """Success: every row is there with a value, and the unit holds what was written."""
        names = [row["name"] for row in self.rows if "name" in row]
        if self.command.shows:
            assert sorted(names) == sorted(self.command.shows), self
            assert self.command.kind == "stream" or all("value" in row for row in self.rows), self
        if self.command.kind == "log":
            assert self.csv.count("\n") == 4 and self.rows[0]["rows"] == 3, (self.csv, self)
        assert self.written == self.command.frames, self
        for _, raw, name in self.command.writes:
            assert self.changed()[name] == raw, (name, self)

    def holds(self, code: int, words: str, *, lucky: bool = False) -> None:
        """The whole expectation."""
        self.sound()
        self.audited()
        self.harmless()
        self.truthful()
        assert self.result.code == code or (lucky and self.result.code == 0), (code, self)
        if self.result.code == 0:
            self.complete()
        else:
            (error,) = [message for message in self.messages if message["level"] == "error"]
            assert any(word in error["text"] for word in words.split("|")), (words, error)

    def warned(self, code: str) -> bool:
        """Whether a warning of that code is there."""
        return any(message["code"] == code and message["level"] == "warning" for message in self.messages)
