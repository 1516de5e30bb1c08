"""Measures the gain from planning all requests of a fleet together: see docs/dispatch.md."""
