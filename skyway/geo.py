"""Positions on the Earth's sphere: distance, bearing, the point on the way, boxes on the map.

Longitudes are never compared or subtracted as plain numbers: 180 and -180 are the same meridian.
`skyway.network.great_circle` does the same for arrays.
"""

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, NamedTuple, Self

from pydantic import Field

#: Mean radius of the Earth (IUGG), metres; used by the haversine distance.
EARTH_RADIUS_M = 6_371_008.8


class Position(NamedTuple):
    """Longitude and latitude in degrees, in GeoJSON's order."""

    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0, strict=True)]
    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0, strict=True)]


class Box(NamedTuple):
    """An area between two meridians and two parallels, in degrees.

    When it crosses longitude 180, its west has the larger longitude.
    """

    west: float
    south: float
    east: float
    north: float

    @classmethod
    def parse(cls, text: str) -> Self:
        """The box in ``west,south,east,north``, as GeoJSON orders a `bbox`.

        Raises
        ------
        ValueError
            The text is not four such numbers, or south lies north of north.
        """
        try:
            box = cls(*map(float, text.split(",")))
        except (TypeError, ValueError) as error:
            raise ValueError("must be west,south,east,north in degrees") from error
        # Numbers that are no numbers lie in no range.
        if not all(-180 <= each <= 180 for each in (box.west, box.east)) or not (
            -90 <= box.south <= box.north <= 90
        ):
            raise ValueError(
                "longitudes lie within 180 degrees, latitudes within 90, south below north"
            )
        return box

    @classmethod
    def around(cls, positions: Iterable[Iterable[float]]) -> Self:
        """The smallest box around these positions, of which there is at least one."""
        longitudes, latitudes = zip(*positions, strict=True)
        west, east = arc_of(longitudes)
        return cls(west, min(latitudes), east, max(latitudes))

    @property
    def width_deg(self) -> float:
        """How far its east lies from its west: 0 to 360."""
        return self.east - self.west + (360.0 if self.west > self.east else 0.0)

    def meets(self, other: "Box") -> bool:
        """Whether the boxes have a point in common."""
        return (self.south <= other.north and other.south <= self.north) and (
            (other.west - self.west) % 360.0 <= self.width_deg
            or (self.west - other.west) % 360.0 <= other.width_deg
        )


def wrapped_deg(longitude_deg: float) -> float:
    """The same meridian as a longitude from -180 up to, and without, 180."""
    wrapped = math.remainder(longitude_deg, 360.0)
    return -180.0 if wrapped == 180.0 else wrapped


def arc_of(longitudes_deg: Iterable[float]) -> tuple[float, float]:
    """The west and east ends of the shortest arc that holds these longitudes.

    The west end is the larger one if the arc crosses longitude 180.
    """
    ordered = sorted(longitudes_deg)
    gaps = [ordered[0] + 360.0 - ordered[-1]]
    gaps += [after - before for before, after in pairwise(ordered)]
    first = gaps.index(max(gaps))
    return ordered[first], ordered[first - 1]


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
    return _towards(
        weight_1 * a + weight_2 * b
        for a, b in zip(unit_vector(start), unit_vector(end), strict=True)
    )


def moved(position: Position, *, east_m: float, north_m: float) -> Position:
    """The position this far away along the great circle that begins in this direction."""
    length_m = math.hypot(east_m, north_m)
    if length_m == 0.0:
        return position
    longitude, latitude = math.radians(position.longitude_deg), math.radians(position.latitude_deg)
    (x, y), across = (math.cos(longitude), math.sin(longitude)), math.sin(latitude)
    to_east, to_north = (-y, x, 0.0), (-across * x, -across * y, math.cos(latitude))
    angle = length_m / EARTH_RADIUS_M
    ahead = math.sin(angle) / length_m
    return _towards(
        math.cos(angle) * here + ahead * (east_m * east + north_m * north)
        for here, east, north in zip(unit_vector(position), to_east, to_north, strict=True)
    )


def _towards(vector: Iterable[float]) -> Position:
    """The position in this direction from the Earth's centre."""
    x, y, z = vector
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
