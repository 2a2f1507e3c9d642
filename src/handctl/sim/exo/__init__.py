"""The simulated EH55BF1 exoskeleton hand."""

from handctl.sim.inspire import EB90

SUMMARY = "exoskeleton hand EH55BF1 (serial)."
WIRES = ("serial",)

FACTS: dict[str, dict[object, str]] = {
    **EB90,
    "speed-register": {1001: "", 1002: "fault=baud-at-1002"},
    "set-points-at-power-on": {-1: "fault=fresh"},
}
"""What a fact about a real one makes of the simulated one, see `engine.facts_file`."""
