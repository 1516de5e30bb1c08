"""Telemetry: the samples of drones for a day, and averages of minutes for a month.

`keep_telemetry` stores samples and replaces old samples by minutes, `page` reads pages.
"""
