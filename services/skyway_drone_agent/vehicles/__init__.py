"""What flies, as the agent sees it: the interface, one reading of its sensors, its battery."""
