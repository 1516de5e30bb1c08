"""The weather of the small world: calm, or a gust that crosses the network."""

import math
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any, Final

from skyway.geo import Position, distance_m
from skyway.network.network import Network

#: Points of the forecast's grid in each direction.
_POINTS: Final = 14

#: The standard error of the wind, m/s: from it follows a P90 before any lateness is learned.
_ERROR_MPS: Final = 3.0

#: How long a forecast of calm air lasts; the last of its values hold as long as those before.
_CALM_LASTS: Final = timedelta(days=20)

#: The gust: how strong, how wide, in how many steps it passes, and how far it moves in each.
GUST_MPS: Final = 17.0
_RADIUS_M: Final = 9_000.0
_STEPS: Final = 4
_MOVES_DEG: Final = (0.05, -0.05)

#: How strong a gust is at a place, in one step of the forecast.
_Gusts = Callable[[int, Position], float]


def calm(network: Network, now: datetime) -> dict[str, Any]:  # a forecast as JSON
    """Still air from now on."""
    return _forecast(network, [now, now + _CALM_LASTS], lambda *_: 0.0, issued_at=now)


def passing_gust(
    network: Network, now: datetime, centre: Position, lasts: timedelta
) -> dict[str, Any]:  # a forecast as JSON
    """A gust that begins near `centre`, moves to the southeast, and is over after `lasts`."""
    times = [now + lasts * step / _STEPS for step in range(_STEPS + 1)]

    def gust(step: int, place: Position) -> float:
        if step >= _STEPS:
            return 0.0
        middle = Position(
            centre.longitude_deg + step * _MOVES_DEG[0], centre.latitude_deg + step * _MOVES_DEG[1]
        )
        away = distance_m(middle, place) / _RADIUS_M
        return round(GUST_MPS * math.exp(-(away**2) / 2), 2)

    return _forecast(network, [*times, now + _CALM_LASTS], gust, issued_at=now)


def _forecast(
    network: Network, times: list[datetime], gust: _Gusts, *, issued_at: datetime
) -> dict[str, Any]:  # a forecast as JSON
    places = [each.position for each in network.stations.values()]
    latitudes = _axis([each.latitude_deg for each in places])
    longitudes = _axis([each.longitude_deg for each in places])

    def values(value: _Gusts) -> list[list[list[float]]]:
        return [
            [[value(step, Position(east, north)) for east in longitudes] for north in latitudes]
            for step in range(len(times))
        ]

    return {
        "source": "the small world",
        "issued_at": issued_at.isoformat(),
        "grid": {
            "time": [each.isoformat() for each in times],
            "latitude": latitudes,
            "longitude": longitudes,
            "wind_speed_mps": values(lambda *_: 0.0),
            "wind_from_deg": values(lambda *_: 315.0),
            "gust_mps": values(gust),
            "error_mps": values(lambda *_: _ERROR_MPS),
        },
    }


def _axis(values: list[float]) -> list[float]:
    """Evenly spaced degrees from the least to the largest value."""
    least, most = min(values), max(values)
    return [round(least + (most - least) * n / (_POINTS - 1), 5) for n in range(_POINTS)]
