"""One hour of requests for a fleet, simulated under several policies of booking drones.

`cases` draws networks, homes and requests. A `policy` says when a drone can be booked again.
`simulate` books the requests in turn: `find_mission` plans, `calendars` holds each drone's
missions. `measures` and `section` report.
"""
