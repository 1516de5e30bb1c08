"""Closures of one place of a network: a station, a pad of it, a segment."""
