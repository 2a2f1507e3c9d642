"""Scan one link for this maker's devices in all their protocols, and describe the result. Read-only.

On a serial line one question in EB90 finds them all (dossier 4.15), and who answers is told by a look; a wrist wanted alone is
asked with the flag that only it has. Modbus RTU is asked behind the first pass: at 115200 bit/s alone, unless it was typed.
On CAN each family has a flag of its own. Where a link carries Modbus TCP a hand is asked that, and nobody else.

`Probing` is the family's own scan, made quiet, for `handctl scan`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import groupby
from typing import NamedTuple

from handctl.devices.inspire import can_frames, eb90
from handctl.devices.inspire.can_bus import CanBus
from handctl.devices.inspire.duplicate_id import Row4, same_id
from handctl.devices.inspire.id_search import (
    CanSearch,
    Findings,
    Requester,
    RtuSearch,
    Scanner,
    ScanRequest,
)
from handctl.devices.inspire.identity import BYTE_HAND, EXO, NOT_SHOWN, SIX_HINT, WRIST, IdentityCheck, Kind
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.devices.inspire.modbus_frames import RTU_SPEED
from handctl.devices.inspire.register_bus import BETWEEN_PROTOCOLS, FEWER, RegisterBus, Span, at_speed, other_speed
from handctl.devices.inspire.register_device import RegisterDevice
from handctl.devices.inspire.serial_bus import SerialBus, frames_of_others, hint_for
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError, UsageError
from handctl.link import ByteLink, Deadline, FrameLink, Link
from handctl.model.device import OTHER_FORM
from handctl.model.param import ids_in
from handctl.model.prompts import Progress
from handctl.model.result import Journal, Row
from handctl.model.scan_task import NOT_ASKED, ScanTask, ended_at_first
from handctl.wording import plural

SCAN_BAUD_RATES = (115200, 57600, 19200)
"""exo §2.3.2; the wrist's manual has 115200 only, its hand's the others too."""
MOST_CAN_IDS = 4096
"""Ids in one CAN scan at the most; all 16383 would only be traffic for the others on the bus."""
WHO = tuple[Kind, "str | None", str]
"""Kind, model (None = open), and what shows it."""


class Target(NamedTuple):
    """What a scan looks for.

    own        the kind
    probe      the register that is read, named `value`
    twin       registers that jitter, for the test of two devices with one id
    speeds     bit/s at which it is looked for where no other maker's device is
    both_ways  its serial line carries both directions at once
    can        span that is read on CAN, None = not on CAN
    look       (bus) -> who answers, where its family tells more than the kind; it speaks Modbus too
    spoken     (link, --protocol) -> eb90, modbus, tcp, or auto: EB90, then Modbus RTU
    """

    own: Kind
    probe: Span
    twin: Span
    value: str
    silence_hint: str
    speeds: tuple[int, ...] = SCAN_BAUD_RATES
    both_ways: bool = False
    can: Span | None = None
    look: Callable[[RegisterBus], WHO] | None = None
    spoken: Callable[[str, str | None], str] = lambda _link, _typed: "eb90"

    @property
    def family(self) -> str:
        """Its command."""
        return self.own.family


def parse_ids(text: str, wire: str) -> list[int]:
    """``1-254`` or ``1,2,10-20`` -> ids in that order, on CAN up to 16383, at most 4096 of them. Raises UsageError."""
    ids = ids_in(text, can_frames.check_id if wire == "can" else eb90.check_id)
    if len(ids) > MOST_CAN_IDS:
        raise UsageError(
            f"--ids {text}: these are {plural(len(ids), 'id')}, but a scan asks 1 to {MOST_CAN_IDS}",
            hint="scan in parts, such as --ids 1-254",
        )
    return ids


# -- the search -------------------------------------------------------------------------------------------------------

FAST = 921600
"""bit/s: the second of the speeds of a hand (rh56 §2.5)."""
SLOWLY = 0.010
"""Seconds more for each id, where Modbus RTU is asked a second time."""


def sweep(link: Link, journal: Journal, bound: Deadline | None, task: ScanTask, targets: Sequence[Target]) -> None:
    """Look for `targets` on a link, into the quest. Raises LinkError."""
    Sweep(link, journal, bound, task, targets).run()


class Sweep:
    """One look for `targets`; `beside`: see `Scanner`; then a hand that carries a wrist is a wrist."""

    def __init__(
        self,
        link: Link,
        journal: Journal,
        bound: Deadline | None,
        task: ScanTask,
        targets: Sequence[Target],
        additional: float | None = None,
    ) -> None:
        self.additional = additional
        self.link, self.journal, self.bound, self.task, self.targets = link, journal, bound, task, targets
        self.ids = list(task.ids or eb90.IDS)
        self.families = [target.family for target in targets]
        self.names = " or ".join(self.families)
        # Of several one is asked for whose question the others answer as well, and who answers is looked at.
        self.lead = next((target for target in targets if target.own is not WRIST), targets[0])
        self.typed = len(targets) == 1 and additional is None
        self.own = self.lead.own if self.lead.own is WRIST or self.typed else EXO
        self.look = next((target.look for target in targets if target.look is not None), None)
        spoken = {target.spoken(link.name, task.own.get("protocol")) for target in targets}
        self.tcp, self.rtu, self.eb90 = "tcp" in spoken, bool(spoken & {"auto", "modbus"}), spoken != {"modbus"}
        self.started = link.now()
        self.asked_rtu: list[int | None] = []
        self.probes = 0
        self.left: list[str] = []
        self.unasked: set[tuple[int | None, int]] = set()
        self.collided: list[tuple[int | None, int]] = []
        self.asked: dict[int | None, set[int]] = {}
        self.speeds: Sequence[int | None] = ()

    def run(self) -> None:
        """All of it; the port has its speed again afterwards."""
        link = self.link
        if isinstance(link, FrameLink):
            self._on_can(link)
        elif isinstance(link, ByteLink):
            if self.tcp:
                self._over_tcp(link)
            else:
                self._on_line(link)
        self._judge_strangers()

    # -- rows ----------------------------------------------------------------------------------------------------

    def _row(self, who: WHO | None, baud: int | None, device_id: int, protocol: str, read: str, odd: str = "") -> None:
        kind, model, shown = who or (None, None, "")
        row: Row = {"family": kind.family if kind is not None else None, "link": self.link.name, "baud": baud}
        row |= {"id": device_id, "protocol": protocol, "model": model}
        self.task.rows.append({**row, "evidence": "; ".join(filter(None, (read, shown))), "suspicion": odd or None})

    def _judge_strangers(self) -> None:
        """Who is of none of the families that were asked for is told, and is no success."""
        task = self.task
        strange = [row for row in task.rows if row["family"] not in self.families]
        for row in strange:
            text = f"id {row['id']}{at_text(row['baud'])} is not of the family {self.names}: {row['evidence']}"
            self.journal.warn("other-device" if row["family"] else NOT_SHOWN, text)
        if strange and len(strange) == len(task.rows):
            known = strange[0]["family"] is not None
            task.failure = DeviceRefused(
                f"{self.link.name}: no {self.names}, but {strange[0]['evidence']}",
                hint=_command_for(strange[0]["family"])
                if known
                else "check the label: the device's replies do not show which device it is",
                code="other-device" if known else NOT_SHOWN,
            )
        if task.rows and not task.find_all and (what := self._behind_the_first()):
            ended_at_first(self.journal, task.left, self.link.name, what)

    def _behind_the_first(self) -> str:
        """What a scan that ended at a device did not try, in words; "" = it was the last question."""
        if not self.asked:
            behind = self.ids[self.ids.index(self.task.rows[-1]["id"]) + 1 :] if not self.tcp else []
            return span_text(behind) if behind else ""
        rest = {
            speed: [number for number in self.ids if number not in self.asked.get(speed, ())] for speed in self.speeds
        }
        return asked_text({speed: ids for speed, ids in rest.items() if ids})

    # -- serial --------------------------------------------------------------------------------------------------

    def _bus(self, link: ByteLink, target: Target) -> SerialBus:
        return SerialBus(link, self.ids[0], self.journal, retries=0, bound=self.bound, family=target.family)

    def _on_line(self, link: ByteLink) -> None:
        speeds: list[int | None] = [link.baud]
        if link.can_set_baud and self.task.baud is None:
            speeds = list(self.lead.speeds if len(self.targets) == 1 else SCAN_BAUD_RATES)
        self.speeds = speeds
        found = Findings()
        with at_speed(link, None):
            if self.eb90:
                found = self._in_eb90(link, self.lead, speeds)
            else:
                self._rtu_alone(link, speeds)
            if self.asked_rtu and self.eb90 and self._time_left(2 * len(self.ids) * SLOWLY):
                if link.can_set_baud and self.task.baud is None:
                    link.set_baud(RTU_SPEED)
                self._in_rtu(link, self.ids, SLOWLY)  # a delay that varies may have pushed questions together
            if WRIST.family in self.families and self.lead.own is not WRIST and self._time_left(1.0):
                (wrist,) = (target for target in self.targets if target.own is WRIST)
                self.probes += self._in_eb90(link, wrist, speeds).probes  # one whose hand is silent
        self._tell(link, found, speeds)

    def _time_left(self, seconds: float) -> bool:
        """Whether nobody was found, and a silent line may be asked for so long yet."""
        task, over = self.task, self.bound is not None and self.bound.expired
        if task.rows or self.collided or over or self.additional is not None:
            return False
        return task.silence is None or self._seconds + seconds < task.silence

    def _in_eb90(self, link: ByteLink, target: Target, speeds: Sequence[int | None]) -> Findings:
        """What a scan in EB90 for one target saw; who was found is in the rows."""
        task, lead = self.task, target is self.lead
        want = ScanRequest(
            find_all=task.find_all,
            probe=target.probe,
            twin=target.twin,
            own=self.own if lead else target.own,
            typed=self.typed,
            given_ids=bool(task.ids),
            thorough=task.silence is None,
            silence=None if task.silence is None else max(0.0, task.silence - self._seconds),
            between=self._between if self.rtu and lead else None,
            behind=(speeds[:2][-1] if FAST in speeds else speeds[0], None),
            patience=0.0 if self.additional is not None else task.patience or 0.0,
            both_ways=all(one.both_ways for one in self.targets),
            additional=self.additional,
        )
        scanner = Scanner(self._bus(link, target), Progress(task.progress), want)
        found = scanner.run(self.ids, speeds)
        self.left += [left_text(speed, number, self.ids[-1], target.family) for speed, number in scanner.left]
        self.collided += found.twins
        self.unasked |= scanner.unasked
        for speed, numbers in scanner.asked.items():
            self.asked.setdefault(speed, set()).update(numbers)
        for speed, device_id, value in found.hits:
            kind, shown = found.kinds.get((speed, device_id), (target.own, ""))
            read = _evidence(target.value, value)
            who: WHO | None = None
            if kind is not None:
                who = kind, None, f"{kind.words}: {shown}" if kind is not target.own else ""
                if self.look is not None and kind.family not in (EXO.family, WRIST.family):
                    with at_speed(link, speed if speed != link.baud else None):
                        who = self._looked(self._bus(link, target).at(device_id=device_id)) or who
            odd = "are there two devices with this id?" if (speed, device_id) in found.twins else ""
            self._row(who, speed, device_id, "eb90", read if kind is not None else shown, odd)
        return found

    def _looked(self, bus: RegisterBus) -> WHO | None:
        line = self.journal.line
        bus.timeout = max(bus.timeout, 1.5 * line.worst + 0.1)
        try:
            return self.look(bus) if self.look is not None else None
        except (NoAnswer, ProtocolError):
            return None

    # -- Modbus --------------------------------------------------------------------------------------------------

    def _between(self) -> bool:
        """Modbus RTU behind the likely speeds in EB90, where that may be asked unsaid. The port has its speed again then."""
        link = self.link
        assert isinstance(link, ByteLink)
        settable = link.can_set_baud and link.baud is not None
        if self.asked_rtu or (settable and self.task.baud is not None and link.baud != RTU_SPEED):
            return False
        with at_speed(link, RTU_SPEED):
            return self._in_rtu(link, self.ids)

    def _rtu_alone(self, link: ByteLink, speeds: Sequence[int | None]) -> None:
        rest = self.ids[1:]
        for ids in filter(None, (self.ids[:1], rest)):
            for speed in speeds:
                if speed is not None and link.can_set_baud:
                    link.set_baud(speed)
                if ids is rest and self.task.silence is not None and link.now() > self.started + self.task.silence:
                    self.left.append(left_text(speed, ids[0], self.ids[-1], self.lead.family))
                elif self._in_rtu(link, ids) and not self.task.find_all:
                    return

    def _in_rtu(self, link: ByteLink, ids: Sequence[int], more: float = 0.0) -> bool:
        """Whether a hand answers in Modbus RTU at this speed, or two with one id do."""
        self.asked_rtu.append(link.baud)
        search = RtuSearch(link, self.journal, self.bound, self.task.find_all, self.additional)
        at = at_text(link.baud)
        answered = search.run(ids, lambda number: self.task.progress(f"id {number} in Modbus RTU{at}"), more)
        self.probes += search.probes
        for device_id in answered:
            bus = ModbusBus(link, device_id, self.journal, tcp=False, bound=self.bound)
            bus.timeout = max(bus.timeout, 1.5 * search.trips[device_id] + 0.1)
            bus.pause(BETWEEN_PROTOCOLS)
            who = self._looked(bus)
            if who is not None:
                self._row(who, self._speed_that_matters(bus), device_id, "modbus-rtu", "")
        twins = [device_id for device_id, count in search.damaged.items() if device_id not in answered and count]
        self.collided += [(link.baud, device_id) for device_id in twins if self._alike(link, device_id)]
        return bool(self.task.rows or self.collided)

    def _alike(self, link: ByteLink, device_id: int) -> bool:
        """Whether the id's own register, alike in two devices with one id, is read whole although other answers are damaged."""
        bus = ModbusBus(link, device_id, self.journal, tcp=False, retries=0, bound=self.bound)
        try:
            return [bus.read(1000, 2) for _ in range(2)] != []
        except (NoAnswer, ProtocolError, DeviceRefused):
            return False

    def _speed_that_matters(self, bus: ModbusBus) -> int | None:
        """The speed of the port, None where the hand answers at another one as well: Bluetooth, or a network."""
        link, line = bus.link, self.journal.line
        if not link.can_set_baud or link.baud is None or link.replayed:
            return link.baud
        was = link.baud
        with at_speed(link, other_speed(was)):
            try:
                line.speed_matters = all(bus.pace(bus.timeout) is None for _ in range(2))
            except (ProtocolError, DeviceRefused):
                line.speed_matters = True
        return was if line.speed_matters else None

    def _over_tcp(self, link: ByteLink) -> None:
        bus = ModbusBus(link, 1, self.journal, tcp=True, retries=0, bound=self.bound, timeout=self.task.patience)
        for timeout in (bus.timeout, 2 * bus.timeout):
            bus.timeout = timeout
            try:
                bus.pace(timeout)
                if self.look is not None:
                    self._row(self.look(bus), None, bus.id, "modbus-tcp", "")
                    return
            except (NoAnswer, ProtocolError, DeviceRefused) as exc:
                self.task.failure = exc
                self.task.tried[None] = exc.code

    # -- CAN -----------------------------------------------------------------------------------------------------

    def _on_can(self, link: FrameLink) -> None:
        task = self.task
        known: list[int] = []
        failure: HandctlError | None = None
        for target in self.targets:
            if target.can is None:
                continue
            bus = CanBus(link, self.ids[0], self.journal, retries=0, bound=self.bound, family=target.family)
            search = CanSearch(bus, target.can, target.family)
            probed = target.value if target.can == target.probe else f"register {target.can[0]}"
            task.progress(f"ids {self.ids[0]} to {self.ids[-1]} of {target.family}")
            found = search.run([number for number in self.ids if number not in known], task.find_all, task.patience)
            known += found
            for number in found:
                here = bus.at(device_id=number)
                here.timeout = max(here.timeout, 1.5 * self.journal.line.worst + 0.1)
                who = self._looked(here) if target.look is not None else None
                data = search.values.get(number)
                read = _evidence(probed, None if data is None else int.from_bytes(data, "little", signed=True))
                self._row(who or (target.own, None, read), None, number, "can", "")
            asked = self.ids[: self.ids.index(found[-1]) + 1] if found and not task.find_all else self.ids
            summary = f"{search.probes} read-only probes of {probed}, {span_text(asked)}, {self._seconds:.2f} s"
            summary += ", ended by --deadline before all were asked" if search.cut else ""
            self.journal.info("scanned", summary)
            task.facts |= {"probes": search.probes, "error_frames": search.errors}
            failure = failure or search.nothing(summary)
            if task.rows and not task.find_all:
                break
        task.facts["seconds"] = round(self._seconds, 3)
        if not task.rows and failure is not None:
            task.failure = failure
            task.tried[None] = failure.code
            if not task.ids:
                task.left.append(f"ids above {eb90.IDS[-1]} of {can_frames.MAX_ID}: try --ids {eb90.IDS.stop}-4350")

    @property
    def _seconds(self) -> float:
        return self.link.now() - self.started

    # -- words ---------------------------------------------------------------------------------------------------

    def _tell(self, link: ByteLink, found: Findings, speeds: Sequence[int | None]) -> None:
        task, journal = self.task, self.journal
        task.left += self._left_out(link, speeds)
        probes = found.probes + self.probes
        ended = task.rows and not task.find_all and self.asked
        all_ids = {speed: [each for each in self.ids if (speed, each) not in self.unasked] for speed in speeds}
        tried = asked_text(self.asked if ended else all_ids)
        summary = f"{probes} probes, {self._seconds:.2f} s, tried: {tried}"
        if self.asked_rtu:
            summary += ", and in Modbus RTU" + at_text(self.asked_rtu[0])
        if found.single is not None:
            summary += (
                f", then again with {1000 * found.single:.0f} ms for each, as a delay that varies makes replies collide"
            )
        if found.cut:
            summary += ", ended by --deadline before all were asked"
        journal.info("scanned", summary)
        task.facts = {
            "probes": probes,
            "seconds": round(self._seconds, 3),
            "single_ms": None if found.single is None else round(found.single * 1000, 3),
            "echo": found.echo,
            "garbage_bytes": found.garbage,
        }
        if self.unasked and (task.find_all or not task.rows):
            numbers = ",".join(map(str, sorted({number for _, number in self.unasked})))
            at = " and ".join(
                str(speed) for speed in dict.fromkeys(speed for speed, _ in sorted(self.unasked, key=str)) if speed
            )
            journal.info(
                NOT_ASKED,
                f"ids {numbers} were not tried{f' at {at} bit/s' if at else ''}: a BarrettHand takes the byte 3 for ^C, which ends its movement, and 13 for CR",
                f"if no BarrettHand is on this line, add --ids {numbers}",
            )
        for speed, device_id in found.unconfirmed:
            journal.warn(
                "unconfirmed", f"id {device_id}{at_text(speed)} replied once and not again, so it is not counted"
            )
        for speed, device_id in sorted({*self.collided}, key=str):
            journal.warn(
                "twin-id",
                f"id {device_id}{at_text(speed)}: two devices with the same id reply. Readings that they share arrive intact, the others are corrupted",
                hint=ONE_ID,
            )
        task.twins = sorted({number for _, number in self.collided})
        if not task.rows:
            task.failure = (
                self._other_form(link, found, speeds)
                or nothing(self.link.name, self.names, self.lead.family, found, task.twins, summary)
                or self._silence(found.cut, summary)
            )
        for speed in speeds if task.baud is None else [None]:
            task.tried[speed] = task.failure.code if task.failure is not None else "found"

    def _other_form(self, link: ByteLink, found: Findings, speeds: Sequence[int | None]) -> ProtocolError | None:
        """The error of a device whose replies are evident, and have another form than the manual's; None where there is none."""
        header = found.came[:2] in (eb90.DEVICE, eb90.HOST) and len(found.came) > 2
        if not (found.damaged or header) or found.cut or self.collided or link.replayed:
            return None
        number = next(iter(found.damaged), found.came[2] if header else 0)
        number = number if number in self.ids else self.ids[0]
        bus = SerialBus(link, number, self.journal, retries=0, bound=self.bound, family=self.lead.family)
        try:
            with at_speed(link, speeds[0]):
                bus.read(*bus.first_questions[0])
        except ProtocolError as exc:
            return exc if exc.code in (OTHER_FORM, FEWER) else None
        except (NoAnswer, DeviceRefused):
            pass
        return None

    def _left_out(self, link: ByteLink, speeds: Sequence[int | None]) -> list[str]:
        """What was not asked, and how to ask it: a BarrettHand could take its bytes for a command, or for firmware."""
        left = list(self.left)
        if self.task.silence is not None:
            left.append(
                "all ids a second time, with more room for each reply, as a half-duplex line needs whose delay varies: --all does that"
            )
        if self.task.rows or self.collided or not link.can_set_baud or link.replayed or self.look is None:
            return left
        others = ", ".join(str(speed) for speed in self._hands_speeds if speed != RTU_SPEED)
        if self.eb90 and self.rtu and others:
            text = f"Modbus RTU at {others} bit/s: if no BarrettHand is on this line, `handctl hand scan --protocol modbus` tries it"
            left.append(text)
        unasked = [speed for speed in self._hands_speeds if speed not in speeds and self.task.baud is None]
        left += [f"{speed} bit/s: `handctl hand scan` tries it" for speed in unasked]
        return left

    @property
    def _hands_speeds(self) -> tuple[int, ...]:
        return next((target.speeds for target in self.targets if target.look is not None), ())

    def _silence(self, cut: bool, summary: str) -> NoAnswer:
        name, what = self.link.name, self.names
        if cut:
            return NoAnswer(f"{name}: no {what} so far ({summary})", hint="use a longer --deadline", code="deadline")
        return NoAnswer(f"{name}: no {what}, complete silence ({summary})", hint=self.lead.silence_hint)


