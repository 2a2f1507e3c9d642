"""Each promise of README, the guides and the helps, held against every family and command: a cell each.

Where a promise does not hold by intent, the family's module `page` says why, and handctl-output(7) shows it. `python -m tests.promises`
prints the matrix.
"""
