"""A simulated drone, its sensors, and its disturbances."""
