"""How often drones land below their reserve when margins follow from a risk.

`python -m skyway_lab reserve_risk [--draws 1000000] [--seed 1]` draws the errors of the stated
model: of the wind in each direction, of the drone's energy use, and of its model. A plan may use
all energy above the reserve. So a landing is below it when the flights need more energy than
planned.
"""

import argparse
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from skyway_lab.benchmarks.planner.table import Table

from skyway.drone.model import DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.energy_risk import MODEL_DEVIATION, EnergyRisk
from skyway.planner.forecast import Forecast, weather_at_risk
from skyway.planner.kernels.memory import Floats
from skyway.planner.weather import Air
from skyway.planner.wind import SegmentWind

#: How far the stations lie from the first one, degrees.
_AWAY_DEG: Final = 0.05

#: Risks, and the deviations of drones that have flown rarely and often.
_RISKS: Final = (0.05, 0.01, 0.001)
_USES: Final = (0.08, 0.04)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Flights up to a recharge, by the direction of each, in a wind from the west.

    Directions are degrees clockwise from north. The wind and its standard error in each direction
    are in metres per second.
    """

    directions_deg: tuple[int, ...]
    wind_mps: float
    error_mps: float


#: What is flown, in words and numbers.
STRETCHES: Final = {
    "against 4 m/s": Stretch((270,), 4.0, 1.0),
    "across 4 m/s": Stretch((0,), 4.0, 1.0),
    "with 4 m/s": Stretch((90,), 4.0, 1.0),
    "in calm air": Stretch((270,), 0.0, 1.5),
    "three ways in 4 m/s": Stretch((270, 0, 90), 4.0, 1.0),
}


def planned(stretch: Stretch, risk: EnergyRisk, model: DroneModel) -> list[Air]:
    """The air of each flight in its plan; its energy holds the whole margin."""
    start = StationId("start")
    stations, segments = {start: Station(start, Position(0.0, 0.0))}, []
    for degrees in stretch.directions_deg:
        name, towards = StationId(f"to_{degrees}"), math.radians(degrees)
        at = Position(_AWAY_DEG * math.sin(towards), _AWAY_DEG * math.cos(towards))
        stations[name] = Station(name, at)
        segments.append(Segment(start, name, 5_000.0))

    def one(value: float) -> Floats:
        return np.full((1, 1), value)

    forecast = Forecast(
        longitude_deg=np.zeros(1),
        latitude_deg=np.zeros(1),
        edges_s=np.array([0.0, 3_600.0]),
        east_mps=one(stretch.wind_mps),
        north_mps=one(0.0),
        gust_mps=one(0.0),
        temperature_c=one(15.0),
        error_mps=one(stretch.error_mps),
    )
    network = Network(stations, segments)
    wind = SegmentWind.of(network, forecast.field_with_deviations())
    weather = weather_at_risk(wind, model, risk)
    airs = [weather.air_between(each.from_id, each.to_id, at_s=0.0) for each in segments]
    return [Air(air.time_factor, air.energy_factor * (1 + risk.own_margin)) for air in airs]


def share_below_reserve(
    stretch: Stretch, risk: EnergyRisk, model: DroneModel, *, draws: int, seed: int
) -> float:
    """The share of draws in which the flights together need more energy than planned."""
    chance = np.random.default_rng(seed)
    east_mps = stretch.wind_mps + chance.normal(0.0, stretch.error_mps, draws)
    north_mps = chance.normal(0.0, stretch.error_mps, draws)
    own = np.exp(chance.normal(0.0, math.hypot(risk.use_deviation, MODEL_DEVIATION), draws))
    needed = np.zeros(draws)
    for degrees in stretch.directions_deg:
        to_east, to_north = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
        along_mps = east_mps * to_east + north_mps * to_north
        across_mps = east_mps * to_north - north_mps * to_east
        ahead_mps = np.sqrt(np.maximum(model.speed_empty_mps**2 - across_mps**2, 0.0))
        ground_mps = np.maximum(ahead_mps + along_mps, 1e-9)
        needed += own * model.speed_empty_mps / ground_mps
    at_hand = sum(air.time_factor * air.energy_factor for air in planned(stretch, risk, model))
    return float((needed > at_hand).mean())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    model = DJI_MATRICE_300_RTK
    table = Table(
        "reserve_risk",
        f"**Landings below the reserve**, {given.draws:,} draws, seed {given.seed}; a drone with "
        f"{model.speed_empty_mps:g} m/s.",
        ("flights", "use deviation", "accepted", "margin", "below the reserve"),
    )
    for name, stretch in STRETCHES.items():
        for use in _USES:
            for accepted in _RISKS:
                risk = EnergyRisk(accepted, use)
                share = share_below_reserve(
                    stretch, risk, model, draws=given.draws, seed=given.seed
                )
                airs = planned(stretch, risk, model)
                most = max(air.energy_factor * min(air.time_factor, 1.0) for air in airs)
                table.rows.append(
                    (name, f"{use:g}", f"{accepted:.1%}", f"{most - 1:.0%}", f"{share:.2%}")
                )
    print(table.as_markdown())


if __name__ == "__main__":
    main()
