"""Candidates: the drones that could fly a request, and why the other providers have none.

`fleet_view` keeps all fleets in memory as columns. `selection` decides and puts able drones in
order, and `reasons` explains why a provider has no candidate.
"""
