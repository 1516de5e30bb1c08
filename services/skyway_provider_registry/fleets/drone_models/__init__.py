"""Drone models: the library's named ones, and those that operators add."""
