"""Deliveries on the simulator's days: promised against delivered."""
