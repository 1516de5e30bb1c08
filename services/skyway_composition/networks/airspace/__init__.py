"""Where drones fly in a network, and where not: its segments and zones."""
