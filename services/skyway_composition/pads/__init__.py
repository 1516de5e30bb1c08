"""Reservations of pads, and how many pads of each station are occupied.

`booked_pad` is one reserved pad, `pad_snapshot` the reservations that planning reads, `occupancy`
counts occupied pads, `store` is the SQL of both. `announce` publishes the occupancy over MQTT,
`routes` shows it over REST.
"""
