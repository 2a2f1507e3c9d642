"""What recorded bytes of the EH55BF1 mean, and which of them write."""

from handctl.devices.inspire.explain_bytes import InspireExplainer, InspireWriteRules
from handctl.devices.inspire.register_map import EXO


def explainer() -> InspireExplainer:
    """For the EH55BF1."""
    return InspireExplainer(EXO)


def words() -> InspireWriteRules:
    """For the EH55BF1."""
    return InspireWriteRules(explainer())
