"""Missions: booked in one transaction, sent to a drone, followed to their end."""
