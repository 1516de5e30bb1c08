"""Schedules: the calendars of drones and stations, as providers and operators see them.

`schedule` makes a drone's schedule from its missions, and a station's from its reservations.
`store` reads the missions, and `routes` serves the schedules.
"""
