"""Positions on the Earth's sphere: distance, bearing, the point on the way."""

import math
from typing import Annotated, NamedTuple

from pydantic import Field

#: Mean radius of the Earth (IUGG), metres; used by the haversine distance.
EARTH_RADIUS_M = 6_371_008.8


class Position(NamedTuple):
    """Longitude and latitude in degrees, in GeoJSON's order."""

    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0, strict=True)]
    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0, strict=True)]


def distance_m(start: Position, end: Position) -> float:
    """Great-circle distance by the haversine formula."""
    latitude_1, latitude_2 = math.radians(start.latitude_deg), math.radians(end.latitude_deg)
    half_latitude = (latitude_2 - latitude_1) / 2
    half_longitude = math.radians(end.longitude_deg - start.longitude_deg) / 2
    chord = (
        math.sin(half_latitude) ** 2
        + math.cos(latitude_1) * math.cos(latitude_2) * math.sin(half_longitude) ** 2
    )
    return 2 * EARTH_RADIUS_M * math.asin(min(1.0, math.sqrt(chord)))


def bearing_rad(start: Position, end: Position) -> float:
    """Initial bearing of the great circle from start to end, clockwise from north, in [0, 2 pi)."""
    latitude_1, latitude_2 = math.radians(start.latitude_deg), math.radians(end.latitude_deg)
    turn = math.radians(end.longitude_deg - start.longitude_deg)
    east = math.sin(turn) * math.cos(latitude_2)
    north = math.cos(latitude_1) * math.sin(latitude_2) - math.sin(latitude_1) * math.cos(
        latitude_2
    ) * math.cos(turn)
    return math.atan2(east, north) % (2 * math.pi)


def point_between(start: Position, end: Position, *, fraction: float) -> Position:
    """The point at `fraction` (0 to 1) of the way along the great circle from start to end."""
    angle = distance_m(start, end) / EARTH_RADIUS_M
    if angle == 0.0:
        return start
    weight_1 = math.sin((1 - fraction) * angle) / math.sin(angle)
    weight_2 = math.sin(fraction * angle) / math.sin(angle)
    x, y, z = (
        weight_1 * a + weight_2 * b
        for a, b in zip(unit_vector(start), unit_vector(end), strict=True)
    )
    return Position(math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y))))


def unit_vector(position: Position) -> tuple[float, float, float]:
    """The direction from the Earth's centre; its axes point to (0, 0), (90, 0) and the pole."""
    longitude = math.radians(position.longitude_deg)
    latitude = math.radians(position.latitude_deg)
    return (
        math.cos(latitude) * math.cos(longitude),
        math.cos(latitude) * math.sin(longitude),
        math.sin(latitude),
    )
