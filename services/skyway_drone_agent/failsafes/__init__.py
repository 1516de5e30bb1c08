"""Faults, and what the drone does about them by itself."""
