"""A recording on the Lab Streaming Layer: its rows and marks are sent, and marks of other programs are received. Needs pylsl (`handctl[lsl]`)."""

from __future__ import annotations

import csv
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from handctl.errors import UsageError
from handctl.number_parsing import real_in
from handctl.record.marks import Heard
from handctl.record.row_source import Source
from handctl.system import clock

MARKERS = "Markers"
"""The type of a stream of marks."""
LOOK_S = 1.0
"""Between two looks for streams of marks that are new."""
WAIT_S = 0.2
"""For a mark; then the thread looks whether it is to end."""


def library() -> Any:
    """pylsl. Raises UsageError where it, or the library below it, is not there."""
    try:
        import pylsl
    except (ImportError, RuntimeError, OSError) as exc:
        raise UsageError(
            "--lsl needs pylsl, which is not installed",
            hint='install it with: pip install "handctl[lsl]". Nothing was sent',
            code="no-extra",
        ) from exc
    return pylsl


class Streams:
    """The streams of one recording: `row` and `mark` send, `heard` is called with what others send, by what, and when."""

    def __init__(self, source: Source, rate: float, heard: Callable[[str, str, float], None]) -> None:
        self._lsl = library()
        self._heard = heard
        self._over = threading.Event()
        self._ahead = self._lsl.local_clock() - clock.now()
        """What the clock of the streams is ahead of ours; both are steady clocks of this computer."""
        columns = source.layout.as_rows()
        self._at = [source.layout.names.index(str(column["column"])) for column in columns]
        name, number = f"handctl {source.kind}", f"handctl-{source.kind}-{id(self):x}-{clock.now():.6f}"
        nominal = rate or self._lsl.IRREGULAR_RATE  # as fast as the line lets it: nobody knows how fast that is
        info = self._lsl.StreamInfo(name, "Motion", len(columns), nominal, self._lsl.cf_double64, number)
        channels = info.desc().append_child("channels")
        for column in columns:
            channel = channels.append_child("channel")
            channel.append_child_value("label", str(column["column"]))
            channel.append_child_value("unit", str(column.get("unit") or ""))
        self._rows = self._lsl.StreamOutlet(info)
        self._own = f"{number}-marks"
        said = self._lsl.StreamInfo(
            f"{name} marks", MARKERS, 1, self._lsl.IRREGULAR_RATE, self._lsl.cf_string, self._own
        )
        self._marks = self._lsl.StreamOutlet(said)
        self.name = name
        self._hearing: dict[str, threading.Thread] = {}
        """By the name of the stream, those that hear it."""
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def row(self, moment: float, line: str) -> None:
        """Send a row of the file, with the moment at which it was taken."""
        fields = next(csv.reader([line]))
        self._rows.push_sample([real_in(fields[at]) for at in self._at], moment + self._ahead)

    def marks(self, came: Sequence[Heard]) -> Sequence[Heard]:
        """Send the marks that did not come from a stream themselves; returns all."""
        for one in came:
            if one.by != "lsl":
                self._marks.push_sample([one.text], (clock.now() if one.mono_s is None else one.mono_s) + self._ahead)
        return came

    def close(self) -> None:
        """Nothing is sent or received any more."""
        self._over.set()
        self._thread.join(2 * WAIT_S)
        for thread in self._hearing.values():
            thread.join(2 * WAIT_S)

    def _listen(self) -> None:
        """Hear each stream of marks but our own, in a thread of its own: a mark of one waits for no other."""
        resolver = self._lsl.ContinuousResolver("type", MARKERS)
        while True:
            for info in resolver.results():
                if info.source_id() != self._own and info.uid() not in self._hearing:
                    thread = self._hearing[info.uid()] = threading.Thread(target=self._hear, args=(info,), daemon=True)
                    thread.start()
            if self._over.wait(LOOK_S):
                return

    def _hear(self, info: Any) -> None:
        """The marks of another program, each at the time at which that program set it."""
        inlet = self._lsl.StreamInlet(info, max_buflen=60, processing_flags=self._lsl.proc_clocksync)
        with suppress(
            RuntimeError
        ):  # nothing is known yet: it begins to compare the clocks, which a first mark waited for
            inlet.time_correction(timeout=0)
        while not self._over.is_set():
            try:
                values, stamp = inlet.pull_sample(timeout=WAIT_S)
            except RuntimeError:  # the stream is over
                return
            if stamp is not None:
                self._heard(str(values[0]), "lsl", stamp - self._ahead)