# -- words ------------------------------------------------------------------------------------------------------------

ONE_ID = "leave one device on the line, change its id with `id`, then connect the other one"
BAD_HINT = "leave one device on the line and check the cable and the ground: two devices have the same id, or the line is disturbed"


def ids_text(ids: Sequence[int]) -> str:
    return f"id {', '.join(map(str, ids))}"


def span_text(ids: Sequence[int]) -> str:
    """``ids 1 to 2, 4 to 254``; each in the order of its number."""
    spans = [[each for _, each in run] for _, run in groupby(enumerate(ids), lambda pair: pair[1] - pair[0])]
    words = ", ".join(f"{span[0]} to {span[-1]}" if len(span) > 1 else str(span[0]) for span in spans)
    return f"{'id' if len(ids) == 1 else 'ids'} {words}"


def asked_text(asked: Mapping[int | None, Collection[int]]) -> str:
    """Speed -> ids, in words, speeds with the same ids together: ``ids 1 to 254 at 115200, 57600``."""
    groups: dict[str, list[str]] = {}
    for speed, ids in asked.items():
        groups.setdefault(span_text(sorted(ids)), []).append(str(speed) if speed else "the link's speed")
    return "; ".join(f"{ids} at {', '.join(speeds)}" for ids, speeds in groups.items())


