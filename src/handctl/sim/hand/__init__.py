"""The simulated RH56 hands, four generations of one maker: DF, TP, F1 and DG2 (RH56 dossier §1).

books.py      the registers of each generation: addresses, sizes, ranges, what a hand shows at power-on
body.py       fingers: they move, meet objects, stall and get warm
tactile.py    what the skin feels while they grasp
model.py      one hand: memory, flash, triggers, and a count of what it was made to do
front.py      what each wire has in common
device.py     EB90 and Modbus RTU on its serial pair
modbus.py     frames of Modbus RTU and TCP, and what a request does
modbus_tcp.py Modbus TCP
can.py        CAN 2.0, and the identifiers of CAN FD
control.py    control commands and state file
"""

SUMMARY = "RH56 dexterous hand: generations df, tp, f1 and dg2 (serial, CAN, Modbus)."
MODELS = ("df", "tp", "f1", "dg2")
WIRES = ("serial", "can", "modbus-tcp")
