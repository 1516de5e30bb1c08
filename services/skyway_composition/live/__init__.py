"""What the gateway reads for its live picture: missions, pads, closures and alarms.

`routes` answers, `live_store` reads the database, `present` shapes the answers.
"""
