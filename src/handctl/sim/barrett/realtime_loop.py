"""RealTime mode of the simulated BarrettHand: control blocks in, feedback blocks out (barrett §5.3.3, §6).

Knows the blocks and what they mean for the motors. One byte comes at a time, at the end of its last bit: the header
alone starts the answer, so that answer and control data overlap, and the next block may come before the answer has left.

    host   C v1 v2                     control data by LCV LCPG (4.4: LCT), motors ascending
    hand     * s1 d1 s2 d2 d4 T T      feedback by LFV LFS LFAP LFDP (4.4: LFBP LFAIN), motors ascending, then LFT

The feedback shows the state before the block; the block acts when it is complete (§6.1). A velocity stays until another
one comes: there is no watchdog (our guess, the manual has none).
"""

from __future__ import annotations

from handctl.sim.barrett.mechanics import PRESS, Motor
from handctl.sim.barrett.parameter_tables import BAD_HEADER, TOO_HOT

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.barrett.shared_state import Board

LEAVE = 3  # ^C
ANALOG = (31, 47, 63, 79)  # LFAIN, invented
CONTROL = (("LCV", 1), ("LCPG", 1), ("LCT", 2))  # bytes
FEEDBACK = ("LFV", "LFS", "LFAP", "LFDP", "LFBP", "LFAIN")

OPTIONS = {
    "loop-exit": (("run", "stop"), "what the motors do after RealTime mode: run (default: the last velocity goes on) or stop"),
    "loop-jump": (("0,0,0,0", -20000, 20000), "F1,F2,F3,S: counts by which the joints jump once LOOP is entered (default 0,0,0,0)"),
    "loop-after": ((0, 0, 1000000000), "blocks of each LOOP that the RealTime faults spare (default 0)"),
    "loop-code": ((1, 1, 32767), "status of the fault loop-error (default 1)"),
    "lfv-unit": (("sample", "10ms"), "LFV in counts per sample (default) or per 10 ms: sample, 10ms"),
}  # fmt: skip
FAULTS = {
    "loop-error": "RealTime: an error takes the place of '*'",
    "loop-silent": "RealTime: deaf until a power cycle, the motors go on",
    "loop-drop": "RealTime: a byte of the feedback is missing",
    "loop-extra": "RealTime: one byte more after the feedback",
}


