"""Tracking: what missions have done and will do, for customers and operators.

`track` is a delivery's track, `progress` one mission with its steps, `routes` serves both.
"""
