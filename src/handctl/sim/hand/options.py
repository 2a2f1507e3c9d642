"""What a simulated RH56 hand can be told at its start: its options, and the faults and states that it has."""

from __future__ import annotations

from handctl.sim.hand import MODELS

OPTIONS = {
    "model": f"generation: {', '.join(MODELS)} (default tp)",
    "bus": "serial (EB90 and Modbus RTU, default), modbus-tcp (tp only) or can",
    "id": "id at the first start, 1..254 (default 1)",
    "ip": "IP address at the first start (tp, default 192.168.11.210). With that of --modbus-tcp, the server moves with it",
    "speed": "speed of all fingers at the first start, as one that a program left there (default 601 to 606)",
    "object": "thousandths of the way (0 closed, 1000 open) at which all fingers touch something soft",
    "refresh": "seconds from one refresh of the readings to the next (default 0.0307)",
    "dead-time": "seconds from a command to its movement (default 0.066)",
    "calibration": "seconds that a calibration takes (default 6)",
    "calibration-moves": "1: a calibration moves all fingers (default), 0: the hand must be open, and stays still (open)",
    "minus-one": "a written -1 is stored (default), or the old set value is kept (open). The finger stays as it is",
    "out-of-range": "a value out of range is ignored (default), or stored as it is (open)",
    "set-points-kept": "1: a save keeps angles, force limits and speeds too (open, default 0)",
    "baud-kept": "0: a save does not keep the speed code (editions differ, default 1)",
    "baud-register": "1002 (default), or 1001 as some code has it (df and tp, open)",
    "reset": "a factory reset changes flash (default), or ram only until a save (open)",
    "gestures": "1: a number written to 1008 moves the fingers, as in older firmware (df and tp, default 0)",
    "tactile": "numbered (default: value i at index i) or quiet (0 where nothing is touched)",
    "jitter": "1: force and current jitter also at rest",
    "limit": "temperature in °C that sets the over-temperature error (default 70)",
}
SERIAL_OPTIONS = {
    "baud": "speed at the first start: one of the model's (default 115200)",
    "speaks": "both (EB90 and Modbus RTU, default), eb90 or modbus",
    "ack-id": "the acknowledgement of an id change carries the id: new (default) or old",
    "result-flag": "flag of the save result: 17 (11 hex, default) or 18 (12 hex)",
    "result-address": "address in the save result: own (default) or 1005, on f1 and dg2 (one print)",
    "gap": "seconds of silence after which an unfinished request is forgotten (default 0.1)",
    "silence": "seconds of silence before and after a Modbus RTU request (default 0.00175)",
}
MODBUS_OPTIONS = {
    "most-written": "most registers that one Modbus request writes: 120 (default) or 123 (editions differ)"
}
CAN_OPTIONS = {
    "bitrate": "speed at the first start: 1000000 (default) or 500000",
    "ack": "acknowledgement of a write: count (the bytes written, default) or empty",
}

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
LATCHED = {  # fault -> (finger, error byte): another finger for each bit, so that a swap is seen
    "locked-rotor": (0, 1),
    "over-temperature": (1, 2),
    "over-current": (2, 4),
    "motor-abnormal": (4, 8),
    "communication": (4, 16),
    "unknown-bits": (3, 160),
}
ALL_FAULTS = (1, 2, 4, 6, 24, 0)  # error bytes of the state "faults" (dossier V14)