class Loop:
    """RealTime mode from `*` to its end; the flags are those at its entry (§6.1)."""

    def __init__(self, device: Board, motors: tuple[int, ...]) -> None:
        get, known = device.memory.motor.get, device.memory.motor.values
        self.device = device
        self.motors = [device.hand.motors[number] for number in motors]
        self._control = [
            (motor, name, size)
            for motor in self.motors
            for name, size in CONTROL
            if name in known and get(name, motor.number)
        ]
        self._size = sum(size for _, _, size in self._control)
        self._feedback = [
            (motor, name) for motor in self.motors for name in FEEDBACK if name in known and get(name, motor.number)
        ]
        self._temperature = device.memory.common.get("LFT") != 0
        self._short_temperature = "LCT" in known  # 4.4: one byte
        self._discard = device.memory.common.get("LFDPD") != 0
        # A coefficient of 0 (§5.3.3 allows it, §6.3 does not) stops the motor, or divides by 1: our guess.
        self._scale = {motor: get("LCVC", motor.number) for motor in self.motors}
        self._per_velocity = {motor: get("LFVC", motor.number) or 1 for motor in self.motors}
        self._per_delta = {motor: get("LFDPC", motor.number) or 1 for motor in self.motors}
        self._gain = {motor: get("FPG", motor.number) for motor in self.motors}
        self._velocity = dict.fromkeys(self.motors, 0.0)  # counts per sample
        self._torque: dict[Motor, int] = {}
        self._block = bytearray()
        self._wanted = 0  # control data still to come
        self._lost = False  # of a block that the hand does not hear
        self._blocks = 0
        for motor in self.motors:
            motor.code = 0
            motor.powered = True  # held at velocity 0 (our guess)

    # -- bytes in ----------------------------------------------------------------------------------------------------

    def hear(self, byte: int) -> None:
        if self._wanted:  # ^C here is data
            self._block.append(byte)
            self._wanted -= 1
            if not self._wanted and not self._lost:
                self._act()
            return
        self.device.hits = self.device.judge()
        self._lost = "deaf" in self.device.hits
        if byte in b"CcAa":
            self._hear_block(byte)
        elif not self._lost:
            self.device.leave_loop(0 if byte == LEAVE else BAD_HEADER)

    def _hear_block(self, header: int) -> None:
        device = self.device
        self._blocks += 1
        befall = device.hits if self._blocks > device.given["loop-after"] else frozenset()
        if "loop-silent" in befall:
            device.hang()
            return
        code = device.given["loop-code"] if "loop-error" in befall else TOO_HOT if device.hand.too_hot() else 0
        if code and not self._lost:  # control data that follow are typed at the prompt
            device.leave_loop(code)
            return
        if not self._lost:
            answer = b"*" + (self.feedback() if header in b"CA" else b"")
            if "loop-drop" in befall:
                answer = answer[: len(answer) // 2] + answer[len(answer) // 2 + 1 :]
            device.post(answer + (b"*" if "loop-extra" in befall else b""))
        if header in b"Cc":
            self._block.clear()
            self._wanted = self._size

    def block(self, velocity: int) -> bytes:
        """The control data of a block: this LCV for every motor, and its gain as it is."""
        datum = {"LCV": [velocity], "LCPG": [10], "LCT": [0, 0]}
        return bytes(byte for _, name, _ in self._control for byte in datum[name])

    # -- feedback ----------------------------------------------------------------------------------------------------

    def feedback(self) -> bytes:
        """The data of a feedback block, at this moment."""
        out = bytearray()
        for motor, name in self._feedback:
            out += self._datum(motor, name)
        if self._temperature:
            tenths = self.device.hand.tenths()
            if self._short_temperature:
                out.append(int(tenths / 10) & 255)
            else:
                out += _word(tenths)
        return bytes(out)

    def _datum(self, motor: Motor, name: str) -> bytes:
        device, now = self.device, self.device.now
        match name:
            case "LFV":
                # Clipped, and whole before it is divided (§6.2.2); that the nearest is taken is our guess.
                unit = 0.01 if device.given["lfv-unit"] == "10ms" else device.hand.sample(motor)
                velocity = int(round(motor.velocity(now) * unit) / self._per_velocity[motor])
                return bytes([max(-128, min(127, velocity)) & 255])
            case "LFS":
                return bytes([device.read("SG", motor.number)])
            case "LFAP":
                return _word(device.shown(motor.position(now)))
            case "LFDP":
                return bytes([self._delta(motor, device.placed(motor.position(now))) & 255])
            case "LFBP":
                return _word(device.shown(motor.broke_at))
        return bytes([ANALOG[motor.number]])

    def _delta(self, motor: Motor, position: int) -> int:
        """§6.2.3; division towards 0 is our guess, and so is that LFDPD drops the remainder too."""
        per = self._per_delta[motor]
        delta = max(-128, min(127, int((position - motor.reported) / per)))
        motor.reported = position if self._discard else motor.reported + delta * per
        return delta

    # -- control -----------------------------------------------------------------------------------------------------

    def _act(self) -> None:
        at = 0
        for motor, name, size in self._control:
            datum = self._block[at : at + size]
            at += size
            if name == "LCPG":
                self._gain[motor] = datum[0]
            elif name == "LCV":
                self._velocity[motor] = _signed(datum[0], 256) * self._scale[motor] / 16.0
            else:
                self._torque[motor] = _signed(datum[0] * 256 + datum[1], 65536)
        now = self.device.now
        for motor in self.motors:
            velocity, press = self._wish(motor)
            motor.cruise(now, velocity / self.device.hand.sample(motor), press)

    def _wish(self, motor: Motor) -> tuple[float, float]:
        """Counts per sample, and the strain at which the motor stalls: invented, but for sign and proportion.

        The command is proportional to the velocity error (§6.1): with a gain of 4 or more the motor follows, with less
        it lags, with 0 it stands. A torque (4.4) drives at a proportional speed.
        """
        if motor in self._torque:
            torque = max(-2032, min(2032, self._torque[motor]))
            return torque / 128.0, min(120.0, abs(torque) / 16.0)
        velocity = self._velocity[motor] * min(1.0, self._gain[motor] / 4.0)
        return velocity, min(120.0, PRESS * abs(velocity) * 16.0 / 100.0 * self._gain[motor] / 10.0)


def _signed(number: int, modulus: int) -> int:
    return number - modulus if number >= modulus // 2 else number


def _word(number: int) -> bytes:
    """Two bytes, high byte first."""
    return bytes([number >> 8 & 255, number & 255])
