"""API keys: who is calling, and in which role.

`issue_keys` makes and deletes keys, `recognise_keys` finds the caller of a shown key. `routes` has
the gate that asks each request for a key.
"""
