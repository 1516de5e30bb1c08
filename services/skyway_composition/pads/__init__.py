"""Reservations of pads, and how many pads of each station are occupied.

`pad_snapshot` holds the reservations that planning reads, `occupancy` counts occupied pads.
`store` and `occupied_store` are the SQL of both. `announce` publishes the occupancy over MQTT,
`routes` shows it over REST.
"""
