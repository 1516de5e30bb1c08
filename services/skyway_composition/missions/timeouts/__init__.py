"""Missions that are checked because time has passed."""
