"""API keys: who is calling, and in which role.

`issue_keys` makes and deletes keys, `recognise_keys` finds the caller of a shown key.
"""
