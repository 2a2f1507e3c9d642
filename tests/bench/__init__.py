"""Measurements anyone can repeat: `python -m tests.bench`. Every figure is a ratio to a floor of the same run."""
