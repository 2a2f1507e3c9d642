"""Which bytes for the wrist module and the hand behind it, on both wires write."""

from handctl.devices.inspire.explain import InspireWrites
from handctl.devices.inspire.wrist.explain import explainer


def words() -> InspireWrites:
    """For the wrist module and the hand behind it, on both wires."""
    return InspireWrites(explainer())
