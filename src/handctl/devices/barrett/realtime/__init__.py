"""The RealTime loop: blocks, guards, schedules, and the way out of it (barrett §6)."""
