"""Recordings without loss: one row per reply in a CSV file, and a sidecar that describes it. Knows no family."""
