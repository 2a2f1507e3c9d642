"""The simulated AIDIN-hand."""
