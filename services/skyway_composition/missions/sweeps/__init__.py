"""Missions that are looked at since time has passed: overdue, late, or waiting for a plan."""
