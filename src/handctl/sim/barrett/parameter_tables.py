"""The second book of the BarrettHand: parameters, commands and status codes (barrett §5.1.3, §5.2 to §5.4), its RAM and EEPROM.

Transcribed from the manual alone, decimal numbers; knows names, numbers and ranges, no bytes and no time. Status parameters are
not in the memory: nobody stores them.
"""

from __future__ import annotations

from handctl.number_parsing import number_in

TYPE_CHECKING = False  # a simulator loads without the typing module
if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

Row = tuple[str, int, int, int, int, int, int, str]


MOVEMENT, STATUS, REALTIME, ADVANCED = 1, 2, 3, 4  # groups of parameters: §5.3.1 to §5.3.4; STATUS is read-only

# Motor parameters: (name, lowest, highest, default of a finger, default of the spread, group, first firmware times
# 100, name in words). Status has no default. Units: DP DS CT OT P MPE IOFF BP in encoder counts, velocities in 1/16
# count a sample, ACCEL in 1/256 count a sample squared, TSTOP in ms, OD in 1000 counts, strain 0 to 255 raw.
MOTOR = (
    ("DP", 0, 65535, 8500, 1575, MOVEMENT, 433, "Default Position"),
    ("DS", 0, 65535, 1700, 315, MOVEMENT, 433, "Default Step"),
    ("HSG", 0, 256, 256, 256, MOVEMENT, 433, "Highest Strain Gauge Value"),
    ("LSG", 0, 256, 256, 256, MOVEMENT, 433, "Lowest Strain Gauge Value"),
    ("MOV", 16, 4080, 100, 60, MOVEMENT, 433, "Maximum Open Velocity"),
    ("MCV", 16, 4080, 100, 60, MOVEMENT, 433, "Maximum Close Velocity"),
    ("MSG", 0, 256, 256, 256, MOVEMENT, 433, "Maximum Strain Gauge"),
    ("OD", 0, 4294967295, 0, 0, STATUS, 433, "Odometer"),
    ("P", -65535, 65535, 0, 0, STATUS, 433, "Position"),
    ("S", 0, 65535, 0, 0, STATUS, 433, "Status"),
    ("SG", 0, 255, 0, 0, STATUS, 433, "Strain Gauge"),
    ("BD", 0, 1, 0, 0, STATUS, 434, "Breakaway Detected"),
    ("BP", -65535, 65535, 0, 0, STATUS, 434, "Breakaway Position"),
    ("LCV", 0, 1, 1, 1, REALTIME, 433, "Loop Control Velocity"),
    ("LCVC", 0, 255, 1, 1, REALTIME, 433, "Loop Control Velocity Coefficient"),
    ("LCPG", 0, 1, 1, 1, REALTIME, 433, "Loop Control Proportional Gain"),
    ("LCT", 0, 1, 0, 0, REALTIME, 440, "Loop Control Torque"),
    ("LFV", 0, 1, 1, 1, REALTIME, 433, "Loop Feedback Velocity"),
    ("LFVC", 0, 255, 1, 1, REALTIME, 433, "Loop Feedback Velocity Coefficient"),
    ("LFS", 0, 1, 1, 1, REALTIME, 433, "Loop Feedback Strain"),
    ("LFAP", 0, 1, 1, 1, REALTIME, 433, "Loop Feedback Absolute Position"),
    ("LFDP", 0, 1, 1, 1, REALTIME, 433, "Loop Feedback Delta Position"),
    ("LFDPC", 0, 255, 1, 1, REALTIME, 433, "Loop Feedback Delta Position Coefficient"),
    ("LFBP", 0, 1, 0, 0, REALTIME, 440, "Loop Feedback Breakaway Position"),
    ("LFAIN", 0, 1, 0, 0, REALTIME, 440, "Loop Feedback Analog Input"),
    ("ACCEL", 0, 65535, 4, 2, ADVANCED, 433, "Acceleration"),
    ("BDAT", 0, 20000, 1500, 1500, ADVANCED, 434, "Breakaway Acceleration Threshold"),
    ("BS", 0, 1, 0, 0, ADVANCED, 434, "Breakaway Stop"),
    ("CT", 0, 65535, 17000, 3150, ADVANCED, 433, "Close Target"),
    ("EN", 0, 1, 1, 1, ADVANCED, 433, "Enabled"),
    ("FDZ", 0, 255, 0, 0, ADVANCED, 433, "Filter Derivative Zero"),
    ("FIP", 0, 255, 0, 0, ADVANCED, 433, "Filter Integral Pole"),
    ("FPG", 0, 255, 10, 10, ADVANCED, 433, "Filter Proportional Gain"),
    ("HOLD", 0, 1, 0, 1, ADVANCED, 433, "Hold"),
    ("IHIT", 0, 65535, 2, 0, ADVANCED, 433, "Initialization Hit Count"),
    ("IOFF", 0, 65535, 50, 0, ADVANCED, 433, "Initialization Offset"),
    ("IVEL", 16, 4080, 300, 150, ADVANCED, 433, "Initialization Velocity"),
    ("MPE", 0, 65535, 50, 50, ADVANCED, 433, "Maximum Position Error"),
    ("OT", 0, 65535, 0, 0, ADVANCED, 433, "Open Target"),
    ("SAMPLE", 15, 255, 31, 31, ADVANCED, 433, "Sample Time"),
    ("SGFLIP", 0, 1, 0, 0, ADVANCED, 433, "Strain Gage Flip"),  # no default in the manual
    ("TSTOP", 0, 65535, 30, 30, ADVANCED, 433, "Time to Stop"),
)
ALIAS = {"MSG": "HSG"}  # one value under two names (§5.3.1)

