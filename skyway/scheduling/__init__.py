"""A drone's calendar: where it stands after a mission, and when another mission can begin there.

`stays` lists where a drone stands after its last hand-over. `slots` chooses the stay at which the
next mission begins. `standby` ends a standby early, so that the next mission can begin.
"""
