"""Verification: the rules that a service's database must keep, and the search for what breaks them.

`rule` is one rule with its advice, and the database at one moment that it reads. `check` checks the
rules of a whole database, and writes `fact_files` for the rules across services. `storage_rules`
are the rules of every database: whole pages, foreign keys, claims that end, messages that are sent.
`stored_forms` checks that stored texts and secrets can be read.
"""
