"""The verifier: what must always hold in the databases of all services, and what breaks it.

`check` opens databases read-only and checks them. `gateway`, `registry` and `composition` have the
rules of one database each (docs/reference/invariants.md), and `across` those that compare two.

`rule` is one rule with its advice, and the database at one moment that it reads. `storage_rules`
are the rules of every database: whole pages, foreign keys, claims that end, messages that are sent,
and texts and secrets that can be read. `finders` find what breaks a rule. `facts` are what a rule
across two services compares.
"""
