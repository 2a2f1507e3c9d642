"""Stop a device at once, even if another process is using it or this one is killed."""
