"""Stopping a device at once, whoever holds it and whatever happens to this process."""
