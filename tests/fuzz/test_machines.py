"""One state machine per device: random valid commands against the simulator and a small model of the manual.

The models are written from the manuals here and know neither handctl's maps nor the simulators: what is read must
always be what the model says. Virtual time; the same examples in each run, any number of others in `tests/search/fuzz.py`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from handctl.devices.aidin import homing_and_bias as modes
from handctl.devices.aidin import motion as aidin_motion
from handctl.devices.aidin.motion import parse
from handctl.devices.aidin.parameter_map import AIDIN, ENCODERS
from handctl.devices.barrett import motion as barrett_motion
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.devices.inspire import id_baud_save_reset
from handctl.devices.inspire.exo import device as exo_motion
from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.errors import UsageError
from handctl.model.param import Element
from handctl.model.prompts import Prompts
from tests.aidin import support as aidin_support
from tests.barrett import support as barrett_support
from tests.fuzz.hand_machine import HandMachine
from tests.inspire.wrist_support import WIRES, fake_wrist, wrist_on
from tests.support.cli import POWER_ON, run
from tests.support.scripted import fake_link, hand_on


def element(params: Any, name: str, index: int = 0) -> Element:
    """One element of a quantity of a map."""
    return Element(params[name], index)


# -- exo: registers in RAM, two of them in flash, setpoints that move (exo §2.3) --------------------------------------

SPEEDS = (115200, 57600, 19200)


class ExoMachine(RuleBasedStateMachine):
    """id acts at once, a speed behind save and power-off; a position setpoint moves its finger, -1 leaves it."""

    def __init__(self) -> None:
        super().__init__()
        self.link = fake_link()
        self.ram = {"id": 1, "baud_code": 0}
        self.flash = dict(self.ram)
        self.at: list[int | None] = list(POWER_ON["position_actual"][2][:5])
        self.fresh()

    def fresh(self) -> None:
        """What holds behind power-on; the fingers stay where they are."""
        self.ram = dict(self.flash)
        self.position = list(POWER_ON["position_set"][2])
        self.force = list(POWER_ON["force_set"][2])
        self.link.set_baud(SPEEDS[self.ram["baud_code"]])
        self.hand = hand_on(self.link, self.ram["id"])

    def settle(self) -> None:
        """1000 units take 0.8 s."""
        self.link.sleep(1.5)

    @rule(finger=st.integers(0, 4), value=st.integers(-1, 1000))
    def set_position(self, finger: int, value: int) -> None:
        self.hand.write([(element(EXO, "position_set", finger), value)])
        self.position[finger] = value
        if value >= 0:
            self.at[finger] = value
        self.settle()

    @rule(values=st.lists(st.integers(0, 1000), min_size=5, max_size=5))
    def command_positions(self, values: list[int]) -> None:
        exo_motion.move(self.hand, dict(enumerate(values)), Prompts(), wait=5.0)
        self.position, self.at = list(values), list(values)

    @rule(finger=st.integers(0, 4), value=st.integers(-1000, 1000))
    def set_force(self, finger: int, value: int) -> None:
        self.hand.write([(element(EXO, "force_set", finger), value)])
        self.force[finger] = value

    @rule(values=st.lists(st.integers(-1000, 1000), min_size=5, max_size=5))
    def command_forces(self, values: list[int]) -> None:
        self.hand.command("force", values)
        self.force = list(values)

    @rule(new=st.integers(1, 254))
    def change_id(self, new: int) -> None:
        id_baud_save_reset.change_id(self.hand, new)
        self.ram["id"] = new

    @rule(code=st.integers(0, 2))
    def change_baud(self, code: int) -> None:
        id_baud_save_reset.change_baud(self.hand, SPEEDS[code])
        self.ram["baud_code"] = code

    @rule()
    def save(self) -> None:
        id_baud_save_reset.save(self.hand, Prompts())
        self.flash = dict(self.ram)

    @rule()
    def clear_errors(self) -> None:
        id_baud_save_reset.clear_errors(self.hand)

    @rule()
    def power_cycle(self) -> None:
        self.link.power_cycle()
        self.fresh()

    @rule(
        name=st.sampled_from(["position_set", "force_set", "id", "baud_code"]),
        value=st.sampled_from([-1001, 1001, 255, 4000, -2]),
    )
    def refuse(self, name: str, value: int) -> None:
        low, high = {"position_set": (-1, 1000), "force_set": (-1000, 1000), "id": (1, 254), "baud_code": (0, 2)}[name]
        if not low <= value <= high:
            with pytest.raises(UsageError):
                EXO[name].parse(str(value))

    @invariant()
    def reads_equal(self) -> None:
        names = ("id", "baud_code", "position_set", "force_set", "position_actual", "error")
        wanted = [element(EXO, name, index) for name in names for index in range(EXO[name].count)]
        got = [reading.value for reading in self.hand.read(wanted)]
        actual = got[12:17]
        assert got[:12] == [self.ram["id"], self.ram["baud_code"], *self.position, *self.force]
        assert all(at is None or at == now for at, now in zip(self.at, actual, strict=True)), (self.at, actual)
        assert got[18:] == [0] * 5


# -- wrist: three setpoints, an arrival (wrist §2.1) -------------------------------------------------------------------


class WristMachine(RuleBasedStateMachine):
    """Angles in hundredths of a degree; both axes are there when the set time is over."""

    @initialize(wire=st.sampled_from(WIRES))
    def begin(self, wire: str) -> None:
        _, self.link = fake_wrist(wire)
        self.wrist = wrist_on(self.link)
        self.adopt()

    def adopt(self) -> None:
        """The manual does not say which setpoints hold at power-on."""
        self.pitch, self.yaw, self.time = (reading.value for reading in self.wrist.read(self.setpoints()))
        self.there = False

    @staticmethod
    def setpoints() -> list[Element]:
        return [element(WRIST, name) for name in ("pitch_set", "yaw_set", "move_time")]

    @rule(pitch=st.integers(-2266, 2212), yaw=st.integers(-2550, 2550), ms=st.integers(1, 3000))
    def move(self, pitch: int, yaw: int, ms: int) -> None:
        self.wrist.move(self.wrist.targets(pitch / 100, yaw / 100, ms), Prompts(), wait=10.0)
        self.pitch, self.yaw, self.time, self.there = pitch / 100, yaw / 100, ms, True

    @rule(which=st.sampled_from(["pitch", "yaw"]), value=st.integers(-2266, 2212))
    def set_angle(self, which: str, value: int) -> None:
        self.wrist.write([(element(WRIST, f"{which}_set"), value / 100)])
        setattr(self, which, value / 100)
        self.there = False

    @rule(ms=st.integers(1, 3000))
    def set_time(self, ms: int) -> None:
        self.wrist.write([(element(WRIST, "move_time"), ms)])
        self.time = ms

    @rule()
    def power_cycle(self) -> None:
        self.link.power_cycle()
        self.adopt()

    @rule(
        name=st.sampled_from(["pitch_set", "yaw_set"]),
        value=st.sampled_from(["22.13", "-22.67", "25.51", "-25.51", "400"]),
    )
    def refuse(self, name: str, value: str) -> None:
        low, high = {"pitch_set": (-22.66, 22.12), "yaw_set": (-25.5, 25.5)}[name]
        if not low <= float(value) <= high:
            with pytest.raises(UsageError):
                WRIST[name].parse(value)

    @invariant()
    def reads_equal(self) -> None:
        if not hasattr(self, "wrist"):
            return
        actual = [element(WRIST, name) for name in ("pitch_actual", "yaw_actual")]
        got = [reading.value for reading in self.wrist.read([*self.setpoints(), *actual])]
        assert got[:3] == [self.pitch, self.yaw, self.time]
        if self.there:
            assert abs(got[3] - self.pitch) <= 0.05 and abs(got[4] - self.yaw) <= 0.05, (got, self.pitch, self.yaw)


# -- barrett: RAM and EEPROM, the reach of movements (barrett §5) ------------------------------------------------------

# mnemonic -> factory values of F1 F2 F3 SPREAD, largest value that is tried
PARAMETERS: dict[str, tuple[tuple[int, ...], int]] = {
    "DP": ((8500, 8500, 8500, 1575), 3000),
    "DS": ((1700, 1700, 1700, 315), 3000),
    "MCV": ((100, 100, 100, 60), 100),
    "CT": ((17000, 17000, 17000, 3150), 3000),
    "OT": ((0, 0, 0, 0), 100),
    "TSTOP": ((30, 30, 30, 30), 1000),
    "FPG": ((10, 10, 10, 10), 255),
    "EN": ((1, 1, 1, 1), 1),
}
MOTORS = st.sets(st.integers(0, 3), min_size=1)
LEAST = {"MCV": 16, "TSTOP": 1, "FPG": 1, "EN": 1}


class BarrettMachine(RuleBasedStateMachine):
    """FSET writes RAM, FSAVE keeps it, FLOAD and power-on bring it back; a movement ends at its target."""

    def __init__(self) -> None:
        super().__init__()
        self.hand, self.link = barrett_support.simulated()
        self.ram = {name: list(values) for name, (values, _) in PARAMETERS.items()}
        self.eeprom = {name: list(values) for name, values in self.ram.items()}
        self.at: list[int | None] = [0, 0, 0, 0]
        self.homed = True

    def ask(self, command: str) -> None:
        self.hand.checked(self.hand.line.ask(command, at_least=2.0))

    @rule(name=st.sampled_from(sorted(PARAMETERS)), motor=st.integers(0, 3), data=st.data())
    def set(self, name: str, motor: int, data: st.DataObject) -> None:
        value = data.draw(st.integers(LEAST.get(name, 0), PARAMETERS[name][1]))
        self.hand.write([(element(BARRETT, BARRETT.find(name)[0].name, motor), value)])
        self.ram[name][motor] = value

    @rule()
    def save(self) -> None:
        self.ask("FSAVE")
        self.eeprom = {name: list(values) for name, values in self.ram.items()}

    @rule()
    def load(self) -> None:
        self.ask("FLOAD")
        self.ram = {name: list(values) for name, values in self.eeprom.items()}

    @rule()
    def defaults(self) -> None:
        self.ask("FDEF")
        self.ram = {name: list(values) for name, (values, _) in PARAMETERS.items()}

    @rule()
    def power_cycle(self) -> None:
        self.link.power_cycle()
        self.link.sleep(5.0)
        self.hand = barrett_support.hand_on(self.link)
        self.hand.line.connect()
        self.ram = {name: list(values) for name, values in self.eeprom.items()}
        self.homed = False
        self.at = [None] * 4

    @rule()
    def init(self) -> None:
        barrett_motion.move(self.hand, "", "HI", None, Prompts())
        self.homed, self.at = True, [0, 0, 0, 0]

    @precondition(lambda self: self.homed)
    @rule(motors=MOTORS, name=st.sampled_from(["M", "C", "O", "HOME", "IC"]), count=st.none() | st.integers(0, 3000))
    def move(self, motors: set[int], name: str, count: int | None) -> None:
        count = count if name in ("M", "IC") else None
        goals = {}
        for motor in motors:
            step = self.ram["DS"][motor] if count is None else count
            place = self.at[motor]
            goals[motor] = {
                "M": self.ram["DP"][motor] if count is None else count, "C": self.ram["CT"][motor],
                "O": self.ram["OT"][motor], "HOME": 0, "IC": None if place is None else place + step,
            }[name]  # fmt: skip
        prefix = "".join(str(motor + 1) for motor in sorted(motors))
        barrett_motion.move(self.hand, prefix, name, count, Prompts())
        for motor, goal in goals.items():
            reachable = goal is not None and goal <= (3150 if motor == 3 else 17000)
            self.at[motor] = goal if reachable else None  # at a joint stop: the manual says "approximately" where

    @invariant()
    def reads_equal(self) -> None:
        wanted = [
            element(BARRETT, BARRETT.find(name)[0].name, motor) for name in (*PARAMETERS, "P") for motor in range(4)
        ]
        got = [reading.value for reading in self.hand.read(wanted)]
        assert got[:-4] == [value for name in PARAMETERS for value in self.ram[name]]
        for now, goal in zip(got[-4:], self.at, strict=True):
            assert goal is None or abs(now - goal) <= 50, (got[-4:], self.at)  # MPE, the position error it may have


# -- ekso: settings one by one, within this tool's policy (ekso §6, ParameterID table) --------------------------------

# name -> value of the simulated clinic preset, largest step of one write, decimals
EKSO: dict[str, tuple[float, float]] = {
    "step_length": (14.75, 1.0),
    "step_height": (2.0, 0.5),
    "forward_shift": (-0.75, 0.5),
    "lateral_shift": (1.25, 0.5),
}


class EksoMachine(RuleBasedStateMachine):
    """A setting within the step is written and stays over power-off; a larger one is refused, and nothing changes."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = tempfile.TemporaryDirectory()
        self.environment = {"XDG_STATE_HOME": self.folder.name}
        rows = self.do("settings").rows
        self.model: dict[str, float] = {row["name"]: row["value"] for row in rows}
        self.logged = {name: {value} for name, value in self.model.items()}
        """The values of the last 10 s, by the log of this user: the simulated clock stands between two commands."""

    def teardown(self) -> None:
        self.folder.cleanup()

    def do(self, *args: str, power: int = 0) -> Any:
        link = f"fake://ekso?clock=virtual&sway=0&state={Path(self.folder.name) / 'state'}&power-cycle={power}"
        return run("ekso", *args, "-p", link, "--json", env=self.environment)

    @rule(name=st.sampled_from(sorted(EKSO)), hundredths=st.integers(-130, 130))
    def set(self, name: str, hundredths: int) -> None:
        value = round(self.model[name] + hundredths / 100, 2)
        done = self.do("set", f"{name}={value}", "--yes", "--operator", "me")
        step = max(abs(value - before) for before in {self.model[name], *self.logged[name]})
        allowed = round(step * 100) <= round(EKSO[name][1] * 100) and (value >= 0 or "shift" in name)
        assert done.code == (0 if allowed else 2), done
        if allowed:
            self.model[name] = value
            self.logged[name].add(value)

    @rule()
    def another_user(self) -> None:
        """Whose log knows of no write: their steps count from here."""
        self.environment = {"XDG_STATE_HOME": tempfile.mkdtemp(dir=self.folder.name)}
        self.logged = {name: {value} for name, value in self.model.items()}

    @rule()
    def power_cycle(self) -> None:
        assert self.do("get", "step_length", power=1).code == 0

    @invariant()
    def reads_equal(self) -> None:
        rows = self.do("settings").rows
        assert {row["name"]: row["value"] for row in rows} == self.model


