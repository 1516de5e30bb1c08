"""Verification: the rules that a service's database must keep, and what breaks them.

`rule` is one rule with its advice, `survey` a database at one moment, `find_broken` checks rules.
`check` checks a whole database, and writes `fact_files` for the rules across services.
`storage_rules` are the rules of every database: whole pages, foreign keys, claims that end.
`outbox_rules` are the rules of messages that wait. `stored_forms` checks that stored texts can be
read, and `hash_forms` reads what is stored of secrets.
"""
