"""The checks of `handctl doctor` that concern one link: does it open, does the device answer, how fast, how reliably.

Asks nothing but the family's cheapest documented read. Every check has an end; what an answer means is not known here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from handctl.errors import DeviceRefused, HandctlError, LinkError, NoAnswer, ProtocolError
from handctl.link import ByteLink, Deadline, FrameLink, Link
from handctl.model.profile import SLOW, RoundTrips
from handctl.model.result import Journal, hex_bytes
from handctl.sentence import plural
from handctl.tools import can_checks
from handctl.tools.line_checks import ONE_MASTER, line_checks
from handctl.tools.machine_checks import Check
from handctl.tools.probes import FamilyProbe

LISTEN = 0.3
READ_SECONDS = 3.0
"""The series of reads ends then, however many it has."""
SPEED_SECONDS = 4.0
GIVE_UP = 5
"""A device that has not answered once so many times is not asked a hundred times."""
BAD_SHARE = 0.01
PLATEAU = (0.035, 0.060)
"""Seconds: a median in there on TCP is a delayed acknowledge (dossier aidin, 1)."""
FTDI = (0.0145, 0.0205)
"""Seconds: a median in there, of which the bytes need less than half, is the 16 ms of an FTDI adapter's latency timer.

Bluetooth takes as long by itself.
"""
WRONG_SPEED = frozenset({"garbage", "bad-checksum", "cut-short", "echo-differs", "no-answer", "wrong-id"})


# -- the wire, watched ------------------------------------------------------------------------------------------------


class Watched(ByteLink):
    """A byte link that remembers what went out and came back since `forget`."""

    def __init__(self, link: ByteLink) -> None:
        self._link = link
        self.name, self.fake, self.replayed = link.name, link.fake, link.replayed
        self.baud, self.can_set_baud = link.baud, link.can_set_baud
        self.written = b""
        self.came = b""
        self.speeds: list[int] = []
        """Speeds that were set, in order."""

    def forget(self) -> None:
        """Begin anew."""
        self.written = self.came = b""

    @property
    def echoed(self) -> bool:
        """Whether what came begins with what was sent."""
        return len(self.written) > 2 and self.came.startswith(self.written)

    def now(self) -> float:
        return self._link.now()

    def sleep(self, seconds: float) -> None:
        self._link.sleep(seconds)

    def event(self, text: str) -> None:
        self._link.event(text)

    def power_cycle(self) -> bool:
        return False

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.written += data
        self._link.write(data, deadline)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        data = self._link.read(deadline, size)
        self.came = (self.came + data)[-4096:]
        return data

    def set_baud(self, baud: int) -> None:
        self._link.set_baud(baud)
        self.baud = self._link.baud
        self.speeds.append(baud)

    def close(self) -> None:
        self._link.close()


# -- the device -------------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Series:
    """N reads: their round trips, and the codes of those that failed."""

    trips: RoundTrips = field(default_factory=RoundTrips)
    failed: Counter[str] = field(default_factory=Counter)
    seen: dict[str, HandctlError] = field(default_factory=dict)
    """The first error of each code."""
    echoes: int = 0
    questions: int = 0
    """Reads that sent something; without any the device speaks by itself."""
    stray: int = 0
    """Bytes that came meanwhile and belonged to no answer."""
    wire: float = 0.0
    """Seconds that the bytes of one read need on the line."""

    @property
    def error(self) -> HandctlError | None:
        """The most telling one: a damaged answer shows that somebody is there, at this speed; else the first."""
        return self.seen.get("bad-checksum") or next(iter(self.seen.values()), None)

    @property
    def asked(self) -> int:
        """How many reads there were."""
        return len(self.trips) + self.failed.total()


class LinkChecks:
    """The checks of one opened link. `device` makes the family's device on a link; `probe` is None for a link alone.

    `journal` is that of the device.
    """

    def __init__(
        self,
        link: Link,
        probe: FamilyProbe | None,
        device: Callable[[Link], Any],
        reads: int,
        bound: Deadline,
        journal: Journal,
    ) -> None:
        self._link: Link = Watched(link) if isinstance(link, ByteLink) else link
        self._probe = probe
        self._device = device
        self._reads = reads
        self._bound = bound
        self._counters = journal.counters
        self._line = journal.line
        self._made: Any = None
        self._first = b""  # what came before anything was asked

    def run(self) -> Iterator[Check]:
        """All rows, each as soon as it is known. Raises LinkError when the link is lost on the way."""
        if isinstance(self._link, FrameLink):
            yield can_checks.adapter_check(self._link)
        yield self._unasked()
        if self._probe is None:
            yield Check("answer", "skipped", "no device was found", "name its family with --family")
            return
        first = getattr(self._link, "baud", None)
        before = self._link.error_frames if isinstance(self._link, FrameLink) else 0
        stray = self._counters.stray_bytes
        series = self.read_series()
        series.stray = self._counters.stray_bytes - stray
        yield self._answer(series)
        if isinstance(self._link, FrameLink):
            yield from can_checks.bus_checks(self._link, before, series.failed, bool(len(series.trips)), self._bound)
        if len(series.trips) and hasattr(self._probe, "identify"):
            yield self._identity(self._probe.identify)
        yield self._speed(series, first)
        yield self._echo(series)
        if isinstance(self._link, Watched) and hasattr(self._probe, "measure"):
            self._probe.measure(self._made, self._first)
            yield from line_checks(self._line, series.failed, bool(self._first))
        if len(series.trips):
            yield self._errors(series)
            yield self._round_trip(series)
            yield self._plateau(series)
        if hasattr(self._probe, "further"):
            yield from (Check(*row) for row in self._probe.further(self._made, bool(len(series.trips))))

    @property
    def device(self) -> Any:
        """What was asked, None before that."""
        return self._made

    def _unasked(self) -> Check:
        """What comes before anything is sent."""
        if isinstance(self._link, FrameLink):
            return can_checks.traffic(self._link, self._bound, LISTEN)
        assert isinstance(self._link, Watched)
        deadline = self._link.deadline(LISTEN).earlier(self._bound)
        came = b""
        while len(came) < 1024 and not deadline.expired:
            came += self._link.read(deadline)
        self._link.forget()
        self._first = came
        if not came:
            return Check("unasked", "ok", f"no data arrived unasked within {LISTEN:g} s")
        text = f"{plural(len(came), 'byte')} arrived before anything was sent: {hex_bytes(came[:16])}"
        if self._probe is not None and "serial" not in self._probe.WIRES:
            return Check("unasked", "ok", f"{text} (this device may send data unasked)")
        return Check("unasked", "warning", text, "check for another device, a second master or a wrong speed")

    def read_series(self) -> Series:
        """Up to `reads` pings, ended by time, and by silence from the start."""
        assert self._probe is not None
        series, link = Series(), self._link
        device = self._made = self._device(link)
        end = link.deadline(READ_SECONDS).earlier(self._bound)
        found = self._settle(device, series)
        while (
            series.asked < self._reads and not end.expired and not (not len(series.trips) and series.asked >= GIVE_UP)
        ):
            self._ping(device, series)
        if not series.asked:  # to find the device took all the time there was
            series.trips = found.trips
        return series

    def _settle(self, device: Any, series: Series) -> Series:
        """The first read, which may have to find the device first: it counts in `series` only when it fails."""
        before = Series()
        self._ping(device, before)
        if before.seen:
            series.failed, series.seen, series.echoes = before.failed, before.seen, before.echoes
        return before

    def _ping(self, device: Any, series: Series) -> None:
        assert self._probe is not None
        link = self._link
        if isinstance(link, Watched):
            link.forget()
        started = link.now()
        try:
            self._probe.ping(device)
        except (NoAnswer, ProtocolError) as exc:
            series.failed[exc.code] += 1
            series.seen.setdefault(exc.code, exc)
        except LinkError as exc:
            if not isinstance(link, FrameLink) or exc.code == "lost":
                raise
            series.failed[exc.code] += 1  # bus off, or refused by the adapter: the checks of the bus tell more
            series.seen.setdefault(exc.code, exc)
        except DeviceRefused:
            series.trips.add(link.now() - started)  # it does not like the question, but it answers
        else:
            series.trips.add(link.now() - started)
        series.echoes += isinstance(link, Watched) and link.echoed
        series.questions += not isinstance(link, Watched) or bool(link.written)
        if isinstance(link, Watched) and link.baud and link.can_set_baud:
            series.wire = max(series.wire, (len(link.written) + len(link.came)) * 10 / link.baud)

    # -- what the series means ------------------------------------------------------------------------------------

    def _answer(self, series: Series) -> Check:
        assert self._probe is not None
        if len(series.trips):
            return Check("answer", "ok", f"the device answers {self._probe.PING}")
        error = series.error
        assert error is not None
        return Check("answer", "fail", error.text, error.hint)

    def _identity(self, identify: Callable[[Any], tuple[str, str, str]]) -> Check:
        """Who answers, where devices of another family understand the same questions."""
        try:
            return Check("identity", *identify(self._made))
        except (NoAnswer, ProtocolError) as exc:
            return Check("identity", "warning", exc.text, exc.hint)

    def _speed(self, series: Series, first: int | None) -> Check:
        """Whether the device answers at the speed that was asked for, else whether it does at another."""
        assert self._probe is not None
        link, probe = self._link, self._probe
        if not isinstance(link, Watched) or not link.can_set_baud or len(probe.SPEEDS) < 2:
            return Check("speed", "skipped", "this link or this device has one speed only")
        if len(series.trips) and link.baud != first:
            text = f"the device answers at {link.baud} bit/s, not at {first}. Other speeds were tried"
            return Check("speed", "ok", text, f"give --baud {link.baud}")
        if len(series.trips) and hasattr(probe, "ignores_speed") and probe.ignores_speed(self._made):
            text = f"the device answers at another speed than {first} bit/s as well. The speed does not matter"
            return Check("speed", "ok", f"{text} on Bluetooth, USB or a network")
        if len(series.trips):
            only = ", and not at another speed" if self._line.speed_matters else ""
            return Check("speed", "ok", f"the device answers at {first} bit/s{only}")
        if link.speeds:
            return Check("speed", "ok", f"tried at {', '.join(map(str, dict.fromkeys(link.speeds)))} bit/s as well")
        return self._other_speeds(link, probe, series, first)

    def _other_speeds(self, link: Watched, probe: FamilyProbe, series: Series, first: int | None) -> Check:
        """Nobody at this speed: does one answer at another?"""
        tried = []
        end = link.deadline(SPEED_SECONDS).earlier(self._bound)
        try:
            for speed in probe.SPEEDS:
                if speed == first:
                    continue
                if end.expired:
                    break
                link.set_baud(speed)
                tried.append(str(speed))
                if _answers(probe, link, end):
                    remedy = f"give --baud {speed}, or set the device back to {first} bit/s"
                    return Check("speed", "fail", f"the device answers at {speed} bit/s, not at {first}", remedy)
        finally:
            if first is not None:
                link.set_baud(first)
        garbage = sum(series.failed[code] for code in WRONG_SPEED - {"no-answer", "bad-checksum"})
        text = f"no answer at {', '.join(tried)} either" if tried else "no time was left for other speeds"
        if series.failed["bad-checksum"] > garbage:
            return Check("speed", "ok", f"answers come at {first} bit/s, with a wrong checksum, {text}")
        if garbage:
            remedy = "look at the type plate, or run `handctl scan`: a wrong speed is likely"
            return Check("speed", "warning", f"the data at {first} bit/s is garbage, {text}", remedy)
        return Check("speed", "ok", text)

    def _echo(self, series: Series) -> Check:
        assert self._probe is not None
        if not isinstance(self._link, Watched):
            return Check("echo", "skipped", "CAN frames are not echoed on a byte level")
        if self._probe.ECHOES:
            return Check("echo", "skipped", "this device echoes every byte")
        if not series.echoes:
            return Check("echo", "ok", "our own bytes do not come back")
        text = f"our own bytes came back in {series.echoes} of {series.asked} reads"
        if len(series.trips):
            remedy = "switch the echo of the RS-485 adapter off, or ignore it: it is harmless"
            return Check("echo", "warning", f"{text}, before the answer", remedy)
        return Check("echo", "fail", text, "check the wiring: TX and RX are connected, or the device has no power")

    def _errors(self, series: Series) -> Check:
        total, stray = series.failed.total(), series.stray
        text = f"{total} of {series.asked} reads failed"
        if total:
            kinds = ", ".join(f"{count} {code}" for code, count in series.failed.most_common())
            text += f" ({100 * total / series.asked:.1f} %): {kinds}"
        if stray and not series.echoes:
            text += f". {plural(stray, 'byte')} in between outside of any answer"
            if not total:
                return Check("error_rate", "warning", text, self._error_remedy({"garbage"}))
        if not total:
            return Check("error_rate", "ok", text)
        status = "fail" if total * 10 > series.asked else "warning" if total > BAD_SHARE * series.asked else "ok"
        remedy = self._error_remedy(set(series.failed)) if status != "ok" else ""
        return Check("error_rate", status, text, remedy)

    def _error_remedy(self, codes: set[str]) -> str:
        if self._line.others or "wrong-id" in codes:
            return ONE_MASTER
        if codes <= {"no-answer"}:
            return "close other programs on this port, check the plug, or give a longer --timeout: answers are lost"
        return "check cable, ground and hub: data is corrupted. Two devices with one id can also cause this"

    def _round_trip(self, series: Series) -> Check:
        assert self._probe is not None
        row = series.trips.as_row()
        what = self._probe.PING if series.questions else f"{self._probe.PING} arrives unasked, interval"
        classes = " ".join(f"≤{top:g}:{count}" if top else f"more:{count}" for top, count in row["histogram"])
        text = (
            f"{what}: median {row['median_ms']:.1f} ms, p95 {row['p95_ms']:.1f}, max {row['max_ms']:.1f} "
            f"over {row['count']}. Histogram in ms: {classes}"
        )
        late = not series.failed and row["late"] > 0.05 * row["count"] and row["max_ms"] > 20
        remedy = "try another USB port: other programs, a hub or a busy computer delay answers" if late else ""
        return Check("round_trip", "warning" if late else "ok", text, remedy, tuple(row.items()))

    def _plateau(self, series: Series) -> Check:
        """The two delays that a whole population of users takes for a slow device."""
        median = series.trips.quantile(0.5)
        if not series.questions:
            return Check("delay", "skipped", "the device sends data unasked: no round trip is measured")
        if self._link.name.startswith("tcp://"):
            if PLATEAU[0] <= median <= PLATEAU[1]:
                text = f"median {median * 1000:.0f} ms: the plateau of a delayed acknowledge, not the device"
                remedy = (
                    "its server writes an answer in pieces: set TCP_NODELAY there, or TCP_QUICKACK in other clients"
                )
                return Check("delay", "warning", text, remedy)
            return Check("delay", "ok", f"median {median * 1000:.1f} ms is not the 40 ms of a delayed acknowledge")
        if median > SLOW:
            text = f"median {median * 1000:.0f} ms: a slow line, such as Bluetooth, a network or a serial server"
            remedy = "use a cable where answers must be quick, or give --timeout"
            return Check("delay", "warning", text, remedy)
        if FTDI[0] <= median <= FTDI[1] and series.wire < median / 2 and "rfcomm" not in self._link.name:
            text = f"median {median * 1000:.0f} ms: looks like an adapter's latency timer of 16 ms"
            return Check("delay", "warning", text, "set the timer to 1 ms: `handctl ports` shows how")
        return Check("delay", "ok", f"median {median * 1000:.1f} ms is not the 16 ms of a latency timer")


def _answers(probe: FamilyProbe, link: Link, end: Deadline) -> bool:
    try:
        return bool(probe.probe(link, Journal(), end))
    except (NoAnswer, ProtocolError):
        return False


def failed_open(error: LinkError) -> list[Check]:
    """The rows of a link that cannot be opened."""
    return [Check("open", "fail", error.text, error.hint), Check("answer", "skipped", "the link is not open")]
