"""How far a drone is from the leg that it should fly."""

import math

from skyway.geo import EARTH_RADIUS_M, Position, bearing_rad, distance_m
from skyway_drone_agent.analysis.leg import Leg


def off_course_m(leg: Leg, position: Position) -> float:
    """Distance from the great circle between the leg's ends, and from the ends beyond them."""
    start, end = leg.step.from_position, leg.step.to_position
    from_start = distance_m(start, position) / EARTH_RADIUS_M
    aside_rad = bearing_rad(start, position) - leg.bearing_rad
    if from_start == 0.0 or math.cos(aside_rad) < 0.0:
        return from_start * EARTH_RADIUS_M
    across = math.asin(math.sin(from_start) * math.sin(aside_rad))
    along = math.acos(min(1.0, math.cos(from_start) / math.cos(across)))
    if along * EARTH_RADIUS_M > leg.span_m:
        return distance_m(end, position)
    return abs(across) * EARTH_RADIUS_M
