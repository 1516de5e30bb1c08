"""Closures: stations, pads, segments and areas that are closed, and ground stops.

`closure` is one closure and what it reaches, `conditions` all closures of a network as planning
needs them. `routes` and `handle_orders` are the REST side, `close` makes and lifts a closure with
all its effects, `store` is the SQL.
"""
