"""The simulated wrist module."""
