"""Which bytes for the EH55BF1 write."""

from handctl.devices.inspire.exo.explain import explainer
from handctl.devices.inspire.explain import InspireWriteRules


def words() -> InspireWriteRules:
    """For the EH55BF1."""
    return InspireWriteRules(explainer())
