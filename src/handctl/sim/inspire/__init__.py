"""The simulated devices of the Inspire family."""
