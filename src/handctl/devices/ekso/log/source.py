"""An EksoNR as a recording sees it: GetData for each row, GetFeedback once a second, GetSettings at both ends (manual §6)."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from handctl.devices.ekso.device import Ekso
from handctl.devices.ekso.frames import Command
from handctl.devices.ekso.log.feedback import FeedbackLine
from handctl.devices.ekso.log.format import RowLayout
from handctl.devices.ekso.map import SETTINGS, boot_ms
from handctl.errors import NoAnswer, ProtocolError
from handctl.record.source import Sample, Source
from handctl.record.timeline import Place

PERSONAL = "pilot_id"
USUAL_MS = 20.0
"""50 Hz, as in the field."""


class EksoSource(Source):
    """One EksoNR. `personal`: the wearer's number is kept; `again` opens a lost port, see `Source.reopen`."""

    kind = "ekso"
    period_ms = USUAL_MS
    clock_name = "BootTime"
    looks = True

    def __init__(self, ekso: Ekso, again: Callable[[], bool], *, raw: bool, personal: bool) -> None:
        self.layout = RowLayout(raw=raw)
        self.feedback = FeedbackLine()
        self._ekso, self._port, self._again, self._personal = ekso, ekso.port, again, personal

    def sample(self) -> Sample:
        words = self._port.read(Command.GET_DATA).words
        return Sample(self._port.moment, words, boot_ms(words))

    def settings(self) -> dict[str, dict[str, Any]]:
        """The 22 words of GetSettings, raw and scaled; the wearer's number only where it is wanted."""
        return {
            param.name: {
                "raw": raw,
                "value": param.from_raw(raw),
                "unit": param.unit,
                "label": param.label(param.from_raw(raw)),
            }
            for param, raw in zip(SETTINGS, self._port.settings_raw(), strict=True)
            if self._personal or param.name != PERSONAL
        }

    def about(self) -> dict[str, Any]:
        link = self._port.link
        return {
            "link": {"port": link.name, "baud": link.baud, "length_mode": self._port.mode},
            "device_time": self._device_time(),
        }

    def _device_time(self) -> dict[str, Any] | None:
        """The device's clock beside the host's own time of day; None when it does not tell."""
        from datetime import datetime

        with suppress(NoAnswer, ProtocolError, ValueError):
            date, time = self._ekso.now()
            device = datetime.fromisoformat(f"{date['value']}T{time['value']}")
            host = datetime.fromtimestamp(self._port.link.wall())  # noqa: DTZ006 - the device tells no zone
            return {"device": device.isoformat(), "host_local": host.isoformat(timespec="seconds"), "offset_s": round((device - host).total_seconds(), 1)}  # fmt: skip
        return None

    def look(self, place: Place, row: int) -> bool:
        """GetFeedback, once: the next row is worth more than a second try."""
        return self.feedback.add(self._port.exchange(Command.GET_FEEDBACK).words, place, row)

    def unanswered(self) -> None:
        self.feedback.unanswered += 1

    def reopen(self) -> bool:
        return self._ekso.reopen(self._again)

    def sidecar(self) -> dict[str, Any]:
        return {
            "feedback": self.feedback.as_row(),
            "counters": {**self._port.journal.counters.as_row(), **self._port.counts.as_dict()},
            "answer_length_mode": self._port.answer_mode,
        }
