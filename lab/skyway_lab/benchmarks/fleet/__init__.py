"""Fleets: what a thousand drones need in one process, and five thousand of the cloud."""
