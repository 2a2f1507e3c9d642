"""What recorded bytes of the EH55BF1 mean."""

from handctl.devices.inspire.explain import InspireExplainer
from handctl.devices.inspire.map import EXO


def explainer() -> InspireExplainer:
    """For the EH55BF1."""
    return InspireExplainer(EXO)
