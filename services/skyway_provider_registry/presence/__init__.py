"""Presence: the last messages of each drone, and the mission it is on.

`follow` receives the messages of drones, `sighting_store` picks the newest ones and stores them.
`store` reads presence, and keeps composition's reports. `drone_presence` is the result. `jump`
finds drones that say what cannot be, and `learning` what flights show about each drone.
"""
