"""Deliveries, from the request to the last package.

`lifecycle` decides: a delivery and what happened go in, the changed delivery and its events come
out. `records` stores deliveries. On these stand the rooms that act: `booking` plans packages that
wait, `apply_reports` applies mission reports, `reading` answers queries. `requests` accepts
requests, which it gives to `booking`, and cancels what can still be stopped; its `routes` are all
calls that change deliveries.
"""
