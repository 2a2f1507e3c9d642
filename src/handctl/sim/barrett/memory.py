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

WEAR = 5000  # saves of each kind in the life of the hand (§5.2.2, §5.2.3)


class Memory:
    """`motor[name]` are the four values in force, `common[name]` the global ones; `saved_…` is the EEPROM."""

    def __init__(self, firmware: int, speed: int) -> None:
        self.motor_rows = {row[0]: row for row in MOTOR if row[6] <= firmware}
        self.common_rows = {row[0]: row for row in GLOBAL if row[5] <= firmware}
        self.motor: dict[str, list[int]] = {}
        self.common: dict[str, int] = {}
        self.default((0, 1, 2, 3))
        self.default_common()
        self.common["BAUD"] = speed
        self.saved_motor = {name: list(values) for name, values in self.motor.items()}
        self.saved_common = dict(self.common)
        self.saves = [0, 0]  # FSAVE, PSAVE

    # -- names -------------------------------------------------------------------------------------------------------

    def motor_names(self, advanced: bool) -> list[str]:
        return [name for name, row in self.motor_rows.items() if advanced or row[5] != ADVANCED]

    def common_names(self, advanced: bool) -> list[str]:
        return [name for name, row in self.common_rows.items() if advanced or row[4] != ADVANCED]

    # -- values in force ---------------------------------------------------------------------------------------------

    def get(self, name: str, number: int) -> int:
        return self.motor[ALIAS.get(name, name)][number]

    def set(self, name: str, text: str, motors: tuple[int, ...]) -> int:
        """Sets a value for these motors; the status code, 0 if it was taken."""
        row = self.motor_rows.get(name)
        if row is None:
            return UNKNOWN_NAME
        if row[5] == STATUS:
            return READ_ONLY
        value = decimal_number(text, row[1], row[2])
        if value is None:
            return BAD_VALUE
        for number in motors:
            self.motor[ALIAS.get(name, name)][number] = value
        return 0

    def set_common(self, name: str, text: str, fastest: int) -> int:
        """Sets a global value; `fastest` is the highest BAUD that this hand can do."""
        row = self.common_rows.get(name)
        if row is None:
            return UNKNOWN_NAME
        if row[4] == STATUS:
            return READ_ONLY
        value = decimal_number(text, row[1], row[2])
        if value is None or (name == "BAUD" and (value not in BAUDS or value > fastest)):
            return BAD_VALUE
        self.common[name] = value
        return 0

    def default(self, motors: tuple[int, ...]) -> None:
        """FDEF: factory values in RAM, nothing saved."""
        for name, row in self.motor_rows.items():
            if row[5] != STATUS and name not in ALIAS:
                values = self.motor.setdefault(name, [0, 0, 0, 0])
                for number in motors:
                    values[number] = row[4] if number == 3 else row[3]

    def default_common(self) -> None:
        for name, row in self.common_rows.items():
            if row[4] != STATUS:
                self.common[name] = row[3]

    # -- EEPROM --------------------------------------------------------------------------------------------------------

    def load(self, motors: tuple[int, ...]) -> None:
        for name, values in self.saved_motor.items():
            for number in motors:
                self.motor[name][number] = values[number]

    def load_common(self) -> None:
        self.common.update(self.saved_common)

    def save(self, motors: tuple[int, ...], worn: bool) -> int:
        """Counts one write; returns how many bytes it programs, two for each value. A worn EEPROM keeps the old ones."""
        self.saves[0] += 1
        if not worn and self.saves[0] <= WEAR:
            for name, values in self.motor.items():
                for number in motors:
                    self.saved_motor[name][number] = values[number]
        return 2 * len(self.motor) * len(motors)

    def save_common(self, worn: bool) -> int:
        self.saves[1] += 1
        if not worn and self.saves[1] <= WEAR:
            self.saved_common.update(self.common)
        return 2 * len(self.common)


def decimal_number(text: str, low: int, high: int) -> int | None:
    """A number as the hand reads it: decimal digits alone (a sign is refused, our guess), in its range."""
    number = number_in(text)
    return number if number is not None and low <= number <= high else None
