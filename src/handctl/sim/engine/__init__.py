"""What every simulated device stands on: the line, its faults, time, the control socket, the servers."""
