"""What the simulated devices of the Inspire family share."""
