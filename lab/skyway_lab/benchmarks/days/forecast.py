"""The forecast of a simulator's day: its mean wind and temperature, as a weather service errs."""

import random
from datetime import datetime, timedelta
from math import cos, radians, sin
from typing import Any, Final

from skyway_drone_agent.simulated.disturbances import Disturbances

from skyway.network.network import Network

#: A forecast for so many hours, hour by hour: longer than a day of the benchmark takes.
_HOURS: Final = 24


def forecast_of(
    day: Disturbances, network: Network, *, from_at: datetime, error_mps: float, seed: int
) -> dict[str, Any]:
    """The body of PUT /v1/networks/{network_id}/weather for a day.

    Gusts are known as the standard error of the wind. The mean wind is wrong by a normal error
    with the standard deviation `error_mps` in each of its components, all day and everywhere.
    """
    chance = random.Random(seed)
    to_rad = radians(day.wind.from_deg + 180)
    east = day.wind.mean_mps * sin(to_rad) + chance.gauss(0.0, error_mps)
    north = day.wind.mean_mps * cos(to_rad) + chance.gauss(0.0, error_mps)
    columns = network.columns
    axes = {
        "latitude": _around(columns.latitude_deg.min(), columns.latitude_deg.max()),
        "longitude": _around(columns.longitude_deg.min(), columns.longitude_deg.max()),
    }
    values = {
        "eastward_wind_mps": east,
        "northward_wind_mps": north,
        "temperature_c": day.battery.temperature_c,
        "error_mps": day.wind.gust_mps,
    }
    hour = from_at.replace(minute=0, second=0, microsecond=0)
    times = [(hour + timedelta(hours=number)).isoformat() for number in range(_HOURS)]
    grid = {name: [[[value] * 2] * 2] * _HOURS for name, value in values.items()}
    return {
        "source": "the simulator",
        "issued_at": from_at.isoformat(),
        "grid": {"time": times, **axes, **grid},
    }


def _around(least: float, most: float) -> list[float]:
    return [round(float(least) - 0.1, 3), round(float(most) + 0.1, 3)]
