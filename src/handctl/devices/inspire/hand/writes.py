"""Which bytes for the RH56 hands write, on each of their wires."""

from handctl.devices.inspire.hand.explain import explainer
from handctl.devices.inspire.hand.map import BYTE_MAP
from handctl.devices.inspire.modbuswords import EitherWrites


def words() -> EitherWrites:
    """For a hand of byte addresses (DF, TP), until its answers show that it counts words."""
    return EitherWrites(BYTE_MAP, explainer())
