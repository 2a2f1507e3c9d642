"""RAM and EEPROM of the simulated BarrettHand: the values of its parameters (barrett §5.2.2, §5.2.3, §5.3, §5.4).

Knows the table and its ranges, no bytes and no motors. Status parameters are not here: nobody stores them.
"""

from __future__ import annotations

from handctl.digits import number_in
from handctl.sim.barrett.tables import (
    ADVANCED,
    ALIAS,
    BAD_VALUE,
    BAUDS,
    GLOBAL,
    MOTOR,
    READ_ONLY,
    STATUS,
    UNKNOWN_NAME,
)

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    Row = tuple[str, int, int, int, int, int, int, str]

WEAR = 5000  # saves of each kind in the life of the hand (§5.2.2, §5.2.3)


class Bank:
    """Parameters of one kind, each with as many values: `values` are those in force, `saved` is the EEPROM."""

    def __init__(self, rows: Iterable[Row], firmware: int, width: int) -> None:
        self.rows = {row[0]: row for row in rows if row[6] <= firmware}
        self.all = tuple(range(width))
        stored = [name for name, row in self.rows.items() if row[5] != STATUS and name not in ALIAS]
        self.values = {name: [0] * width for name in stored}
        self.default(self.all)
        self.saved = {name: list(values) for name, values in self.values.items()}
        self.saves = 0
        self.only: dict[str, Collection[int]] = {}  # parameters that take some values of their range alone

    def names(self, advanced: bool) -> list[str]:
        return [name for name, row in self.rows.items() if advanced or row[5] != ADVANCED]

    def get(self, name: str, number: int = 0) -> int:
        return self.values[ALIAS.get(name, name)][number]

    def put(self, name: str, text: str, numbers: tuple[int, ...]) -> int:
        """Sets a value for these; the status code, 0 if it was taken."""
        row = self.rows.get(name)
        if row is None:
            return UNKNOWN_NAME
        if row[5] == STATUS:
            return READ_ONLY
        value = decimal_number(text, row[1], row[2])
        if value is None or value not in self.only.get(name, (value,)):
            return BAD_VALUE
        for number in numbers:
            self.values[ALIAS.get(name, name)][number] = value
        return 0

    def default(self, numbers: tuple[int, ...]) -> None:
        """Factory values in RAM, nothing saved."""
        for name, values in self.values.items():
            row = self.rows[name]
            for number in numbers:
                values[number] = row[4] if number == 3 else row[3]

    def load(self, numbers: tuple[int, ...]) -> None:
        """From the EEPROM."""
        for name, values in self.saved.items():
            for number in numbers:
                self.values[name][number] = values[number]

    def save(self, numbers: tuple[int, ...], worn: bool) -> int:
        """Counts one write; returns how many bytes it programs, two for each value. A worn EEPROM keeps the old ones."""
        self.saves += 1
        if not worn and self.saves <= WEAR:
            for name, values in self.values.items():
                for number in numbers:
                    self.saved[name][number] = values[number]
        return 2 * len(self.values) * len(numbers)


class Memory:
    """The parameters of the motors, and those of the whole hand."""

    def __init__(self, firmware: int, speed: int, fastest: int) -> None:
        """`fastest` is the highest BAUD that this hand can do."""
        self.motor, self.common = Bank(MOTOR, firmware, 4), Bank(GLOBAL, firmware, 1)
        self.common.values["BAUD"][0] = self.common.saved["BAUD"][0] = speed
        self.common.only["BAUD"] = [baud for baud in BAUDS if baud <= fastest]

    @property
    def speed(self) -> int:
        """BAUD, in bit/s."""
        return 100 * self.common.get("BAUD")

    def load(self) -> None:
        for bank in (self.motor, self.common):
            bank.load(bank.all)


def decimal_number(text: str, low: int, high: int) -> int | None:
    """A number as the hand reads it: decimal digits alone (a sign is refused, our guess), in its range."""
    number = number_in(text)
    return number if number is not None and low <= number <= high else None
