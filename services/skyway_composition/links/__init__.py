"""Links to drones: the instructions we sent, in order, and the last messages we received.

`link` decides what follows from a drone's message, `courier` sends instructions, `cached_links`
recognises messages that change nothing. `store` and `instruction_store` are the SQL.
"""
