"""Fleets: the drones of each provider, their models, states, statistics and credentials.

`drone` is a drone on the wire with the state that its provider sees, and `fleet_drone` a drone
inside the registry. `registration` builds new drones. `issue_credentials` gives drones tokens,
passwords, keys and certificates.
"""
