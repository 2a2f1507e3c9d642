"""How a simulated RH56 hand is made: its generation, what it shows when it is found, and each open point one way or the other."""

from __future__ import annotations

from handctl.digits import number_in
from handctl.sim.hand import MODELS, books
from handctl.sim.hand.books import FACTORY_ADDRESS, GENERATIONS, Generation

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.engine.model import Options

REFRESH = 0.0307  # s (dossier §5)
DEAD_TIME = 0.066  # s (dossier §5)

Found = tuple[int, int, int, int, int, int]


class Setup:
    """Texts of each: options.py."""

    def __init__(
        self,
        generation: Generation,
        golden: dict[str, tuple[int, ...]],
        readings: list[Found],
        *,
        factory: dict[str, tuple[int, ...]] | None = None,
        voltage: int = 558,
        stays: bool = False,
        number: int = 1,
        address: tuple[int, ...] = FACTORY_ADDRESS,
        thing: int | None = None,
        refresh: float = REFRESH,
        dead_time: float = DEAD_TIME,
        calibration: float = 6.0,
        still: bool = False,
        keeps: bool = False,
        unchecked: bool = False,
        saves_all: bool = False,
        saves_speed: bool = True,
        resets_flash: bool = True,
        other_speed: bool = False,
        gestures: bool = False,
        quiet: bool = False,
        jitter: bool | None = False,
        limit: float = 70.0,
    ) -> None:
        """`golden` are the set values and `readings` the readings (books.py) of the hand as it is found, also behind every
        power-on when it `stays` so; `factory` are its settings after a factory reset. `jitter` None: no noise at all."""
        self.generation = generation
        self.golden = golden
        self.readings = readings
        self.factory = factory if factory is not None else books.factory(generation)
        self.voltage = voltage
        self.stays = stays
        self.number = number
        self.address = address
        self.thing = thing
        self.refresh = refresh
        self.dead_time = dead_time
        self.calibration = calibration
        self.still = still
        self.keeps = keeps
        self.unchecked = unchecked
        self.saves_all = saves_all
        self.saves_speed = saves_speed
        self.resets_flash = resets_flash
        self.other_speed = other_speed
        self.gestures = gestures
        self.quiet = quiet
        self.jitter = jitter
        self.limit = limit


def from_options(options: Options) -> Setup:
    """The golden hand of a generation, with what the options say."""

    def one(name: str, *words: str) -> bool:
        """Whether it is the second word; the first is the default."""
        return options.choice(name, words[0], words) == words[1]

    generation = GENERATIONS[options.choice("model", "tp", MODELS)]
    golden = books.golden(generation)
    if options.text("speed") is not None:
        golden["speed-set"] = (options.integer("speed", 0, 0, generation.fast),) * generation.count
    return Setup(
        generation,
        golden,
        [books.readings(generation, number) for number in range(generation.count)],
        number=options.integer("id", 1, 1, 254),
        address=_address(options.text("ip")),
        thing=None if options.text("object") is None else options.integer("object", 0, 0, 1000),
        refresh=options.seconds("refresh", REFRESH, 60.0),
        dead_time=options.seconds("dead-time", DEAD_TIME, 60.0),
        calibration=options.seconds("calibration", 6.0, 3600.0),
        still=one("calibration-moves", "1", "0"),
        keeps=one("minus-one", "stored", "kept"),
        unchecked=one("out-of-range", "ignored", "stored"),
        saves_all=one("set-points-kept", "0", "1"),
        saves_speed=not one("baud-kept", "1", "0"),
        resets_flash=not one("reset", "flash", "ram"),
        other_speed=one("baud-register", "1002", "1001"),
        gestures=one("gestures", "0", "1"),
        quiet=one("tactile", "numbered", "quiet"),
        jitter=one("jitter", "0", "1"),
        limit=float(options.integer("limit", 70, 40, 100)),
    )


def _address(text: str | None) -> tuple[int, ...]:
    if text is None:
        return FACTORY_ADDRESS
    parts = text.split(".")
    numbers = [number for part in parts if (number := number_in(part)) is not None and number < 256]
    if len(parts) != 4 or len(numbers) != 4:
        raise ValueError(f"option ip={text}: not an IP address, as 192.168.11.210")
    return tuple(numbers)
