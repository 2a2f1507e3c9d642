"""The cable of a simulated device: options, faults, power, control, the state file; transmission time, the client's speed.

Generic: knows bytes, replies and time, no protocol. Both directions are independent (full duplex), one byte is 10 bits
(start, 8 data, stop; exo §2.1). Nothing here sleeps: the driver calls `advance(now)`, then `feed` and `take`, and asks
`next_event` how long it may sleep. What is not of bytes alone (`Cable`) is that of a CAN bus too (can_line.py).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from operator import attrgetter

from handctl.number_parsing import real_in
from handctl.sim.engine.simulated_device import NOTHING, Model, Options, Random, Reply, Rows, soonest

Taught = tuple[list[str], list[str]]
"""Control commands that the simulator took, and those that it does not have."""

LINE_OPTIONS = Rows({
    "seed": ((0, 0, 4294967295), "start of the random generator, 0..4294967295 (default 0)"),
    "fault": (None, "faults and states, with commas between"),
    "after": ((0, 0, 1000000000), "the first N requests are healthy (default 0)"),
    "every": ((1, 1, 1000000000), "of the later requests only each N-th is hit (default 1)"),
    "wire": (None, "transmission time of 10 bits a byte at this speed, or 'auto' for the device's own (default: none)"),
    "turnaround": ((0.0, 60.0), "seconds from the last bit of a request to the first of its answer (default 0)"),
    "late": ((0.6, 3600.0), "seconds that the fault 'late' adds (default 0.6)"),
    "reply-times": (None, "seconds with commas between: each answer takes at least one of these times, picked at random"),
    "values": (None, "used by the option transcript of a LINK and of `handctl sim`: what the recorded device showed"),
    "facts": (None, "facts file of `handctl prove`: the simulator becomes like that device, as far as the facts go"),
    "state": (None, "file that keeps memory, flash and positions from one run to the next"),
    "save": (("always", "changed", "never"), "when the state file is written: always (default), changed (when the device's state has changed), never"),
    "elapse": ((None, 1e9), "seconds that have passed since the state file was written. Movements have ended"),
    "power-cycle": (False, "1: power cycle after the state file was loaded"),
    "use": (("off", "on"), "on: someone is using the device (a slow grasp or a walk). Its state file is read, not written (default off)"),
    "unplug": (None, "AT:SECONDS[,AT:SECONDS]: the port goes away AT seconds after the start, for SECONDS. The device goes on"),
    "clock": (None, "used by the in-process link, ignored here"),
})  # fmt: skip
LINE_FAULTS: dict[str, str] = {
    "healthy": "no fault",
    "silent": "the device obeys the request, its answer is lost",
    "deaf": "the request is lost, the device does nothing",
    "noise": "junk bytes before and after each answer, and garbage in reply to a request at the wrong baud rate",
    "garble": "garbage in reply to a request at the wrong baud rate, nothing else",
    "truncate": "the answer is cut short",
    "dribble": "the answer arrives byte by byte, 3 ms apart",
    "split": "the answer arrives in random pieces with small gaps",
    "bad-checksum": "the check value of the answer is wrong",
    "wrong-id": "the answer is valid but carries another id",
    "twin-id": "a second device with the same id answers at the same time (wired AND of both answers)",
    "echo": "every byte received returns first",
    "loopback": "only the echo, no device",
    "duplicate": "the answer arrives twice",
    "stale": "the answer to the previous request arrives first",
    "late": "the answer arrives late (see the option late)",
    "slow": "turnaround 20 ms longer",
    "disconnect": "the line hangs up in the middle of the answer",
    "refuse": "writes are refused, reads are healthy",
}
UNTOUCHED = 0.05  # s from the start until the user of the device does anything: the first look finds it as it was left
TICK = 0.002  # s of wire time after which a long frame is handed over in part
DRIBBLE = 0.003  # s per byte
SLOW = 0.020  # s
BACKLOG = 65536  # bytes on the wire to the device that are kept; a client cannot make the simulator grow
PLUG_COMMANDS = ("unplug [SECONDS]", "replug")


class Plug:
    """Out at the moments of a plan "AT:SECONDS,AT:SECONDS", counted from the start, or by command."""

    def __init__(self, plan: str | None) -> None:
        """Raises ValueError for a plan that is none."""
        self.plan = sorted(_pair(item) for item in (plan or "").split(",") if item.strip())
        self._start = 0.0
        self.until = 0.0  # by hand
        self.used = bool(self.plan)  # else it is in

    def begin(self, now: float) -> None:
        """The start of the plan."""
        self._start = now

    def command(self, words: list[str], now: float) -> str:
        """unplug [SECONDS] | replug, as words. Raises ValueError."""
        match words:
            case ["unplug", *seconds] if len(seconds) < 2:
                self.until, self.used = now + _seconds(seconds[0]) if seconds else float("inf"), True
            case ["replug"]:
                self.until = 0.0
            case _:
                raise ValueError(f"unknown command {' '.join(words)!r}. Known: {' | '.join(PLUG_COMMANDS)}")
        return " ".join(words)

    def out(self, now: float) -> bool:
        """Whether it is out."""
        if not self.plan:
            return now < self.until
        since = now - self._start
        return now < self.until or any(at <= since < at + seconds for at, seconds in self.plan)

    def next_event(self, now: float) -> float | None:
        """When that changes next."""
        if not self.plan and self.until <= now:
            return None
        moments = [self.until, *[self._start + edge for at, seconds in self.plan for edge in (at, at + seconds)]]
        return min([moment for moment in moments if now < moment < float("inf")], default=None)


def _seconds(text: str) -> float:
    seconds = real_in(text)
    if not 0.0 < seconds <= 1e9:
        raise ValueError(f"{text!r} is not a number of seconds")
    return seconds


def _pair(text: str) -> tuple[float, float]:
    at, _, seconds = text.partition(":")
    found = real_in(at), real_in(seconds)
    if not (0.0 <= found[0] <= 1e9 and 0.0 < found[1] <= 1e9):
        raise ValueError(f"unplug={text}: expected AT:SECONDS, for example 2.5:1")
    return found


class Switched:
    """What has power, faults, and a count of requests that were understood: the control commands of every simulator."""

    requests = 0

    def power(self, on: bool) -> None:
        """Off: whatever was on the wire or still to come is gone."""
        raise NotImplementedError

    def fault(self, names: str) -> str:
        """Other faults from now on, with commas between; those that are present then. Raises ValueError."""
        raise NotImplementedError

    def further(self, words: list[str]) -> str:
        """Any other control command. Raises ValueError."""
        raise NotImplementedError

    def power_cycle(self) -> None:
        self.power(False)
        self.power(True)

    def command(self, text: str) -> str:
        """A control command; returns one line, raises ValueError."""
        match text.split():
            case ["power-cycle"]:
                self.power_cycle()
                return "power cycled"
            case ["power", "on" | "off" as state]:
                self.power(state == "on")
                return f"power {state}"
            case ["fault", _, *_] as words:
                return f"fault {self.fault(','.join(words[1:]))}"
            case ["requests"]:
                return f"requests {self.requests}"
            case words:
                return self.further(words or ["help"])


class Cable(Switched):
    """A simulated device at the end of a cable that has options and faults of its own."""

    def __init__(self, model: type[Model], raw: dict[str, str], options: Rows, faults: Mapping[str, str]) -> None:
        """`options` and `faults` are those of the cable."""
        self._options = Options(model.KIND, raw, options, model.OPTIONS)
        self.kind = model.KIND
        self.given = given = self._options.read(options)
        self._turnaround = float(given["turnaround"])
        self._random = Random(given["seed"])
        self._known = {**faults, **model.FAULTS}
        self._faults = self._parse_faults(given["fault"] or "")
        self.device = model(self._options, self._random)
        self.device.judge, self.device.hits_of = self._judge, self._hits
        self.device.faults = self._faults
        self.device.power(True)
        self.hung_up = False
        self._plug = Plug(given["unplug"])
        self.pulled = False  # the port went away, and no client has opened it since
        self.second = False  # another device than the first of its kind: what it measures differs a little
        self.now = 0.0
        self._begun = False
        self._closed = False
        self._settled = False  # all that happens until now has happened, and nobody has done anything since
        self._save = "never" if given["use"] == "on" else given["save"]
        self._changed = False
        self._user: Iterator[float] | None = None  # acts, then tells for how many seconds it does nothing else
        self._acts = 0.0  # when it acts next
        self._reply_times = [float(text) for text in (given["reply-times"] or "").split(",") if text]
        self._chance, self._floor = Random(given["seed"] + 1), 0.0  # of its own: what the device does stays the same
        known = self._load()
        self.values = self._taught([] if known else (given["values"] or "").split(";"))
        if given["use"] == "on":
            self._user = self.device.user()
        if given["power-cycle"]:
            self.device.power(False)
            self.device.power(True)
        self.device.set_faults(self._faults)
        self.device.dirty = False

    @property
    def away(self) -> bool:
        """Whether the port is gone."""
        return self.device.absent or self._plug.out(self.now)

    def reconnect(self) -> None:
        """A new client: what was on the wire is lost, the device goes on."""
        self.hung_up = self.pulled = self._settled = False
        self._drop()

    def _look(self) -> None:
        """With the port goes what was on the wire."""
        if self.away and not self.pulled:
            self.pulled = self.hung_up = True
            self._drop()

    def command(self, text: str) -> str:
        answer = super().command(text)
        self._look()
        return answer

    def advance(self, now: float) -> None:
        """Moves time on; the first call is the moment of power-on. A time before the last one is taken as the last."""
        if not self._begun:
            self.now, self._begun = now, True
            self._begin(now)
            self.device.boot(now)
            self._acts = now + UNTOUCHED
            return
        while self._user is not None and self._acts <= now:  # the user of the device acts at each moment that has come
            self._pass(self._acts)
            self._acts += next(self._user)
            self._settled = False
        self._pass(now)

    # -- power and control ----------------------------------------------------------------------------------------

    def power(self, on: bool) -> None:
        self._settled = False
        if not on:
            self._drop()
        if on != self.device.powered:
            self.device.power(on)
        self._persist()

    def fault(self, names: str) -> str:
        self._faults = self._parse_faults(names)
        self._settled = False
        self.device.set_faults(self._faults)
        return ",".join(sorted(self._faults)) or "none"

    def further(self, words: list[str]) -> str:
        """Beside those of every device: unplug [SECONDS] | replug."""
        if words[0] in ("unplug", "replug"):
            return self._plug.command(words, self.now)
        self._settled = False
        answer = self.device.command(words)
        if words == ["help"]:
            commons = " | ".join((*PLUG_COMMANDS, "power-cycle", "power on|off", "fault NAME[,NAME]|none", "requests"))
            return f"{commons} | {answer}"
        self._persist()
        return answer

    def close(self) -> None:
        """Writes the state file, if there is one."""
        if not self._closed:
            self.device.dirty = self.device.dirty or self._changed or self._save == "always"
            self._persist()
        self._closed = True

    # -- inside -----------------------------------------------------------------------------------------------------

    def _drop(self) -> None:
        """Forgets what is on the wire."""
        raise NotImplementedError

    def _begin(self, now: float) -> None:
        """The moment of power-on."""
        self._plug.begin(now)

    def _pass(self, now: float) -> None:
        """Moves time on to this moment, with all that happens until then."""
        raise NotImplementedError

    def _parse_faults(self, text: str) -> frozenset[str]:
        names = {name.strip().replace("_", "-") for name in text.split(",")} - {"", "none", "healthy"}
        for name in sorted(names):
            if name not in self._known:
                raise ValueError(
                    f"unknown fault {name!r} of the simulated {self.kind}. {_near(name, self._known)}Known: {', '.join(sorted(self._known))}"
                )
        return frozenset(names)

    def _hits(self, number: int) -> frozenset[str]:
        """The faults that befall the request with this number, counted from 1."""
        if not self._faults:
            return NOTHING
        beyond = number - self.given["after"]
        return self._faults if beyond > 0 and beyond % self.given["every"] == 0 else NOTHING

    def _due(self, reply: Reply) -> float:
        """When it leaves."""
        due = reply.due + self._turnaround
        if times := self._reply_times:  # never ahead of the answer before
            wait = times[self._chance.between(0, len(times) - 1)]
            self._floor = max(self._floor, self.now + wait)
            due = max(due, self._floor)
        if not reply.hits:
            return due
        slow, late = SLOW if "slow" in reply.hits else 0.0, self.given["late"] if "late" in reply.hits else 0.0
        return due + slow + late

    def _judge(self) -> frozenset[str]:
        self.requests += 1
        return self._hits(self.requests)

    def _load(self) -> bool:
        """Whether there is a state from an earlier run; then the device is in it."""
        if self.given["state"] is None:
            return False
        from handctl.sim.engine import state_file

        known = state_file.load(self.given["state"], self.device)
        if known and self.given["elapse"] is not None:
            self.device.elapse(self.given["elapse"])
        return known

    def _taught(self, told: list[str]) -> Taught:
        """Carry out control commands that make the device show what another one showed."""
        taken, left = [], []
        for words in filter(None, told):
            try:
                self.device.command(words.split())
                taken.append(words)
            except ValueError:
                left.append(words)
        return taken, left

    def _persist(self) -> None:
        if self.given["state"] is not None and self.device.dirty and self._save != "never":
            from handctl.sim.engine import state_file

            state_file.save(self.given["state"], self.device)
            self._changed = True
        self.device.dirty = False


def _near(name: str, known: Collection[str]) -> str:
    """The one that was meant, if one is near."""
    from difflib import get_close_matches

    near = get_close_matches(name, known, n=1, cutoff=0.6)
    return f"Did you mean {near[0]!r}? " if near else ""


class _Segment:
    """Bytes on the wire: byte k is complete at start + (k + 1) * step (at start when step is 0). `put` are those that were
    sent at `speed`; `data` is what is heard of them."""

    def __init__(
        self, start: float, step: float, data: bytes, put: bytes = b"", speed: int | None = None, hang: bool = False
    ) -> None:
        self.start = start
        self.step = step
        self.data = data
        self.sent = 0
        self.hang = hang
        self.put = put
        self.speed = speed

    def end_of(self, count: int) -> float:
        return self.start + self.step * count

    def complete(self, now: float) -> int:
        """How many bytes are complete; a millionth of a byte of rounding is forgiven."""
        if self.step == 0.0:
            return len(self.data) if now >= self.start else 0
        return max(0, min(len(self.data), int((now - self.start) / self.step + 0.000001)))

    def next_event(self) -> float:
        if self.step == 0.0:
            return self.start
        return self.start + self.step * min(len(self.data), self.sent + max(1, int(TICK / self.step)))


class Line(Cable):
    """A simulated device as a client sees it: a cable end that takes and gives bytes."""

    def __init__(self, model: type[Model], raw: dict[str, str]) -> None:
        super().__init__(model, raw, LINE_OPTIONS, LINE_FAULTS)
        auto = self._options.text("wire") == "auto"
        self._wire = 0 if auto else self._options.integer("wire", -1, 50, 20000000)  # bit/s, -1: bytes take no time
        self._client_baud: int | None = None
        self._rx: list[_Segment] = []
        self._rx_free = 0.0
        self._out: list[tuple[float, list[tuple[float, float, bytes]], bool, int | None, int | None]] = []
        self._tx: list[_Segment] = []
        self._tx_free = 0.0
        self._previous = b""

    def reconnect(self) -> None:
        super().reconnect()
        self.device.reconnected()

    @property
    def client_baud(self) -> int | None:
        """The speed at which the client hears and speaks; None: any. What is on its way when it changes is heard anew."""
        return self._client_baud

    @client_baud.setter
    def client_baud(self, baud: int | None) -> None:
        if baud == self._client_baud:
            return
        self._client_baud, self._settled = baud, False
        for segment in self._tx:
            done = segment.complete(self.now)
            if done < len(segment.data) and segment.speed is not None and baud is not None:
                rest = segment.put[len(segment.put) * done // len(segment.data) :]
                segment.data = segment.data[:done] + self._heard(rest, segment.speed, baud)

    # -- time and bytes -------------------------------------------------------------------------------------------

    def _pass(self, now: float) -> None:
        if now > self.now:
            self.now, self._settled = now, False
        elif self._settled:
            return
        if self._rx:
            self._listen()
        device = self.device
        device.advance(self.now)
        if device.replies or self._out or device.dirty:
            self._collect()
        if self._plug.used or device.absent:
            self._look()
        self._settled = True

    def feed(self, data: bytes) -> None:
        """Bytes that the client writes at the present time."""
        if not self._begun:
            self.advance(0.0)
        self._settled = False
        now, baud = self.now, self._client_baud
        if self.hung_up or not data:
            return
        step = self._step(baud) if self._wire >= 0 else 0.0
        start = max(now, self._rx_free) if step else now
        upcoming = self._hits(self.requests + 1) if self._faults else NOTHING
        if "echo" in upcoming or "loopback" in upcoming:
            self._tx.append(_Segment(max(start, self._tx_free), step, bytes(data)))
            self._tx_free = self._tx[-1].end_of(len(data))
        if "loopback" in upcoming or not self.device.powered:
            return
        end = start + step * len(data)
        heard: bytes | None = bytes(data)
        if baud is not None and self.device.speed not in (None, baud):
            heard = self.device.mishear(bytes(data), baud, self.device.speed or 0)
            if heard is None:
                # At a wrong speed a UART sees framing errors: the device never finds a header, so it is silent.
                if "noise" in upcoming or "garble" in upcoming:
                    self._send(end, self._random.junk(self._random.between(3, 12), self.device.HEADER), NOTHING)
                    self._dispatch(now)
                return
            step *= len(data) / max(1, len(heard))  # the same time on the wire, whatever is made of it
            self._rx_free = end
        if not heard:
            return
        if self._rx and sum([len(segment.data) - segment.sent for segment in self._rx]) + len(data) > BACKLOG:
            return
        self._rx_free = end
        if not (step or self._rx):
            self._hand_over(heard)
        else:
            self._rx.append(_Segment(start, step, heard))
            self._listen()
            self._collect()
        if self._plug.used or self.device.absent:
            self._look()

    def take(self) -> bytes:
        """Bytes that have fully arrived at the client by now."""
        if not self._tx:
            return b""
        now = self.now
        out = b""
        while self._tx and not self.hung_up:
            segment = self._tx[0]
            done = segment.complete(now)
            out += segment.data[segment.sent : done]
            segment.sent = done
            if done < len(segment.data):
                break
            del self._tx[0]
            if segment.hang:
                self.hung_up = True
                self._drop()
        return out

    def next_event(self) -> float | None:
        """The earliest time at which `take` may return something or the device acts; None: nothing is scheduled."""
        first = self.device.next_event() if self.device.powered else None
        if self._tx:
            first = soonest(first, self._tx[0].next_event())
        if self._out:
            first = soonest(first, self._out[0][0])
        if self._rx:
            first = soonest(first, self._hearing()[1])
        if self._plug.used:
            first = soonest(first, self._plug.next_event(self.now))
        return first

    # -- inside -----------------------------------------------------------------------------------------------------

    def _step(self, sender: int | None = None) -> float:
        """Seconds per byte on the wire; with wire=auto at the speed of the sender, the device when it is not told."""
        speed = (sender or self.device.speed or 0) if self._wire == 0 else self._wire
        return 10.0 / speed if speed > 0 else 0.0

    def _hearing(self) -> tuple[int, float]:
        """Of the bytes on their way to the device: how many to hand over next, and when the last of them is in."""
        first = self._rx[0]
        pending = first.data[first.sent :]
        if len(self._rx) > 1:
            pending += b"".join([segment.data for segment in self._rx[1:]])
        wanted = self.device.due(pending) or len(pending)
        if not first.step:
            return wanted, first.start
        # At most 20 ms of wire time at once, or the device would take a long frame on a slow line for a pause.
        count = min(wanted, len(first.data) - first.sent, max(1, int(0.020 / first.step)))
        return count, first.start + first.step * (first.sent + count)

    def _listen(self) -> None:
        """Hands the bytes that reached the device over, each request at the time of its last bit."""
        now = self.now
        while self._rx:
            count, when = self._hearing()
            if when > now + 0.000000001:
                return
            data = b""
            while len(data) < count:
                segment = self._rx[0]
                part = segment.data[segment.sent : segment.sent + count - len(data)]
                data += part
                segment.sent += len(part)
                if segment.sent == len(segment.data):
                    del self._rx[0]
            self.device.advance(max(self.device.now, when))
            self.device.feed(data)
            self._collect()

    def _hand_over(self, data: bytes) -> None:
        """The same with bytes that take no time on the wire, and come alone."""
        device = self.device
        behind = device.now != self.now
        while data:
            count = (device.together(data) if len(data) > 1 else 1) or len(data)
            part, data = data[:count], data[count:]
            if behind:
                device.advance(max(device.now, self.now))
            device.feed(part)
            self._collect()
            behind = True  # a request may have set something off

    def _collect(self) -> None:
        """Takes the replies of the device and puts those that are due on the wire."""
        if self.device.replies:
            replies = self.device.take()
            for reply in sorted(replies, key=attrgetter("due")) if len(replies) > 1 else replies:
                self._transmit(reply)
        if self._out:
            self._dispatch(self.now)
        if self.device.dirty:
            self._persist()

    def _transmit(self, reply: Reply) -> None:
        """Applies the faults of the line to one reply."""
        hits, frame = reply.hits, self.device.twin(reply.data) if self.second else reply.data
        previous, self._previous = self._previous, frame
        if not hits:
            self._send(self._due(reply), frame, hits)
            return
        if "silent" in hits:
            return
        if "twin-id" in hits:
            frame = bytes(one & other for one, other in zip(frame, self.device.twin(frame), strict=True))
        if "wrong-id" in hits:
            frame = self.device.readdress(frame)
        if "bad-checksum" in hits:
            frame = self.device.spoil(frame)
        if "truncate" in hits:
            frame = frame[: self._random.between(1, len(frame) - 1)] if len(frame) > 1 else b""
        if "duplicate" in hits:
            frame += frame
        if "stale" in hits:
            frame = previous + frame
        if "noise" in hits:
            before = self._random.junk(self._random.between(1, 6), self.device.HEADER)
            frame = before + frame + self._random.junk(self._random.between(1, 6), self.device.HEADER)
        self._send(self._due(reply), frame, hits)

    def _send(self, due: float, data: bytes, hits: frozenset[str]) -> None:
        """Queues bytes as (gap before, seconds per byte, bytes) pieces."""
        step = self._step() if self._wire >= 0 else 0.0
        hang = "disconnect" in hits
        if hang:
            data = data[: len(data) // 2]
        pieces = [(0.0, step, data)]
        if "dribble" in hits:
            pieces = [(0.0, max(step, DRIBBLE), data)]
        elif "split" in hits:
            pieces = []
            while data:
                count = self._random.between(1, max(1, len(data) // 2))
                pieces.append((self._random.between(0, 8) / 1000.0 if pieces else 0.0, step, data[:count]))
                data = data[count:]
        self._out.append((due, pieces, hang, self.device.speed, self._client_baud))
        if len(self._out) > 1 and due < self._out[-2][0]:
            self._out.sort(key=lambda entry: entry[0])

    def _dispatch(self, now: float) -> None:
        baud = self._client_baud
        while self._out and self._out[0][0] <= now + 0.000000001:
            due, pieces, hang, speed, listener = self._out.pop(0)
            start = max(due, self._tx_free)
            for gap, step, sent in pieces:
                start += gap
                data = sent
                if speed is not None and baud is not None and listener != baud:
                    data = self._heard(sent, speed, baud)
                elif speed is not None and baud not in (None, speed):
                    heard = self.device.mishear(sent, speed, baud or 0)
                    data = sent if heard is None else heard
                self._tx.append(_Segment(start, step, data, sent, speed))
                start += step * len(data)
            self._tx_free = start
            if hang:
                self._tx.append(_Segment(start, 0.0, b"", hang=True))

    def _heard(self, data: bytes, speed: int, baud: int) -> bytes:
        """What a client makes of bytes that were sent at `speed` when it has just changed to `baud`."""
        return data if speed == baud else self.device.mishear(data, speed, baud) or b""

    def _drop(self) -> None:
        self._rx.clear()
        self._tx.clear()
        self._out.clear()
        self._rx_free = self._tx_free = 0.0
