"""What recorded bytes of the wrist module and the hand behind it mean, on both wires, and which of them write."""

from handctl.devices.inspire.explain_bytes import InspireExplainer, InspireWriteRules
from handctl.devices.inspire.wrist.register_map import WRIST


def explainer() -> InspireExplainer:
    """For the wrist module and the hand behind it, on both wires."""
    return InspireExplainer(WRIST)


def words() -> InspireWriteRules:
    """For the wrist module and the hand behind it, on both wires."""
    return InspireWriteRules(explainer())
