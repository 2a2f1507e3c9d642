"""The simulated EH55BF1 exoskeleton hand."""
