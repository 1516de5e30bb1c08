"""Flies a simulated hour on the real services, and compares real and simulated delivery times.

`python -m skyway_lab live_hour --places city,corridor` runs a whole Skyway on the embedded database
and broker for each case of `skyway experiment --only fleet`: the same network, homes and requests,
at the same moments of the hour. The drones fly as planned. The simulation is that of `skyway
experiment --only dispatch`: calendars in the order of asking, and the search that plans all waiting
requests each minute. The search keeps promises as the live dispatcher does. The live dispatcher
looks as often in fleet time as by default in real time (every 10 s), if the clock is slow enough:
after a search it rests, so that it uses at most 2.5 % of the machine's processor time. On two cores
it rests for 6 s. With the fleet clock at 60 it would plan every 6 minutes, and a promise would be
firm before any search.
"""

import argparse
import asyncio
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from statistics import mean
from typing import Any, Final

from skyway_lab.benchmarks.days.player import Player, playing
from skyway_lab.benchmarks.load.run import data_folder, verify
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.dispatched_hour.cases import FleetCase, fleet_case
from skyway_lab.experiments.dispatched_hour.measures import PolicyHour, fly_hour
from skyway_lab.experiments.dispatched_hour.policies import searched_in_rounds, searches
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour, on_time_share
from skyway_lab.experiments.fleet_hour.cases import PLACES, HourRequest, Load

from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.errors import SkywayError
from skyway.network.geojson import write_network

_NETWORK_ID: Final = "hour"
_CALENDARS: Final = "P3 calendars"
#: The search of the experiment, in which each request flies alone.
_SEARCH, *_ = searches(searched_in_rounds(2, most_steps=8_000))
#: How late the live dispatcher may deliver by default, seconds after the promise.
_TOLERANCE_S: Final = 60.0
#: Seconds of fleet time between two looks of the live dispatcher: its default with a real clock.
_LOOKS_EVERY_S: Final = 10.0

#: As in the simulation: a provider whose drones stay where they have delivered.
_TERMS: Final = {
    "name": "Hour Air",
    "tariff": {"currency": "USD", "base": 100, "per_km": 10, "pooled_factor": 0.7},
    "standby": "STAY",
}

_HEADER: Final = (
    "case, seed",
    "calendars, min",
    "order search, min",
    "live, min",
    "live / search",
    "on time, simulated and live",
    "completed",
    "check",
)


@dataclass(frozen=True, slots=True)
class _Hour:
    """A case, what each customer allows, and when its promise has to be firm, seconds."""

    case: FleetCase
    may_be_later_s: float
    firm_within_s: float


@dataclass(frozen=True, slots=True)
class _LiveHour:
    """Seconds from each request to its last delivery, and what `skyway verify` says."""

    waited_s: Mapping[int, float]
    violations: str


def main() -> int:
    """Fly each case, and print a row for it."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab live_hour", description=__doc__)
    parser.add_argument("--places", default="city", help=f"of {', '.join(PLACES)}")
    parser.add_argument("--drones", type=int, default=25)
    parser.add_argument("--requests", type=int, default=100)
    parser.add_argument(
        "--may-be-later-s", type=float, default=0.0, help="seconds of lateness that customers allow"
    )
    parser.add_argument(
        "--firm-within-s", type=float, default=0.0, help="seconds until promises are firm"
    )
    parser.add_argument(
        "--clock-rate", type=float, default=10.0, help="fleet seconds in a second; an hour is 6 min"
    )
    parser.add_argument("--seeds", default="1", help="whole numbers, separated by commas")
    given = parser.parse_args()
    load = Load(given.drones, given.requests)
    print(f"{Machine.here().as_text()}; {load}, clock rate {given.clock_rate:g}\n", flush=True)
    os.environ["SKYWAY_DISPATCH_EVERY_S"] = str(_LOOKS_EVERY_S / given.clock_rate)
    rows = []
    try:
        for place in given.places.split(","):
            for seed in map(int, given.seeds.split(",")):
                hour = _Hour(
                    fleet_case(place, load, seed=seed), given.may_be_later_s, given.firm_within_s
                )
                calendars = fly_hour(PolicyHour(place, load, seed, _CALENDARS))
                row = _row(hour, mean(calendars.delays_min), seed, given.clock_rate)
                rows.append(row)
                print(" | ".join(rows[-1]), flush=True)
    except SkywayError as error:
        print(error, file=sys.stderr)
        return 1
    caption = "Mean minutes from each request to its last delivery."
    print(Table("live-hour", caption, _HEADER, rows).as_markdown(), flush=True)
    return 0


def _row(hour: _Hour, calendars_min: float, seed: int, clock_rate: float) -> tuple[str, ...]:
    tolerance_s = max(_TOLERANCE_S, hour.may_be_later_s)
    policy = replace(_SEARCH, promise_tolerance_s=tolerance_s, firm_within_s=hour.firm_within_s)
    simulated = RollingHour(hour.case, policy, seed)
    simulated.run()
    live = asyncio.run(_fly(hour, clock_rate=clock_rate))
    live_min = mean(live.waited_s.values()) / 60
    shares = [on_time_share(hour.case, each) for each in (simulated.waited_s(), live.waited_s)]
    return (
        f"{hour.case.name}, {seed}",
        f"{calendars_min:.0f}",
        f"{simulated.mean_min:.0f}",
        f"{live_min:.0f}",
        f"{live_min / simulated.mean_min:.2f}",
        "{:.0%}, {:.0%}".format(*shares),
        f"{len(live.waited_s)} of {len(hour.case.hour.requests)}",
        live.violations,
    )


async def _fly(hour: _Hour, *, clock_rate: float) -> _LiveHour:
    with data_folder() as folder, storage_pair("embedded", folder):
        async with playing(folder, clock_rate=clock_rate) as player:
            waited_s = await _play(hour, player)
        violations = await asyncio.to_thread(verify, folder)
    return _LiveHour(waited_s, violations)


async def _play(hour: _Hour, player: Player) -> dict[int, float]:
    case = hour.case.hour
    await player.call("PUT", f"/v1/networks/{_NETWORK_ID}", write_network(case.network))
    await player.start_fleet(case.homes, DJI_MATRICE_300_RTK.model_id, terms=_TERMS)
    started_at = await player.now()
    asked: dict[int, tuple[str, datetime]] = {}
    for request in case.requests:
        at = started_at + timedelta(milliseconds=request.asked_ms)
        await player.until(at)
        answer = await player.call("POST", "/v1/deliveries", _body(request, hour))
        asked[request.number] = (answer["delivery_id"], at)
    waited_s = {}
    for number, (delivery_id, at) in asked.items():
        delivery = await player.ended(delivery_id)
        if delivery["state"] == "COMPLETED":
            arrived = [
                datetime.fromisoformat(each["delivered_at"]) for each in delivery["packages"]
            ]
            waited_s[number] = (max(arrived) - at).total_seconds()
    return waited_s


def _body(request: HourRequest, hour: _Hour) -> dict[str, Any]:
    return {
        "pickup": {"station_id": request.source},
        "packages": [
            {
                "package_id": each.package_id,
                "mass_kg": each.mass_kg,
                "destination": {"station_id": each.destination},
            }
            for each in request.packages
        ],
        "qos": {
            "objective": "FASTEST",
            "may_be_later_s": hour.may_be_later_s,
            "firm_within_s": hour.firm_within_s,
        },
    }


if __name__ == "__main__":
    sys.exit(main())
