"""Offers: composed as seldom as possible, ranked as asked."""

from typing import Any

import pytest
from skyway_composition.planning.least_time import least_delivery_s
from skyway_composition.planning.offers import make_offers
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World

from skyway.delivery.plan import Plan
from skyway.ids import DroneId, StationId
from skyway.planner.problem import Problem
from skyway.units import moment_to_ms

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


class CountingSolver(SolverPool):
    """Remembers what it was asked, but for the ways home."""

    def __init__(self) -> None:
        super().__init__(threads=1, time_limit_s=5.0)
        self.asked: list[StationId] = []

    async def compose(self, problem: Problem, **options: Any) -> Plan:
        if problem.finish == "recharge":
            self.asked.append(problem.start_station_id)
        return await super().compose(problem, **options)


async def offers_of(composition: Any, request: Any, *candidates: Any, busy: Any = ()) -> Any:
    """The offers, and the stations from which was composed."""
    skyway = await composition.parts.networks.current("row")
    world = await World.of(skyway, composition.parts.db, after_ms=0)
    async with CountingSolver() as solver:
        offers = await make_offers(
            solver,
            world,
            request,
            candidates=candidates,
            busy=frozenset(busy),
            start_ms=moment_to_ms(composition.clock.now()),
        )
    return offers, solver.asked


async def test_drones_that_are_alike_are_composed_once(composition: Any, make: Any) -> None:
    drones = [make.candidate(number) for number in range(5)]

    offers, asked = await offers_of(composition, make.request("b"), *drones)

    assert (len(offers.ranked), asked) == (5, ["a"])


async def test_a_drone_too_far_to_win_is_not_composed_when_only_time_counts(
    composition: Any, make: Any
) -> None:
    near, far = make.candidate(1), make.candidate(2, station_id="e")

    offers, asked = await offers_of(composition, make.request("b"), far, near)

    assert [offer.candidate.drone_id for offer in offers.ranked] == ["drn_1"]
    assert asked == ["a"]


async def test_every_drone_is_composed_when_the_price_counts(composition: Any, make: Any) -> None:
    near, far = make.candidate(1), make.candidate(2, station_id="e")
    request = make.request("b", qos={"weights": {"time": 1, "price": 1}})

    _, asked = await offers_of(composition, request, far, near)

    assert sorted(asked) == ["a", "e"]


async def test_the_least_time_is_never_above_the_true_one(composition: Any, make: Any) -> None:
    skyway = await composition.parts.networks.current("row")
    for station_id in "abcde":
        candidate = make.candidate(station_id=station_id)
        request = make.request("c", "e")

        offers, _ = await offers_of(composition, request, candidate)

        least_s = least_delivery_s(
            skyway, request, model=candidate.model, station_id=StationId(station_id)
        )
        assert least_s <= offers.ranked[0].trip.plan.delivery_time_s


async def test_a_segment_shorter_than_the_great_circle_lowers_the_least_time(
    composition: Any, make: Any
) -> None:
    network = make.network()
    straight = await composition.parts.networks.current("row")
    network["features"][-1]["properties"]["length_m"] = 10_000
    await composition.publish(network)

    short = await composition.parts.networks.current("row")

    assert straight.straightness == pytest.approx(1.0, abs=1e-6)
    assert short.straightness == pytest.approx(0.5, abs=1e-3)


async def test_a_provider_with_an_offer_gives_no_reason(composition: Any, make: Any) -> None:
    busy = make.candidate(1)
    free = make.candidate(2)
    other = make.candidate(3, provider_id="prv_2")

    offers, _ = await offers_of(
        composition, make.request("b"), busy, free, other, busy=[DroneId("drn_1"), DroneId("drn_3")]
    )

    assert [(each.provider_id, each.code) for each in offers.reasons] == [("prv_2", "BUSY")]
