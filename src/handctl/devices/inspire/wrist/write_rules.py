"""Which bytes for the wrist module and the hand behind it, on both wires write."""

from handctl.devices.inspire.explain import InspireWriteRules
from handctl.devices.inspire.wrist.explain import explainer


def words() -> InspireWriteRules:
    """For the wrist module and the hand behind it, on both wires."""
    return InspireWriteRules(explainer())
