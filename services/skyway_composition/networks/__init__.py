"""Skyway networks and their versions, which operators publish.

`publish` makes a version current, `prepared` caches parsed versions for planning, `announce`
publishes current versions over MQTT, `settings` are a network's settings. `routes` and
`station_routes` are the REST side, `station_check` answers other services about stations, `store`
and `station_store` are the SQL.
"""
