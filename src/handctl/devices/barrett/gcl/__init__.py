"""The Grasper Control Language: meeting the hand, its speed, its commands, the passthrough (barrett §5)."""
