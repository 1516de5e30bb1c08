"""Commands for drones: `skyway drone` and `skyway fleet` start the drone agent.

`upkeep` has the commands for batteries and maintenance.
"""
