"""Schedules: the calendars of drones as providers and operators see them.

`schedule` makes a drone's schedule from its missions, `schedule_query` is the span that a list
shows, `store` reads the missions, and `routes` serves them.
"""
