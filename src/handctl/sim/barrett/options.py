"""Options and states of the simulated BarrettHand: their texts, their reading, what a state does to the body."""

from __future__ import annotations

from handctl.sim.barrett import loop, monitor
from handctl.sim.barrett.tables import NO_BOARD, NO_MOTOR
from handctl.sim.engine.model import Options

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.barrett.board import Board

OBSTACLES = (9250.0, 9400.0, 9550.0)  # places of the fault "obstacle": P 9200, 9350, 9500 after HI
HOT = 702  # 0.1 °C

OPTIONS = {
    "firmware": "4.33 (default), 4.34 (adds BD BP BS BDAT) or 4.4 (adds LCT LFBP LFAIN too)",
    "baud": "saved speed at the first start: 600 1200 2400 4800 9600 (default) 19200 38400",
    "max-baud": "highest speed that BAUD accepts (default 38400)",
    "initialized": "1: start as after HI (default 0: HI is needed)",
    "texts": "layout of FLIST, FLISTV, ?, ERR, VERS, all invented: values (default), names, prose",
    "prompt": "space (default): '=> '. bare: '=>' as the manual prints it",
    "line-end": "lfcr (default) or crlf",
    "line-limit": "longest line, 16..1000 characters (default 128). A longer one is an unknown command",
    "max-arguments": "most arguments of FGET, FSET, PGET, PSET, 1..200 (default 64). More are error 1024",
    "boot": "seconds from power on or RESET to the banner, with the window of the boot monitor (default 1)",
    "found": "state at the first start: ready (default), off, boot (just switched on), monitor (no firmware), loop, moving, saving."
    " Also: record (a download was cut off), loop-block (in the middle of a control block), loop-moving, typed (half a"
    " line: C)",
    "uart": "the hand's receiver at a wrong speed: mid (default, one sample a bit) or sci (16 samples a bit)",
    "align": "seconds that HI takes besides its movements (default 0.5)",
    "write-time": "seconds to program one byte of EEPROM, two bytes a value (default 0.01)",
    "otemp-stops": "what fails above OTEMP: all motor commands (default) or only movements",
    "hctl-clock": "clock of the motor controllers in MHz: 2.00 (default) or 1.25",
    "temperature": "temperature of the CPU board at the first start, -550..1250 in 0.1 °C (default 412)",
    "no-load": "strain readings without load, N,N,N for F1,F2,F3 (default 112,119,126)",
    **loop.OPTIONS,
    **monitor.OPTIONS,
}
FAULTS = {
    "no-echo": "the echo is missing, the answer arrives",
    "hang": "the echo arrives, the answer does not, and the hand is deaf until a power cycle",
    "no-abort": "^C is ignored during a movement",
    "blocked": "no motor can move",
    "obstacle": "an object stops F1 at about 9200, F2 at 9350, F3 at 9500",
    "strain": "the strain reading of F2 is 221",
    "strain-offset": "the strain reading of F3 without load is 188",
    "no-gauges": "all strain readings are 255",
    "hot": "70.2 °C, which does not fall",
    "over-temperature": "hot, and OTEMP is 600 unless it is set",
    "not-homed": "no motor is initialized",
    "no-board": "F2 has no motor board (status 1)",
    "no-motor": "F3 has no motor (status 2)",
    "reversed": "F1 moves the wrong way",
    "breakaway": "the clutch of F3 lets go at 2000",
    "eeprom-worn": "saves are counted but not kept",
    "erratic": "decayed firmware: some commands are unknown, some values have a wrong bit",
    "unknown-codes": "the status of F3 has the unused codes 8 and 512",
    **loop.FAULTS,
    **monitor.FAULTS,
}


def numbers(options: Options, name: str, default: str, low: int, high: int) -> tuple[int, ...]:
    """As many whole numbers as the default has, with commas between."""
    text = options.text(name) or default
    numbers = [Options(options.kind, {name: part}, [name]).integer(name, 0, low, high) for part in text.split(",")]
    if len(numbers) != default.count(",") + 1:
        raise ValueError(f"option {name}={text}: not {default.count(',') + 1} numbers, such as {default}")
    return tuple(numbers)


def switches(options: Options) -> list[float]:
    """The option switch: moments in ascending order, off and on by turns, on at last."""
    text = options.text("switch")
    if text is None:
        return []
    times = [
        Options(options.kind, {"switch": part}, ["switch"]).seconds("switch", 0.0, 1e9) for part in text.split(",")
    ]
    if len(times) % 2 or times != sorted(times):
        raise ValueError(f"option switch={text}: use ascending seconds, alternating off and on, such as 2,8")
    return times


def apply_faults(device: Board, before: frozenset[str]) -> None:
    """Puts the states of the body in, and takes away those of `before` that are no longer wanted."""
    faults = device.faults
    motors = device.hand.motors

    def change(name: str) -> bool | None:
        return True if name in faults else False if name in before else None

    if change("blank-firmware"):
        device.monitor.erase()
        device.settle()
    for motor in motors:
        if (on := change("blocked")) is not None:
            motor.jammed = on
        if (on := change("no-gauges")) is not None:
            motor.no_load = 255 if on else device.no_load[motor.number]
        if (on := change("obstacle")) is not None and motor.number < 3:
            motor.obstacle = OBSTACLES[motor.number] if on else None
        if "not-homed" in faults:
            motor.initialized = False
    for name, number, code in (("no-board", 1, NO_BOARD), ("no-motor", 2, NO_MOTOR)):
        if (on := change(name)) is not None:
            motors[number].fault = code if on else 0
    if (on := change("strain")) is not None:
        motors[1].strain = 221 if on else None
    if (on := change("strain-offset")) is not None:
        motors[2].no_load = 188 if on else device.no_load[2]
    if (on := change("reversed")) is not None:
        motors[0].reversed = on
    if (on := change("breakaway")) is not None:
        motors[2].clutch = 2050.0 if on else None
    if {"hot", "over-temperature"} & (faults | before):
        device.hand.set_temperature(HOT if {"hot", "over-temperature"} & faults else device.usual_temperature)
    if "over-temperature" in faults and not device.memory.common["OTEMP"]:
        device.memory.common["OTEMP"] = device.memory.saved_common["OTEMP"] = 600
    device.hand.disturbed()
