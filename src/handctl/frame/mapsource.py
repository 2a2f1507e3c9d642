"""A device with a parameter map as a recording sees it: the values of chosen quantities, and its settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from handctl.errors import NoAnswer
from handctl.frame.stored import kept_of
from handctl.model.clocks import Moment
from handctl.model.param import Element, Reading
from handctl.record.source import RowsLayout, Sample, Source
from handctl.screen.sheet import column_of, in_persons_unit, name_of, text_of

if TYPE_CHECKING:
    from handctl.model.device import Device


class MapSource(Source):
    """`elements` of a device; `again` opens a lost port, see `Source.reopen`."""

    def __init__(self, device: Device, elements: Sequence[Element], again: Callable[[], bool]) -> None:
        self.kind = device.kind
        rows = [device.row(Reading(element, None, b"", None)) for element in elements]
        self.layout = RowsLayout([(column_of(row), row) for row in rows])
        self._device, self._elements, self._again = device, list(elements), again
        self._identity = device.identity()
        self._met = False
        self._settings = kept_of(device.map, setpoints=False, further=device.further(self._identity))

    def sample(self) -> Sample:
        device = self._device
        begun = device.link.now()
        readings = device.read(self._elements)
        moment = Moment(begun, device.link.now())
        failed = [reading for reading in readings if reading.error is not None]
        if readings and len(failed) == len(readings):
            raise failed[0].error or NoAnswer("nothing was read")
        rows = [device.row(reading) for reading in readings]
        texts = [text_of(in_persons_unit(row)) for row in rows]
        errors = "; ".join(dict.fromkeys(f"{name_of(row)}: {row['error']}" for row in rows if row.get("error")))
        return Sample(moment, (texts, errors))

    def settings(self) -> dict[str, dict[str, Any]]:
        if not self._settings and not self._met:  # a stranger is seen before there is a file
            self._device.read(self._elements)
        self._met = True
        rows = [self._device.row(reading) for reading in self._device.read(self._settings)] if self._settings else []
        return {
            str(element.full_name): {"value": row.get("value"), "unit": row.get("unit")}
            for element, row in zip(self._settings, rows, strict=True)
        }

    def about(self) -> dict[str, Any]:
        device = self._device
        told = {"kind": device.kind, "model": device.about.get("model"), "id": self._identity.get("id")}
        return {"device": told, "link": {"port": device.link.name, "baud": getattr(device.link, "baud", None)}}

    def sidecar(self) -> dict[str, Any]:
        return {"counters": self._device.journal.counters.as_row()}

    def reopen(self) -> bool:
        return self._device.reopen(self._again)
