"""What recorded bytes of the RH56 hands mean, and which of them write: EB 90, CAN, Modbus RTU and Modbus TCP, by the map of their generation."""

from handctl.devices.inspire.explain_bytes import Generation, InspireExplainer, InspireWriteRules
from handctl.devices.inspire.hand.register_map import BYTE_MAP, DF, DG2, DG2_MAP, F1, F1_MAP, TP
from handctl.devices.inspire.identity import is_dg2, is_f1, is_six_wide

GENERATIONS = (
    Generation((DF, TP), "an RH56 of byte addresses", BYTE_MAP, 1, is_six_wide),
    Generation((F1,), "an RH56F1", F1_MAP, 2, is_f1),
    Generation((DG2,), "an RH5DG2", DG2_MAP, 2, is_dg2),
)


def explainer() -> InspireExplainer:
    """For a hand of byte addresses, until the bytes or an event show another generation."""
    return InspireExplainer(BYTE_MAP, GENERATIONS)


def words() -> InspireWriteRules:
    """For a hand of byte addresses (DF, TP), until its answers show that it counts words."""
    return InspireWriteRules(explainer())
