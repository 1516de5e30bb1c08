"""Skyway networks and their versions: published by operators, kept parsed for planning."""
