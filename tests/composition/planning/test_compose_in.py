"""Composing among all reservations reads only the reservations near the request."""

import random
from typing import Any

import numpy as np
import pytest
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World
from skyway_composition.tables import pad_reservations
from sqlalchemy import insert

from skyway.delivery.plan import Plan
from skyway.ids import NetworkId, StationId
from skyway.network.geojson import write_network
from skyway.network.synthetic import synthetic_city
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from skyway.units import moment_to_ms

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


ROW = "abcdefghijklmnopqrstuvwxyz"


class CountingSolver(SolverPool):
    """Counts its compositions."""

    composed = 0

    async def compose(self, problem: Problem, **options: Any) -> Plan:
        self.composed += 1
        return await super().compose(problem, **options)


async def look(composition: Any, network_id: str = "row") -> World:
    skyway = await composition.parts.networks.current(NetworkId(network_id))
    return await World.of(skyway, composition.db, after_ms=moment_to_ms(composition.clock.now()))


def make_problem(composition: Any, make: Any, world: World, *places: str, **more: Any) -> Problem:
    source, *destinations = places
    return Problem.model_validate(
        {
            "network": world.skyway.network,
            "start_at": composition.clock.now(),
            "drone": {"model": make.candidate().model, "soc": 1.0},
            "source": source,
            "packages": [
                {"package_id": f"p{number}", "mass_kg": 0.1, "destination": destination}
                for number, destination in enumerate(destinations)
            ],
            **more,
        }
    )


async def hold(composition: Any, *sessions: tuple[str, int, int, int]) -> None:
    """Reserve (station, pad, start, end), seconds from now, for the mission that is booked."""
    booking = await composition.book()
    now_ms = moment_to_ms(composition.clock.now())
    rows = [
        {
            "station_id": station_id,
            "pad": pad,
            "start_ms": now_ms + 1000 * start_s,
            "end_ms": now_ms + 1000 * end_s,
            "mission_id": booking.missions[0].mission_id,
        }
        for station_id, pad, start_s, end_s in sessions
    ]
    async with composition.db.write() as tx:
        await tx.execute(insert(pad_reservations), rows)


async def test_only_pads_near_a_request_are_read(composition: Any, make: Any) -> None:
    await composition.publish(make.network(stations=ROW))
    world = await look(composition)
    problem = make_problem(composition, make, world, "h", "l")

    plan = await composition.parts.inquiries.compose_in(world, problem)

    assert plan.status == "optimal"
    assert [each for each in ROW if world.pads.has_read(StationId(each))] == list("hijklm")


async def test_the_plan_is_as_early_as_with_every_reservation_read(
    composition: Any, make: Any
) -> None:
    city = synthetic_city(stations=100, seed=3, spacing_m=8_000.0)
    document = write_network(city)
    for feature in document["features"][:80]:
        feature["properties"]["pads"] = 0
    answer = await composition("operator:op", "PUT", "/v1/networks/city", document)
    assert answer.is_success
    rng = random.Random(3)
    stations = list(city.stations)
    await hold(
        composition,
        *(
            (station_id, pad, start_s, start_s + rng.randint(1_000, 5_000))
            for station_id in stations[80:]
            for pad in range(4)
            for start_s in range(rng.randrange(3_000), 60_000, 6_000)
        ),
    )
    start_ms = moment_to_ms(composition.clock.now())
    everything = await look(composition, "city")
    await everything.pads.read(np.arange(len(stations), dtype=np.int32))
    read = []
    async with CountingSolver(threads=1, time_limit_s=60.0) as solver:
        for _ in range(12):
            world = await look(composition, "city")
            problem = make_problem(composition, make, world, *rng.sample(stations, 3))

            plan = await solver.compose_in(world, problem)

            best = compose(problem, booked=everything.pads.book.seen_from(start_ms))
            assert (plan.status, plan.delivery_time_s) == (best.status, best.delivery_time_s)
            read.append(len(world.pads.book.station))
    assert min(read) < len(everything.pads.book.station)
    assert solver.composed > 12, "no plan charged outside the first box"
