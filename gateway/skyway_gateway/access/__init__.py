"""API keys: who is calling, and in which role.

`keys` issues and deletes keys, and finds the caller of a shown key. `routes` has the gate that asks
each request for a key. `store` has the SQL.
"""
