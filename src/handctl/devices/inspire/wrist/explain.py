"""What recorded bytes of the wrist module and the hand behind it, on both wires mean."""

from handctl.devices.inspire.explain import InspireExplainer
from handctl.devices.inspire.map import WRIST


def explainer() -> InspireExplainer:
    """For the wrist module and the hand behind it, on both wires."""
    return InspireExplainer(WRIST)
