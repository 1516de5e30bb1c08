"""The provider registry finds the drones that could fly a request.

It owns providers, fleets, presence, telemetry and broker accounts. Rooms: `providers` (names,
tariffs, terms), `fleets` (drones, drone models and credentials), `enrolment` (broker accounts,
tokens and keys), `presence` (the last messages of drones), `telemetry` (their history), and
`candidates` (the drones that could fly a request). `change_store` numbers the changes that
`candidates` depends on.
"""
