"""Base classes for a device with a simple request/reply protocol, one value per request. See `model.device`.

For protocols in which each request has one answer. A family says what is asked, and which frame answers. Knows no bytes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from handctl.errors import CheckFailed, DeviceRefused, NoAnswer, ProtocolError
from handctl.model.device import Device, Gate, Line
from handctl.model.frames import Decoder, frames_in
from handctl.model.param import Element, Number, Param, Reading, Step
from handctl.model.result import Column, Grid, Row, hex_bytes

if TYPE_CHECKING:
    from handctl.link import ByteLink, Deadline
    from handctl.model.guide import Guide
    from handctl.model.result import Journal

PERIOD = 0.05
"""Seconds between two looks at a movement."""

F = TypeVar("F")


class Asking(Line, ABC, Generic[F]):
    """Questions and answers on a link, and who is there before the first write.

    kind     the family's command
    decoder  of its codec
    seconds  for an answer, unless --timeout says otherwise
    """

    link: ByteLink
    kind: str
    decoder: type[Decoder[F]]
    seconds = 0.3

    def __init__(
        self,
        link: ByteLink,
        journal: Journal,
        *,
        timeout: float | None = None,
        retries: int | None = None,
        bound: Deadline | None = None,
        assumed: bool = False,
    ) -> None:
        super().__init__(link, journal, retries=retries, bound=bound)
        self.timeout = timeout or self.seconds
        self._gate = Gate(assumed)

    @abstractmethod
    def ask(self, param: Param) -> int:
        """One raw value, asked once."""

    @abstractmethod
    def request(self, param: Param, raw: int) -> bytes:
        """What writes one raw value."""

    @abstractmethod
    def send(self, param: Param, raw: int) -> int:
        """Write one raw value, once; the one that the acknowledgement repeats."""

    @abstractmethod
    def look(self) -> object:
        """Ask what only a device of this family answers."""

    def identify(self) -> None:
        """Once, before the first write. Raises NotIdentified, Interrupted."""
        self._gate.check(self.link, self.journal, self.look)

    def value(self, param: Param) -> Number:
        """One value in its unit, asked again where no valid answer came."""
        return param.from_raw(self.repeated(lambda: self.ask(param)))

    def put(self, param: Param, value: Number) -> None:
        """Write one value, once. Raises CheckFailed where another one is acknowledged."""
        self.identify()
        raw = param.to_raw(value)
        if (taken := self.send(param, raw)) != raw:
            text = f"{self.where}: {param.name} {raw} was sent, {taken} was taken"
            raise CheckFailed(text, hint=f"`handctl {self.kind} dump`")

    def exchange(self, request: bytes, answers: Callable[[F], bool]) -> F:
        """Send once, and wait for the frame that `answers`, which may raise DeviceRefused for one that says no.

        Raises NoAnswer, ProtocolError, LinkError besides.
        """
        text = request.decode("ascii").strip() if request.isascii() else hex_bytes(request)
        self.check_bound(text)
        while self.link.read(self.link.deadline(0.0)):  # what came late answers an older question
            pass
        since, deadline = self.link.now(), self.deadline(self.timeout)
        self.link.write(request, deadline)
        self.journal.counters.sent += 1
        decoder, came, wrong = self.decoder(), b"", ["half an answer"]
        while chunk := self.link.read(deadline):
            came += chunk
            decoder.feed(chunk)
            for frame in frames_in(decoder, lambda error: wrong.append(error.text)):
                if answers(frame):
                    self.journal.counters.received += 1
                    return frame
        if not came:
            raise self.unanswered(text, self.timeout, since, "check power, cable and port")
        self.journal.counters.bad_frames += 1
        hint = "another device, or another speed? check the port"
        raise ProtocolError(f"{self.where}: no answer to {text}, but {wrong[-1]}", hint=hint, came=came)


def prober(line: Callable[..., Asking[Any]], param: Param) -> Callable[..., list[Row]]:
    """The `probe` of a family (`tools.probes.FamilyProbe`) of which a value tells: only its device answers that question."""

    def probe(
        link: ByteLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,), timeout: float | None = None
    ) -> list[Row]:
        value = line(link, journal, timeout=timeout, retries=0, bound=deadline).value(param)
        return [{"evidence": f"{param.name} {value}"}]

    return probe


class AskedDevice(Device):
    """One device on such a line: rows of name, value and unit. A family adds `status` and its movements."""

    columns = (Column("name", "Name"), Column("value", "Value", right=True), Column("unit", "Unit"))
    plain = ("name", "value")

    def __init__(self, talk: Asking[Any]) -> None:
        super().__init__(talk)
        self.talk = talk

    def identify(self) -> None:
        self.talk.identify()

    def read(self, elements: Sequence[Element]) -> list[Reading]:
        found: list[Reading] = []
        with self.keeping(lambda: found):
            for element in elements:
                try:
                    found.append(Reading(element, self.talk.value(element.param)))
                except (NoAnswer, ProtocolError, DeviceRefused) as exc:
                    found.append(Reading(element, None, error=exc))
        return found

    def named(self, element: Element) -> Row:
        return {"name": element.full_name}

    def valued(self, reading: Reading) -> Row:
        return {"value": reading.value, "unit": reading.element.param.unit}

    @staticmethod
    def view(rows: list[Row]) -> list[Grid]:
        """A line a value."""
        lines = tuple((row["name"], str(row.get("value", "?")), row["unit"], row.get("error", "")) for row in rows)
        return [Grid(("Name", "Value", "Unit", "Error"), lines, right=frozenset({1}))]

    def plan(self, changes: Sequence[tuple[Element, Number]]) -> list[Step]:
        return [
            Step(f"{one.full_name} = {value}", self.talk.request(one.param, one.param.to_raw(value)), one.param.moves)
            for one, value in changes
        ]

    def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        for element, value in changes:
            self.talk.put(element.param, value)
        found = self.read([element for element, _ in changes])
        self.check_read_back(changes, found, f"`handctl {self.kind} dump`")
        return found

    @contextmanager
    def driving(self, guide: Guide) -> Iterator[None]:
        """Around a movement. Whatever ends it early stops it: Ctrl-C, an error, the time, the death of this process."""
        self.identify()
        with self.driven(guide):
            try:
                yield
            except Exception:
                with guide.undisturbed():
                    self.stop()
                raise

    def wait_until(self, there: Callable[[], bool], seconds: float, what: str) -> None:
        """Wait until the device is `there`, in words `what`. Raises CheckFailed after so many `seconds`."""
        end = self.talk.deadline(seconds)
        while not there():
            if end.expired:
                text = f"{self.talk.where}: not {what} in time, stopped"
                raise CheckFailed(text, hint="check whether something is in its way")
            self.link.sleep(PERIOD)
