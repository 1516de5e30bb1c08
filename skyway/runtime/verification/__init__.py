"""Verification: the rules that a service's database must keep, and what breaks them.

`rule` is one rule with its advice, `survey` a database at one moment, `find_broken` checks rules.
`storage_rules` are the rules of every database: whole pages, foreign keys, claims that end.
`stored_forms` checks that stored texts can be read.
"""
