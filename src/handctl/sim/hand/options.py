"""What a simulated RH56 hand can be told at its start: its options, and the faults and states that it has."""

from __future__ import annotations

from handctl.sim.hand import MODELS

OPTIONS = {
    "model": (("tp", MODELS), f"generation: {', '.join(MODELS)} (default tp)"),
    "bus": (("serial", ("serial", "modbus-tcp", "can")), "serial (EB90 and Modbus RTU, default), modbus-tcp (tp only) or can"),
    "id": ((1, 1, 254), "id at the first start, 1..254 (default 1)"),
    "ip": (None, "IP address at the first start (tp, default 192.168.11.210). With that of --modbus-tcp, the server moves with it"),
    "speed": (None, "speed of all fingers at the first start, as one that a program left there (default 601 to 606)"),
    "object": ((None, 0, 1000), "thousandths of the way (0 closed, 1000 open) at which all fingers touch something soft"),
    "refresh": ((0.0307, 60.0), "seconds from one refresh of the readings to the next (default 0.0307)"),
    "dead-time": ((0.066, 60.0), "seconds from a command to its movement (default 0.066)"),
    "calibration": ((6.0, 3600.0), "seconds that a calibration takes (default 6)"),
    "calibration-moves": (True, "1: a calibration moves all fingers (default), 0: the hand must be open, and stays still (open)"),
    "minus-one": (("stored", "kept"), "a written -1 is stored (default), or the old set value is kept (open). The finger stays as it is"),
    "out-of-range": (("ignored", "stored"), "a value out of range is ignored (default), or stored as it is (open)"),
    "set-points-kept": (False, "1: a save keeps angles, force limits and speeds too (open, default 0)"),
    "baud-kept": (True, "0: a save does not keep the baud rate code (editions differ, default 1)"),
    "baud-register": (("1002", "1001"), "1002 (default), or 1001 as some code has it (df and tp, open)"),
    "reset": (("flash", "ram"), "a factory reset changes flash (default), or ram only until a save (open)"),
    "gestures": (False, "1: a number written to 1008 moves the fingers, as in older firmware (df and tp, default 0)"),
    "tactile": (("numbered", "quiet"), "numbered (default: value i at index i) or quiet (0 where nothing is touched)"),
    "jitter": (False, "1: force and current jitter also at rest"),
    "limit": ((70, 40, 100), "temperature in °C that sets the over-temperature error (default 70)"),
}  # fmt: skip
SERIAL_OPTIONS = {
    "baud": (None, "baud rate at the first start: one of the model's (default 115200)"),
    "speaks": (("both", "eb90", "modbus"), "both (EB90 and Modbus RTU, default), eb90 or modbus"),
    "ack-id": (("new", "old"), "the acknowledgement of an id change carries the id: new (default) or old"),
    "result-flag": (("17", "18"), "flag of the save result: 17 (11 hex, default) or 18 (12 hex)"),
    "result-address": (("own", "1005"), "address in the save result: own (default) or 1005, on f1 and dg2 (one print)"),
    "gap": ((0.1, 3600.0), "seconds of silence after which an unfinished request is forgotten (default 0.1)"),
    "silence": ((0.00175, 1.0), "seconds of silence before and after a Modbus RTU request (default 0.00175)"),
}  # fmt: skip
MODBUS_OPTIONS = {
    "most-written": (("120", "123"), "most registers that one Modbus request writes: 120 (default) or 123 (editions differ)"),
}  # fmt: skip
CAN_OPTIONS = {
    "bitrate": (("1000000", "500000"), "bitrate at the first start: 1000000 (default) or 500000"),
    "ack": (("count", "empty"), "acknowledgement of a write: count (the bytes written, default) or empty"),
}  # fmt: skip

FAULTS = {
    "strict": "silence, or a Modbus exception, for a write of anything that cannot be written or is out of range",
    "block-silent": "silence for reads that touch undocumented bytes, on Modbus exception 2",
    "save-fails": "flash stays as it was, and the save result is FF",
    "fresh": "never commanded since power-on: status 255, set values -1",
    "foreign": "the registers do not look like this device (angles out of range)",
    "faults": "error bytes 01 02 04 06 18 00",
    "hot": "all fingers start above the limit and cool down",
    "blocked": "no finger can move",
    "locked-rotor": "error bit 0 on the first finger",
    "over-temperature": "error bit 1 on the second, which stays hot",
    "over-current": "error bit 2 on the third",
    "motor-abnormal": "error bit 3 on the fifth",
    "communication": "error bit 4 on the fifth",
    "unknown-bits": "error bits 5 and 7 on the fourth",
    "force-deaf": "a finger at its force limit takes no command until the limit is another",
    "stops-short": "the second finger closes to 46 thousandths before its end, without an error",
    "tactile-dead": "zones without a sign of life: middle tip, thumb, palm",
    "tactile-saturated": "tactile values that are invalid (65280 and above)",
}
MODBUS_FAULTS = {
    "high-half": "the bytes of error, status and temperature words are swapped",
}
SERIAL_FAULTS = {
    "rtu-unpacked": "Modbus RTU shows one error, status or temperature in each register",
    "no-late-frames": "no save result, no end of a calibration",
}
TCP_FAULTS = {
    "txid-off": "answers carry the transaction id of the request before",
    "twin-ip": "another hand has the same address and answers every second client, its readings a little different",
    "two-clients-drop": "a second client makes the hand drop the first",
}
ALL_FAULTS = (1, 2, 4, 6, 24, 0)  # error bytes of the state "faults" (dossier V14)
