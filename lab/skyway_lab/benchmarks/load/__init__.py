"""A synthetic city under load: how many deliveries a second a whole Skyway plans and dispatches."""
