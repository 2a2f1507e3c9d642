"""The scan for this maker's devices on one link, in every protocol they speak, and what came of it in words. Read-only.

On a serial line one question in EB90 finds them all (dossier 4.15), and who answers is told by a look; a wrist wanted alone is
asked with the flag that only it has. Modbus RTU is asked behind the first pass: at 115200 bit/s alone, unless it was typed.
On CAN each family has a flag of its own. Where a link carries Modbus TCP a hand is asked that, and nobody else.
"""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire import canreg
from handctl.devices.inspire.asker import Findings
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.canbus import CanBus
from handctl.devices.inspire.cansearch import CanSearch
from handctl.devices.inspire.identity import EXO, SIX_HINT, WRIST
from handctl.devices.inspire.modbus import RTU_SPEED
from handctl.devices.inspire.modbusbus import BETWEEN_PROTOCOLS, ModbusBus
from handctl.devices.inspire.registers import RegisterBus
from handctl.devices.inspire.rtusearch import RtuSearch
from handctl.devices.inspire.scanner import Scanner
from handctl.devices.inspire.scanwords import ONE_ID, at_text, left_text, nothing, span_text
from handctl.devices.inspire.target import SPEEDS, WHO, Target
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError
from handctl.link import ByteLink, Deadline, FrameLink, Link
from handctl.model.guide import Progress
from handctl.model.quest import Quest
from handctl.model.result import Journal, Row

USUAL = range(1, 255)
FAST = 921600
"""bit/s: the second of the speeds of a hand (rh56 §2.5)."""
SLOWLY = 0.010
"""Seconds more for each id, where Modbus RTU is asked a second time."""


def sweep(link: Link, journal: Journal, bound: Deadline | None, quest: Quest, targets: Sequence[Target]) -> None:
    """Look for `targets` on a link, into the quest. Raises LinkError."""
    Sweep(link, journal, bound, quest, targets).run()