def _command_for(family: str) -> str:
    """The next step where a scan for another family found one of this."""
    return SIX_HINT if family == BYTE_HAND.family else f"use `handctl {family}`, the command for it"


def left_text(speed: int | None, first: int, last: int, family: str) -> str:
    return f"ids {first} to {last} of {family}{at_text(speed)}: --all tries these"


def _evidence(probed: str, value: int | None) -> str:
    """What shows that a device is there: the value of the register that was probed, None = it does not reply to that."""
    if value is None:
        return f"replies to other reads, asked twice, but not to that of {probed}"
    return f"{probed} reads {value}, asked twice"


def at_text(speed: int | None) -> str:
    return f" at {speed}" if speed else ""


def nothing(
    name: str, what: str, family: str, found: Findings, twins: Sequence[int], summary: str
) -> ProtocolError | None:
    """The error for data received without a device, None for silence. `twins`: ids that two devices have."""
    twice = [device_id for device_id, count in found.damaged.items() if count >= 2]
    code, text, hint = "", "", ""
    if twins:
        code, hint = "twin-id", ONE_ID
        text = f"two devices have {ids_text(twins)}: their replies corrupt each other"
    elif twice:
        code, hint = "bad-checksum", BAD_HINT
        text = f"{ids_text(twice)} replied, but each time with a wrong checksum"
    elif found.headless:
        code = "first-byte-lost"
        text = f"{ids_text(sorted(found.headless))} replied, but the first byte of each reply is missing"
    elif found.foreign:
        code = "wrong-id"
        text = f"{ids_text([device_id for _, device_id in found.unconfirmed])} replied, but to a request for another id"
    elif found.echo:
        code, text = "echo", f"no {what}, only our own bytes came back"
    elif found.garbage:
        code, text = "garbage", f"no {what}, but received {plural(found.garbage, 'byte')}, not a valid frame"
    if not code:
        return None
    came = found.came if code == "garbage" and eb90.sign(found.came) else b""
    return ProtocolError(f"{name}: {text} ({summary})", hint=hint or hint_for(code, family), code=code, came=came)


