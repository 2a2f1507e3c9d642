"""What recorded bytes of the EH55BF1 mean, and which of them write."""

from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.explain_bytes import InspireExplainer, InspireWriteRules


def explainer() -> InspireExplainer:
    """For the EH55BF1."""
    return InspireExplainer(EXO)


def words() -> InspireWriteRules:
    """For the EH55BF1."""
    return InspireWriteRules(explainer())
