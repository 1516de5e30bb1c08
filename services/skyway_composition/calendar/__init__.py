"""Whether the world has moved since something was planned: one way to see it for all who plan.

Each plan is made with a snapshot of what was read: the state of the network, and the number of each
drone's calendar. `commit` locks all of it in one order, and compares. `store` reads and raises
the numbers.
"""
