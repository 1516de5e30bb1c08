"""The ledger: what customers pay and providers get, by month.

`line` is a line of the ledger, and `store` its SQL. `statement` is the sum of a party's lines in a
month; `routes` shows statements and lines, and `page` prints them. `close_months` closes the months
that are over. Docs: docs/money.md.
"""
