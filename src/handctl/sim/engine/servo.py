"""What the actuators of the simulated Inspire devices have in common: heat and error bits.

Temperatures are °C, computed in closed form from the time that passed. The wrist's manual gives no error bits; they are
taken to be those of the hands of the same maker (exo §2.3.12).
"""

from __future__ import annotations

HEATING = 0.06  # °C above rest per mA above rest, once settled
SETTLING = 60.0  # s, time constant of heating and cooling
COOLER = 10.0  # °C below the limit at which the over-temperature error goes away
E = 2.718281828459045

LOCKED_ROTOR, OVER_TEMPERATURE, OVER_CURRENT, MOTOR_ABNORMAL, COMMUNICATION = 1, 2, 4, 8, 16  # exo §2.3.12
CLEARABLE = LOCKED_ROTOR + OVER_CURRENT + MOTOR_ABNORMAL + COMMUNICATION  # exo §2.3.3


class Servo:
    """Heat and errors of one actuator that settles at `at_rest` °C and is too hot from `limit` on."""

    __slots__ = ("ambient", "at_rest", "errors", "hot", "limit", "temperature")

    def __init__(self, at_rest: float, limit: float) -> None:
        self.at_rest = at_rest
        self.limit = limit
        self.temperature = at_rest
        self.ambient = at_rest  # where it settles at rest
        self.errors = 0
        self.hot = False
        self._check_heat()

    def warm(self, seconds: float, rise: float) -> None:
        """Lets time pass at a current that is `rise` mA above rest."""
        settled = self.ambient + HEATING * rise
        if self.temperature != settled:
            self.temperature = settled + (self.temperature - settled) * E ** (-seconds / SETTLING)
            self._check_heat()

    def error(self) -> int:
        """The error byte. Bit 1 follows the temperature alone (exo §2.3.3 note)."""
        return self.errors + (OVER_TEMPERATURE if self.hot else 0)

    def set_error(self, byte: int) -> None:
        """Puts it into a state with this error byte; an over-temperature error comes with lasting heat."""
        self.errors = byte & ~OVER_TEMPERATURE & 255
        if byte & OVER_TEMPERATURE:
            self.overheat()
        elif self.hot:
            self.cool_down()
            self.set_temperature(self.limit - COOLER)

    def set_temperature(self, degrees: float) -> None:
        """Heats or cools at once; from there it drifts to where it settles."""
        self.temperature = degrees
        self._check_heat()

    def overheat(self) -> None:
        """Heats it above the limit, for good."""
        self.ambient = self.limit + 8.0
        self.set_temperature(max(self.temperature, self.ambient))

    def cool_down(self) -> None:
        """Takes the cause of lasting heat away."""
        self.ambient = self.at_rest

    def _check_heat(self) -> None:
        self.hot = self.temperature >= self.limit or (self.hot and self.temperature > self.limit - COOLER)
