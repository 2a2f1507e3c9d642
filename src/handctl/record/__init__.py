"""Recordings that lose nothing: one row per answer in a CSV file, and a sidecar that says what the file holds. Knows no family."""
