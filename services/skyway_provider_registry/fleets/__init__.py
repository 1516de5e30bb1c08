"""Fleets: the drones of each provider, and the models they are of."""
