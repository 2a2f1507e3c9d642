"""Which bytes for the EH55BF1 write."""

from handctl.devices.inspire.map import EXO
from handctl.devices.inspire.writes import InspireWrites


def words() -> InspireWrites:
    """For the EH55BF1."""
    return InspireWrites(EXO)