# -- what the module probe of a family offers -------------------------------------------------------------------------

BURST = 8
"""Questions back to back, of which the first is answered while the last are sent."""
ASIDE = 0.02
"""Seconds for a burst to be sent beyond its time on the wire."""


WAIT = 0.12
"""Seconds for the answer of one id, with room for Bluetooth."""


class Probing:
    """What the module `probe` of a family offers, see `tools.family_probe`. Nothing in it writes.

    target  what a scan looks for
    live    what is measured again and again: a constant would be the same of two devices with one id
    long    one long answer of documented registers
    """

    def __init__(self, target: Target, live: Span, long: Span) -> None:
        self.target, self.live, self.long = target, live, long

    def probe(
        self, link: Link, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,), timeout: float | None = None
    ) -> list[Row]:
        """Rows of whoever answers to `ids` at the link's present speed. Raises NoAnswer, ProtocolError for what came instead."""
        task = ScanTask(ids=ids, baud=getattr(link, "baud", None) or 0, patience=timeout, progress=journal.progress)
        Sweep(link, journal, deadline, task, [self.target], additional=timeout or WAIT).run()
        if task.failure is not None and not task.rows:
            if task.failure.code == "deadline":
                raise NoAnswer(task.failure.text, hint=task.failure.hint)  # it is the search's, which says so itself
            raise task.failure
        return task.rows

    def ping(self, device: RegisterDevice) -> None:
        """One short read, asked once. Raises what the bus raises."""
        device.answered(lambda: device.bus.read(*self.live, retries=0))

    def identify(self, device: RegisterDevice) -> tuple[str, str, str]:
        """Status, evidence and remedy of an identity check. Raises as the check does."""
        own, look = self.target.own, IdentityCheck(device.bus)
        kind = look.who(own)
        if kind is own:
            return "ok", f"nothing contradicts {own.words}: {look.evidence}", ""
        command = f"use `{kind.command}`, the command for it"
        return "fail", f"this is {kind.words}, not {own.words}: {look.evidence}", command

    def further(self, device: RegisterDevice, answered: bool) -> Iterator[Row4]:
        """Whether only one device has this id, which only repeated reading shows."""
        if answered or device.bus.journal.counters.bad_frames:
            yield same_id(device)

    def measure(self, device: RegisterDevice, unasked: bytes) -> None:
        """Fill the profile of the line with what reading shows; `unasked` is what came before anything was sent.

        A `long` answer is read for its packets. Whatever fails is left open: the series of reads tells that.
        """
        bus = device.bus
        if not isinstance(bus, SerialBus):
            return
        line = bus.journal.line
        if frames_of_others(unasked, b"", lambda _frame: False):
            line.others = True
        if not len(line.trips):
            return
        with suppress(NoAnswer, ProtocolError):
            for _ in range(2):
                bus.read(*self.long, retries=0)
        asker = Requester(bus, ASIDE, self.target.probe)
        line.half_duplex = not any(asker.overlaps(bus.id, BURST, short=short) for short in (False, True))
        line.others = bool(line.others)
        bus.drain()

    def overheard(self, data: bytes) -> list[int]:
        """The ids of frames in `data` that others asked or answered, of the wrist's flags or of all others."""
        own = (eb90.WRIST_READ, eb90.WRIST_WRITE)
        frames = frames_of_others(data, b"", lambda _frame: False)
        return sorted({frame.id for frame in frames if (frame.flag in own) is (self.target.own is WRIST)})


def ignores_speed(device: RegisterDevice) -> bool:
    """Whether a device that has answered does so at another speed of the port as well. Leaves the port as it was."""
    bus = device.bus
    if not isinstance(bus, SerialBus) or not bus.link.can_set_baud or bus.link.baud is None:
        return False
    line, wait = bus.journal.line, max(0.05, 2 * (bus.round_trip or 0.0) + 0.03)
    try:
        with at_speed(bus.link, other_speed(bus.link.baud)):
            line.speed_matters = all(bus.pace(wait) is None for _ in range(2))
    finally:
        bus.pace(wait)  # what the other speed left half read is passed over
    return not line.speed_matters
