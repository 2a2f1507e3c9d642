"""The checks of `handctl doctor` for one link: whether it opens, whether the device replies, how fast and how reliably.

Asks nothing but the family's cheapest documented read. A bitrate is looked for by listening only: the controller neither sends
nor acknowledges then, so that a wrong one disturbs no one. Every check has an end; what an answer means is not known here, and
a family's probe tells two devices apart by its `fingerprint`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from ipaddress import IPv4Address, ip_network
from typing import Any

from handctl.errors import DeviceRefused, HandctlError, Hint, LinkError, NoAnswer, NotRunning, ProtocolError
from handctl.link import ByteLink, CanFrame, Deadline, Link, open_link
from handctl.link.transcript import observed
from handctl.model.check_rows import Check
from handctl.model.result import SLOW, Journal, RoundTrips, hex_bytes
from handctl.tools.family_probe import BITRATES, FamilyProbe
from handctl.tools.port_inventory import Machine
from handctl.tools.scan_report import CONTACT
from handctl.wording import plural

LISTEN = 0.3
LISTEN_SECONDS = 0.25
"""For one bitrate."""
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
WRONG_SPEED = frozenset({"garbage", "cut-short", "echo-differs", "wrong-id"})
"""What a device at another speed looks like."""
BLUETOOTH = 20
"""Bytes of a packet of Bluetooth 4.0 as serial modules send them (exo §1.1)."""
ONE_MASTER = "leave only one device and one master on the line: end other programs, or disconnect the second master"
NO_ACK = "check the hand's power, CAN high and low, and the termination (120 ohm at both ends)"
BUS = {
    "no-ack": ("no device acknowledges", NO_ACK),
    "bus-off": (
        "the CAN controller has left the bus (bus off)",
        "check CAN high, CAN low and the bitrate. Opening the link starts the controller again",
    ),
    "refused": ("the adapter refuses frames (BEL)", "unplug the adapter and plug it in again"),
    "bel": ("the adapter replies to frames with BEL", NO_ACK),
    "repeats": (
        "the device replied, so its frames and the requests are acknowledged. But the adapter has counted many bus errors, so frames were repeated",
        "check CAN high and low, the termination (120 ohm at both ends), and that every device on the bus has this bitrate",
    ),
    "bus-errors": (
        "frames are destroyed on the bus",
        "disconnect one of two devices that have one id, or check the termination (120 ohm at both ends)",
    ),
}
"""Code of a trouble of the bus -> what it is, and what to do."""


class Wire:
    """What passed on a byte link since `forget`, and the speeds that were set, in order. See `link.transcript.Observer`."""

    def __init__(self) -> None:
        self.written = self.came = b""
        self.speeds: list[str] = []

    def forget(self) -> None:
        """Start again."""
        self.written = self.came = b""

    def opened(self, now: float) -> None:
        """Nothing has passed yet."""

    def passed(self, now: float, mark: str, data: bytes, can_id: int | None) -> None:
        if mark == ">":
            self.written += data
        else:
            self.came = (self.came + data)[-4096:]

    def event(self, now: float, text: str) -> None:
        event, _, speed = text.partition(" ")
        if event == "baud":
            self.speeds.append(speed)


Verdict = tuple[str, str] | tuple[str, str, str] | tuple[str, str, str, tuple[tuple[str, Any], ...]]
"""What a check found: status, evidence, and where there are such a remedy and numbers."""


@dataclass(slots=True)
class Series:
    """N reads: their round trips, and the codes of those that failed."""

    trips: RoundTrips = field(default_factory=RoundTrips)
    failed: Counter[str] = field(default_factory=Counter)
    seen: dict[str, HandctlError] = field(default_factory=dict)
    """The first error of each code."""
    refusal: DeviceRefused | None = None
    """How it refused what was asked, which is an answer too."""
    echoes: int = 0
    questions: int = 0
    """Reads that sent something; without any the device speaks by itself."""
    stray: int = 0
    """Bytes that came meanwhile and belonged to no answer."""
    wire: float = 0.0
    """Seconds that the bytes of one read need on the line."""

    @property
    def asked(self) -> int:
        """How many reads there were."""
        return len(self.trips) + self.failed.total()


class LinkChecks:
    """The checks of one opened link. `make` makes the family's device on a link; `probe` is None for a link alone.

    `journal` is that of the device.
    """

    probe: FamilyProbe
    device: Any = None
    """What was asked, None before that."""

    def __init__(
        self,
        link: Link,
        probe: FamilyProbe | None,
        make: Callable[[Link], Any],
        reads: int,
        bound: Deadline,
        journal: Journal,
    ) -> None:
        self.wire = Wire() if isinstance(link, ByteLink) else None
        self.link: Any = observed(link, self.wire) if self.wire is not None else link
        self.known = probe is not None
        if probe is not None:
            self.probe = probe
        self.make = make
        self.reads = reads
        self.bound = bound
        self.counters = journal.counters
        self.line = journal.line
        self.first = getattr(link, "baud", None)
        self.before = 0
        """Error frames on the bus before the reads."""
        self.unasked = b""
        """What came before anything was asked."""
        self.series = Series()

    @property
    def answered(self) -> bool:
        """Whether the device has answered."""
        return len(self.series.trips) > 0

    @property
    def network_alone(self) -> bool:
        """Whether the device has no serial line, on which bytes are damaged."""
        return self.known and "serial" not in self.probe.WIRES

    def run(self) -> Iterator[Check]:
        """All rows, each as soon as it is known. Raises LinkError when the link is lost on the way."""
        for name, applies, look in CHECKS:
            if applies(self):
                yield Check(name, *look(self))
        if self.known and hasattr(self.probe, "further"):
            yield from (Check(*row) for row in self.probe.further(self.device, self.answered))

    # -- reading --------------------------------------------------------------------------------------------------

    def read_series(self) -> None:
        """Up to `reads` pings, ended by time, and by silence from the start."""
        self.before, stray = getattr(self.link, "error_frames", 0), self.counters.stray_bytes
        self.device = self.make(self.link)
        if self.unasked:
            self.device.overheard(self.unasked)
        end = self.link.deadline(READ_SECONDS).earlier(self.bound)
        found = Series()  # the first read may have to find the device first: it counts only when it fails
        self._ping(found)
        series = self.series = Series(failed=found.failed, seen=found.seen, echoes=found.echoes if found.seen else 0)
        while series.asked < self.reads and not end.expired and (self.answered or series.asked < GIVE_UP):
            self._ping(series)
        if not series.asked:  # to find the device took all the time there was
            series.trips = found.trips
        series.stray = self.counters.stray_bytes - stray

    def _ping(self, series: Series) -> None:
        link, wire = self.link, self.wire
        if wire is not None:
            wire.forget()
        started = link.now()
        try:
            try:
                self.probe.ping(self.device)
            except NotRunning:
                raise
            except DeviceRefused as exc:  # it does not like the question, but it answers
                series.refusal = exc
            series.trips.add(link.now() - started)
        except (NoAnswer, ProtocolError, LinkError, NotRunning) as exc:
            if isinstance(exc, LinkError) and (wire is not None or exc.code == "lost"):
                raise
            series.failed[exc.code] += 1  # bus off, or refused by the adapter: the checks of the bus tell more
            series.seen.setdefault(exc.code, exc)
        if wire is None:
            series.questions += 1
            return
        series.echoes += len(wire.written) > 2 and wire.came.startswith(wire.written)
        series.questions += bool(wire.written)
        if link.baud and link.can_set_baud:
            series.wire = max(series.wire, (len(wire.written) + len(wire.came)) * 10 / link.baud)


# -- what is there ----------------------------------------------------------------------------------------------------


def _adapter(it: LinkChecks) -> Verdict:
    """Who the adapter says it is."""
    if it.link.adapter is None:
        return "skipped", "this interface has no adapter that could be asked"
    return "ok", it.link.adapter or "it replies, but reports neither version nor serial number"


def _traffic(it: LinkChecks) -> Verdict:
    """Frames of others before anything is sent."""
    link, frames = it.link, list[CanFrame]()
    deadline = link.deadline(LISTEN).earlier(it.bound)
    while not deadline.expired and len(frames) < 1000 and (frame := link.receive(deadline)) is not None:
        frames.append(frame)
    if link.error_frames:
        remedy = "check bitrate, termination (120 ohm at both ends) and that a device is powered"
        return "warning", f"{plural(link.error_frames, 'error frame')} on the bus", remedy
    if link.damaged:
        remedy = "check the adapter's cable and hub, and that no other program reads its port"
        return "warning", f"{plural(link.damaged, 'corrupted line')} of the adapter, such as {link.damage}", remedy
    return "ok", f"{plural(len(frames), 'frame')} of others within {LISTEN:g} s"


def _unasked(it: LinkChecks) -> Verdict:
    """What comes before anything is sent."""
    deadline = it.link.deadline(LISTEN).earlier(it.bound)
    while len(it.unasked) < 1024 and not deadline.expired:
        it.unasked += it.link.read(deadline)
    if not it.unasked:
        return "ok", f"no data arrived unasked within {LISTEN:g} s"
    text = f"{plural(len(it.unasked), 'byte')} arrived before anything was sent: {hex_bytes(it.unasked[:16])}"
    if it.network_alone:
        return "ok", f"{text} (this device may send data unasked)"
    return (
        "warning",
        text,
        "run it again if the device was just switched on. Otherwise check for another device, a second master or a wrong speed",
    )


def _answer(it: LinkChecks) -> Verdict:
    if not it.known:
        return "skipped", "no device was found", "name its family with --family"
    it.read_series()
    if it.answered:
        refusal = it.series.refusal
        return "ok", f"the device replies ({it.probe.PING}){f', with a refusal: {refusal.text}' if refusal else ''}"
    # the most telling error: a damaged answer shows that somebody is there, at this speed; else the first
    error = it.series.seen.get("bad-checksum") or next(iter(it.series.seen.values()))
    return "fail", error.text, error.hint


def _bus(it: LinkChecks) -> Verdict:
    """The report of the CAN controller after the reads. Failed reads have shown it already, and reading clears it."""
    status, trouble = "warning" if it.answered else "fail", it.link.trouble(it.before)
    for code in it.series.failed:
        if code in BUS:
            return status, *BUS[code]
    if trouble is None:
        return "skipped", "this interface reports no state of the bus"
    if not trouble.code:
        return "ok", f"no bus error. {trouble.evidence}"
    # An adapter that is error passive has counted errors; that nobody acknowledges is one cause, which a reply excludes.
    text, remedy = BUS["repeats" if it.answered and trouble.code == "no-ack" else trouble.code]
    return status, f"{text}. {trouble.evidence}", remedy


def _bitrate(it: LinkChecks) -> Verdict:
    """The bitrate at which frames of others are heard."""
    link, given = it.link, it.link.bitrate
    tried: list[int] = []
    noisy = False
    try:
        for bitrate in dict.fromkeys((given or BITRATES[0], *BITRATES)):
            if it.bound.expired:
                break
            heard = link.listen(bitrate, LISTEN_SECONDS)
            if heard is None:
                hint = "see the bitrate of a Linux interface with `ip -details link show can0`, and the frames with `candump can0`"
                return "skipped", "this interface cannot be set to listen only", hint
            frames, errors = heard
            tried.append(bitrate)
            noisy = noisy or errors
            if frames and bitrate == given:
                return "ok", f"frames of others are heard at {given} bit/s"
            if frames:
                text = f"frames of others are heard at {bitrate} bit/s, not at {given}"
                return "fail", text, f"add ?bitrate={bitrate} to the LINK"
    finally:
        link.resume()
    at = f"handctl only listened, at {', '.join(map(str, tried))} bit/s"
    if noisy:
        hint = "check the termination (120 ohm at both ends), and add the bitrate of the bus to the LINK: ?bitrate=N"
        return "warning", f"the bus has traffic, but no whole frame was heard. {at}", hint
    hint = "try adding ?bitrate=500000 to the LINK, but only while no other device is on the bus"
    return "skipped", f"no other device sends on this bus, so its bitrate cannot be heard. {at}", hint


def _identity(it: LinkChecks) -> Verdict:
    """Who answers, where devices of another family understand the same questions."""
    try:
        found: Verdict = it.probe.identify(it.device)  # type: ignore[attr-defined]
    except (NoAnswer, ProtocolError) as exc:
        return "warning", exc.text, exc.hint
    return found


def _speed(it: LinkChecks) -> Verdict:
    """Whether the device answers at the speed that was asked for, else whether it does at another."""
    link, probe, first = it.link, it.probe, it.first
    if any(isinstance(error, NotRunning) for error in it.series.seen.values()):
        return "skipped", "the device that replied runs no firmware: nothing is sent to it at another speed"
    if it.wire is None or not link.can_set_baud or len(probe.SPEEDS) < 2:
        return "skipped", "this link or this device has one speed only"
    if it.answered and link.baud != first:
        text = f"the device replies at {link.baud} bit/s, not at {first}. Other speeds were tried"
        return "ok", text, f"give --baud {link.baud}"
    if it.answered and hasattr(probe, "ignores_speed") and probe.ignores_speed(it.device):
        text = f"the device replies at another speed than {first} bit/s as well. The speed does not matter"
        return "ok", f"{text} on Bluetooth, USB or a network"
    if it.answered:
        only = ", and not at another speed" if it.line.speed_matters else ""
        return "ok", f"the device replies at {first} bit/s{only}"
    if any(code in it.series.failed for code in CONTACT):
        return "ok", f"the data that arrives at {link.baud} bit/s is readable, so the baud rate is right"
    if it.wire.speeds:
        return "ok", f"tried at {', '.join(dict.fromkeys(it.wire.speeds))} bit/s as well"
    return _other_speeds(it)


def _other_speeds(it: LinkChecks) -> Verdict:
    """No reply at this baud rate: check the others."""
    link, first, tried = it.link, it.first, []
    end = link.deadline(SPEED_SECONDS).earlier(it.bound)
    try:
        for speed in it.probe.SPEEDS:
            if speed == first:
                continue
            if end.expired:
                break
            link.set_baud(speed)
            tried.append(str(speed))
            with suppress(NoAnswer, ProtocolError):
                if it.probe.probe(link, Journal(), end):
                    remedy = f"give --baud {speed}, or set the device back to {first} bit/s"
                    return "fail", f"the device replies at {speed} bit/s, not at {first}", remedy
    finally:
        if first is not None:
            link.set_baud(first)
    failed = it.series.failed
    garbage = sum(failed[code] for code in WRONG_SPEED)
    silent = {*failed} <= {NoAnswer.default_code}
    text = (
        f"no reply at {', '.join(tried)}{' either' if silent else ''}" if tried else "no time was left for other speeds"
    )
    if failed["bad-checksum"] > garbage:
        return "ok", f"replies come at {first} bit/s, with a wrong checksum, {text}"
    if garbage:
        remedy = Hint("look at the type plate, or run {}: a wrong speed is likely", "scan")
        return "warning", f"the data at {first} bit/s is garbage, {text}", remedy
    return "ok", text


def _echo(it: LinkChecks) -> Verdict:
    if it.wire is None:
        return "skipped", "CAN frames are not echoed on a byte level"
    if "no-echo" in it.series.failed:
        return "fail", "this device echoes every byte, but no echo arrives"
    if getattr(it.probe, "ECHOES", False):
        return "skipped", "this device echoes every byte"
    if not it.series.echoes:
        return "ok", "our own bytes do not come back"
    text = f"our own bytes came back in {it.series.echoes} of {it.series.asked} reads"
    if it.answered:
        remedy = "switch the echo of the RS-485 adapter off, or ignore it: it is harmless"
        return "warning", f"{text}, before the reply", remedy
    return "fail", text, "check the wiring: TX and RX are connected, or the device has no power"


# -- what a serial line does to answers: what a family measured of it, in words ------------------------------------------


def _first_byte(it: LinkChecks) -> Verdict:
    it.probe.measure(it.device, it.unasked)  # type: ignore[attr-defined]
    answered = bool(len(it.line.trips))
    if "first-byte-lost" in it.series.failed:
        remedy = "use another RS-485 adapter, or set this one to switch its direction sooner"
        return "warning" if answered else "fail", "replies arrive without their first byte", remedy
    return ("ok", "replies arrive with their first byte") if answered else ("skipped", "no reply arrived")


def _half_duplex(it: LinkChecks) -> Verdict:
    if it.line.half_duplex is None:
        return "skipped", "only a reply shows whether the line is full duplex"
    if it.line.half_duplex:
        text = "a reply is lost while handctl is sending: half duplex, as on RS-485"
        return "ok", text, "let other programs wait for each reply, as handctl does"
    return "ok", "a reply arrives while handctl is sending: full duplex"


def _packets(it: LinkChecks) -> Verdict:
    longest, packet = it.line.longest, it.line.packet
    if longest is None:
        return "skipped", "no long reply was read"
    if packet is None:
        return "ok", f"a reply of {longest} bytes arrives byte by byte, not in packets"
    if packet == longest:
        text = f"a reply of {longest} bytes arrives in one piece: something in between buffers the data"
        return "ok", text, "if you need quick replies, turn off buffering in the serial server"
    text = f"a reply of {longest} bytes arrives in packets of {packet}"
    text += ", the size of Bluetooth 4.0" if packet == BLUETOOTH else ""
    return "ok", text, "let other programs wait for the whole reply, not for its first packet"


def _others(it: LinkChecks) -> Verdict:
    if it.line.others:
        text = "received frames that are not replies to handctl: another program uses this line"
        return "warning", text, ONE_MASTER
    if it.unasked:
        return "skipped", "data came unasked, but no whole frame of this family"
    return "ok", "no frames from other programs"


# -- what the series of reads means ---------------------------------------------------------------------------------------


def _errors(it: LinkChecks) -> Verdict:
    series = it.series
    total = series.failed.total()
    text = f"{total} of {series.asked} reads failed"
    if total:
        kinds = ", ".join(f"{count} {code}" for code, count in series.failed.most_common())
        text += f" ({100 * total / series.asked:.1f} %): {kinds}"
    stray = series.stray and not series.echoes
    if stray:
        text += f". {plural(series.stray, 'byte')} in between outside of any reply"
    status = "fail" if total * 10 > series.asked else "warning" if total > BAD_SHARE * series.asked else "ok"
    if not total and stray:
        status = "warning"
    if status == "ok":
        return status, text
    if it.line.others or "wrong-id" in series.failed:
        remedy = ONE_MASTER
    elif total and {*series.failed} <= {"no-answer"}:
        remedy = "close other programs on this port, check the plug, or give a longer --timeout: replies are lost"
    elif it.network_alone:
        remedy = "record the bytes with --trace FILE, and ask the vendor: a network does not corrupt data, the device sent it"
    else:
        remedy = "check cable, ground and hub: data is corrupted. Two devices with one id can also cause this"
    return status, text, remedy


def _round_trip(it: LinkChecks) -> Verdict:
    row = it.series.trips.as_row()
    what = it.probe.PING if it.series.questions else f"{it.probe.PING} arrives unasked, interval"
    classes = " ".join(f"≤{top:g}:{count}" if top else f"more:{count}" for top, count in row["histogram"])
    text = (
        f"{what}: median {row['median_ms']:.1f} ms, p95 {row['p95_ms']:.1f}, max {row['max_ms']:.1f} "
        f"over {row['count']}. Histogram in ms: {classes}"
    )
    late = not it.series.failed and row["late"] > 0.05 * row["count"] and row["max_ms"] > 20
    way = "cable" if it.network_alone or it.link.name.startswith("tcp://") else "USB port"
    remedy = f"try another {way}: other programs, a hub or a busy computer delay replies" if late else ""
    return "warning" if late else "ok", text, remedy, tuple(row.items())


def _delay(it: LinkChecks) -> Verdict:
    """The two delays that a whole population of users takes for a slow device."""
    median = it.series.trips.quantile(0.5)
    if not it.series.questions:
        return "skipped", "the device sends data unasked: no round trip is measured"
    if it.link.name.startswith("tcp://"):
        if PLATEAU[0] <= median <= PLATEAU[1]:
            text = f"median {median * 1000:.0f} ms: the plateau of a delayed acknowledge, not the device"
            remedy = "its server writes a reply in pieces: set TCP_NODELAY there, or TCP_QUICKACK in other clients"
            return "warning", text, remedy
        return "ok", f"median {median * 1000:.1f} ms is not the 40 ms of a delayed acknowledge"
    if median > SLOW:
        text = f"median {median * 1000:.0f} ms: a slow line, such as Bluetooth, a network or a serial server"
        return "warning", text, "use a cable where replies must be quick, or give --timeout"
    if FTDI[0] <= median <= FTDI[1] and it.series.wire < median / 2 and "rfcomm" not in it.link.name:
        text = f"median {median * 1000:.0f} ms: looks like an adapter's latency timer of 16 ms"
        return "warning", text, Hint("set the timer to 1 ms: {} shows how", "ports")
    return "ok", f"median {median * 1000:.1f} ms is not the 16 ms of a latency timer"


def _on_can(it: LinkChecks) -> bool:
    return it.wire is None


def _answers(it: LinkChecks) -> bool:
    return it.known and it.answered


def _measured(it: LinkChecks) -> bool:
    return it.known and it.wire is not None and hasattr(it.probe, "measure")


CHECKS: tuple[tuple[str, Callable[[LinkChecks], bool], Callable[[LinkChecks], Verdict]], ...] = (
    ("adapter", _on_can, _adapter),
    ("unasked", _on_can, _traffic),
    ("unasked", lambda it: it.wire is not None, _unasked),
    ("answer", lambda it: True, _answer),
    ("bus", lambda it: it.known and it.wire is None, _bus),
    ("bitrate", lambda it: it.known and it.wire is None and not it.answered, _bitrate),
    ("identity", lambda it: _answers(it) and hasattr(it.probe, "identify"), _identity),
    ("speed", lambda it: it.known, _speed),
    ("echo", lambda it: it.known, _echo),
    ("first_byte", _measured, _first_byte),
    ("half_duplex", _measured, _half_duplex),
    ("packets", _measured, _packets),
    ("others", _measured, _others),
    ("error_rate", _answers, _errors),
    ("round_trip", _answers, _round_trip),
    ("delay", _answers, _delay),
)
"""Name of a check, whether it is made, and what makes it, in the order in which they are made."""


# -- a device on a network: our own address towards it, and who answers there -------------------------------------------


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
    try:
        pairs = [(fingerprint(device), fingerprint(device))]
        for _ in range(CONNECTIONS - 1):
            with closing(open_link(link)) as opened:
                made = make(opened)
                pairs.append((fingerprint(made), fingerprint(made)))
    except HandctlError as exc:
        yield Check("same_address", "skipped", f"not every connection could be read: {exc.text}")
        return
    if any(_apart(*pair) for pair in pairs):
        yield Check("same_address", "skipped", "the readings change: let the device rest, then run this again")
    elif any(_apart(pairs[0][0], one) for one, _ in pairs):
        others = sorted({tuple(one) for one, _ in pairs})
        read = " and ".join(" ".join(map(str, values[:6])) for values in others)
        text = f"{plural(len(others), 'device')} reply at {host_in(link)}: connections read {read}"
        apart = Hint("leave one of them powered and give it another address: {} or {}", "hand network", "hand pair")
        yield Check("same_address", "fail", text, apart)
    else:
        text = f"{plural(len(pairs), 'connection')} read the same: one device has this address"
        yield Check("same_address", "ok", text)
    try:  # whether the first connection lived through the others
        fingerprint(device)
    except LinkError:
        remedy = "let one program at a time use this device: end the others before you run handctl"
        yield Check("clients", "warning", "another connection ended the first one", remedy)
    except HandctlError as exc:
        yield Check("clients", "warning", exc.text, exc.hint)
    else:
        yield Check("clients", "ok", "other connections leave the first one alone")


def _apart(one: list[int], other: list[int]) -> bool:
    return len(one) != len(other) or any(abs(a - b) > APART for a, b in zip(one, other, strict=False))
