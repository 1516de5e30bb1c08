"""Closures of many places at once: zones, and ground stops."""
