"""The state machine of the RH56 hands: random valid commands against the simulator and a small model of the dossier."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from handctl.devices.inspire import id_baud_save_reset
from handctl.devices.inspire.hand import motion
from handctl.devices.inspire.hand.register_map import BYTE_MAP, DF, TP
from handctl.model.param import Element
from handctl.model.prompts import Prompts
from tests.inspire.rh56_support import CAN, EB90, RTU, TCP, hand_on

PLACES = [(DF, EB90), (DF, RTU), (DF, CAN), (TP, EB90), (TP, RTU), (TP, TCP), (TP, CAN)]
SIX = 6


def element(name: str, index: int = 0) -> Element:
    """One element of a register."""
    return BYTE_MAP[name].each[index]


class HandMachine(RuleBasedStateMachine):
    """Set-points move and are forgotten with the power; defaults are kept by a save and copied at power-on (rh56 §3.1)."""

    @initialize(place=st.sampled_from(PLACES))
    def begin(self, place: tuple[str, str]) -> None:
        self.model, self.wire = place
        self.hand: Any = hand_on(self.model, self.wire)
        self.held = {
            "id": [1],
            "default_speed": [701, 702, 703, 704, 705, 706], "default_force": [501, 502, 503, 504, 505, 506],
            "speed_set": [601, 602, 603, 604, 605, 606], "force_limit": [401, 402, 403, 404, 405, 406],
        }  # fmt: skip
        self.flash = {name: list(self.held[name]) for name in ("id", "default_speed", "default_force")}
        self.at: list[int | None] = [None] * SIX

    @rule(
        name=st.sampled_from(["default_speed", "default_force", "speed_set", "force_limit"]),
        finger=st.integers(0, 5),
        value=st.integers(1, 1000),
    )
    def set_one(self, name: str, finger: int, value: int) -> None:
        self.hand.write([(element(name, finger), value)])
        self.held[name][finger] = value

    @rule(
        name=st.sampled_from(["default_speed", "speed_set"]),
        values=st.lists(st.integers(1, 1000), min_size=6, max_size=6),
    )
    def set_all(self, name: str, values: list[int]) -> None:
        self.hand.write([(element(name, index), value) for index, value in enumerate(values)])
        self.held[name] = list(values)

    @rule(finger=st.integers(0, 5), value=st.integers(0, 1000))
    def move(self, finger: int, value: int) -> None:
        """Fast and with no limit that an empty hand reaches; only this finger."""
        self.hand.write([(element("speed_set", finger), 1000), (element("force_limit", finger), 1000)])
        self.held["speed_set"][finger] = self.held["force_limit"][finger] = 1000
        motion.move(self.hand, "angle_set", [(element("angle_set", finger), value)], Prompts(), wait=5.0)
        self.at[finger] = value

    @rule()
    def stop(self) -> None:
        assert self.hand.stop().error is None
        self.held["speed_set"] = [0] * SIX

    @rule(new=st.integers(1, 254))
    def change_id(self, new: int) -> None:
        if self.wire != TCP:
            id_baud_save_reset.change_id(self.hand, new)
            self.held["id"] = [new]

    @rule()
    def save(self) -> None:
        id_baud_save_reset.save(self.hand, Prompts())
        self.flash = {name: list(self.held[name]) for name in self.flash}

    @rule()
    def clear_errors(self) -> None:
        id_baud_save_reset.clear_errors(self.hand)

    @rule()
    def power_cycle(self) -> None:
        assert self.hand.link.power_cycle()
        self.hand.link.sleep(5.0)
        self.held.update({name: list(values) for name, values in self.flash.items()})
        self.held["speed_set"], self.held["force_limit"] = (
            list(self.held["default_speed"]),
            list(self.held["default_force"]),
        )
        self.hand.bus.id = self.held["id"][0]

    @invariant()
    def reads_equal(self) -> None:
        if not hasattr(self, "hand"):
            return
        for name, values in self.held.items():
            got = [reading.value for reading in self.hand.read(BYTE_MAP[name].each)]
            assert got == values, (name, got, values, self.model, self.wire)
        angles = [reading.value for reading in self.hand.read(BYTE_MAP["angle_actual"].each)]
        assert all(goal is None or abs(goal - now) <= 4 for goal, now in zip(self.at, angles, strict=True)), (
            self.at,
            angles,
        )
        errors = [reading.value for reading in self.hand.read(BYTE_MAP["error"].each)]
        assert errors == [0] * SIX
