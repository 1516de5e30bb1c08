"""The wind triangle: how fast a track is flown over ground when the wind is held against."""

import math
from typing import Final

#: A drone that the wind holds or pushes back still counts as this share of its speed: whatever is
#: computed stays finite, and ten times the energy is out of reach anyway.
_LEAST_SHARE: Final = 0.1

#: East and north, metres per second.
Velocity = tuple[float, float]


def ground_speed_mps(air_speed_mps: float, bearing_rad: float, wind_mps: Velocity) -> float:
    """Speed along a track of this bearing; the wind goes to the east and to the north."""
    sine, cosine = math.sin(bearing_rad), math.cos(bearing_rad)
    along = wind_mps[0] * sine + wind_mps[1] * cosine
    across = wind_mps[0] * cosine - wind_mps[1] * sine
    held = air_speed_mps * air_speed_mps - across * across
    least = _LEAST_SHARE * air_speed_mps
    return max(least, along + math.sqrt(held)) if held > 0.0 else least
