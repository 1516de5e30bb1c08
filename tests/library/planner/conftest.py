"""Makers of small networks and problems with round numbers."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pytest

from skyway.drone.model import ChargePoint, DroneModel
from skyway.geo import Position
from skyway.ids import DroneModelId, StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.airspace import Airspace
from skyway.planner.forecast import Forecast
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation

#: Flies 10 m/s and 10 km on a full battery with packages of 0 kg. 1 s on a pad gives 1 s in the
#: air.
MODEL = DroneModel(
    model_id=DroneModelId("round"),
    empty_mass_kg=1.0,
    max_payload_kg=1.0,
    battery_j=100_000.0,
    speed_empty_mps=10.0,
    speed_full_mps=10.0,
    power_empty_w=100.0,
    charge_curve=(ChargePoint(0, 0), ChargePoint(1000, 1)),
)


def forecast(
    east_mps: float,
    *,
    gust_mps: float = 0.0,
    error_mps: float = 0.0,
    temperature_c: float = 15.0,
) -> Forecast:
    """An hour of wind to the east, at one place."""

    def one(value: float) -> Any:
        return np.full((1, 1), value)

    return Forecast(
        longitude_deg=np.zeros(1),
        latitude_deg=np.zeros(1),
        edges_s=np.array([0.0, 3600.0]),
        east_mps=one(east_mps),
        north_mps=one(0.0),
        gust_mps=one(gust_mps),
        temperature_c=one(temperature_c),
        error_mps=one(error_mps),
    )


def _make_network(
    segments: str, *, pads: Mapping[str, int] | None = None, zones: Iterable[Any] = ()
) -> Network:
    """A network from words like ``a-b:6`` (both ways, km) and ``a>b:6`` (one way)."""
    stations: dict[StationId, Station] = {}
    made: list[Segment] = []
    for word in segments.split():
        ends, length_km = word.split(":")
        is_one_way = ">" in ends
        start, end = (StationId(name) for name in ends.replace(">", "-").split("-"))
        for name in (start, end):
            position = Position(0.01 * len(stations), 0.0)
            stations.setdefault(name, Station(name, position, (pads or {}).get(name, 4)))
        made.append(Segment(start, end, float(length_km) * 1000))
        if not is_one_way:
            made.append(Segment(end, start, float(length_km) * 1000))
    return Network(stations, tuple(made), tuple(zones))


def _make_problem(
    network: Network | str,
    *destinations: str,
    source: str = "a",
    soc: float = 1.0,
    model: DroneModel = MODEL,
    station: str | None = None,
    mass_kg: float = 0.0,
    pads: Mapping[str, int] | None = None,
    **fields: Any,
) -> Problem:
    """A problem with a package of `mass_kg` for each destination."""
    made = _make_network(network, pads=pads) if isinstance(network, str) else network
    return Problem.model_validate(
        {
            "network": made,
            "drone": {"model": model, "soc": soc, "station_id": station},
            "source": source,
            "packages": [
                {"package_id": f"p{number}", "mass_kg": mass_kg, "destination": destination}
                for number, destination in enumerate(destinations, start=1)
            ],
            **fields,
        }
    )


@pytest.fixture(scope="session")
def model() -> DroneModel:
    return MODEL


@pytest.fixture(scope="session")
def make_network() -> Callable[..., Network]:
    return _make_network


@pytest.fixture(scope="session")
def make_problem() -> Callable[..., Problem]:
    return _make_problem


@pytest.fixture(scope="session")
def make_situation() -> Callable[..., Situation]:
    def make(*args: Any, **fields: Any) -> Situation:
        problem = _make_problem(*args, **fields)
        return Situation.of(problem, Airspace.of(problem.network))

    return make


@pytest.fixture(scope="session")
def taken() -> Callable[..., list[dict[str, Any]]]:
    """All four pads of a station, reserved."""

    def make(station: str, start_s: float, end_s: float | None, pads: int = 4) -> list[Any]:
        return [
            {"station_id": station, "pad": pad, "start_s": start_s, "end_s": end_s}
            for pad in range(pads)
        ]

    return make
