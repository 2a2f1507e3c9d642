"""The AIDIN-hand over TCP with JSON objects."""
