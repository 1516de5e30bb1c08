"""Statistics of deliveries, by state, provider and time."""
