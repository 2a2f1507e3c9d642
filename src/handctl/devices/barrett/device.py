"""The BarrettHand in supervisory mode: reading and writing its parameters, its status. See `model.device`.

GCL has no checksum: an answer is believed when its echo, its number of lines and its number of values fit.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import product
from types import MappingProxyType

from handctl.devices.barrett.gcl.codec import (
    CR,
    DISTURBED,
    KINDS,
    Answer,
    batches,
    encode,
    kind_of,
    motor_prefix,
    motors_of,
    split,
    values,
)
from handctl.devices.barrett.gcl.line import GclLine, Restarted
from handctl.devices.barrett.gcl.status_codes import (
    UNKNOWN_COMMAND,
    UNKNOWN_NAME,
    explain_status,
    hint_for,
    shows_heat,
)
from handctl.devices.barrett.parameter_map import (
    BARRETT,
    POSITIONS,
    TRAVEL,
    GclParam,
    check_careful,
    gcl_name,
    with_sign,
)
from handctl.devices.barrett.status_and_parameter_views import (
    GCL,
    LABEL,
    MOTOR,
    NAME,
    NO_GAUGE,
    UNIT,
    VALUE,
    audit,
    heat_hint,
    later_names,
    later_settings,
    mark_not_homed,
    meaning,
    parameters_view,
    status_view,
    unhealthy,
    why_doubtful,
)
from handctl.errors import Aftermath, DeviceRefused, HandctlError, Hint, NoAnswer, NotPresent, ProtocolError, UsageError
from handctl.model.device import Device
from handctl.model.param import Element, Number, Reading, Step
from handctl.model.result import Finding, Row, Table
from handctl.model.stop_sequence import Stopped

UNKNOWN = "Its effect on the hand is unknown"
SPLITTABLE = UNKNOWN_COMMAND | UNKNOWN_NAME | 1024
"""Statuses that a long line may cause: it is asked again in halves (dossier 1.4)."""


Changes = Sequence[tuple[Element, Number]]


def step_of(text: str) -> Step:
    """A GCL line as a step of a plan."""
    kind = KINDS[kind_of(text)]
    return Step(text, encode(text), moves=kind.moves, strands=bool(kind.question))


def check_line(text: str, *, force: bool = False) -> list[str]:
    """The objections to a line as it is typed, with `force`.

    Raises UsageError for what would lose the line, and without `force` for values that `set` refuses without it too.
    """
    if (refused := KINDS[kind_of(text)].refused) is not None:
        raise UsageError(refused[0], hint=refused[1])
    prefix, command, words = split(text)
    if command is None or command.name not in ("FSET", "PSET"):
        return []
    motors = motors_of(motor_prefix(prefix) if prefix else "")
    changes: list[tuple[Element, Number]] = []
    for name, value in zip(words[::2], words[1::2], strict=False):
        try:
            param, elements = BARRETT.find(name)
        except UsageError:
            continue
        if value.isdecimal():
            if not force:
                param.check(int(value), f"{text}: {param.mnemonic}")
            changes += [(each, int(value)) for each in elements if param.is_global or each.part in motors]
        elif not force:
            raise UsageError(
                f"{text}: handctl cannot check the value {value} of {param.mnemonic}",
                hint="write it as a whole number. Nothing was sent.",
                code="careful",
            )
    return list(dict.fromkeys(check_careful(changes, force)))


def _check_typed(text: str, check: Callable[[str], object] = check_line) -> None:
    """`check` for the terminal, which has no --force."""
    try:
        check(text)
    except UsageError as exc:
        if exc.code in ("careful", "opening-speed", "targets"):
            exc.hint = Hint("{} sends it anyway. Nothing was sent.", f'barrett gcl --force "{text}"')
        raise


class BarrettHand(Device):
    """One hand on a line."""

    kind = "barrett"
    product = "BH8"
    map = BARRETT
    live = ("position", "strain", "status", "temperature")
    vital = ("status",)
    scales: Mapping[str, tuple[float, float]] = MappingProxyType({"position": (0.0, float(TRAVEL[0]))})
    columns = (NAME, GCL, MOTOR, VALUE, UNIT, LABEL)
    view = staticmethod(parameters_view)
    not_covered = (
        "the EEPROM: restored values stay in RAM until `--save` or `handctl barrett save` saves them",
        "read-only values (odometer, temperatures, serial number)",
    )
    line_end = CR

    def __init__(self, line: GclLine) -> None:
        super().__init__(line)
        self.line = line
        self.count_save: Callable[[], None] = lambda: None
        """Counts a save that is sent as it was typed; who opens the hand has the journal."""
        self.refuse_harm: Callable[[str], None] = lambda line: None
        """Raises UsageError for a typed opening that may harm; who opens the hand has the movements."""
        self._told_sign = False

    def abort(self) -> Stopped:
        """^C, which leaves the motors to their HOLD. Never raises."""
        from handctl.devices.barrett.stopper import CTRL_C_KEEPS_POWER

        return self.stop(powered=CTRL_C_KEEPS_POWER)

    def plan_typed(self, data: bytes, can_id: int | None) -> tuple[Step, str]:
        """As `gcl` does. ^C alone ends a movement, and is not asked for."""
        *lines, rest = data.split(CR)
        if not data.strip(b"\0\3"):
            return Step("^C: abort", data), ""
        for line in lines:
            _check_typed(line.decode("ascii", "replace"))
        if rest or not all(32 <= byte < 127 for line in lines for byte in line):
            return Step("this is not a complete GCL line", data, moves=True, strands=True), UNKNOWN
        steps = [step_of(line.decode()) for line in lines]
        questions = dict.fromkeys(KINDS[kind_of(step.meaning)].question for step in steps if step.strands)
        meaning = " | ".join(step.meaning or "an empty line" for step in steps)
        moves, strands = any(step.moves for step in steps), bool(questions)
        return Step(meaning, data, moves=moves, strands=strands), ". ".join(questions)

    def admit(self, data: bytes, can_id: int | None) -> None:
        """Find the hand, and refuse openings that may harm it; a save is counted even if its reply does not come. Raises UsageError."""
        self.line.connect()
        lines = [line.decode("ascii", "replace") for line in data.split(CR)]
        for line in lines:
            _check_typed(line, self.refuse_harm)
        if any(kind_of(line) == "save" for line in lines):
            self.count_save()

    def identity(self) -> dict[str, object]:
        """Serial number (0 on hands upgraded in the field) and firmware as the hand says it."""
        (serial,) = self.read(BARRETT.elements("SN"))
        self.about |= {"serial": str(serial.value)} if serial.value else {}
        return {"kind": self.kind, "serial_number": serial.value, "firmware": self.version()}

    def version(self) -> str:
        """The firmware's own text (its format is not documented)."""
        self.about["firmware"] = " ".join(self.checked(self.line.read("VERS", _has_text)).lines)
        return self.about["firmware"]

    def further(self, identity: dict[str, object]) -> list[str]:
        """Settings of later firmware that this hand has, by what it says of itself."""
        return later_settings(str(identity.get("firmware")), self.journal)

    def checked(self, answer: Answer) -> Answer:
        """The same answer, or DeviceRefused with the manual's wording of its status."""
        if answer.status:
            raise self.refusal(answer)
        return answer

    def do(self, command: str) -> None:
        """Send a command that answers with its prompt alone. Raises what speaks against it."""
        error = self.objection(self.line.ask(command))
        if error is not None:
            raise self.name_heat(error)

    def objection(self, answer: Answer) -> HandctlError | None:
        """What speaks against such a command: a status, or a line, which may be a spoiled ERR."""
        if answer.status:
            return self.refusal(answer)
        if answer.lines:
            came = answer.raw[-48:].hex(" ").upper()
            return ProtocolError(
                f"{self.link.name}: {answer.command}: expected a prompt or ERR, got {answer.lines[0]!r} ({came})",
                hint=Hint(
                    "run {}, then check the cable: it is not known whether the command took effect", "barrett status"
                ),
                code="bad-line",
            )
        return None

    def refusal(self, answer: Answer) -> DeviceRefused:
        """The error of an answer with a status: link, command, sum and the manual's wording."""
        made = NotPresent if answer.status == UNKNOWN_NAME else DeviceRefused
        return made(
            f"{self.link.name}: {answer.command}: ERR {answer.status}: {explain_status(answer.status)}",
            hint=hint_for(answer.status),
            code=f"err-{answer.status}",
        )

    def name_heat(self, error: HandctlError) -> HandctlError:
        """The same error; of an over-temperature the hint says whether it is the heat or the setting.

        Only at the prompt: it asks TEMP and OTEMP, which answer also when every motor command fails.
        """
        if not shows_heat(error):
            return error
        try:
            now, limit = self.read(BARRETT.elements("TEMP", "OTEMP"))
        except HandctlError:
            return error
        if now.value is not None and limit.value is not None:
            error.hint = heat_hint(int(now.value), int(limit.value))
        return error

    # -- reading -------------------------------------------------------------------------------------------------

    def read(self, elements: Sequence[Element]) -> list[Reading]:
        """Read elements in as few lines as fit; all motors that are wanted share a prefix (barrett §5.2.2, §5.2.3)."""
        numbers = [element for element in elements if element.param.name not in BARRETT.texts]
        if len(numbers) == len(elements):
            return self._read_numbers(elements)
        found = {reading.element: reading for reading in (self._read_numbers(numbers) if numbers else ())}
        for element in elements:
            if element not in found:
                try:
                    found[element] = Reading(element, 0, self.version().encode())
                except (NoAnswer, ProtocolError, DeviceRefused) as exc:
                    if not numbers:
                        raise
                    found[element] = Reading(element, None, b"", exc)
        return [found[element] for element in elements]

    def numbers(self, elements: Sequence[Element]) -> list[int]:
        """The values of these, in their order. Raises why one of them could not be read."""
        return [int(reading.required) for reading in self.read(elements)]

    def by_name(
        self, *names: str, motors: Collection[int] = range(4), dispensable: Collection[str] = ()
    ) -> dict[tuple[str, str | None], int]:
        """Values by mnemonic and motor; facts about the hand itself are kept. Raises the error if one cannot be read.

        Of `dispensable` mnemonics those may be missing that this firmware does not have.
        """
        found: dict[tuple[str, str | None], int] = {}
        for reading in self.read(BARRETT.elements(*names, motors=motors)):
            if isinstance(reading.error, NotPresent) and gcl_name(reading.element) in dispensable:
                continue
            value = reading.required
            self.keep_facts(reading.element.param, value)
            found[gcl_name(reading.element), reading.element.part] = int(value)
        return found

    def _read_numbers(self, elements: Sequence[Element]) -> list[Reading]:
        found: dict[str, dict[int, int] | HandctlError] = {}

        def some() -> bool:
            return any(isinstance(one, dict) for one in found.values())

        def so_far() -> list[Reading]:
            rest = HandctlError("not read")
            return [_reading(one, found.get(gcl_name(one), rest), self.line.sign) for one in elements] if some() else []

        with self.keep_partial(so_far):
            motors = sorted({element.index for element in elements if element.param.elements})
            prefix = "" if len(motors) in (0, 4) else "".join(str(motor + 1) for motor in motors)
            params = [BARRETT.by_mnemonic(name) for name in dict.fromkeys(map(gcl_name, elements))]
            kinds = [((one.is_global, one.optional), one.mnemonic) for one in params]
            for common, later in product((False, True), repeat=2):  # what is absent must not spoil the others
                names = [(name,) for kind, name in kinds if kind == (common, later)]
                for line, items in batches("PGET" if common else f"{prefix}FGET", names):
                    try:
                        self._get(line, [0] if common else motors, found)
                    except (NoAnswer, ProtocolError) as exc:
                        if not some():
                            raise
                        found.update({name: exc for (name,) in items})
            refused = [one for one in found.values() if isinstance(one, HandctlError)]
            for error in refused[:1]:
                self.name_heat(error)
            for error in refused[1:]:
                error.hint = refused[0].hint if error.code == refused[0].code else error.hint
        readings = [_reading(element, found[gcl_name(element)], self.line.sign) for element in elements]
        self._tell_signs(readings, found)
        return readings

    def _tell_signs(self, readings: Sequence[Reading], found: Mapping[str, dict[int, int] | HandctlError]) -> None:
        """Say once that positions were printed without their sign."""
        for reading in readings if not self._told_sign else ():
            element = reading.element
            printed = found[gcl_name(element)] if gcl_name(element) in POSITIONS else None
            if not self._told_sign and isinstance(printed, dict) and printed[element.index] != reading.value:
                self._told_sign = True
                text = f"sign: {element.part} {printed[element.index]} is {reading.value}"
                if self.line.sign:
                    text = f"on this device a position below 0 has no {text}"
                else:
                    text = f"this hand prints a position below 0 without its {text}, because the joint does not travel that far (barrett §5.3.2, §5.3.4 IOFF)"
                self.journal.info("unsigned-position", text)

    def _get(self, line: str, motors: list[int], into: dict[str, dict[int, int] | HandctlError]) -> None:
        verb, *names = line.split()
        answer = self.line.read(line, lambda answer: answer.status or values(answer, len(names), len(motors)))
        if answer.status and answer.status & ~SPLITTABLE == 0 and len(names) > 1:
            middle = len(names) // 2
            for half in (names[:middle], names[middle:]):
                self._get(" ".join([verb, *half]), motors, into)
        elif answer.status:
            into.update(dict.fromkeys(names, self.refusal(answer)))
        else:
            for name, numbers in zip(names, values(answer, len(names), len(motors)), strict=True):
                into[name] = dict(zip(motors, numbers, strict=True))

    def element_keys(self, element: Element) -> Row:
        return {"name": element.param.name, "parameter": gcl_name(element), "motor": element.part}

    def value_keys(self, reading: Reading) -> Row:
        param = reading.element.param
        assert isinstance(param, GclParam) and reading.value is not None
        if param.name in BARRETT.texts:
            return {"value": reading.raw.decode(), "unit": None, "label": None}
        row: Row = {
            "value": reading.value,
            "unit": param.unit,
            "label": meaning(param, reading.value, reading.element.index),
            "default": param.default_of(reading.element.index),
        }
        doubt = why_doubtful(param, reading.element.index, reading.value)
        if param.mnemonic == "SG":
            row["doubt"] = NO_GAUGE if reading.value == 255 else doubt
        elif doubt:
            row["doubt"] = doubt
        return row

    # -- writing -------------------------------------------------------------------------------------------------

    def plan(self, changes: Changes) -> list[Step]:
        """FSET and PSET lines for checked changes: motors that get the same value share a prefix; the speed goes last."""
        return [step_of(text) for text, _ in self._commands(changes)]

    def _commands(self, changes: Changes) -> list[tuple[str, Changes]]:
        """The lines that write `changes`, each with its changes, in order."""
        same: dict[tuple[str, Number], list[tuple[Element, Number]]] = {}
        for change in sorted(changes, key=_is_speed):
            same.setdefault((gcl_name(change[0]), change[1]), []).append(change)
        verbs: dict[tuple[bool, str], dict[tuple[str, ...], Changes]] = {}
        for (name, value), mine in same.items():
            digits = "".join(str(element.index + 1) for element, _ in sorted(mine, key=lambda one: one[0].index))
            verb = "PSET" if BARRETT.by_mnemonic(name).is_global else f"{'' if digits == '1234' else digits}FSET"
            verbs.setdefault((_is_speed(mine[0]), verb), {})[name, str(value)] = mine
        return [
            (line, [change for words in items for change in written[words]])
            for (_, verb), written in verbs.items()
            for line, items in batches(verb, list(written))
        ]

    def write(self, changes: Changes) -> list[Reading]:
        """Set values in RAM, each line once, and read them all back; a change of BAUD goes last, with the port.

        Raises DeviceRefused with the hand's status; CheckFailed when the read-back differs.
        """
        calm = [change for change in changes if not _is_speed(change)]
        readings = self._write_calm(calm) if calm else []
        for element, value in filter(_is_speed, changes):
            self.line.change_speed(int(value))
            readings += self._read_back([(element, value)], self._commands([(element, value)]))
        return readings

    def _write_calm(self, changes: Changes) -> list[Reading]:
        self.line.connect()
        done: list[str] = []
        commands = self._commands(changes)
        for number, (command, mine) in enumerate(commands, 1):
            try:
                self._write_line(command, mine, last=number == len(commands))
            except HandctlError as exc:
                if done:
                    what = "lost by the restart" if isinstance(exc, Restarted) else "already set"
                    exc.add_aftermath(Aftermath(behind=f"{what}: {', '.join(done)}"))
                raise
            done.append(command)
        return self._read_back(changes, commands)

    def _write_line(self, command: str, changes: Changes, *, last: bool) -> None:
        """One line. Where its answer is lost, nothing follows it before it reads back."""
        sent = self.journal.counters.sent
        try:
            answer = self.line.ask(command)
        except (NoAnswer, ProtocolError) as exc:
            if self.journal.counters.sent == sent or isinstance(exc, Restarted):
                raise  # a hand that restarted has its saved settings again: what was set before is gone
            self.journal.warn(
                "answer-lost", f"no valid reply to {command} ({exc.text}), so handctl reads the values back"
            )
            self.line.resynchronise()
            if not last:
                self._read_back(changes, [(command, changes)])
            return
        if answer.status:
            error = self.name_heat(self.refusal(answer))
            names = list(dict.fromkeys(gcl_name(element) for element, _ in changes))
            if len(names) > 1:  # the first wrong pair ends the line, those before it stay
                error.add_aftermath(
                    Aftermath(behind=(f"perhaps also set: {', '.join(names[:-1])}. Check: `handctl barrett get`"))
                )
            raise error

    def _read_back(self, changes: Changes, commands: Sequence[tuple[str, Changes]]) -> list[Reading]:
        """Read the values back. Raises CheckFailed if they are not what `commands` wrote."""
        readings = self.read([element for element, _ in changes])
        now = {reading.element.full_name: reading.value for reading in readings}
        for command, mine in commands:
            step = step_of(command)
            if all(now[element.full_name] == value for element, value in mine):
                self.journal.ledger.confirm("read back", step)
            elif all(now[element.full_name] is not None for element, _ in mine):
                self.journal.ledger.doubt("reads back otherwise", step)
        self.check_read_back(changes, readings, "read them with `handctl barrett get` before writing again")
        return readings

    # -- tables --------------------------------------------------------------------------------------------------

    def table(self, readings: Sequence[Reading], title: str = "") -> Table:
        """Readings as a Table; for people one line per parameter, motors side by side."""
        table = super().table(readings, title)
        mark_not_homed(table.rows)
        return table

    def partial(self, failed: Sequence[Reading]) -> HandctlError | None:
        """Which parameters, by their names in GCL, and why."""
        first, names = failed[0].error, dict.fromkeys(gcl_name(reading.element) for reading in failed)
        assert first is not None
        said = first.text.removeprefix(self.link.name).lstrip(": ")
        return first.reworded(f"{self.link.name}: {', '.join(names)}: {said}")

    def dump(self) -> Table:
        """Every parameter of §5.3 and §5.4 against its default, and what later firmware has, by the version that it reports."""
        params = [param for param in BARRETT if param.readable and not param.since]
        wanted = [element for param in params for element in param.each]
        readings = self.read(wanted)
        trouble = None
        try:
            version = " ".join(self.checked(self.line.read("VERS")).lines)
            if later := BARRETT.elements(*later_names(version)):
                readings += self.read(later)
        except (NoAnswer, ProtocolError, DeviceRefused) as exc:
            trouble = exc
        table = self.table(self.present(readings))
        table.failure = table.failure or trouble
        for finding in audit(table.rows):
            self.journal.warn("audit", finding)
        return table

    def status(self, check: bool) -> Table:
        """Position, strain, status, way, temperature against its limit, firmware. With `check`, unhealthy is exit 7."""
        names = ("P", "SG", "S", "OD", "EN", "TEMP", "OTEMP", "PTEMP", "UPSECS", "SN", "BAUD")
        table = self.table(self.present(self.read(BARRETT.elements(*names))))
        try:
            firmware = self.version()
        except HandctlError as exc:
            firmware = f"? ({exc.text})"
        (version,) = BARRETT.elements("VERS")
        table.rows.append(self.row(Reading(version, 0, firmware.encode())))
        table.view = status_view
        findings = list(unhealthy(table.rows))
        if check:  # S says nothing of it: a hand that was left in RealTime is "ready" while it runs
            from handctl.devices.barrett.gcl.session_start import look_for_motion

            findings += [Finding(f"the hand is moving: {motor}", ("moving",)) for motor in look_for_motion(self.line)]
        return self.with_findings(table, findings, check)


def _has_text(answer: Answer) -> None:
    """Raise ProtocolError for a prompt alone: it may be a leftover, and is no sign of a firmware that runs."""
    if not answer.status and not "".join(answer.lines).strip():
        raise ProtocolError(
            f"{answer.command}: expected a text, received a prompt alone ({answer.raw[-24:].hex(' ').upper()})",
            hint=DISTURBED,
            code="bad-line",
        )


def _is_speed(change: tuple[Element, Number]) -> bool:
    return gcl_name(change[0]) == "BAUD"


def _reading(element: Element, found: dict[int, int] | HandctlError, sign: str) -> Reading:
    if isinstance(found, dict):
        value = found[element.index if element.param.elements else 0]
        return Reading(element, with_sign(element.index, value, sign) if gcl_name(element) in POSITIONS else value)
    return Reading(element, None, b"", found)
