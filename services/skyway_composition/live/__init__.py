"""What the gateway reads for its live picture: missions, pads, closures and alarms.

`routes` shapes and gives the answers, `live_store` reads the database.
"""
