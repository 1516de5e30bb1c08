"""One hour of requests for a fleet, simulated under several policies of booking drones.

`cases` draws networks, homes and requests. `calendars` holds each drone's missions under a policy,
which says when a drone can be booked again. `find_mission` plans a request. `measures` simulates
the hour and adds it up, `section` reports.
"""
