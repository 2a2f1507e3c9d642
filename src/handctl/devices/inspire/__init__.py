"""The devices of Inspire: the EH55BF1 exoskeleton hand (`exo`) and the wrist module (`wrist`). One frame, see `eb90`."""
