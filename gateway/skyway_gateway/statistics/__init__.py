"""How deliveries go, by state, provider and time."""
