"""Fleets: the drones of each provider, their models, states, statistics and credentials.

`drone` is a drone on the wire with the state that its provider sees, and inside the registry.
`registration` builds new drones. `issue_credentials` makes drones' tokens, passwords, keys and
certificates.
"""
