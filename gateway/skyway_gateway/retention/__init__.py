"""Retention: deletes what is older than the settings keep.

`pruning` has the steps and starts their loops: deliveries that ended long ago, at composition
first; the oldest of the audit log and of webhooks' attempts; and what has expired. `store` has the
SQL. `archived_tables` are what `skyway archive` writes.
"""
