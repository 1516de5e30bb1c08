"""What the sensors mean: charge, health, wind, consumption, and what can still be reached."""
