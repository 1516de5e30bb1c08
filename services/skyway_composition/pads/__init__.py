"""Reservations of pads, and how many pads of each station are occupied.

`booked_pad` is one reserved pad, `pad_snapshot` the reservations that planning reads, `store` the
SQL of reservations. `occupancy` counts occupied pads, `occupancy_store` is its SQL, `announce`
publishes it over MQTT, `routes` shows it over REST.
"""
