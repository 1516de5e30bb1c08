"""Fleets: the drones of each provider, their models, states, statistics and credentials.

`drone` is a drone on the wire, and `fleet_drone` a drone inside the registry. `registration` builds
new drones. `drone_states` decides the state that a provider sees.
"""
