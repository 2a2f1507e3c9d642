"""Which bytes for the RH56 hands write."""

from handctl.devices.inspire.hand.explain import explainer
from handctl.devices.inspire.writes import InspireWrites


def words() -> InspireWrites:
    """For a hand of byte addresses (DF, TP), until its answers show that it counts words."""
    return InspireWrites(explainer())
