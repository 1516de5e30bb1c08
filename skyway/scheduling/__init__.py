"""A drone's calendar: where it stands after a mission, and when another mission can begin there.

`trip` is a drone's whole trip with the pads that it reserves, and may end its standby early for the
next mission. `standby` finds where the drone goes after a delivery. `stays` lists where a drone
stands after its last hand-over, and chooses the stay at which the next mission begins. `giving_way`
says which pads of a standby another drone's service may use. `repositioning` says where a drone
waits so that the next pickup is near.
"""
