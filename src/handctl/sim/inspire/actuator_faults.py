"""What the actuators of the simulated Inspire devices have in common: heat and error bits.

Temperatures are °C, computed in closed form from the time that passed. The wrist's manual gives no error bits; they are
taken to be those of the hands of the same maker (exo §2.3.12).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Latched = Mapping[str, tuple[int, int]]

HEATING = 0.06  # °C above rest per mA above rest, once settled
SETTLING = 60.0  # s, time constant of heating and cooling
COOLER = 10.0  # °C below the limit at which the over-temperature error goes away
EULER = 2.718281828459045

LOCKED_ROTOR, OVER_TEMPERATURE, OVER_CURRENT, MOTOR_ABNORMAL, COMMUNICATION = 1, 2, 4, 8, 16  # exo §2.3.12
ACTUATOR_FAULTS = {  # fault -> (finger, error byte): another finger for each bit, so that a swap is seen
    "locked-rotor": (0, 1),
    "over-temperature": (1, 2),
    "over-current": (2, 4),
    "motor-abnormal": (4, 8),
    "communication": (4, 16),
    "unknown-bits": (3, 160),
}
CLEARABLE = LOCKED_ROTOR + OVER_CURRENT + MOTOR_ABNORMAL + COMMUNICATION  # exo §2.3.3


class Servo:
    """Heat and errors of one actuator that settles at `at_rest` °C and is too hot from `limit` on."""

    def __init__(self, at_rest: float, limit: float) -> None:
        self.at_rest = at_rest
        self.limit = limit
        self.ambient = at_rest  # where it settles at rest
        self.errors = 0
        self.hot = False
        self.temperature = at_rest

    @property
    def temperature(self) -> float:
        """Heated or cooled at once, it drifts from there to where it settles."""
        return self.degrees

    @temperature.setter
    def temperature(self, degrees: float) -> None:
        self.degrees = degrees  # for those who read it, often
        self._check_heat()

    def warm(self, seconds: float, rise: float) -> None:
        """Lets time pass at a current that is `rise` mA above rest."""
        settled = self.ambient + HEATING * rise
        if self.degrees != settled:
            self.temperature = settled + (self.degrees - settled) * EULER ** (-seconds / SETTLING)

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
            self.temperature = self.limit - COOLER

    def overheat(self) -> None:
        """Heats it above the limit, for good."""
        self.ambient = self.limit + 8.0
        self.temperature = max(self.temperature, self.ambient)

    def cool_down(self) -> None:
        """Takes the cause of lasting heat away."""
        self.ambient = self.at_rest

    def _check_heat(self) -> None:
        self.hot = self.degrees >= self.limit or (self.hot and self.degrees > self.limit - COOLER)


def apply_faults(
    servos: Sequence[Servo], faults: frozenset[str], every: Sequence[int], latched: Latched = ACTUATOR_FAULTS
) -> None:
    """Puts the actuators into the states of these faults; `every` are the error bytes of the fault "faults"."""
    errors = [*every] if "faults" in faults else []
    errors += [0] * len(servos)
    for name in faults & latched.keys():
        place, bits = latched[name]
        errors[place] |= bits
    for servo, byte in zip(servos, errors, strict=False):
        servo.errors |= byte & ~OVER_TEMPERATURE
        if byte & OVER_TEMPERATURE:
            servo.overheat()
        else:
            servo.cool_down()


def fault_help(places: Sequence[str], latched: Latched = ACTUATOR_FAULTS) -> dict[str, str]:
    """What these faults are, of actuators with these names."""
    texts = {}
    for name, (place, byte) in latched.items():
        bits = [str(bit) for bit in range(8) if byte >> bit & 1]
        hot = ", which stays hot" if byte == OVER_TEMPERATURE else ""
        texts[name] = f"error bit{'s' if len(bits) > 1 else ''} {' and '.join(bits)} on {places[place]}{hot}"
    return texts


def start_hot(servos: Sequence[Servo], faults: frozenset[str]) -> None:
    """Behind a power-on: with the fault "hot" all begin above the limit."""
    for number, servo in enumerate(servos) if "hot" in faults else ():
        servo.temperature = servo.limit + 1.0 + number
