"""The checks of `handctl doctor` that concern one link: does it open, does the device answer, how fast, how reliably.

Asks nothing but the family's cheapest documented read. Every check has an end; what an answer means is not known here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from ipaddress import IPv4Address, ip_network
from typing import Any

from handctl.errors import DeviceRefused, HandctlError, LinkError, NoAnswer, ProtocolError
from handctl.link import ByteLink, CanFrame, Deadline, FrameLink, Link
from handctl.model.profile import SLOW, Profile, RoundTrips
from handctl.model.result import Journal, hex_bytes
from handctl.sentence import plural
from handctl.tools.machine import Machine
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
            yield adapter_check(self._link)
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
            yield from bus_checks(self._link, before, series.failed, bool(len(series.trips)), self._bound)
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
            return traffic(self._link, self._bound, LISTEN)
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


# -- what a serial line does to answers: what a family measured of it, in words ----------------------------------------


BLUETOOTH = 20
"""Bytes of a packet of Bluetooth 4.0 as serial modules send them (exo §1.1)."""
ONE_MASTER = "leave only one device and one master on the line: end other programs, or disconnect the second master"


def line_checks(line: Profile, failed: Collection[str], unasked: bool) -> Iterator[Check]:
    """First byte, half duplex, packets, others. `failed`: codes of reads that failed; `unasked`: data came by itself."""
    answered = bool(len(line.trips))
    yield _first_byte(failed, answered)
    yield _half_duplex(line)
    yield _packets(line)
    yield _others(line, unasked)


def _first_byte(failed: Collection[str], answered: bool) -> Check:
    if "first-byte-lost" in failed:
        remedy = "use another RS-485 adapter, or set this one to switch its direction sooner"
        return Check("first_byte", "warning" if answered else "fail", "replies arrive without their first byte", remedy)
    if not answered:
        return Check("first_byte", "skipped", "no reply arrived")
    return Check("first_byte", "ok", "replies arrive with their first byte")


def _half_duplex(line: Profile) -> Check:
    if line.half_duplex is None:
        return Check("half_duplex", "skipped", "only a reply shows whether the line is full duplex")
    if line.half_duplex:
        text = "a reply is lost while handctl is sending: half duplex, as on RS-485"
        return Check("half_duplex", "ok", text, "let other programs wait for each answer, as handctl does")
    return Check("half_duplex", "ok", "a reply arrives while handctl is sending: full duplex")


def _packets(line: Profile) -> Check:
    if line.longest is None:
        return Check("packets", "skipped", "no long answer was read")
    if line.packet is None:
        return Check("packets", "ok", f"an answer of {line.longest} bytes arrives byte by byte, not in packets")
    if line.packet == line.longest:
        text = f"an answer of {line.longest} bytes arrives in one piece: something in between buffers the data"
        return Check("packets", "ok", text, "if you need quick replies, turn off buffering in the serial server")
    text = f"an answer of {line.longest} bytes arrives in packets of {line.packet}"
    if line.packet == BLUETOOTH:
        text += ", the size of Bluetooth 4.0"
    return Check("packets", "ok", text, "let other programs wait for the whole answer, not for its first packet")


def _others(line: Profile, unasked: bool) -> Check:
    if line.others:
        return Check(
            "others",
            "warning",
            "received frames that are not replies to handctl: another program uses this line",
            ONE_MASTER,
        )
    if unasked:
        return Check("others", "skipped", "data came unasked, but no whole frame of this family")
    return Check("others", "ok", "no frames from other programs")


# -- what a CAN bus has of its own -------------------------------------------------------------------------------------


LISTEN_SECONDS = 0.25
BITRATES = (1_000_000, 500_000, 250_000, 125_000, 800_000)
"""Those of hands first: 1 Mbit/s (wrist §2.3), 500 kbit/s on sibling hands."""
REMEDIES = {
    "no-ack": "check the hand's power, CAN high and low, and the termination (120 ohm at both ends)",
    "bus-off": "check CAN high, CAN low and the bitrate. Opening the link starts the controller again",
    "refused": "unplug the adapter and plug it in again",
    "bel": "check the hand's power, CAN high and low, and the termination (120 ohm at both ends)",
    "bus-errors": "disconnect one of two devices that have one id, or check the termination (120 ohm at both ends)",
}
NAMES = {
    "no-ack": "no device acknowledges",
    "bus-off": "the CAN controller has left the bus (bus off)",
    "refused": "the adapter refuses frames (BEL)",
    "bel": "the adapter answers frames with BEL",
    "bus-errors": "frames are destroyed on the bus",
}


def adapter_check(link: FrameLink) -> Check:
    """Who the adapter says it is."""
    if link.adapter is None:
        return Check("adapter", "skipped", "this interface has no adapter that could be asked")
    return Check("adapter", "ok", link.adapter or "it answers, but reports neither version nor serial number")


def traffic(link: FrameLink, bound: Deadline, seconds: float) -> Check:
    """Frames of others before anything is sent."""
    deadline = link.deadline(seconds).earlier(bound)
    frames: list[CanFrame] = []
    while not deadline.expired and len(frames) < 1000:
        frame = link.receive(deadline)
        if frame is None:
            break
        frames.append(frame)
    if link.error_frames:
        remedy = "check bitrate, termination (120 ohm at both ends) and that a device is powered"
        return Check("unasked", "warning", f"{plural(link.error_frames, 'error frame')} on the bus", remedy)
    if link.damaged:
        remedy = "check the adapter's cable and hub, and that no other program reads its port"
        return Check(
            "unasked",
            "warning",
            f"{plural(link.damaged, 'damaged line')} of the adapter, such as {link.damage}",
            remedy,
        )
    return Check("unasked", "ok", f"{plural(len(frames), 'frame')} of others within {seconds:g} s")


def bus_checks(link: FrameLink, before: int, failed: Iterable[str], answered: bool, bound: Deadline) -> Iterator[Check]:
    """What the controller reports after the reads, and where no one answered, the bitrate.

    `failed` are the codes of reads that failed: their reports are over, as asking for them clears them.
    """
    trouble = link.trouble(before)
    if known := [code for code in failed if code in NAMES]:
        yield Check("bus", "warning" if answered else "fail", NAMES[known[0]], REMEDIES[known[0]])
    elif trouble is None:
        yield Check("bus", "skipped", "this interface reports no state of the bus")
    elif trouble.code:
        status = "warning" if answered else "fail"
        yield Check("bus", status, f"{NAMES[trouble.code]}. {trouble.evidence}", REMEDIES[trouble.code])
    else:
        yield Check("bus", "ok", f"no bus error. {trouble.evidence}")
    if not answered:
        yield _bitrate(link, bound)


def _bitrate(link: FrameLink, bound: Deadline) -> Check:
    """The bitrate at which frames of others are heard."""
    given = link.bitrate
    tried: list[int] = []
    noisy = False
    try:
        for bitrate in dict.fromkeys((given or BITRATES[0], *BITRATES)):
            if bound.expired:
                break
            heard = link.listen(bitrate, LISTEN_SECONDS)
            if heard is None:
                hint = (
                    "see the bitrate of a Linux interface with `ip -details link show can0`, "
                    "and the frames with `candump can0`"
                )
                return Check("bitrate", "skipped", "this interface cannot be set to listen only", hint)
            frames, errors = heard
            tried.append(bitrate)
            noisy = noisy or errors
            if frames and bitrate == given:
                return Check("bitrate", "ok", f"frames of others are heard at {given} bit/s")
            if frames:
                text = f"frames of others are heard at {bitrate} bit/s, not at {given}"
                return Check("bitrate", "fail", text, f"add ?bitrate={bitrate} to the LINK")
    finally:
        link.resume()
    at = f"handctl only listened, at {', '.join(map(str, tried))} bit/s"
    if noisy:
        hint = "check the termination (120 ohm at both ends), and add the bitrate of the bus to the LINK: ?bitrate=N"
        return Check("bitrate", "warning", f"the bus has traffic, but no whole frame was heard. {at}", hint)
    hint = "try adding ?bitrate=500000 to the LINK, but only while no other device is on the bus"
    return Check("bitrate", "skipped", f"no other device sends on this bus, so its bitrate cannot be heard. {at}", hint)


# -- a device on a network: our own address towards it, and who answers there ------------------------------------------


MASK = 24
"""Bits of a network: that of the devices here, where nothing else is known."""
CONNECTIONS = 4
"""So many, one behind the other: two devices with one address take turns, or one of them answers all."""
APART = 2
"""Counts by which readings of one resting device may differ."""


def host_in(link: str) -> str:
    """The host of a LINK over TCP, "" = it is none."""
    from urllib.parse import urlsplit

    return urlsplit(link).hostname or "" if link.startswith("tcp://") else ""


def subnet(machine: Machine, address: str, *, reached: bool | None) -> Iterator[Check]:
    """Whether this computer is in the network of an address.

    reached  the device answers there, whatever the way; None = nobody asked there, the device was read over another wire
    """
    there = _ipv4(address)
    if there is None or there.is_loopback:
        return
    ours = machine.source(address)
    network = ip_network(f"{address}/{MASK}", strict=False)
    mine = _ipv4(ours)
    if mine is not None and mine in network:
        yield Check("subnet", "ok", f"this computer has {ours}, in the network of {address}")
        return
    free = next(str(one) for one in network.hosts() if one != there)
    text = f"this computer has {ours} towards {address}" if ours else f"this computer has no way to {address}"
    text += f", and no address in its network {network.network_address}"
    if reached:
        yield Check("subnet", "ok", f"{text}. A router leads there")
        return
    remedy = f"give this computer an address such as {free}, mask 255.255.255.0"
    yield Check("subnet", "skipped" if reached is None else "fail", text, remedy)


def is_local(host: str) -> bool:
    """Whether a host is this computer: a simulator, or a tunnel."""
    there = _ipv4(host)
    return host == "localhost" or (there is not None and there.is_loopback)


def _ipv4(text: str) -> IPv4Address | None:
    with suppress(ValueError):
        return IPv4Address(text)
    return None


def same_address(
    link: str, device: Any, make: Callable[[Any], Any], fingerprint: Callable[[Any], list[int]]
) -> Iterator[Check]:
    """Whether one device answers all connections. The first connection, that of `device`, may not survive the others."""
    from handctl.link import open_link

    seen: list[list[int]] = []
    try:
        seen += _prints(device, fingerprint)
        for _ in range(CONNECTIONS - 1):
            with closing(open_link(link)) as opened:
                seen += _prints(make(opened), fingerprint)
    except HandctlError as exc:
        yield Check("same_address", "skipped", f"not every connection could be read: {exc.text}")
        return
    pairs = list(zip(seen[0::2], seen[1::2], strict=True))
    if any(_apart(*pair) for pair in pairs):
        yield Check("same_address", "skipped", "the readings change: let the device rest, then run this again")
    elif any(_apart(pairs[0][0], one) for one, _ in pairs):
        others = {tuple(one) for one, _ in pairs}
        text = f"{plural(len(others), 'device')} answer at {host_in(link)}: connections read {' and '.join(map(_short, sorted(others)))}"
        remedy = "leave one of them powered and give it another address: `handctl hand network` or `handctl hand pair`"
        yield Check("same_address", "fail", text, remedy)
    else:
        yield Check(
            "same_address", "ok", f"{plural(len(pairs), 'connection')} read the same: one device has this address"
        )
    yield from _second_client(device, fingerprint)


def _second_client(device: Any, fingerprint: Callable[[Any], list[int]]) -> Iterator[Check]:
    """Whether the first connection lived through the others."""
    try:
        fingerprint(device)
    except LinkError:
        remedy = "let one program at a time use this device: end the others before you run handctl"
        yield Check("clients", "warning", "another connection ended the first one", remedy)
    except HandctlError as exc:
        yield Check("clients", "warning", exc.text, exc.hint)
    else:
        yield Check("clients", "ok", "other connections leave the first one alone")


def _prints(device: Any, fingerprint: Callable[[Any], list[int]]) -> list[list[int]]:
    return [fingerprint(device) for _ in range(2)]


def _apart(one: list[int], other: list[int]) -> bool:
    return len(one) != len(other) or any(abs(a - b) > APART for a, b in zip(one, other, strict=False))


def _short(values: tuple[int, ...]) -> str:
    return " ".join(map(str, values[:6]))
