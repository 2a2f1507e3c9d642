"""python -m handctl.sim: the simulators without the rest of the tool."""

from handctl.sim.cli import cli

if __name__ == "__main__":
    cli(prog_name="python -m handctl.sim")
