"""Telemetry: the samples of drones for a day, and averages of minutes for a month.

`recorder` stores samples, `thinning` replaces old samples by minutes, and `query` reads pages.
"""
