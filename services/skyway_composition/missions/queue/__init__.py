"""The queues of drones: missions that wait behind the missions before them.

A QUEUED mission is planned and its pads are reserved, but it is not sent. `keep_calendars` looks
after all of them. `plan_queue` decides, and plans again what no longer fits. `move_queued` sends a
mission, moves it or drops it, and ends a standby early. `store` is the SQL.
`dispatching` exchanges what waits between drones.
"""
