"""Presence: what each drone said last, and which mission it is said to be on."""
