"""Decides the next act of the drone and performs it, one step after another."""