# -- aidin: homing sets the origin, targets are reached and what is not named stays (aidin, modes) ---------------------

# (finger, element) -> range in counts, from the manual's ranges
COUNTS = {"thumb": (280_000, 280_000, 210_000)}
OTHERS = (440_000, 440_000, 170_000)


class AidinMachine(RuleBasedStateMachine):
    """Encoder targets of one motor at a time, joints, stop, homing, power-off."""

    def __init__(self) -> None:
        super().__init__()
        self.hand, self.link = aidin_support.simulated(start="homed")
        self.homed = True
        self.at: list[int | None] = [None] * 15
        self.torque: int | None = None

    @rule()
    def home(self) -> None:
        modes.home(self.hand, Prompts())
        self.homed, self.at = True, [0] * 15

    @precondition(lambda self: self.homed)
    @rule()
    def initial(self) -> None:
        modes.initial(self.hand, Prompts(), assume_homed=True)
        self.at = [0] * 15

    @precondition(lambda self: self.homed)
    @rule(
        finger=st.sampled_from(["thumb", "index", "middle", "ring", "little"]),
        motor=st.integers(0, 2),
        part=st.integers(0, 30),
    )
    def encoders(self, finger: str, motor: int, part: int) -> None:
        value = COUNTS.get(finger, OTHERS)[motor] * part // 100
        goal = parse(ENCODERS, [f"{finger}.m{motor + 1}={value}"])
        aidin_motion.move(self.hand, goal, Prompts(), assume_homed=True)
        index = 3 * ["thumb", "index", "middle", "ring", "little"].index(finger) + motor
        self.at[index] = value

    @rule(value=st.integers(700, 1000))
    def max_torque(self, value: int) -> None:
        modes.max_torque(self.hand, value)

    @rule()
    def bias(self) -> None:
        modes.bias(self.hand)

    @rule(
        text=st.sampled_from(["index.m1=440001", "index.m1=-1", "thumb.m3=210001", "ring.m3=170001", "thumb.m1=280001"])
    )
    def refuse(self, text: str) -> None:
        with pytest.raises(UsageError):
            parse(ENCODERS, [text])

    @invariant()
    def reads_equal(self) -> None:
        got = [reading.value for reading in self.hand.read([element(AIDIN, "motor_pos", index) for index in range(15)])]
        for index, (now, goal) in enumerate(zip(got, self.at, strict=True)):
            assert goal is None or abs(now - goal) <= 600, (index, got, self.at)


MACHINES: dict[str, tuple[type[RuleBasedStateMachine], int, int]] = {
    "exo": (ExoMachine, 30, 15),
    "wrist": (WristMachine, 15, 10),
    "hand": (HandMachine, 15, 10),
    "barrett": (BarrettMachine, 20, 12),
    "ekso": (EksoMachine, 3, 8),
    "aidin": (AidinMachine, 2, 8),
}
"""Machine, examples and steps of the default run: `tests.search` runs them without end."""
QUIET = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much, HealthCheck.large_base_example]


@pytest.mark.parametrize("name", MACHINES)
def test_machine(name: str) -> None:
    machine, examples, steps = MACHINES[name]
    run_state_machine_as_test(  # type: ignore[no-untyped-call]
        machine,
        settings=settings(
            max_examples=examples, stateful_step_count=steps, deadline=None, derandomize=True, database=None,
            suppress_health_check=QUIET, phases=[Phase.generate],
        ),
    )  # fmt: skip
