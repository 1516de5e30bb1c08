"""What cells cost: regions on one composition, and each region on a composition of its own.

`regions` is the world, `run` one run of it, and `routing` a hundred cells without their servers.
"""
