"""Which bytes for the RH56 hands write."""

from handctl.devices.inspire.explain import InspireWrites
from handctl.devices.inspire.hand.explain import explainer


def words() -> InspireWrites:
    """For a hand of byte addresses (DF, TP), until its answers show that it counts words."""
    return InspireWrites(explainer())
