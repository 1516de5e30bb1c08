"""Missions: booked in one transaction, sent to a drone, followed to their end.

`mission` is what all rooms share: the record of a mission, its steps, the custody of its packages,
the lock on it, and what it sends to its drone and reports to others. On top of it:

- `booking` makes missions of the best offer,
- `following` handles what drones report,
- `replanning` finds new plans for missions whose plan no longer holds,
- `interventions` are what people do to missions: load, command, cancel,
- `closure_impact` finds the missions that a closure hits,
- `timeouts` checks missions because time has passed,
- `queue` looks after the missions that wait behind other missions,
- `schedule` shows the calendars of drones,
- `tracking` shows missions and the tracks of deliveries.
"""
