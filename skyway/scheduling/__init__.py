"""A drone's calendar: where it stands after a mission, and when another mission can begin there.

`trip` is a drone's whole trip, `booked_pad` a pad that it reserves. `standby_search` finds where
the drone stands by after a delivery, among the ends of its `standby_choice`. `stays` lists where a
drone stands after its last hand-over. `slots` chooses the stay at which the next mission begins.
`standby` ends a standby early, so that the next mission can begin.
"""
