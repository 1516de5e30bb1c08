"""Verification: what must always hold in the registry's database (docs/reference/invariants.md).

`rules` lists all rules: of `drones` with their accounts and keys, and of `hints`: their presence,
the reported missions, and the change numbers. `facts` are compared with other services.
"""
