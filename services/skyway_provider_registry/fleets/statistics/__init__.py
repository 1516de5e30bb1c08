"""All drones together: how many are in which state, and how fresh what is known of them is."""
