"""A mission: its record, its steps and custody, the lock on it, and what it tells others."""
