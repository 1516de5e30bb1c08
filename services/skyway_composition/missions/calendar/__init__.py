"""The calendars of drones: missions that wait behind the missions before them.

A QUEUED mission is planned and its pads are reserved, but it is not sent. `keep_calendars` looks
after all of them. It decides (`next_mission`), ends a standby early or sends a mission
(`send_next`), and plans again what no longer fits (`plan_queue`, `move_queued`).
"""
