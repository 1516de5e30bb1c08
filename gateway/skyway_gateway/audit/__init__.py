"""The audit log: one entry for each call of an operator or provider that may change something."""
