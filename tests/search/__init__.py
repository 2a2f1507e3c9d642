"""The unbounded search: all cells of the generated suites, for as long as there is time. What it finds becomes a pin."""
