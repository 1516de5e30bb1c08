"""The replicas of a service on one database: who lives, who leads, and who owns which drone.

`share` decides from a list of live replicas. `replica_store` keeps this list in the database.
`membership` joins it, reads it again and again, and remembers the earlier ones.
"""
