"""Links to drones: the instructions we sent, in order, and the last messages we received.

`link` decides what follows from a drone's message, and recognises messages that change nothing.
`renewal_routes` forgets what came with a drone's earlier credentials. `courier` sends instructions,
`listening` knows since when no message was missed. `store` and `instruction_store` are the SQL.
"""
