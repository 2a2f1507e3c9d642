"""Care of the hand: diagnosis, maintenance, strain gauges, fingertips (barrett §7 to §9)."""
