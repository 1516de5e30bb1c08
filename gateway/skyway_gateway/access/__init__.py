"""API keys: who is calling, and in which role; and the audit log: what they changed.

`keys` issues and deletes keys, and finds the caller of a shown key. `routes` gives the
caller of each request. `store` has the SQL. `broker_accounts` opens and closes the broker
accounts of people with their keys. `audit_trail` writes one entry for each call of an
operator or provider that may change something.
"""
