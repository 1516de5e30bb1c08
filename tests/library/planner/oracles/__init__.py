"""Judges of the planner that share nothing with it but the form of a problem and of a network.

`instances` makes problems, `grid` and `milp` solve them in other ways, `judge` compares, `sweep`
does it thousands of times. Run from tests/library/planner: ``python -m oracles.sweep --help``.
"""
