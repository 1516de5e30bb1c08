"""Retention: deletes what is older than the settings keep.

`prune_deliveries` deletes deliveries that ended long ago, at composition first; its SQL is in
`delivery_store`. `prune_logs` deletes the oldest of the audit log and of webhooks' attempts, by
`log_store`, and what has expired. `start_pruning` starts the loops. `archived_tables` are
what `skyway archive` writes.
"""
