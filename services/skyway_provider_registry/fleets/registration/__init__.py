"""Registration: one drone or a whole fleet in one call, with the accounts they log in with."""
