"""The remainder of a mission under way: where a new plan begins, and how it may end.

`anchor` is where and when it begins, `aims` where the packages go, `landing` where the drone can
land, and `planner` finds the best remainder.
"""
