"""The simulated RH56 hands, four generations of one maker: DF, TP, F1 and DG2 (RH56 dossier §1).

register_maps.py  the registers of each generation: addresses, sizes, ranges, what a hand shows at power-on
fingers.py        fingers: they move, meet objects, stall and get warm
registers.py      one hand: memory, flash, triggers, a count of what it was made to do, skin; what its wires
                  have in common, and what it can be told at its start
device.py         its wires: EB90 and Modbus RTU, CAN, Modbus TCP, and what a request of Modbus does
control_commands.py  control commands, state file, use
"""

from handctl.sim.inspire import EB90

SUMMARY = "RH56 dexterous hand: generations df, tp, f1 and dg2 (serial, CAN, Modbus)."
MODELS = ("df", "tp", "f1", "dg2")
WIRES = ("serial", "can", "modbus-tcp")

FACTS: dict[str, dict[object, str]] = {
    **EB90,
    "generation": {"*": "model={}"},
    "protocol": {"*": "speaks={}"},
    "byte-groups": {"low half first": "", "high half first": "fault=high-half", "one a register": "fault=rtu-unpacked"},
    "current-sign": {"signed": ""},
    "speed-register": {1002: "", 1001: "baud-register=1001"},
    "set-points-at-power-on": {-1: ""},
    "write-acknowledgement": {"*": "ack={}"},
}
"""What a fact about a real one makes of the simulated one, see `engine.facts_file`."""
