"""Options, states and faults of the simulated BarrettHand, beside those of its RealTime mode and of its boot monitor."""

from __future__ import annotations

from handctl.sim.barrett.mechanics import TEMPERATURE
from handctl.sim.barrett.parameter_tables import BAUDS, NO_BOARD, NO_MOTOR

STATES = ("ready", "off", "boot", "monitor", "record", "loop", "loop-block", "loop-moving", "moving", "saving", "typed")
"""In which a client may find the hand: what somebody, or a program that died, has left behind; those of the dossier's connect."""
OBSTACLES = (9250.0, 9400.0, 9550.0)  # places of the fault "obstacle": P 9200, 9350, 9500 after HI
HOT = 702  # 0.1 °C

OPTIONS = {
    "firmware": (("4.33", "4.34", "4.4"), "4.33 (default), 4.34 (adds BD BP BS BDAT) or 4.4 (adds LCT LFBP LFAIN too)"),
    "baud": (("9600", tuple(str(100 * baud) for baud in BAUDS)), "saved baud rate at the first start: 600 1200 2400 4800 9600 (default) 19200 38400"),
    "max-baud": (("38400", tuple(str(100 * baud) for baud in BAUDS)), "highest speed that BAUD accepts (default 38400)"),
    "initialized": (False, "1: start as after HI (default 0: HI is needed)"),
    "texts": (("values", "names", "prose"), "layout of FLIST, FLISTV, ?, ERR, VERS, all invented: values (default), names, prose"),
    "prompt": (("space", "bare"), "space (default): '=> '. bare: '=>' as the manual prints it"),
    "position-sign": (("signed", "unsigned", "clamped"), "how a position below 0 is printed, on the stop side of the origin: signed (-50, default), unsigned (65486) or clamped (0)"),
    "line-end": (("lfcr", "crlf"), "lfcr (default) or crlf"),
    "line-limit": ((128, 16, 1000), "longest line, 16..1000 characters (default 128). A longer one is an unknown command"),
    "max-arguments": ((64, 1, 200), "most arguments of FGET, FSET, PGET, PSET, 1..200 (default 64). More are error 1024"),
    "boot": ((1.0, 60.0), "seconds from power on or RESET to the banner, with the window of the boot monitor (default 1)"),
    "found": (STATES, "state at the first start: ready (default), off, boot (just switched on), monitor (no firmware), loop, moving, saving. Also: record (a download was cut off), loop-block (in the middle of a control block), loop-moving, typed (half a line: C)"),
    "uart": (("mid", "sci"), "the hand's receiver at a wrong baud rate: mid (default, one sample a bit) or sci (16 samples a bit)"),
    "align": ((0.5, 60.0), "seconds that HI takes besides its movements (default 0.5)"),
    "write-time": ((0.01, 1.0), "seconds to program one byte of EEPROM, two bytes a value (default 0.01)"),
    "otemp-stops": (("all", "movements"), "what fails above OTEMP: all motor commands (default) or only movements"),
    "hctl-clock": (("2.00", "1.25"), "clock of the motor controllers in MHz: 2.00 (default) or 1.25"),
    "temperature": ((int(TEMPERATURE), -550, 1250), "temperature of the CPU board at the first start, -550..1250 in 0.1 °C (default 412)"),
    "no-load": (("112,119,126", 0, 255), "strain readings without load, N,N,N for F1,F2,F3 (default 112,119,126)"),
}  # fmt: skip
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
}
OF_MOTORS = {  # fault -> motors, attribute, values while it lasts, value otherwise
    "blocked": ((0, 1, 2, 3), "jammed", (True,) * 4, False),
    "no-gauges": ((0, 1, 2, 3), "no_load", (255,) * 4, None),
    "obstacle": ((0, 1, 2), "obstacle", OBSTACLES, None),
    "no-board": ((1,), "fault", (NO_BOARD,), 0),
    "no-motor": ((2,), "fault", (NO_MOTOR,), 0),
    "strain": ((1,), "strain", (221,), None),
    "strain-offset": ((2,), "no_load", (188,), None),
    "reversed": ((0,), "reversed", (True,), False),
    "breakaway": ((2,), "clutch", (2050.0,), None),
}
