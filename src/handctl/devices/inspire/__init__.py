"""The Inspire family: the EH55BF1 exoskeleton hand (`exo`). One frame format, see `eb90`."""
