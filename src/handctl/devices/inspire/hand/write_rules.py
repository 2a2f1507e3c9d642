"""Which bytes for the RH56 hands write."""

from handctl.devices.inspire.explain import InspireWriteRules
from handctl.devices.inspire.hand.explain import explainer


def words() -> InspireWriteRules:
    """For a hand of byte addresses (DF, TP), until its answers show that it counts words."""
    return InspireWriteRules(explainer())
