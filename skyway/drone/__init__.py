"""The physics of a drone, used by the planner and by the simulated drone alike."""
