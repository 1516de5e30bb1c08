"""Skyway networks and their versions, which operators publish.

`publish` makes a version current and announces it over MQTT, `prepared` caches parsed versions for
planning, `settings` are a network's settings. `pickup_store` reads where a provider's next pickup
is expected. `routes` and `station_routes` are the REST side, also
for other services' questions about stations. `store` and `station_store` are the SQL.
"""
