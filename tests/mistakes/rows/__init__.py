"""The seeded mistakes, a module for each room of the source; each has ROWS."""
