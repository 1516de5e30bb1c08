"""The same Idempotency-Key, the same effect and the same answer, for a day."""
