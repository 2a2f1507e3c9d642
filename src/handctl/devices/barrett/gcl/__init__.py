"""The Grasper Control Language: connecting, baud rate, commands, passthrough (barrett §5)."""
