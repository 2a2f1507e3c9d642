"""Which bytes for the EH55BF1 write."""

from handctl.devices.inspire.exo.explain import explainer
from handctl.devices.inspire.explain import InspireWrites


def words() -> InspireWrites:
    """For the EH55BF1."""
    return InspireWrites(explainer())
