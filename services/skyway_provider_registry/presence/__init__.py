"""Presence: the last messages of each drone, and the mission it is on.

`follow` receives the messages of drones, `newest` picks the newest ones and `sighting_store` stores
them. `mission_reports` stores composition's reports. `drone_presence` is the result.
"""