# Global parameters (§5.4), rows alike. BAUD in 100 bit/s, temperatures in 0.1 °C.
GLOBAL = (
    ("BAUD", 6, 384, 96, 96, MOVEMENT, 433, "Baud Rate"),
    ("LFT", 0, 1, 0, 0, MOVEMENT, 433, "Loop Feedback Temperature"),
    ("OTEMP", 0, 1250, 0, 0, MOVEMENT, 433, "OverTemperature"),
    ("TEMP", -550, 1250, 0, 0, STATUS, 433, "Temperature"),
    ("PTEMP", 0, 1250, 0, 0, STATUS, 433, "Peak Temperature"),
    ("UPSECS", 0, 4294967295, 0, 0, STATUS, 433, "Uptime Seconds"),
    ("SN", 0, 65535, 0, 0, STATUS, 433, "Serial Number"),
    ("LFDPD", 0, 1, 0, 0, ADVANCED, 433, "Loop Feedback Delta Position Discard"),
)
BAUDS = (6, 12, 24, 48, 96, 192, 384)

# Commands (§5.2): (name, takes a motor prefix, most arguments or -1, advanced, name in words).
COMMANDS = (
    ("C", True, 0, False, "Close"),
    ("HI", True, 0, False, "Hand Initialize"),
    ("HOME", True, 0, False, "Home"),
    ("IO", True, 1, False, "Incremental Open"),
    ("IC", True, 1, False, "Incremental Close"),
    ("LOOP", True, 0, False, "Loop"),
    ("M", True, 1, False, "Move"),
    ("O", True, 0, False, "Open"),
    ("T", True, 0, False, "Terminate power"),
    ("TC", True, 0, False, "Torque-Controlled Close"),
    ("TO", True, 0, False, "Torque-Controlled Open"),
    ("FSET", True, -1, False, "Finger Set"),
    ("FGET", True, -1, False, "Finger Get"),
    ("FLOAD", True, 0, False, "Finger Load"),
    ("FSAVE", True, 0, False, "Finger Save"),
    ("FDEF", True, 0, False, "Finger Default"),
    ("FLIST", False, 0, False, "Finger List"),
    ("FLISTV", True, 0, False, "Finger List Value"),
    ("PSET", False, -1, False, "Parameter Set"),
    ("PGET", False, -1, False, "Parameter Get"),
    ("PLOAD", False, 0, False, "Parameter Load"),
    ("PSAVE", False, 0, False, "Parameter Save"),
    ("PDEF", False, 0, False, "Parameter Default"),
    ("PLIST", False, 0, False, "Parameter List"),
    ("PLISTV", False, 0, False, "Parameter List Value"),
    ("?", False, 0, False, "Help"),
    ("RESET", False, 0, False, "Reset"),
    ("ERR", False, 1, False, "Error"),
    ("VERS", False, 0, False, "Version"),
    ("A?", False, 0, True, "Help All"),
    ("FLISTA", False, 0, True, "Finger List All"),
    ("FLISTAV", True, 0, True, "Finger List All Value"),
    ("PLISTA", False, 0, True, "Parameter List All"),
    ("PLISTAV", False, 0, True, "Parameter List All Value"),
)
ROWS = {row[0]: row for row in COMMANDS}
MOVES = ("C", "HI", "HOME", "IO", "IC", "M", "O", "TC", "TO")
PREFIX = {"1": (0,), "2": (1,), "3": (2,), "4": (3,), "S": (3,), "G": (0, 1, 2)}  # §5.1.2

# Status codes (§5.1.3); 8 and 512 are not used.
NO_BOARD, NO_MOTOR, NOT_INITIALIZED, NOT_REACHED = 1, 2, 4, 16
UNKNOWN_COMMAND, UNKNOWN_NAME, BAD_VALUE, READ_ONLY = 32, 64, 128, 256
TOO_MANY, BAD_HEADER, NO_PREFIX, TOO_HOT, ABORTED = 1024, 2048, 4096, 8192, 16384
ERRORS = (
    (1, "No motor board found"),
    (2, "No motor found"),
    (4, "Motor not initialized"),
    (8, "(not used)"),
    (16, "Couldn't reach position"),
    (32, "Unknown command"),
    (64, "Unknown parameter name"),
    (128, "Invalid value"),
    (256, "Tried to write a read only parameter"),
    (512, "(not used)"),
    (1024, "Too many arguments for this command"),
    (2048, "Invalid RealTime control block header"),
    (4096, "Command can't have motor prefix"),
    (8192, "Overtemperature fault tripped"),
    (16384, "Cntl-C abort command received"),
)


WEAR = 5000  # saves of each kind in the life of the hand (§5.2.2, §5.2.3)


class Bank:
    """Parameters of one kind, each with as many values: `values` are those in force, `saved` is the EEPROM."""

    def __init__(self, rows: Iterable[Row], firmware: int, width: int) -> None:
        self.rows = {row[0]: row for row in rows if row[6] <= firmware}
        self.all = tuple(range(width))
        stored = {name: row for name, row in self.rows.items() if row[5] != STATUS and name not in ALIAS}
        self._factory = {name: (*[row[3]] * 3, row[4])[:width] for name, row in stored.items()}
        self.values = {name: [*values] for name, values in self._factory.items()}
        self.saved = {name: [*values] for name, values in self._factory.items()}
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
            for number in numbers:
                values[number] = self._factory[name][number]

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
