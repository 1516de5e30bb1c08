"""What all rooms of missions share.

`record` is a mission as composition stores it; `row` and `store` read and write it. `from_trip`
makes a mission and its steps from a planned trip; `step_record` and `step_store` keep the steps,
`custody` and `custody_store` who holds each package. `unit_of_work` locks missions together with
the links to their drones. `instruct` sends instructions to the drone, `notify` sends reports and
alarms to everybody else. `release_pads` frees pads, `end` ends a mission.
"""