class Sweep:
    """One look for `targets`; `beside`: see `Scanner`; then a hand that carries a wrist is a wrist."""

    def __init__(
        self,
        link: Link,
        journal: Journal,
        bound: Deadline | None,
        quest: Quest,
        targets: Sequence[Target],
        beside: float | None = None,
    ) -> None:
        self.beside = beside
        self.link, self.journal, self.bound, self.quest, self.targets = link, journal, bound, quest, targets
        self.ids = list(quest.ids or USUAL)
        self.families = [target.family for target in targets]
        self.names = " or ".join(self.families)
        # Of several one is asked for whose question the others answer as well, and who answers is looked at.
        self.lead = next((target for target in targets if target.own is not WRIST), targets[0])
        self.own = self.lead.own if self.lead.own is WRIST or (len(targets) == 1 and beside is None) else EXO
        self.look = next((target.look for target in targets if target.look is not None), None)
        spoken = {target.spoken(link.name, quest.own.get("protocol")) for target in targets}
        self.tcp, self.rtu, self.eb90 = "tcp" in spoken, bool(spoken & {"auto", "modbus"}), spoken != {"modbus"}
        self.started = link.now()
        self.asked_rtu: list[int | None] = []
        self.probes = 0
        self.left: list[str] = []
        self.collided: list[tuple[int | None, int]] = []

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
        self.quest.rows.append({**row, "evidence": "; ".join(filter(None, (read, shown))), "suspicion": odd or None})

    def _judge_strangers(self) -> None:
        """Who is of none of the families that were asked for is told, and is no success."""
        quest = self.quest
        strange = [row for row in quest.rows if row["family"] not in self.families]
        for row in strange:
            text = f"id {row['id']}{at_text(row['baud'])} is not of the family {self.names}: {row['evidence']}"
            self.journal.warn("other-device", text)
        if strange and len(strange) == len(quest.rows):
            quest.failure = DeviceRefused(
                f"{self.link.name}: no {self.names}, but {strange[0]['evidence']}", hint=SIX_HINT, code="other-device"
            )
        elif quest.rows and not quest.find_all:
            self.journal.info("first", "the scan ended at the first device", hint="add --all to look for more")

    # -- serial --------------------------------------------------------------------------------------------------

    def _bus(self, link: ByteLink, target: Target) -> Bus:
        bus = Bus(link, self.ids[0], self.journal, retries=0, bound=self.bound, family=target.family)
        return bus.at("wrist") if target.own is WRIST else bus

    def _on_line(self, link: ByteLink) -> None:
        speeds: list[int | None] = [link.baud]
        if link.can_set_baud and self.quest.baud is None:
            speeds = list(self.lead.speeds if len(self.targets) == 1 else SPEEDS)
        was, found = link.baud, Findings()
        try:
            if self.eb90:
                found = self._in_eb90(link, self.lead, speeds)
            else:
                self._rtu_alone(link, speeds)
            if self.asked_rtu and self.eb90 and self._time_left(2 * len(self.ids) * SLOWLY):
                if link.can_set_baud and self.quest.baud is None:
                    link.set_baud(RTU_SPEED)
                self._in_rtu(link, self.ids, SLOWLY)  # a delay that varies may have pushed questions together
            if WRIST.family in self.families and self.lead.own is not WRIST and self._time_left(1.0):
                (wrist,) = (target for target in self.targets if target.own is WRIST)
                self.probes += self._in_eb90(link, wrist, speeds).probes  # one whose hand is silent
        finally:
            if was is not None and link.can_set_baud and link.baud != was:
                link.set_baud(was)
        self._tell(link, found, speeds)

    def _time_left(self, seconds: float) -> bool:
        """Whether nobody was found, and a silent line may be asked for so long yet."""
        quest, over = self.quest, self.bound is not None and self.bound.expired
        if quest.rows or self.collided or over or self.beside is not None:
            return False
        return quest.silence is None or self._seconds + seconds < quest.silence

    def _in_eb90(self, link: ByteLink, target: Target, speeds: Sequence[int | None]) -> Findings:
        """What a scan in EB90 for one target saw; who was found is in the rows."""
        quest, lead = self.quest, target is self.lead
        scanner = Scanner(
            self._bus(link, target),
            Progress(quest.progress),
            find_all=quest.find_all,
            probe=target.probe,
            twin=target.twin,
            own=self.own if lead else target.own,
            thorough=quest.silence is None,
            silence=None if quest.silence is None else max(0.0, quest.silence - self._seconds),
            between=self._between if self.rtu and lead else None,
            behind=(speeds[:2][-1] if FAST in speeds else speeds[0], None),
            patience=0.0 if self.beside is not None else quest.patience or 0.0,
            both_ways=all(one.both_ways for one in self.targets),
            beside=self.beside,
        )
        found = scanner.run(self.ids, speeds)
        self.left += [left_text(speed, number, self.ids[-1], target.family) for speed, number in scanner.left]
        self.collided += found.twins
        for speed, device_id, value in found.hits:
            kind, shown = found.kinds.get((speed, device_id), (target.own, ""))
            read = f"{target.value} reads {value}, asked twice"
            who: WHO | None = None
            if kind is not None:
                who = kind, None, f"{kind.words}: {shown}" if kind is not target.own else ""
                if self.look is not None and kind.family not in (EXO.family, WRIST.family):
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
        was, settable = link.baud, link.can_set_baud and link.baud is not None
        if self.asked_rtu or (settable and self.quest.baud is not None and was != RTU_SPEED):
            return False
        if settable:
            link.set_baud(RTU_SPEED)
        try:
            return self._in_rtu(link, self.ids)
        finally:
            if settable and was is not None:
                link.set_baud(was)

    def _rtu_alone(self, link: ByteLink, speeds: Sequence[int | None]) -> None:
        rest = self.ids[1:]
        for ids in filter(None, (self.ids[:1], rest)):
            for speed in speeds:
                if speed is not None and link.can_set_baud:
                    link.set_baud(speed)
                if ids is rest and self.quest.silence is not None and link.now() > self.started + self.quest.silence:
                    self.left.append(left_text(speed, ids[0], self.ids[-1], self.lead.family))
                elif self._in_rtu(link, ids) and not self.quest.find_all:
                    return

    def _in_rtu(self, link: ByteLink, ids: Sequence[int], more: float = 0.0) -> bool:
        """Whether a hand answers in Modbus RTU at this speed, or two with one id do."""
        self.asked_rtu.append(link.baud)
        search = RtuSearch(link, self.journal, self.bound, self.quest.find_all, self.beside)
        at = at_text(link.baud)
        answered = search.run(ids, lambda number: self.quest.progress(f"id {number} in Modbus RTU{at}"), more)
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
        return bool(self.quest.rows or self.collided)

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
        link.set_baud(57600 if was == 115200 else 115200)
        try:
            line.speed_matters = all(bus.pace(bus.timeout) is None for _ in range(2))
        except (ProtocolError, DeviceRefused):
            line.speed_matters = True
        finally:
            link.set_baud(was)
        return was if line.speed_matters else None

    def _over_tcp(self, link: ByteLink) -> None:
        bus = ModbusBus(link, 1, self.journal, tcp=True, retries=0, bound=self.bound, timeout=self.quest.patience)
        for timeout in (bus.timeout, 2 * bus.timeout):
            bus.timeout = timeout
            try:
                bus.pace(timeout)
                if self.look is not None:
                    self._row(self.look(bus), None, bus.id, "modbus-tcp", "")
                    return
            except (NoAnswer, ProtocolError, DeviceRefused) as exc:
                self.quest.failure = exc
                self.quest.tried[None] = exc.code

    # -- CAN -----------------------------------------------------------------------------------------------------

    def _on_can(self, link: FrameLink) -> None:
        quest = self.quest
        known: list[int] = []
        failure: HandctlError | None = None
        for target in self.targets:
            if target.can is None:
                continue
            flag, span = target.can
            bus = CanBus(link, self.ids[0], self.journal, retries=0, bound=self.bound, read_flag=flag)
            search = CanSearch(bus, span, target.family)
            quest.progress(f"ids {self.ids[0]} to {self.ids[-1]} of {target.family}")
            found = search.run([number for number in self.ids if number not in known], quest.find_all, quest.patience)
            known += found
            for number in found:
                here = bus.at(device_id=number)
                here.timeout = max(here.timeout, 1.5 * self.journal.line.worst + 0.1)
                who = self._looked(here) if target.look is not None else None
                read = int.from_bytes(search.values[number], "little", signed=True)
                who = who or (
                    target.own,
                    None,
                    "" if target.look is not None else f"{target.value} reads {read}, asked twice",
                )
                self._row(who, None, number, "can", "")
            summary = (
                f"{search.probes} read-only probes of {target.value}, {span_text(self.ids)}, {self._seconds:.2f} s"
            )
            summary += ", ended by --deadline before all were asked" if search.cut else ""
            self.journal.info("scanned", summary)
            quest.facts |= {"probes": search.probes, "error_frames": search.errors}
            failure = failure or search.nothing(summary)
            if quest.rows and not quest.find_all:
                break
        quest.facts["seconds"] = round(self._seconds, 3)
        if not quest.rows and failure is not None:
            quest.failure = failure
            quest.tried[None] = failure.code
            if not quest.ids:
                quest.left.append(f"ids above {USUAL[-1]} of {canreg.MAX_ID}: --ids {USUAL.stop}-4350 goes on")

    @property
    def _seconds(self) -> float:
        return self.link.now() - self.started

    # -- words ---------------------------------------------------------------------------------------------------

    def _tell(self, link: ByteLink, found: Findings, speeds: Sequence[int | None]) -> None:
        quest, journal = self.quest, self.journal
        quest.left += self._left_out(link, speeds)
        at = ", ".join(str(speed) if speed else "the link's speed" for speed in speeds)
        probes = found.probes + self.probes
        summary = f"{probes} probes, {self._seconds:.2f} s, asked for: {span_text(self.ids)} at {at}"
        if self.asked_rtu:
            summary += ", and in Modbus RTU" + at_text(self.asked_rtu[0])
        if found.single is not None:
            summary += (
                f", then again with {1000 * found.single:.0f} ms for each, as a delay that varies makes answers collide"
            )
        if found.cut:
            summary += ", ended by --deadline before all were asked"
        journal.info("scanned", summary)
        quest.facts = {
            "probes": probes,
            "seconds": round(self._seconds, 3),
            "single_ms": None if found.single is None else round(found.single * 1000, 3),
            "echo": found.echo,
            "garbage_bytes": found.garbage,
        }
        for speed, device_id in found.unconfirmed:
            journal.warn(
                "unconfirmed", f"id {device_id}{at_text(speed)} answered once and not again, so it is not counted"
            )
        for speed, device_id in sorted({*self.collided}, key=str):
            journal.warn(
                "twin-id",
                f"id {device_id}{at_text(speed)}: two devices with the same id answer. Readings that they share arrive intact, the others are damaged",
                hint=ONE_ID,
            )
        quest.twins = sorted({number for _, number in self.collided})
        if not quest.rows:
            quest.failure = nothing(
                self.link.name, self.names, self.lead.family, found, quest.twins, summary
            ) or self._silence(found.cut, summary)
        for speed in speeds if quest.baud is None else [None]:
            quest.tried[speed] = quest.failure.code if quest.failure is not None else "found"

    def _left_out(self, link: ByteLink, speeds: Sequence[int | None]) -> list[str]:
        """What was not asked, and how to ask it: a BarrettHand could take its bytes for a command, or for firmware."""
        left = list(self.left)
        if self.quest.silence is not None:
            left.append(
                "all ids a second time, with more room for each answer, as a half-duplex line needs whose delay varies: --all asks so"
            )
        if self.quest.rows or self.collided or not link.can_set_baud or link.replayed or self.look is None:
            return left
        others = ", ".join(str(speed) for speed in self._hands_speeds if speed != RTU_SPEED)
        if self.eb90 and self.rtu and others:
            text = f"Modbus RTU at {others} bit/s: if no BarrettHand is on this line, `handctl hand scan --protocol modbus` asks there"
            left.append(text)
        unasked = [speed for speed in self._hands_speeds if speed not in speeds and self.quest.baud is None]
        left += [f"{speed} bit/s: `handctl hand scan` asks there" for speed in unasked]
        return left

    @property
    def _hands_speeds(self) -> tuple[int, ...]:
        return next((target.speeds for target in self.targets if target.look is not None), ())

    def _silence(self, cut: bool, summary: str) -> NoAnswer:
        name, what = self.link.name, self.names
        if cut:
            return NoAnswer(f"{name}: no {what} so far ({summary})", hint="use a longer --deadline", code="deadline")
        return NoAnswer(f"{name}: no {what}, complete silence ({summary})", hint=self.lead.silence_hint)
