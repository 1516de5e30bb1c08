"""`python -m skyway_lab overload`: more is asked than the system can carry, and then less again.

`stages` offers several times the capacity, one stage after another. `quota` gives each process a
share of a core. `picture` draws what was offered, and what was done.
"""
