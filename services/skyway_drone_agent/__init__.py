"""The drone level: one drone, or a simulated fleet, that flies what the cloud instructs.

- `journal`: a file of records of what happened, and the logbook that they add up to
- `messages`: reads and answers the cloud's instructions, sends state and telemetry
- `flying`: decides the next act and has the vehicle do it
- `analysis`: estimates charge, wind and reach from the sensors
- `failsafes`: what the drone does by itself about a fault
- `link`: messages and events on their way to the cloud, and whether the link is up
- `simulated`, `mavlink`: the two kinds of vehicles
- `landing_book`: stations near the routes, for landings that nobody planned
- `enrolment`: how a drone gets its credentials and changes them

The `cockpit` puts the parts together and the `agent` links them to the cloud. Read
`flying.mission` first.
"""
