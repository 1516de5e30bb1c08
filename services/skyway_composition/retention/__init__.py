"""Retention: deletes what is old.

`forget_routes` deletes deliveries that ended long ago when the gateway asks for it; its SQL is in
`forget_store`. `prune` deletes old closures and alarms. `archived_tables` are what `skyway archive`
writes.
"""
