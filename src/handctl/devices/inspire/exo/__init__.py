"""The EH55BF1 exoskeleton hand."""
