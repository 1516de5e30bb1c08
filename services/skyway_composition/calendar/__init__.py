"""Detects changes between planning and commit, in one way for everything that plans.

Each plan is made with a snapshot of what was read: the state of the network, and the number of each
drone's calendar. `attempts` is the loop in which every cause proposes its change and commits it.
`commit` locks all that was read in one order, and compares. `store` reads and raises the numbers.
"""
