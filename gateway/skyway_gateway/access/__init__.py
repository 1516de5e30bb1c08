"""API keys: who is calling, and in which role; and the audit log: what they changed.

`keys` issues and deletes keys with the broker accounts of people, and `recognise` finds the holder
of a shown key. `routes` gives the caller of each request. `store` has the SQL. `audit_trail` writes
one entry for each call of an operator or provider that may change something, and about refused
keys.
"""
