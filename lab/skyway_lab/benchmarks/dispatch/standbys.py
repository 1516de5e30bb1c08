"""Where idle drones wait: at home, where they delivered, or near the next pickup.

Requests are booked in calendars, one after another. The dispatcher searches for no better order.
"""

from collections.abc import Iterator
from statistics import mean
from typing import Final

from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.fleet_hour.calendars import CHAINED, CHAINED_HOME, CHAINED_NEAR, Policy
from skyway_lab.experiments.fleet_hour.cases import Load, Place, draw_day
from skyway_lab.experiments.fleet_hour.measures import delays_min, simulate

PLACES: Final[tuple[Place, ...]] = ("city", "corridor", "three hubs", "hub")

_LOAD: Final = Load(25, 100)

#: Requests come within an hour, or within so many hours: then drones are idle between requests.
_HOURS: Final = (1.0, 8.0)

#: The requests of so many days before are known.
_DAYS_BEFORE: Final = 3

_STANDBYS: Final[tuple[Policy, ...]] = (CHAINED_HOME, CHAINED, CHAINED_NEAR)


def standbys(*, seeds: int) -> Iterator[Table]:
    """Minutes from each request to its last delivery, and the energy of all flights."""
    for hours in _HOURS:
        table = Table(
            "standbys",
            f"{_LOAD} within {hours:g} h, booked in calendars",
            ("case", "standby", "mean, min", "by seed", "kWh"),
        )
        for place in PLACES:
            for policy in _STANDBYS:
                table.rows.append(_row(place, policy, hours, seeds))
        yield table


def _row(place: Place, policy: Policy, hours: float, seeds: int) -> tuple[str, ...]:
    minutes, energy_j = [], 0.0
    for seed in range(1, seeds + 1):
        case = draw_day(place, _LOAD, seed=seed, hours=hours, days_before=_DAYS_BEFORE)
        flown = simulate(case, policy)
        minutes.append(mean(delays_min(flown)))
        energy_j += sum(each.energy_j for each in flown.missions) / seeds
    by_seed = ", ".join(f"{each:.1f}" for each in minutes)
    return place, policy.standby, f"{mean(minutes):.1f}", by_seed, f"{energy_j / 3.6e6:.1f}"
