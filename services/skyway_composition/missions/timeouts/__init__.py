"""Missions that are checked because time has passed.

`overdue` ends missions whose drones are silent, `late` checks plans with overdue steps, `loading`
ends missions that nobody has loaded in time, `store` finds all of them.
"""
