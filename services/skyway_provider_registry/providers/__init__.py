"""Providers: the owners of fleets, with their tariffs and terms."""
