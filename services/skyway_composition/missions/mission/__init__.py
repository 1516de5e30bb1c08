"""What all rooms of missions share.

`record` is a mission as composition stores it; `store` reads and writes it. `from_trip`
makes a mission and its steps from a planned trip; `step_store` keeps the steps, `custody_store`
who holds each package. `unit_of_work` locks missions together with the links to their drones, and
sends reports and alarms about them. `instruct` sends instructions to the drone. `standby`
frees pads and ends a standby for the next mission, `end` ends a mission.
"""
