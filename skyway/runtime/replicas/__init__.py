"""The replicas of a service on one database: which are live, which leads, which owns a drone.

`share` decides from a list of live replicas. `replica_store` keeps this list in the database.
`membership` adds this replica to the list, reads the list again and again, and remembers the
earlier lists.
"""
